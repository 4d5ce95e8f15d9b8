"""Lanes of one road: sections, borders as t over s, links.

A section says which lanes lie beside each other from `start_m` on. `singleSide` sections change one
side only; they are resolved here, so that every section has all lanes of the road's cross-section.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsensor.types import Array
from vsensor.world.opendrive import taylor
from vsensor.world.opendrive.marks import RoadMark
from vsensor.world.opendrive.polynomial import Cubics


@dataclass(frozen=True, slots=True)
class Lane:
    """One lane of a section; id 0 is the centre lane, which has no width.

    `width` is the lane's width over absolute s, or, if `is_border`, the distance of its outer border
    from the centre lane. `reversed` lanes carry traffic against the road's rule.
    """

    id: int
    type: str
    width: Cubics
    is_border: bool
    marks: tuple[RoadMark, ...]
    predecessors: tuple[int, ...]
    successors: tuple[int, ...]
    reversed: bool

    def linked(self, direction: int) -> tuple[int, ...]:
        """Return the lanes that follow in the direction (+1 along s, -1 against it)."""
        return self.successors if direction > 0 else self.predecessors


@dataclass(frozen=True)
class Section:
    """The cross-section from `start_m` to `end_m`; `lanes` by id, from left (highest id) to right."""

    start_m: float
    end_m: float
    lane_offset: Cubics
    lanes: Mapping[int, Lane]

    @cached_property
    def ids(self) -> tuple[int, ...]:
        """Lane ids from left to right, 0 among them."""
        return tuple(self.lanes)

    def of_type(self, *types: str) -> tuple[int, ...]:
        """Return the ids of the lanes of these types, from left to right, never 0."""
        return tuple(i for i, lane in self.lanes.items() if i != 0 and lane.type in types)

    def borders(self, s_m: Array, ids: Iterable[int]) -> tuple[dict[int, Array], dict[int, Array]]:
        """Return t and dt/ds (N,) of the outer border of each of `ids` (0: the centre lane's own)."""
        wanted = tuple(ids)
        offset, slope, _ = self.lane_offset.at(s_m)
        t, dt = {0: offset}, {0: slope}
        for side in (1, -1):
            outermost = max((side * i for i in wanted), default=0)
            inner, inner_slope = offset, slope
            for lane in self._outwards(side, outermost):
                inner, inner_slope = _outer(lane, side, s_m, (inner, inner_slope), (offset, slope))
                t[lane.id], dt[lane.id] = inner, inner_slope
        return t, dt

    def border_series(self, s_m: Array, ids: Iterable[int]) -> dict[int, Array]:
        """Return the Taylor series along s of t of the outer border of each of `ids`, see `borders`."""
        wanted = tuple(ids)
        centre = taylor.of_cubics(self.lane_offset, s_m)
        t = {0: centre}
        for side in (1, -1):
            inner = centre
            for lane in self._outwards(side, max((side * i for i in wanted), default=0)):
                outer = (centre if lane.is_border else inner) + side * taylor.of_cubics(lane.width, s_m)
                narrow = side * (outer[0] - inner[0]) < 0.0  # a width below 0 is 0
                t[lane.id] = inner = np.where(narrow, inner, outer) if narrow.any() else outer
        return t

    def _outwards(self, side: int, outermost: int) -> list[Lane]:
        ids = sorted((i for i in self.lanes if 0 < side * i <= outermost), key=abs)
        return [self.lanes[i] for i in ids]

    def inner(self, lane_id: int) -> int:
        """Return the lane whose outer border is the inner border of `lane_id`."""
        side = 1 if lane_id > 0 else -1
        return max((i for i in self.lanes if 0 < side * i < side * lane_id), key=abs, default=0)

    def centre(self, s_m: Array, lane_id: int) -> tuple[Array, Array, Array]:
        """Return t, dt/ds of the lane's middle and its width, each (N,)."""
        t, dt = self.borders(s_m, (lane_id,))
        inner = self.inner(lane_id)
        return (t[inner] + t[lane_id]) / 2, (dt[inner] + dt[lane_id]) / 2, np.abs(t[lane_id] - t[inner])


def _outer(
    lane: Lane, side: int, s_m: Array, inner: tuple[Array, Array], centre: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return t and slope of the outer border; a width below 0 counts as 0."""
    value, slope, _ = lane.width.at(s_m)
    base, base_slope = centre if lane.is_border else inner
    t, dt = base + side * value, base_slope + side * slope
    narrow = side * (t - inner[0]) < 0.0
    if narrow.any():
        t, dt = np.where(narrow, inner[0], t), np.where(narrow, inner[1], dt)
    return t, dt
