"""Cross-sections of the road where it may hide what lies behind a crest; a flat page has none.

A road hides nothing of itself unless its grade falls by at least the camera's height over the range:
0.2 m over 650 m are 3e-4. Sections stand as close as the road's vertical curvature asks: between two of
them it rises by no more than RISE_M above the chord.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np

from vsensor.types import Array, RoadSurface, frozen
from vsensor.world.page import LongLine

LEAST_FALL = 3e-4  # grade
RISE_M = 1e-3
STRAIGHT_M = 5e-4
"""Borders between the outermost two are left out where all lie this near to the straight line."""
STEPS_M = (2.0, 10.0)
GRADE_BASE_M = 5  # curvature is that of grades over this length: joints of real maps step by millimetres


@dataclass(frozen=True, slots=True)
class Sections:
    """Cross-sections `points_world_m` (M, L, 3) at stations first, first + every, ..."""

    first: int
    every: int
    points_world_m: Array

    def window(self, first: int, end: int) -> RoadSurface | None:
        """Return the sections at stations first to end - 1, None if there are none."""
        low = max(0, ceil((first - self.first) / self.every))
        high = max(0, ceil((end - self.first) / self.every))
        part = self.points_world_m[low:high]
        return RoadSurface(points_world_m=part) if len(part) else None


def sections_of(lines: Sequence[LongLine], spacing_m: float) -> Sections | None:
    """Return the cross-sections of a page's lines, which share their stations; None if it is flat."""
    borders = list({line.group: line for line in lines}.values())
    if len(borders) < 2:
        return None
    metre = max(1, round(1.0 / spacing_m))
    first = ceil(min(line.first for line in borders) / metre) * metre
    points = _at_stations(borders, first, metre)
    grade = _grades(points, 1)
    highest = np.fmax.accumulate(np.where(np.isnan(grade), -np.inf, grade), axis=0)
    if not np.nanmax(np.where(np.isnan(grade), 0.0, highest - grade), initial=0.0) > LEAST_FALL:
        return None
    metres = _step_metres(points)
    points = _left_to_right(points)[::metres]
    return Sections(first, metre * metres, frozen(_without_straight(points)))


def _at_stations(borders: Sequence[LongLine], first: int, every: int) -> Array:
    """Return the borders (M, L, 3) at every so many stations, NaN where one is not there."""
    end = max(line.first + len(line.painted) for line in borders)
    points = np.full((max(0, -((first - end) // every)), len(borders), 3), np.nan)
    for column, line in enumerate(borders):
        row = max(0, -((first - line.first) // every))
        mine = line.points_world_m[first + row * every - line.first :: every]
        points[row : row + len(mine), column] = mine
    return points


def _grades(points: Array, metres: int) -> Array:
    """Return the grade (M - metres, L) of each border over so many rows."""
    step = points[metres:] - points[:-metres]
    run = np.hypot(step[..., 0], step[..., 1])
    grade: Array = step[..., 2] / np.where(run > 0.0, run, np.nan)
    return grade


def _step_metres(points: Array) -> int:
    """Return how far apart sections may stand: the sagitta of a chord c over a radius R is c^2 / (8 R)."""
    low, high = STEPS_M
    if len(points) <= GRADE_BASE_M:
        return int(low)
    bend = np.abs(np.diff(_grades(points, GRADE_BASE_M)[::GRADE_BASE_M], axis=0)) / GRADE_BASE_M
    curvature = float(bend[np.isfinite(bend)].max(initial=8.0 * RISE_M / high**2))
    return int(max(sqrt(8.0 * RISE_M / curvature), low))


def _left_to_right(points: Array) -> Array:
    """Return each section (M, L, 3) in order from its left end, NaN last."""
    known = ~np.isnan(points[..., 2])
    middle = np.where(known[..., None], points, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)[:, None]
    column = int(known.sum(axis=0).argmax())
    ahead = np.gradient(points[:, column, :2], axis=0)
    offset = points[..., :2] - middle[:, None, :2]
    left = ahead[:, None, 0] * offset[..., 1] - ahead[:, None, 1] * offset[..., 0]
    order = np.argsort(np.where(known, -left, np.inf), axis=1, kind="stable")
    return np.take_along_axis(points, order[..., None], axis=1)


def _without_straight(points: Array) -> Array:
    """Return the outermost borders alone where all sections are straight, else all of them."""
    count = (~np.isnan(points[..., 2])).sum(axis=1)
    ends = np.stack([points[:, 0], points[np.arange(len(points)), np.maximum(count - 1, 0)]], axis=1)
    side = ends[:, 1] - ends[:, 0]
    square = (side * side).sum(axis=1)
    offset = points - ends[:, :1]
    share = (offset * side[:, None]).sum(axis=2) / np.where(square > 0.0, square, np.nan)[:, None]
    off = offset[..., 2] - share * side[:, None, 2]
    return ends if float(np.nanmax(np.abs(off), initial=0.0)) <= STRAIGHT_M else points
