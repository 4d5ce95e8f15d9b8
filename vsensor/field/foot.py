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
from typing import Any

import numpy as np

from vsensor.types import Array, BoolArray, IntArray

STEPS = 12
"""Each is a step of Newton's method along the line; 2 to 4 are needed, then all have arrived."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polyline:
    """A reference line in driving direction: vertices (K,), K >= 2, about evenly spaced.

    `gap` (K - 1,): pieces that only bridge a place where nothing was measured. `lane` (K,): which of several
    lines this is there; a lane change begins a new one.
    """

    x_m: Array
    y_m: Array
    gap: BoolArray
    lane: IntArray

    @property
    def spacing_m(self) -> float:
        """The mean length of a piece."""
        length = float(np.hypot(np.diff(self.x_m), np.diff(self.y_m)).sum())
        return max(length / (len(self.x_m) - 1), 1e-9)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Feet:
    """The feet of points (N,): `error_m` and `place`, both NaN where the line has none within reach."""

    error_m: Array
    place: Array


def feet(line: Polyline, x_m: Array, y_m: Array, place: Array, reach: Array | float) -> Feet:
    """Return the feet of points (N,), looked for at most `reach` pieces from the `place` (N,) expected."""
    last = len(line.x_m) - 2
    expected = np.nan_to_num(place, nan=-1.0)
    low = np.clip(np.floor(expected - reach), 0, last).astype(np.int64)
    high = np.clip(np.floor(expected + reach), 0, last).astype(np.int64)
    dx, dy = np.diff(line.x_m), np.diff(line.y_m)
    square = np.maximum(dx * dx + dy * dy, 1e-18)
    piece = np.clip(np.floor(expected), low, high).astype(np.int64)
    for _ in range(STEPS):
        along = (x_m - line.x_m[piece]) * dx[piece] + (y_m - line.y_m[piece]) * dy[piece]
        step = np.floor(along / square[piece])
        moved = np.clip(piece + np.clip(step, -1e6, 1e6), low, high).astype(np.int64)
        if np.array_equal(moved, piece):
            break
        piece = moved
    best = np.full(len(x_m), np.inf)
    error, found = np.full(len(x_m), np.nan), np.full(len(x_m), np.nan)
    for beside in (0, -1, 1):  # around a vertex the foot may be on either side
        k = np.clip(piece + beside, low, high)
        east, north = x_m - line.x_m[k], y_m - line.y_m[k]
        part = (east * dx[k] + north * dy[k]) / square[k]
        inside = np.clip(part, 0.0, 1.0)
        east, north = east - inside * dx[k], north - inside * dy[k]
        apart = np.hypot(east, north)
        beyond = ((part < -1e-9) & (k == low)) | ((part > 1 + 1e-9) & (k == high))
        better = apart < best
        best = np.where(better, apart, best)
        side = np.where(dx[k] * north - dy[k] * east < 0.0, -1.0, 1.0)
        error = np.where(better, np.where(beyond, np.nan, side * apart), error)
        found = np.where(better, np.where(beyond, np.nan, k + inside), found)
    unknown = np.isnan(place)
    return Feet(error_m=np.where(unknown, np.nan, error), place=np.where(unknown, np.nan, found))


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
