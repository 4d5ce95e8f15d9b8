"""The lane at the front axle, and its virtual centre."""

import math
from collections.abc import Mapping

from vsensor.signals.vehicle import VehicleConfig
from vsensor.types import Boundary, EgoState, LaneEstimate, Side

_NAN = math.nan
_LONGEST_CROSSING_S = 40.0  # beyond it "at constant lateral speed" says nothing; fits the native signal
_FARTHEST_AHEAD_M = 20.0  # the road right ahead is out of the image, and a gap between dashes is up to 12 m
_CENTRE_MEANS = (
    *("offset_m", "heading", "c2_per_m", "c3_per_m2"),
    *("curvature_per_m", "curvature_rate_per_m2"),
)
_CENTRE_NAMES: Mapping[tuple[str, ...], tuple[tuple[str, list[str]], ...]] = {
    seen: tuple((f"centre.{name}", [f"{word}.{name}" for word in seen]) for name in _CENTRE_MEANS)
    for seen in (("left",), ("right",), ("left", "right"))
}


def lane_offset_m(boundary: Boundary, x_m: float) -> float:
    """Return y of the inner edge (towards the vehicle) of a left or right line at x, left positive.

    Half the width is taken across the line, so along y it is longer by sqrt(1 + slope^2).
    """
    y, slope = _at(boundary, x_m)
    half_m = boundary.width_m / 2 * math.hypot(1.0, slope)
    return y - half_m if boundary.side is Side.LEFT else y + half_m


def _near(boundary: Boundary | None, axle_m: float) -> Boundary | None:
    """Return the line if it is seen near enough to the front axle to say where it is there."""
    if boundary is None or boundary.x_min_m > axle_m + _FARTHEST_AHEAD_M:
        return None
    return boundary


def _at(boundary: Boundary, x_m: float) -> tuple[float, float]:
    """Return y and dy/dx at x (Horner)."""
    y = slope = 0.0
    for coefficient in reversed(boundary.coefficients.tolist()):
        slope = slope * x_m + y
        y = y * x_m + coefficient
    return y, slope


def put_lane(values: dict[str, float], vehicle: VehicleConfig, estimate: LaneEstimate, ego: EgoState) -> None:
    """Put lane offsets, width, lateral speed and time to line crossing."""
    axle_m = vehicle.wheelbase_m
    left, right = (_near(estimate.on(side), axle_m) for side in (Side.LEFT, Side.RIGHT))
    seen = [line for line in (left, right) if line is not None]
    if not seen:
        return
    left_m = lane_offset_m(left, axle_m) if left is not None else _NAN
    right_m = lane_offset_m(right, axle_m) if right is not None else _NAN
    # The lane's direction at the front axle, seen from the vehicle.
    angle = math.atan(sum(_at(line, axle_m)[1] for line in seen) / len(seen))
    values["left.lane_offset_m"], values["right.lane_offset_m"] = left_m, right_m
    values["lane.width_m"] = (left_m - right_m) * math.cos(angle)
    # Velocity of the front axle's centre is (v, yaw rate * wheelbase); its part across the lane.
    across_mps = ego.yaw_rate_radps * axle_m * math.cos(angle) - ego.speed_mps * math.sin(angle)
    values["lane.lateral_speed_mps"] = across_mps
    half_m = vehicle.width_m / 2
    gap_m = left_m - half_m if across_mps > 0 else -right_m - half_m
    values["lane.time_to_crossing_s"] = _crossing_s(gap_m * math.cos(angle), abs(across_mps))


def _crossing_s(gap_m: float, speed_mps: float) -> float:
    """Return the time until the gap is closed: 0 if it is, NaN if it never (or not within reason) will be."""
    if math.isnan(gap_m) or math.isnan(speed_mps) or max(gap_m, 0.0) > speed_mps * _LONGEST_CROSSING_S:
        return _NAN
    return max(gap_m, 0.0) / speed_mps if speed_mps > 0.0 else _NAN


# ---- the virtual line in the middle of the lane ------------------------------------------------------


def put_centre(values: dict[str, float], vehicle: VehicleConfig) -> None:
    """Put the mean of left and right; beside the only line seen, half the assumed width of the lane.

    Valid where all its lines are; as sure as the least sure of them.
    """
    seen = [word for word in ("left", "right") if values[f"{word}.available"]]
    if not seen:
        return
    weight = 1.0 / len(seen)
    for mean, names in _CENTRE_NAMES[tuple(seen)]:
        values[mean] = sum([values[name] for name in names]) * weight
    if len(seen) == 1:
        half_m = vehicle.assumed_lane_width_m / 2 * math.hypot(1.0, values["centre.heading"])
        values["centre.offset_m"] += -half_m if seen == ["left"] else half_m
    start_m = max(values[f"{word}.x_min_m"] for word in seen)
    values["centre.available"], values["centre.x_min_m"] = 1.0, start_m
    values["centre.x_max_m"] = max(start_m, min(values[f"{word}.x_max_m"] for word in seen))
    values["centre.order"] = max(values[f"{word}.order"] for word in seen)
    for name in ("quality", "measured"):
        values[f"centre.{name}"] = min(values[f"{word}.{name}"] for word in seen)
