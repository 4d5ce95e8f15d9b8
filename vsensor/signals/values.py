"""Every quantity that a sensor sends, of one image, in SI and model signs."""

import math
from collections.abc import Mapping

import numpy as np

from vsensor.profile import QUANTITIES, LaneChange, wiper_of
from vsensor.signals.lane import put_centre, put_lane
from vsensor.signals.vehicle import VehicleConfig
from vsensor.types import (
    SIDE_NAMES,
    Beam,
    Boundary,
    EgoState,
    Environment,
    LaneEstimate,
    SensorMode,
    SignalValues,
)

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
_DRY_DAY = Environment()
_LANE_CHANGE = {0: LaneChange.NONE, 1: LaneChange.LEFT, -1: LaneChange.RIGHT}


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
    is closest to it over its view range is reported. Light, wiper and headlights of
    `ego` follow from the environment.
    """
    values = dict(_ABSENT)
    values["ego.speed_mps"], values["ego.yaw_rate_radps"] = ego.speed_mps, ego.yaw_rate_radps
    values["ego.acceleration_mps2"] = ego.acceleration_mps2
    values["ego.lateral_acceleration_mps2"] = ego.lateral_acceleration_mps2
    values["ego.light"] = float(environment.light)
    values["ego.wiper"] = float(wiper_of(environment.rain))
    values["ego.low_beam"] = float(environment.headlights is not Beam.OFF)
    values["ego.high_beam"] = float(environment.headlights is Beam.HIGH)
    values["image.index"] = float(estimate.image_index)
    values["image.timestamp_ms"] = float(estimate.exposed_at_ns // 1_000_000)
    values["sensor.state"] = float(mode)
    values["sensor.light"] = float(environment.light)
    values["sensor.rain"] = float(environment.rain)
    if mode.reports_lines:
        for boundary in estimate.boundaries:
            values.update(zip(_NAMES[boundary.side], _line(boundary), strict=True))
        values["lane.change"] = float(_LANE_CHANGE[estimate.lane_change])
        put_lane(values, vehicle, estimate, ego)
        put_centre(values, vehicle)
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
