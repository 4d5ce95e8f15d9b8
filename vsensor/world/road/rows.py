"""Piecewise cubics as rows (s, a, b, c, d): made, cut, moved, added."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from itertools import pairwise

from vsensor.errors import ConfigError
from vsensor.world.opendrive.polynomial import CubicRecord
from vsensor.world.road.config import Points

SHORTEST_M = 1e-3
LARGEST = 1e6
"""Of a place and a value: no road is so long or wide."""

ZERO: tuple[CubicRecord, ...] = ((0.0, 0.0, 0.0, 0.0, 0.0),)


def smooth_rows(
    points: Points, key: str, convert: Callable[[float], float] = float
) -> tuple[CubicRecord, ...]:
    """Return what a number or points [[s, value], ...] say, on 3 u^2 - 2 u^3 between them."""
    values = [(s, convert(value)) for s, value in stations(points, key)]
    rows: list[CubicRecord] = [(0.0, values[0][1], 0.0, 0.0, 0.0)]
    rows += [step_row(s0, s1, v0, v1) for (s0, v0), (s1, v1) in pairwise(values)]
    return tidied([*rows, (values[-1][0], values[-1][1], 0.0, 0.0, 0.0)])


def straight_rows(points: Points, key: str) -> tuple[CubicRecord, ...]:
    """Return what a number or points say, straight between them."""
    values = stations(points, key)
    rows: list[CubicRecord] = [(0.0, values[0][1], 0.0, 0.0, 0.0)]
    rows += [(s0, v0, (v1 - v0) / (s1 - s0), 0.0, 0.0) for (s0, v0), (s1, v1) in pairwise(values)]
    return tidied([*rows, (values[-1][0], values[-1][1], 0.0, 0.0, 0.0)])


def stations(points: Points, key: str) -> list[tuple[float, float]]:
    """Return the points with rising s; raises ConfigError naming `key`."""
    if not isinstance(points, list):
        return [(0.0, _plausible(points, key))]
    if not points:
        raise ConfigError(f"{key}: an empty list; a number or points [[s, value], ...] were expected")
    for (s0, _), (s1, _) in pairwise(points):
        if s1 < s0 + SHORTEST_M:
            raise ConfigError(f"{key}: s must rise by {SHORTEST_M:g} m, but {s1:g} m comes after {s0:g} m")
    if points[0][0] < 0.0 or points[-1][0] > LARGEST:
        worst = points[0][0] if points[0][0] < 0.0 else points[-1][0]
        raise ConfigError(f"{key}: s = {worst:g} m: from 0 to {LARGEST:g} m was expected")
    return [(float(s), _plausible(value, key)) for s, value in points]


def _plausible(value: float, key: str) -> float:
    if abs(value) > LARGEST:
        raise ConfigError(f"{key} = {value:g}: at most {LARGEST:g} was expected")
    return float(value)


def step_row(s0: float, s1: float, v0: float, v1: float) -> CubicRecord:
    """Return the row that goes from one value to another and is level at both."""
    span, rise = s1 - s0, v1 - v0
    return (s0, v0, 0.0, 3.0 * rise / span**2, -2.0 * rise / span**3)


def tidied(rows: Sequence[CubicRecord]) -> tuple[CubicRecord, ...]:
    """Return the rows, of several at one s the last, without constant ones that change nothing."""
    kept: list[CubicRecord] = []
    for row in {row[0]: row for row in rows}.values():
        is_same = bool(kept) and row[2:] == kept[-1][2:] == (0.0, 0.0, 0.0) and row[1] == kept[-1][1]
        if not is_same:
            kept.append(row)
    return tuple(kept)


def value_at(rows: Sequence[CubicRecord], s_m: float) -> float:
    """Return the value at s."""
    return moved_row(rows, s_m)[1]


def moved_row(rows: Sequence[CubicRecord], s_m: float) -> CubicRecord:
    """Return the polynomial that holds at s, written from there on."""
    s, a, b, c, d = rows[max(0, bisect_right([row[0] for row in rows], s_m) - 1)]
    h = s_m - s
    return (s_m, a + h * (b + h * (c + h * d)), b + h * (2.0 * c + h * 3.0 * d), c + 3.0 * h * d, d)


def between(rows: Sequence[CubicRecord], from_m: float, to_m: float) -> tuple[CubicRecord, ...]:
    """Return the rows that hold between two places, the first written from `from_m` on."""
    return (moved_row(rows, from_m), *(row for row in rows if from_m < row[0] < to_m))


def total(parts: Sequence[tuple[float, Sequence[CubicRecord]]]) -> tuple[CubicRecord, ...]:
    """Return the sum of factor times rows."""
    starts = sorted({row[0] for _, rows in parts for row in rows})
    found = []
    for s in starts:
        moved = [(factor, moved_row(rows, s)) for factor, rows in parts]
        a, b, c, d = (sum(factor * row[k] for factor, row in moved) for k in range(1, 5))
        found.append((s, a, b, c, d))
    return tidied(found)
