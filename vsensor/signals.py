"""From a lane estimate to signal values: what is sent, in model signs, then as the bus describes it.

y left          inner edge          front axle x = wheelbase
  |  ======================================  left line, width w
  |  --- lane offset: centreline to inner edge, along y, at the front axle
  +-----o-----------------------------> x    o rear axle
"""

import math
from collections.abc import Mapping
from typing import Annotated

import msgspec
import numpy as np

from vsensor.errors import ConfigError
from vsensor.profile import QUANTITIES, GeometryConfig, LaneChange
from vsensor.schema import Config
from vsensor.types import (
    SIDE_NAMES,
    Boundary,
    EgoState,
    Environment,
    LaneEstimate,
    SensorMode,
    Side,
    SignalValues,
)

__all__ = ["QUANTITIES", "VehicleConfig", "from_bus", "lane_offset_m", "to_bus", "values_from"]

_LONGEST_CROSSING_S = 40.0  # beyond it "at constant lateral speed" says nothing; fits the native signal
_FARTHEST_AHEAD_M = 20.0  # the road right ahead is out of the image, and a gap between dashes is up to 12 m
_NAN = math.nan
_ABSENT: Mapping[str, float] = {
    **dict.fromkeys(QUANTITIES, _NAN),
    **{
        f"{side}.{name}": 0.0
        for side in SIDE_NAMES.values()
        for name in ("available", "measured", "quality", "kind")
    },
    **dict.fromkeys(("centre.available", "centre.measured", "centre.quality"), 0.0),
}
_NAMES = {
    side: tuple(
        f"{word}.{name}"
        for name in (
            *("available", "offset_m", "heading", "c2_per_m", "c3_per_m2", "curvature_per_m"),
            *("curvature_rate_per_m2", "order", "x_min_m", "x_max_m", "quality", "kind", "colour"),
            *("width_m", "measured"),
        )
    )
    for side, word in SIDE_NAMES.items()
}
_CENTRE_MEANS = (
    *("offset_m", "heading", "c2_per_m", "c3_per_m2"),
    *("curvature_per_m", "curvature_rate_per_m2"),
)
_WORDS: Mapping[str, Side | None] = {**{word: side for side, word in SIDE_NAMES.items()}, "centre": None}
_DRY_DAY = Environment()
_LANE_CHANGE = {0: LaneChange.NONE, 1: LaneChange.LEFT, -1: LaneChange.RIGHT}

_Length = Annotated[float, msgspec.Meta(gt=0, le=15)]


class VehicleConfig(Config, frozen=True, kw_only=True):
    """`[vehicle]`: the vehicle around the sensor.

    `width_m` over the outer edges of the front wheels; `front_overhang_m` from front axle to bumper;
    `assumed_lane_width_m` of a lane of which only one line is seen, for its virtual centre.
    """

    wheelbase_m: _Length = 2.8
    front_overhang_m: Annotated[float, msgspec.Meta(ge=0, le=5)] = 0.9
    width_m: _Length = 1.85
    assumed_lane_width_m: _Length = 3.5


def values_from(
    vehicle: VehicleConfig,
    estimate: LaneEstimate,
    ego: EgoState,
    mode: SensorMode,
    environment: Environment = _DRY_DAY,
) -> SignalValues:
    """Return every quantity of QUANTITIES that a sensor sends, in SI and model signs; NaN = not available.

    A line that was not seen has NaN, and 0 for available, measured, quality and kind; so have all lines
    while the mode is neither AVAILABLE nor DEGRADED. Of a polynomial of an order above 3 the cubic that
    is closest to it over its view range is reported. `ego.light` is that of the environment.
    """
    values = dict(_ABSENT)
    values["ego.speed_mps"], values["ego.yaw_rate_radps"] = ego.speed_mps, ego.yaw_rate_radps
    values["ego.acceleration_mps2"] = ego.acceleration_mps2
    values["ego.lateral_acceleration_mps2"] = ego.lateral_acceleration_mps2
    values["ego.light"] = float(environment.light)
    values["image.index"] = float(estimate.image_index)
    values["image.timestamp_ms"] = float(estimate.exposed_at_ns // 1_000_000)
    values["sensor.state"] = float(mode)
    values["sensor.light"] = float(environment.light)
    values["sensor.rain"] = float(environment.rain)
    if mode.reports_lines:
        for boundary in estimate.boundaries:
            values.update(zip(_NAMES[boundary.side], _line(boundary), strict=True))
        values["lane.change"] = float(_LANE_CHANGE[estimate.lane_change])
        _put_lane(values, vehicle, estimate, ego)
        _put_centre(values, vehicle)
    return values


def _line(boundary: Boundary) -> tuple[float, ...]:
    """Return the values of one line, in the order of _NAMES."""
    c0, c1, c2, c3 = _cubic(boundary)
    start, end = boundary.x_min_m, boundary.x_max_m
    order, quality = min(len(boundary.coefficients) - 1, 3), boundary.quality
    return (
        *(1.0, c0, c1, c2, c3, 2.0 * c2, 6.0 * c3, float(order), start, end, float(quality)),
        *(float(boundary.kind), float(boundary.colour), boundary.width_m, float(boundary.measured)),
    )


def _cubic(boundary: Boundary) -> tuple[float, float, float, float]:
    """Return c0..c3; of a higher order the cubic through the Chebyshev nodes' least squares."""
    c = boundary.coefficients.tolist()
    if len(c) > 4:
        polynomial = np.polynomial.Polynomial(boundary.coefficients)
        domain = [boundary.x_min_m, boundary.x_max_m]
        near = np.polynomial.Chebyshev.interpolate(polynomial, len(c) - 1, domain).truncate(4)
        c = near.convert(kind=np.polynomial.Polynomial).coef.tolist()
    c0, c1, c2, c3 = (*c, 0.0, 0.0, 0.0)[:4]
    return c0, c1, c2, c3


# ---- the lane at the front axle ----------------------------------------------------------------------


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


def _put_lane(
    values: dict[str, float], vehicle: VehicleConfig, estimate: LaneEstimate, ego: EgoState
) -> None:
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


def _put_centre(values: dict[str, float], vehicle: VehicleConfig) -> None:
    """Put the mean of left and right; beside the only line seen, half the assumed width of the lane.

    Valid where all its lines are; as sure as the least sure of them.
    """
    seen = [word for word in ("left", "right") if values[f"{word}.available"]]
    if not seen:
        return
    for name in _CENTRE_MEANS:
        values[f"centre.{name}"] = sum(values[f"{word}.{name}"] for word in seen) / len(seen)
    if len(seen) == 1:
        half_m = vehicle.assumed_lane_width_m / 2 * math.hypot(1.0, values["centre.heading"])
        values["centre.offset_m"] += -half_m if seen == ["left"] else half_m
    start_m = max(values[f"{word}.x_min_m"] for word in seen)
    values["centre.available"], values["centre.x_min_m"] = 1.0, start_m
    values["centre.x_max_m"] = max(start_m, min(values[f"{word}.x_max_m"] for word in seen))
    values["centre.order"] = max(values[f"{word}.order"] for word in seen)
    for name in ("quality", "measured"):
        values[f"centre.{name}"] = min(values[f"{word}.{name}"] for word in seen)


# ---- as the bus describes a line ---------------------------------------------------------------------


def to_bus(
    geometry: GeometryConfig, vehicle: VehicleConfig, values: SignalValues, camera_x_m: float | None = None
) -> SignalValues:
    """Return the values with every line as this bus describes it: origin, edge, angle, curvature, start.

    Sign and unit of a single number are in its Binding. `camera_x_m` ahead of the rear axle is needed
    where the profile's origin is the camera.
    """
    if geometry == _MODEL_GEOMETRY:
        return values
    moved = dict(values)
    for word, side in _described(values):
        _line_to_bus(moved, word, side, geometry, origin_x_m(geometry, vehicle, camera_x_m))
    return moved


def from_bus(
    geometry: GeometryConfig, vehicle: VehicleConfig, values: SignalValues, camera_x_m: float | None = None
) -> SignalValues:
    """Return model values from those of a bus; the inverse of to_bus, for the values of one whole image.

    A coefficient that the bus does not carry counts as 0.
    """
    if geometry == _MODEL_GEOMETRY:
        return values
    moved = dict(values)
    for word, side in _described(values):
        _line_from_bus(moved, word, side, geometry, origin_x_m(geometry, vehicle, camera_x_m))
    return moved


def origin_x_m(geometry: GeometryConfig, vehicle: VehicleConfig, camera_x_m: float | None) -> float:
    """Return where this bus has x = 0, ahead of the rear axle."""
    if geometry.origin_x_m is not None:
        return geometry.origin_x_m
    if geometry.origin == "camera":
        if camera_x_m is None:
            raise ConfigError('geometry.origin = "camera": no camera here; give geometry.origin_x_m')
        return camera_x_m
    front_m = vehicle.wheelbase_m
    ahead = {"rear_axle": 0.0, "front_axle": front_m, "bumper": front_m + vehicle.front_overhang_m}
    return ahead[geometry.origin]


_MODEL_GEOMETRY = GeometryConfig()


def _described(values: SignalValues) -> list[tuple[str, Side | None]]:
    """Return the lines to convert: the four, and the virtual one (of no side) if it is there."""
    virtual = any(name.startswith("centre.") for name in values)
    return [(word, side) for word, side in _WORDS.items() if side is not None or virtual]


def _line_to_bus(
    values: dict[str, float], word: str, side: Side | None, geometry: GeometryConfig, origin: float
) -> None:
    c = _coefficients(values, word)
    c0, c1, c2, c3 = _shifted(c, origin)
    if geometry.edge == "inner":
        c0 += _to_inner_m(values, word, side, c1)
    curvature = 2 * c2 / math.hypot(1.0, c1) ** 3 if geometry.curvature == "true" else 2 * c2
    heading = math.atan(c1) if geometry.heading == "angle" else c1
    _put_line(values, word, (c0, heading, c2, c3, curvature), -origin)
    if geometry.range_start == "zero" and not math.isnan(values[f"{word}.x_min_m"]):
        values[f"{word}.x_min_m"] = 0.0


def _line_from_bus(
    values: dict[str, float], word: str, side: Side | None, geometry: GeometryConfig, origin: float
) -> None:
    c0, heading, c2, c3 = _coefficients(values, word)
    c1 = math.tan(heading) if geometry.heading == "angle" else heading
    if f"{word}.curvature_per_m" in values and geometry.curvature == "true":
        c2 = values[f"{word}.curvature_per_m"] / 2 * math.hypot(1.0, c1) ** 3
    if geometry.edge == "inner":
        c0 -= _to_inner_m(values, word, side, c1)
    c0, c1, c2, c3 = _shifted((c0, c1, c2, c3), -origin)
    _put_line(values, word, (c0, c1, c2, c3, 2 * c2), origin)


def _coefficients(values: SignalValues, word: str) -> tuple[float, float, float, float]:
    """Return c0..c3 from whichever of c2, 2 c2, c3, 6 c3 is there; one that is not carried counts as 0."""
    c2 = values.get(f"{word}.c2_per_m", values.get(f"{word}.curvature_per_m", 0.0) / 2)
    c3 = values.get(f"{word}.c3_per_m2", values.get(f"{word}.curvature_rate_per_m2", 0.0) / 6)
    return values.get(f"{word}.offset_m", _NAN), values.get(f"{word}.heading", 0.0), c2, c3


def _shifted(c: tuple[float, float, float, float], x_m: float) -> tuple[float, float, float, float]:
    """Return the coefficients of y(x + x_m) (Taylor shift)."""
    c0, c1, c2, c3 = c
    return (
        c0 + x_m * (c1 + x_m * (c2 + x_m * c3)),
        c1 + x_m * (2 * c2 + x_m * 3 * c3),
        c2 + x_m * 3 * c3,
        c3,
    )


def _to_inner_m(values: SignalValues, word: str, side: Side | None, slope: float) -> float:
    """Return the step along y from a marking's centre to its edge towards the vehicle; 0 without one."""
    if side is None:
        return 0.0
    half_m = values.get(f"{word}.width_m", _NAN) / 2 * math.hypot(1.0, slope)
    if math.isnan(half_m):
        return 0.0
    return -half_m if side in (Side.LEFT, Side.NEXT_LEFT) else half_m


def _put_line(
    values: dict[str, float], word: str, line: tuple[float, float, float, float, float], moved_m: float
) -> None:
    c0, heading, c2, c3, curvature = line
    values[f"{word}.offset_m"], values[f"{word}.heading"] = c0, heading
    values[f"{word}.c2_per_m"], values[f"{word}.c3_per_m2"] = c2, c3
    values[f"{word}.curvature_per_m"], values[f"{word}.curvature_rate_per_m2"] = curvature, 6 * c3
    for end in ("x_min_m", "x_max_m"):
        values[f"{word}.{end}"] = values.get(f"{word}.{end}", _NAN) + moved_m
