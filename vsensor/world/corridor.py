"""The drive along a lane: poses, lanes beside it, and the borders as long dense lines, built in blocks.

    route distance  0        200       400        (true length of the lane's middle, m)
    blocks          |----A----|---B--|-----C---|   one lane of one section each, at most 200 m
    stations        ......................         every 0.1 m, counted over the whole route
    pages           [====== 0 ======]              what a window is cut from: arrays of several blocks,
                          [====== 1 ======]        joined, so that a window is a view

Blocks and pages are kept in small caches: an hour of driving needs no more memory than a minute,
but for some 200 bytes a block. What a window shows depends on its place alone, not on what was
asked before. Only the roads driven on have borders here: a carriageway that is a road of its own,
or another way through a junction, is not seen.
"""

import math
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from vsensor.errors import MapError
from vsensor.types import Array, IntArray, Marking
from vsensor.world.borders import border_lines
from vsensor.world.chains import Chains
from vsensor.world.lane_piece import LanePiece
from vsensor.world.lane_table import LaneTable
from vsensor.world.opendrive.lanes import Section
from vsensor.world.opendrive.network import Place
from vsensor.world.opendrive.road import RoadMap
from vsensor.world.page import Page, Strip, join
from vsensor.world.route import DRIVABLE, CorridorConfig, Route

PAGE_M = 200.0
REACH_M = 300.0
"""A page starts every 200 m and reaches 300 m past the next page's start."""

TABLES_KEPT = 64
PAGES_KEPT = 3

K = TypeVar("K")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Poses:
    """Poses along the corridor: `position_world_m` (N, 3), angles and curvature (N,).

    Angles are those of EgoState's road-level frame; `curvature_per_m` is the lane's, within the
    road's plane, left positive: yaw rate about the road's normal per speed.
    """

    position_world_m: Array
    roll_rad: Array
    pitch_rad: Array
    yaw_rad: Array
    curvature_per_m: Array


@dataclass(frozen=True, slots=True)
class LaneBeside:
    """A lane beside the driven one at some place: its middle is `offset_m` to the left of the own middle.

    `offset_m`, `width_m` (N,). `oncoming` lanes are driven the other way.
    """

    lane_id: int
    type: str
    oncoming: bool
    offset_m: Array
    width_m: Array


@dataclass(frozen=True, slots=True)
class Block:
    """One piece of the route at its place: stations `first` to `last` - 1 lie in it."""

    piece: LanePiece
    sigma_m: float
    groups: tuple[int, ...]
    lane_ids: tuple[int, ...]


class Corridor:
    """The drive along one lane of a map, followed over links and junctions; s is the route distance.

    Built where asked; raises MapError if the start or the route names what is not there.
    """

    def __init__(self, road_map: RoadMap, config: CorridorConfig | None = None) -> None:
        """Find the start; nothing is sampled yet. Raises MapError, also if there is nothing ahead of it."""
        self.road_map = road_map
        self.config = config or CorridorConfig()
        self._route = Route(road_map, self.config)
        self._chains = Chains(self.config.lateral_m)
        self._blocks: list[Block] = []
        self._starts_m: list[float] = [0.0]
        self._strips: dict[int, Strip] = {}
        self._ready_page = -1
        self._tables: OrderedDict[int, LaneTable] = OrderedDict()
        self._pages: OrderedDict[tuple[int, int], Page] = OrderedDict()
        if not self.reaches(1e-6):
            start = self.start
            raise MapError(
                f"{road_map.path}: road {start.road_id} lane {start.lane_id}: nothing to drive on there"
            )

    @property
    def start(self) -> Place:
        """The place of the drive's first metre."""
        return self._route.start

    @property
    def spacing_m(self) -> float:
        """Distance of the stations along the lane's middle."""
        return self.config.spacing_m

    def reaches(self, s_m: float) -> bool:
        """Return whether the route goes on to `s_m` (True for ever on a closed circuit)."""
        while self._starts_m[-1] < s_m:
            piece = self._route.advance()
            if piece is None:
                return False
            lane_ids, groups = self._chains.extend(piece)
            self._blocks.append(Block(piece, self._starts_m[-1], groups, lane_ids))
            self._starts_m.append(self._starts_m[-1] + piece.length_m)
        return s_m >= 0.0

    @cached_property
    def length_m(self) -> float:
        """Length of the whole route, infinite if it returns to itself."""
        while self.reaches(self._starts_m[-1] + 1e-3):
            if self._route.is_closed:
                return math.inf
        return self._starts_m[-1]

    def poses(self, s_m: Array, offset_m: Array | float = 0.0) -> Poses:
        """Return poses (N,) at distances (N,), `offset_m` to the left of the lane's middle.

        Within 2e-7 m of the map's own curves in a bend of 10 m radius, 1e-9 m from 100 m on (see
        LaneTable). The heading is that of the lane's middle, whatever the offset. Beyond the ends of
        the route the lane goes on straight.
        """
        s = np.asarray(s_m, dtype=np.float64)
        offset = np.broadcast_to(np.asarray(offset_m, dtype=np.float64), s.shape)
        numbers = self._numbers(s)
        if len(s) and (numbers == numbers[0]).all():
            return self._poses_in(int(numbers[0]), s, offset)
        out = Poses(np.empty((len(s), 3)), *np.empty((4, len(s))))
        for number in np.unique(numbers):
            mine = numbers == number
            part = self._poses_in(int(number), s[mine], offset[mine])
            for name in Poses.__slots__:
                getattr(out, name)[mine] = getattr(part, name)
        return out

    def pose(self, s_m: float, offset_m: float = 0.0) -> Poses:
        """Return one pose, as `poses` with N = 1."""
        return self.poses(np.array([s_m]), np.array([offset_m]))

    def _numbers(self, s_m: Array) -> IntArray:
        """Return the block (N,) of each distance; raises ValueError for NaN and infinity."""
        if not np.isfinite(s_m).all():
            raise ValueError("a distance along the corridor is not finite")
        self.reaches(float(s_m.max(initial=0.0)) + 1e-9)
        last = len(self._blocks) - 1
        return np.array([min(max(bisect_right(self._starts_m, s) - 1, 0), last) for s in s_m], dtype=np.int64)

    def _poses_in(self, number: int, s_m: Array, offset_m: Array) -> Poses:
        block = self._blocks[number]
        table = self._table(block.piece)
        sigma = np.minimum(np.maximum(s_m - block.sigma_m, 0.0), block.piece.length_m)
        position, forward, left, curvature = table.at(sigma)
        position = position + (s_m - block.sigma_m - sigma) * forward + offset_m * left
        return Poses(
            np.ascontiguousarray(position.T),
            np.arctan2(left[2], forward[0] * left[1] - forward[1] * left[0]),
            np.arctan2(-forward[2], np.hypot(forward[0], forward[1])),
            np.arctan2(forward[1], forward[0]),
            curvature,
        )

    def place(self, s_m: float) -> tuple[Place, float]:
        """Return the lane driven at a distance, and s on its road."""
        block = self._block_at(s_m)
        return block.piece.place, float(block.piece.s_at(np.array([s_m - block.sigma_m]))[0])

    def section(self, s_m: float) -> Section:
        """Return the road's cross-section at a distance."""
        return self._block_at(s_m).piece.section

    def _block_at(self, s_m: float) -> Block:
        return self._blocks[int(self._numbers(np.array([s_m]))[0])]

    def lane_width(self, s_m: float) -> float:
        """Return the width of the driven lane, m."""
        block = self._block_at(s_m)
        s = block.piece.s_at(np.array([s_m - block.sigma_m]))
        return float(block.piece.section.centre(s, block.piece.place.lane_id)[2][0])

    def lane_beside(self, s_m: float, lanes_left: int) -> LaneBeside | None:
        """Return the lane so many lanes to the left (negative: right) of the driven one, None if none.

        Lanes that nobody drives on (shoulder, border, median) are passed over in counting.
        """
        block = self._block_at(s_m)
        piece = block.piece
        own_type = piece.section.lanes[piece.place.lane_id].type
        known = {own_type, *DRIVABLE}
        lanes = [i for i in piece.ids_left_to_right() if i != 0 and piece.section.lanes[i].type in known]
        column = lanes.index(piece.place.lane_id) - lanes_left
        if not 0 <= column < len(lanes):
            return None
        lane = piece.section.lanes[lanes[column]]
        s = piece.s_at(np.array([s_m - block.sigma_m]))
        own, _, _ = piece.section.centre(s, piece.place.lane_id)
        other, _, width = piece.section.centre(s, lane.id)
        drives = piece.road.direction(lane.id, reversed_lane=lane.reversed)
        offset = piece.place.direction * (other - own)
        return LaneBeside(lane.id, lane.type, drives != piece.place.direction, offset, width)

    def own_groups(self, s_m: float) -> tuple[int, int]:
        """Return the `group` of the driven lane's left and right border."""
        block = self._block_at(s_m)
        left, right = block.piece.own_borders()
        by_lane = dict(zip(block.lane_ids, block.groups, strict=True))
        return by_lane[left], by_lane[right]

    def markings_window(self, s_from_m: float, s_to_m: float) -> tuple[Marking, ...]:
        """Return the borders between two distances as views, ordered by id.

        A border that is double anywhere on the page gives two stripes, which lie on each other where
        it is single; else one. Borders without any mark on the page are left out, except the driven
        lane's own. Empty outside the route.
        """
        number = max(0, math.floor(s_from_m / PAGE_M))
        length = max(1, math.ceil((s_to_m - number * PAGE_M) / (PAGE_M + REACH_M)))
        page = _cached(self._pages, (number, length), PAGES_KEPT, lambda: self._page(number, length))
        if self._ready_page != number + 1:
            self._prepare(number + 1)
        first = math.ceil(s_from_m / self.spacing_m - 1e-9)
        return page.window(first, math.floor(s_to_m / self.spacing_m + 1e-9) + 1)

    def _prepare(self, number: int) -> None:
        """Do one step towards the page that comes next, so that no single tick pays for all of it."""
        start, end = number * PAGE_M, (number + 1) * PAGE_M + REACH_M
        if self._starts_m[-1] < end and self.reaches(self._starts_m[-1] + 1e-6):
            return
        for i in self._overlapping(start, end):
            if i not in self._strips or id(self._blocks[i].piece) not in self._tables:
                self._strip(i)
                self._table(self._blocks[i].piece)
                return
        self._ready_page = number

    def _overlapping(self, start_m: float, end_m: float) -> Iterator[int]:
        """Yield the blocks that are built and lie between two distances, at least in part."""
        for i in range(max(0, bisect_right(self._starts_m, start_m) - 1), len(self._blocks)):
            if self._starts_m[i] >= end_m:
                return
            yield i

    def _page(self, number: int, length: int) -> Page:
        start, end = number * PAGE_M, number * PAGE_M + length * (PAGE_M + REACH_M)
        self.reaches(end)
        strips, own = [], set[int]()
        for i in self._overlapping(start, end):
            strips.append(self._strip(i))
            own.update(self.own_groups((self._starts_m[i] + self._starts_m[i + 1]) / 2))
        kept = set(self._overlapping(start - PAGE_M, end + 2 * PAGE_M))
        self._strips = {i: strip for i, strip in self._strips.items() if i in kept}
        return join(strips, own)

    def _strip(self, number: int) -> Strip:
        if number not in self._strips:
            self._strips[number] = self._sampled(number)
        return self._strips[number]

    def _table(self, piece: LanePiece) -> LaneTable:
        return _cached(self._tables, id(piece), TABLES_KEPT, lambda: LaneTable.of(piece))

    def _sampled(self, number: int) -> Strip:
        """Return the borders of a block at its stations."""
        block = self._blocks[number]
        first = math.ceil(self._starts_m[number] / self.spacing_m)
        end = math.ceil(self._starts_m[number + 1] / self.spacing_m)
        stations = np.arange(first, max(first, end), dtype=np.float64)
        sigma = stations * self.spacing_m - block.sigma_m
        s = block.piece.s_at(sigma)
        lines = border_lines(block.piece, s, block.piece.road.cross(s), block.lane_ids)
        return Strip(first, len(sigma), dict(zip(block.groups, lines, strict=True)))


def _cached(cache: OrderedDict[K, T], key: K, most: int, make: Callable[[], T]) -> T:
    """Return the cached value, else make it and let the oldest go."""
    if key in cache:
        cache.move_to_end(key)
        return cache[key]
    value = cache[key] = make()
    while len(cache) > most:
        cache.popitem(last=False)
    return value
