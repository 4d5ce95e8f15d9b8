"""The borders along the route as windows: views into pages, which join the borders of several blocks."""

import math
from collections import OrderedDict

import numpy as np

from vsensor.types import Marking, RoadSurface
from vsensor.world.blocks import Blocks, cached
from vsensor.world.borders import border_lines, extra_line
from vsensor.world.course import RouteCurve
from vsensor.world.page import Page, Strip, join
from vsensor.world.sections import Sections, sections_of

PAGE_M = 200.0
REACH_M = 300.0
"""A page starts every 200 m and reaches 300 m past the next page's start."""

PAGES_KEPT = 3


class Windows:
    """Samples blocks at the stations, joins them to pages, and keeps only those around the last window."""

    def __init__(self, blocks: Blocks, spacing_m: float) -> None:
        self._blocks = blocks
        self._spacing_m = spacing_m
        self._curve = RouteCurve(blocks, spacing_m)
        self._strips: dict[int, Strip] = {}
        self._pages: OrderedDict[tuple[int, int], Page] = OrderedDict()
        self._sections: OrderedDict[tuple[int, int], Sections | None] = OrderedDict()
        self._ready_page = -1

    def between(self, s_from_m: float, s_to_m: float) -> tuple[Marking, ...]:
        """Return the borders between two distances, see `Corridor.markings_window`."""
        key = _key(s_from_m, s_to_m)
        page = self._page(*key)
        if self._ready_page != key[0] + 1:
            self._prepare(key[0] + 1)
        return page.window(*self._stations(s_from_m, s_to_m), self._curve)

    def surface(self, s_from_m: float, s_to_m: float) -> RoadSurface | None:
        """Return the road's cross-sections between two distances, None where it hides nothing of itself."""
        key = _key(s_from_m, s_to_m)
        sections = cached(
            self._sections, key, PAGES_KEPT, lambda: sections_of(self._page(*key).lines, self._spacing_m)
        )
        return sections.window(*self._stations(s_from_m, s_to_m)) if sections is not None else None

    def _stations(self, s_from_m: float, s_to_m: float) -> tuple[int, int]:
        """Return the first station between two distances and the first one behind them."""
        first = math.ceil(s_from_m / self._spacing_m - 1e-9)
        return first, math.floor(s_to_m / self._spacing_m + 1e-9) + 1

    def _prepare(self, number: int) -> None:
        """Do one step towards the page that comes next, so that no single tick pays for all of it."""
        start, end = number * PAGE_M, (number + 1) * PAGE_M + REACH_M
        if self._blocks.end_m < end and self._blocks.extend():
            return
        for i in self._blocks.between(start, end):
            piece = self._blocks[i].piece
            if i not in self._strips:
                self._strip(i)
                return
            if not self._blocks.has_table(piece):
                self._blocks.table(piece)
                return
        self._ready_page = number

    def _page(self, number: int, length: int) -> Page:
        return cached(self._pages, (number, length), PAGES_KEPT, lambda: self._joined(number, length))

    def _joined(self, number: int, length: int) -> Page:
        start, end = number * PAGE_M, number * PAGE_M + length * (PAGE_M + REACH_M)
        self._blocks.reach(end)
        inside = list(self._blocks.between(start, end))
        own = {group for i in inside for group in self._blocks[i].own_groups()}
        page = join([self._strip(i) for i in inside], own)
        kept = set(self._blocks.between(start - PAGE_M, end + 2 * PAGE_M))
        self._strips = {i: strip for i, strip in self._strips.items() if i in kept}
        return page

    def _strip(self, number: int) -> Strip:
        if number not in self._strips:
            self._strips[number] = self._sampled(number)
        return self._strips[number]

    def _sampled(self, number: int) -> Strip:
        """Return the borders of a block at its stations."""
        block = self._blocks[number]
        first, end = self._blocks.stations(number, self._spacing_m)
        sigma = np.arange(first, end, dtype=np.float64) * self._spacing_m - block.start_m
        s = block.piece.s_at(sigma)
        cross = block.piece.road.cross(s)
        lines = border_lines(block.piece, s, cross, block.lane_ids)
        extra = {}
        for place, group in zip(block.extra, block.extra_groups, strict=True):
            line = block.piece.road.lines[place]
            inside = np.flatnonzero((s >= line.from_m) & (s <= line.to_m))
            if len(inside):
                there = s[inside]
                found = extra_line(block.piece, line, there, block.piece.road.cross(there))
                extra[group] = (first + int(inside[0]), found)
        return Strip(first, len(sigma), dict(zip(block.groups, lines, strict=True)), extra)


def _key(s_from_m: float, s_to_m: float) -> tuple[int, int]:
    """Return number and length of the page that holds what lies between two distances."""
    number = max(0, math.floor(s_from_m / PAGE_M))
    return number, max(1, math.ceil((s_to_m - number * PAGE_M) / (PAGE_M + REACH_M)))
