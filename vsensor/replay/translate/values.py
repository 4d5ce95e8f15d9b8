"""What one bus told of an image, as all that the model knows: the lines' derived quantities with it."""

import math
from collections.abc import Mapping
from enum import IntEnum
from typing import TypeVar

import numpy as np

from vsensor.profile import Profile
from vsensor.signals import VehicleConfig, values_from
from vsensor.types import (
    SIDE_NAMES,
    Boundary,
    Colour,
    EgoState,
    Environment,
    LaneEstimate,
    Light,
    MarkingKind,
    SensorMode,
    Side,
    SignalValues,
    frozen,
)

_NAN = math.nan
ASSUMED_WIDTH_M = 0.15
"""Of a marking whose width a bus does not tell: most roads have 0.12 to 0.2 m."""
ASSUMED_RANGE_M = 50.0
"""Up to which a line counts as seen where a bus does not tell: without a range it would contradict itself."""
_TWINS: Mapping[str, str] = {
    "c2_per_m": "curvature_per_m",
    "curvature_per_m": "c2_per_m",
    "c3_per_m2": "curvature_rate_per_m2",
    "curvature_rate_per_m2": "c3_per_m2",
}
_NOWHERE = frozen([_NAN, _NAN, _NAN])


def known_of(profile: Profile) -> frozenset[str]:
    """Return the quantities that a profile tells, those that say the same in other words with them."""
    known = set(profile.quantities())
    for name in profile.quantities():
        line, _, what = name.partition(".")
        if what in _TWINS:
            known.add(f"{line}.{_TWINS[what]}")
    return frozenset(known)


def completed(
    known: frozenset[str], vehicle: VehicleConfig, told: SignalValues, index: int, milliseconds: int
) -> SignalValues:
    """Return every quantity of an image from those that a bus told, in SI, model signs and the model's frame.

    `known` are those that it tells at all. A line is there if its offset and heading are; what is not told
    of it is derived from its polynomial, or assumed: quality 4, measured, of unknown kind, ASSUMED_WIDTH_M
    wide, seen from 0 to ASSUMED_RANGE_M; the sensor as available, by day, dry.
    """
    lines = [line for side in Side if (line := _line(known, told, side)) is not None]
    estimate = LaneEstimate(
        exposed_at_ns=milliseconds * 1_000_000,
        image_index=index,
        boundaries=tuple(lines),
        lane_change={1.0: 1, 2.0: -1}.get(told.get("lane.change", 0.0), 0),
    )
    mode = _code(SensorMode, told.get("sensor.state", _NAN), SensorMode.AVAILABLE)
    rain = told.get("sensor.rain", _NAN)
    environment = Environment(
        light=_code(Light, told.get("sensor.light", told.get("ego.light", _NAN)), Light.DAY),
        rain=0.0 if math.isnan(rain) else rain,
    )
    values = dict(values_from(vehicle, estimate, _ego(told), mode, environment))
    there = {SIDE_NAMES[line.side] for line in lines} if mode.reports_lines else set[str]()
    absent = set(SIDE_NAMES.values()) - there
    values |= {name: told[name] for name in known & told.keys() if name.partition(".")[0] not in absent}
    if mode.reports_lines:  # a bus may tell lane offsets, but no polynomial
        bare = {word for word in absent if f"{word}.offset_m" not in known}
        values |= {
            name: told[name] for name in _LANE_OFFSETS & known & told.keys() if name.partition(".")[0] in bare
        }
    values["image.index"], values["image.timestamp_ms"] = float(index), float(milliseconds)
    return values


_LANE_OFFSETS = frozenset({"left.lane_offset_m", "right.lane_offset_m"})


def _ego(told: SignalValues) -> EgoState:
    return EgoState(
        t_ns=0,
        position_world_m=_NOWHERE,
        speed_mps=told.get("ego.speed_mps", _NAN),
        yaw_rate_radps=told.get("ego.yaw_rate_radps", _NAN),
        acceleration_mps2=told.get("ego.acceleration_mps2", _NAN),
        lateral_acceleration_mps2=told.get("ego.lateral_acceleration_mps2", _NAN),
    )


def _line(known: frozenset[str], told: SignalValues, side: Side) -> Boundary | None:
    """Return a line that was told, None if there is none."""
    word = SIDE_NAMES[side]

    def of(what: str, default: float) -> float:
        value = told.get(f"{word}.{what}", _NAN) if f"{word}.{what}" in known else _NAN
        return default if math.isnan(value) else value

    offset_m, heading = of("offset_m", _NAN), told.get(f"{word}.heading", 0.0)
    if math.isnan(offset_m) or math.isnan(heading) or not of("available", 1.0):
        return None
    c2 = of("c2_per_m", of("curvature_per_m", 0.0) / 2)
    c3 = of("c3_per_m2", of("curvature_rate_per_m2", 0.0) / 6)
    most = 3.0 if f"{word}.c3_per_m2" in known else 2.0 if f"{word}.c2_per_m" in known else 1.0
    size = min(max(int(of("order", most)), 1), 3) + 1
    return Boundary(
        side=side,
        coefficients=frozen([offset_m, heading, c2, c3][:size]),
        covariance=frozen(np.zeros((size, size))),
        x_min_m=of("x_min_m", 0.0),
        x_max_m=of("x_max_m", ASSUMED_RANGE_M),
        quality=int(of("quality", 4.0)),
        kind=_code(MarkingKind, of("kind", _NAN), MarkingKind.UNKNOWN),
        colour=_code(Colour, of("colour", _NAN), Colour.UNKNOWN),
        width_m=of("width_m", ASSUMED_WIDTH_M),
        measured=bool(of("measured", 1.0)),
        marking=-1,
        points=-1,
    )


_Code = TypeVar("_Code", bound=IntEnum)


def _code(codes: type[_Code], value: float, otherwise: _Code) -> _Code:
    """Return the code that a number stands for; `otherwise` for NaN and for what is none."""
    return codes(int(value)) if not math.isnan(value) and int(value) in list(codes) else otherwise
