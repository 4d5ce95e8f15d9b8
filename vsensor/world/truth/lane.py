"""The truth of the lane: the same quantities by the same formulas as on the bus, of the true lines."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from vsensor.signals import VehicleConfig
from vsensor.signals.lane import put_lane
from vsensor.types import Boundary, Colour, EgoState, LaneEstimate, Side, frozen
from vsensor.world.truth.lines import LineTruth

_NO_COVARIANCE = frozen([[0.0, 0.0], [0.0, 0.0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneTruth:
    """Width between the inner edges across the lane, speed across it to the left, time to line crossing.

    NaN as on the bus: no line, no crossing within reason.
    """

    width_m: float
    lateral_speed_mps: float
    time_to_crossing_s: float


def lane_truth(vehicle: VehicleConfig, truths: Mapping[Side, LineTruth], ego: EgoState) -> LaneTruth:
    """Return the lane at the front axle from the true lines beside it."""
    axle_m = vehicle.wheelbase_m
    lines = tuple(
        _tangent(side, truths[side], axle_m)
        for side in (Side.LEFT, Side.RIGHT)
        if side in truths and not math.isnan(truths[side].axle_y_m)
    )
    values = dict.fromkeys(("lane.width_m", "lane.lateral_speed_mps", "lane.time_to_crossing_s"), math.nan)
    put_lane(values, vehicle, LaneEstimate(exposed_at_ns=0, image_index=0, boundaries=lines), ego)
    return LaneTruth(
        width_m=values["lane.width_m"],
        lateral_speed_mps=values["lane.lateral_speed_mps"],
        time_to_crossing_s=values["lane.time_to_crossing_s"],
    )


def _tangent(side: Side, truth: LineTruth, axle_m: float) -> Boundary:
    """Return the true line's tangent at the front axle as a report; place and slope there are what counts."""
    return Boundary(
        side=side,
        coefficients=frozen([truth.axle_y_m - truth.axle_slope * axle_m, truth.axle_slope]),
        covariance=_NO_COVARIANCE,
        x_min_m=axle_m,
        x_max_m=axle_m,
        quality=4,
        kind=truth.kind,
        colour=Colour.UNKNOWN,
        width_m=truth.width_m,
        measured=True,
        marking=truth.marking,
        points=-1,
    )
