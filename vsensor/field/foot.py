"""The distance of points from a line of straight pieces, many points at once.

    line   o-----o-----o-----o         place = number of the piece + part of it that lies before the foot
                  |
                  foot, error > 0 to the left of the line's direction
                  .p

P1 eq. 2.37-2.51 as ERRATA corrects them: the foot lies on a piece, not between the two nearest vertices; the
sign is that of the cross product; beyond either end there is no error. Each point is looked for near a place
where it is expected, so a line that comes back to itself (a loop, a roundabout) is no harm.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vsensor.types import Array, BoolArray, IntArray

STEPS = 12
"""Each is a step of Newton's method along the line; 2 to 4 are needed, then all have arrived."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Polyline:
    """A reference line in driving direction: vertices (K,), K >= 2, about evenly spaced.

    `gap` (K - 1,): pieces that only bridge a place where nothing was measured. `lane` (K,): which of several
    lines this is there; a lane change begins a new one.
    """

    x_m: Array
    y_m: Array
    gap: BoolArray
    lane: IntArray

    @cached_property
    def pieces(self) -> tuple[Array, Array, Array]:
        """The pieces' components and the squares of their lengths, each (K - 1,)."""
        dx, dy = np.diff(self.x_m), np.diff(self.y_m)
        return dx, dy, np.maximum(dx * dx + dy * dy, 1e-18)

    @cached_property
    def spacing_m(self) -> float:
        """The mean length of a piece."""
        return float(np.sqrt(self.pieces[2]).mean())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Feet:
    """The feet of points (N,): `error_m` and `place`, both NaN where the line has none within reach."""

    error_m: Array
    place: Array


def feet(line: Polyline, x_m: Array, y_m: Array, place: Array, reach: Array) -> Feet:
    """Return the feet of points (N,), looked for at most `reach` (N,) pieces from the `place` (N,) expected.

    A point or place that is NaN has none.
    """
    error, found = np.full(len(x_m), np.nan), np.full(len(x_m), np.nan)
    known = np.flatnonzero(np.isfinite(x_m + y_m + place))
    expected, last = place[known], len(line.x_m) - 2
    low = np.clip(np.floor(expected - reach[known]), 0, last).astype(np.int64)
    high = np.clip(np.floor(expected + reach[known]), 0, last).astype(np.int64)
    pieces = _Pieces(line, x_m[known], y_m[known], low, high)
    nearest = pieces.newton(np.clip(np.floor(expected), low, high).astype(np.int64))
    error[known], found[known] = pieces.best_around(nearest)
    return Feet(error_m=error, place=found)


class _Pieces:
    """The pieces of a line, and points (N,) each of which may have its foot on those from `low` to `high`."""

    def __init__(self, line: Polyline, x_m: Array, y_m: Array, low: IntArray, high: IntArray) -> None:
        self._line, self._x, self._y, self._low, self._high = line, x_m, y_m, low, high
        self._dx, self._dy, self._square = line.pieces

    def newton(self, piece: IntArray) -> IntArray:
        """Return the pieces on which the points stand about upright, from those expected on."""
        line = self._line
        for _ in range(STEPS):
            along = (self._x - line.x_m[piece]) * self._dx[piece] + (self._y - line.y_m[piece]) * self._dy[
                piece
            ]
            step = np.clip(np.floor(along / self._square[piece]), -1e6, 1e6).astype(np.int64)
            if not step.any():
                break
            piece = np.clip(piece + step, self._low, self._high)
        return piece

    def best_around(self, piece: IntArray) -> tuple[Array, Array]:
        """Return error and place of the nearest of three pieces: around a vertex it may be on either side."""
        error, found, best = self._foot_on(piece)
        for beside in (-1, 1):
            one, place, apart = self._foot_on(np.clip(piece + beside, self._low, self._high))
            better = apart < best
            error, found = np.where(better, one, error), np.where(better, place, found)
            best = np.where(better, apart, best)
        return error, found

    def _foot_on(self, k: IntArray) -> tuple[Array, Array, Array]:
        """Return error and place, NaN for a foot beyond the last piece in reach, and the distance."""
        dx, dy = self._dx[k], self._dy[k]
        east, north = self._x - self._line.x_m[k], self._y - self._line.y_m[k]
        part = (east * dx + north * dy) / self._square[k]
        inside = np.clip(part, 0.0, 1.0)
        east, north = east - inside * dx, north - inside * dy
        apart = np.hypot(east, north)
        beyond = ((part < -1e-9) & (k == self._low)) | ((part > 1 + 1e-9) & (k == self._high))
        side = np.where(dx * north - dy * east < 0.0, -apart, apart)
        return np.where(beyond, np.nan, side), np.where(beyond, np.nan, k + inside), apart


def resampled_line(x_m: Array, y_m: Array, breaks: BoolArray, step_m: float) -> Polyline:
    """Return a line with vertices about every `step_m`; `breaks` (K - 1,): pieces that only bridge a gap."""
    length = np.hypot(np.diff(x_m), np.diff(y_m))
    s = np.concatenate([[0.0], np.cumsum(length)])
    count = max(int(np.ceil(s[-1] / step_m)), 1)
    at = np.linspace(0.0, s[-1], count + 1)
    middle = (at[1:] + at[:-1]) / 2
    piece = np.clip(np.searchsorted(s, middle, side="right") - 1, 0, len(length) - 1)
    return Polyline(
        x_m=np.interp(at, s, x_m),
        y_m=np.interp(at, s, y_m),
        gap=breaks[piece],
        lane=np.zeros(len(at), dtype=np.int64),
    )


def nearest_places(line: Polyline, x_m: Array, y_m: Array, yaw_rad: Array, farthest_m: float) -> Array:
    """Return the place (N,) on a line that is nearest to each pose and leads its way, NaN if none is near."""
    from scipy.spatial import KDTree

    tree = KDTree(np.column_stack([line.x_m, line.y_m]))
    heading = np.arctan2(np.gradient(line.y_m), np.gradient(line.x_m))
    places: Array = np.full(len(x_m), np.nan)
    left = np.arange(len(x_m))
    for count in (2, 64):  # more are needed only where a line crosses itself, or runs back beside itself
        found: Any = tree.query(
            np.column_stack([x_m[left], y_m[left]]), k=count, distance_upper_bound=farthest_m
        )
        apart, vertex = found
        known = np.minimum(vertex, len(line.x_m) - 1)
        there = np.isfinite(apart) & (np.cos(heading[known] - yaw_rad[left, None]) > 0.3)
        first = np.argmax(there, axis=1)
        rows = np.arange(len(left))
        places[left] = np.where(there[rows, first], known[rows, first], np.nan)
        left = left[~there[rows, first] & np.isfinite(apart[:, 0])]
    return places
