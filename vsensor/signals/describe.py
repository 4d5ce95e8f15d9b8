"""A line as a bus describes it, and back: origin, edge, angle, curvature, start."""

import math
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from vsensor.errors import ConfigError
from vsensor.profile import GeometryConfig
from vsensor.signals.vehicle import VehicleConfig
from vsensor.types import SIDE_NAMES, Array, Side, SignalValues

Number: TypeAlias = Any  # a float, or an array (N,) of many images

_NAN = math.nan
_WORDS: Mapping[str, Side | None] = {**{word: side for side, word in SIDE_NAMES.items()}, "centre": None}


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
    columns = {name: np.array(value, dtype=np.float64) for name, value in values.items()}
    moved = columns_from_bus(geometry, vehicle, columns, camera_x_m)
    return {name: float(value) for name, value in moved.items()}


def columns_from_bus(
    geometry: GeometryConfig,
    vehicle: VehicleConfig,
    columns: Mapping[str, Array],
    camera_x_m: float | None = None,
) -> dict[str, Array]:
    """Return model values of many images at once, all columns (N,); see from_bus.

    A column that is not there is a coefficient that the bus does not carry; NaN in one stays NaN.
    """
    moved = dict(columns)
    for word, side in _described(columns):
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
_AWAY: Mapping[Side, float] = {Side.LEFT: 1.0, Side.NEXT_LEFT: 1.0, Side.RIGHT: -1.0, Side.NEXT_RIGHT: -1.0}
"""Sign of the step along y from the inner edge to the marking's centre."""


def _described(values: Mapping[str, Number]) -> list[tuple[str, Side | None]]:
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
    values: dict[str, Array], word: str, side: Side | None, geometry: GeometryConfig, origin: float
) -> None:
    c0, heading, c2, c3 = _coefficients(values, word)
    c1 = np.tan(heading) if geometry.heading == "angle" else heading
    if f"{word}.curvature_per_m" in values and geometry.curvature == "true":
        c2 = values[f"{word}.curvature_per_m"] / 2 * np.hypot(1.0, c1) ** 3
    if geometry.edge == "inner" and side is not None and f"{word}.width_m" in values:
        half_m = values[f"{word}.width_m"] / 2 * np.hypot(1.0, c1)
        c0 = c0 + _AWAY[side] * np.where(np.isnan(half_m), 0.0, half_m)
    c0, c1, c2, c3 = _shifted((c0, c1, c2, c3), -origin)
    _put_line(values, word, (c0, c1, c2, c3, 2 * c2), origin)


def _coefficients(values: Mapping[str, Number], word: str) -> tuple[Number, Number, Number, Number]:
    """Return c0..c3 from whichever of c2, 2 c2, c3, 6 c3 is there; one that is not carried counts as 0."""
    c2 = values.get(f"{word}.c2_per_m", values.get(f"{word}.curvature_per_m", 0.0) / 2)
    c3 = values.get(f"{word}.c3_per_m2", values.get(f"{word}.curvature_rate_per_m2", 0.0) / 6)
    return values.get(f"{word}.offset_m", _NAN), values.get(f"{word}.heading", 0.0), c2, c3


def _shifted(c: tuple[Number, Number, Number, Number], x_m: float) -> tuple[Number, Number, Number, Number]:
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
    return 0.0 if math.isnan(half_m) else -_AWAY[side] * half_m


def _put_line(
    values: dict[str, Number],
    word: str,
    line: tuple[Number, Number, Number, Number, Number],
    moved_m: float,
) -> None:
    c0, heading, c2, c3, curvature = line
    values[f"{word}.offset_m"], values[f"{word}.heading"] = c0, heading
    values[f"{word}.c2_per_m"], values[f"{word}.c3_per_m2"] = c2, c3
    values[f"{word}.curvature_per_m"], values[f"{word}.curvature_rate_per_m2"] = curvature, 6 * c3
    for end in ("x_min_m", "x_max_m"):
        values[f"{word}.{end}"] = values.get(f"{word}.{end}", _NAN) + moved_m
