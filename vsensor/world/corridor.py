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
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsensor.errors import MapError
from vsensor.types import Array, GroundPaint, Marking, RoadSurface, Unevenness
from vsensor.world.blocks import Blocks
from vsensor.world.chains import Chains
from vsensor.world.opendrive.lanes import Section
from vsensor.world.opendrive.network import Place
from vsensor.world.opendrive.road import RoadMap
from vsensor.world.route import DRIVABLE, CorridorConfig, Route
from vsensor.world.surface_extras import SurfaceExtras
from vsensor.world.windows import Windows

UNEVEN_M = 30.0
"""How far behind and ahead of the rear axle unevenness is given: a tick's way, and the front axle."""


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


class Corridor:
    """The drive along one lane of a map, followed over links and junctions; s is the route distance.

    Built where asked; raises MapError if the start or the route names what is not there.
    """

    def __init__(
        self,
        road_map: RoadMap,
        config: CorridorConfig | None = None,
        known_groups: Mapping[int, int] | None = None,
        first_group: int = 0,
    ) -> None:
        """Find the start; nothing is sampled yet. Raises MapError, also if there is nothing ahead of it.

        `known_groups`: the groups of borders, by the lane that owns them, that go on from another corridor.
        """
        self.road_map = road_map
        self.config = config or CorridorConfig()
        chains = Chains(self.config.lateral_m, known_groups, first_group)
        self._blocks = Blocks(Route(road_map, self.config), chains)
        self._windows = Windows(self._blocks, self.config.spacing_m)
        self._extras = SurfaceExtras(self._blocks)
        if not self.reaches(1e-6):
            start = self.start
            raise MapError(
                f"{road_map.path}: road {start.road_id} lane {start.lane_id}: nothing to drive on there"
            )

    @property
    def start(self) -> Place:
        """The place of the drive's first metre."""
        return self._blocks.route.start

    @property
    def spacing_m(self) -> float:
        """Distance of the stations along the lane's middle."""
        return self.config.spacing_m

    def reaches(self, s_m: float) -> bool:
        """Return whether the route goes on to `s_m` (True for ever on a closed circuit)."""
        return s_m >= 0.0 and self._blocks.reach(s_m)

    @cached_property
    def length_m(self) -> float:
        """Length of the whole route, infinite if it returns to itself."""
        while self._blocks.extend():
            if self._blocks.route.is_closed:
                return math.inf
        return self._blocks.end_m

    @cached_property
    def lap_m(self) -> float:
        """Length of the route; of one that returns to itself at least one round."""
        return self._blocks.end_m if self.length_m == math.inf else self.length_m

    def poses(self, s_m: Array, offset_m: Array | float = 0.0) -> Poses:
        """Return poses (N,) at distances (N,), `offset_m` to the left of the lane's middle.

        They differ from the map's own curves by 2e-7 m in a bend of 10 m radius, 1e-8 m from 100 m
        on (see LaneTable; at worst 1.2e-6 m on the real maps, at R = 4 m). The heading is that of the
        lane's middle, whatever the offset. Beyond the ends of the route the lane goes on straight.
        """
        s = np.asarray(s_m, dtype=np.float64)
        offset = np.broadcast_to(np.asarray(offset_m, dtype=np.float64), s.shape)
        numbers = self._blocks.numbers_at(s)
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

    def _poses_in(self, number: int, s_m: Array, offset_m: Array) -> Poses:
        block = self._blocks[number]
        sigma = np.minimum(np.maximum(s_m - block.start_m, 0.0), block.piece.length_m)
        position, forward, left, curvature = self._blocks.table(block.piece).at(sigma)
        position = position + (s_m - block.start_m - sigma) * forward + offset_m * left
        return Poses(
            np.ascontiguousarray(position.T),
            np.arctan2(left[2], forward[0] * left[1] - forward[1] * left[0]),
            np.arctan2(-forward[2], np.hypot(forward[0], forward[1])),
            np.arctan2(forward[1], forward[0]),
            curvature,
        )

    def place(self, s_m: float) -> tuple[Place, float]:
        """Return the lane driven at a distance, and s on its road."""
        block = self._blocks.at(s_m)
        return block.piece.place, block.piece.s_one(s_m - block.start_m)

    def distance(
        self, road_id: str, s_m: float, lane_id: int | None = None, *, from_m: float = 0.0, until_m: float
    ) -> float | None:
        """Return the first route distance in [from, until] at s of a road (and lane), None if none."""
        number = max(0, bisect_right(self._blocks.edges_m, from_m) - 1)
        while number < len(self._blocks) or self._blocks.extend():
            block = self._blocks[number]
            if block.start_m > until_m:
                return None
            if block.piece.place.road_id == road_id and lane_id in (None, block.piece.place.lane_id):
                low, high = sorted((block.piece.s_from_m, block.piece.s_to_m))
                if low <= s_m <= high:
                    return block.start_m + block.piece.sigma_one(s_m)
            number += 1
        return None

    def groups(self, s_m: float) -> dict[int, int]:
        """Return the groups of the borders at a distance, by the lane that owns them."""
        block = self._blocks.at(s_m)
        return dict(zip(block.lane_ids, block.groups, strict=True))

    def row(self, s_m: float) -> tuple[Array, float, float]:
        """Return the lane's cubics (4, 10) at a distance, where on them in [0, 1], the way beyond the end.

        Position, forward, left, curvature, as in LaneTable: for many bodies whose poses are made at once.
        """
        block = self._blocks.at(s_m)
        sigma = min(max(s_m - block.start_m, 0.0), block.piece.length_m)
        cubics, x = self._blocks.table(block.piece).row(sigma)
        return cubics, x, s_m - block.start_m - sigma

    def curvature(self, s_m: float) -> float:
        """Return the lane's curvature at a distance, left positive; that of its end beyond."""
        block = self._blocks.at(s_m)
        sigma = min(max(s_m - block.start_m, 0.0), block.piece.length_m)
        return self._blocks.table(block.piece).curvature(sigma)

    def section(self, s_m: float) -> Section:
        """Return the road's cross-section at a distance."""
        return self._blocks.at(s_m).piece.section

    def lane_width(self, s_m: float) -> float:
        """Return the width of the driven lane, m."""
        block = self._blocks.at(s_m)
        s = block.piece.s_at(block.sigma(s_m))
        return float(block.piece.section.centre(s, block.piece.place.lane_id)[2][0])

    def lane_beside(self, s_m: float, lanes_left: int) -> LaneBeside | None:
        """Return the lane so many lanes to the left (negative: right) of the driven one, None if none.

        Lanes that nobody drives on (shoulder, border, median) are passed over in counting.
        """
        block = self._blocks.at(s_m)
        piece = block.piece
        own_type = piece.section.lanes[piece.place.lane_id].type
        known = {own_type, *DRIVABLE}
        lanes = [i for i in piece.ids_left_to_right() if i != 0 and piece.section.lanes[i].type in known]
        column = lanes.index(piece.place.lane_id) - lanes_left
        if not 0 <= column < len(lanes):
            return None
        lane = piece.section.lanes[lanes[column]]
        s = piece.s_at(block.sigma(s_m))
        own, _, _ = piece.section.centre(s, piece.place.lane_id)
        other, _, width = piece.section.centre(s, lane.id)
        drives = piece.road.direction(lane.id, reversed_lane=lane.reversed)
        offset = piece.place.direction * (other - own)
        return LaneBeside(lane.id, lane.type, drives != piece.place.direction, offset, width)

    def own_groups(self, s_m: float) -> tuple[int, int]:
        """Return the `group` of the driven lane's left and right border."""
        return self._blocks.at(s_m).own_groups()

    def markings_window(self, s_from_m: float, s_to_m: float) -> tuple[Marking, ...]:
        """Return the borders between two distances as views, ordered by id.

        A border that is double anywhere on the page gives two stripes, which lie on each other where
        it is single; else one. Borders without any mark on the page are left out, except the driven
        lane's own. Empty outside the route.
        """
        return self._windows.between(s_from_m, s_to_m)

    def surface_window(self, s_from_m: float, s_to_m: float) -> RoadSurface | None:
        """Return the road's cross-sections between two distances, None where it is too flat to hide anything.

        They reach from the outermost border of `markings_window` to the other.
        """
        return self._windows.surface(s_from_m, s_to_m)

    def ground_window(self, s_from_m: float, s_to_m: float) -> tuple[GroundPaint, ...]:
        """Return crosswalks and stop lines between two distances, and some around them."""
        return self._extras.ground(s_from_m, s_to_m)

    def uneven(self, s_m: float) -> Unevenness | None:
        """Return what lies under a vehicle whose rear axle is at a distance, None on an even road."""
        if not self.road_map.has_swells:
            return None
        return Unevenness(rear_axle_m=s_m, swells=self._extras.swells(s_m - UNEVEN_M, s_m + UNEVEN_M))
