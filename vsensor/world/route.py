"""The way of a drive over the map: which piece of lane comes next."""

import itertools
from dataclasses import replace
from typing import Annotated, Any

import msgspec
import numpy as np

from vsensor.errors import MapError
from vsensor.schema import Config
from vsensor.world.lane_piece import LanePiece
from vsensor.world.opendrive.network import Place, auto_start, following, place_at, section_of, span
from vsensor.world.opendrive.road import RoadMap

PIECE_M = 200.0
SHORTEST_M = 1e-6
MOST_EMPTY_SECTIONS = 1000
LONGEST_PER_S = 20.0
"""A lane's middle that is longer than so many times its road is a slip in some polynomial."""

DRIVABLE = {
    *("driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "bidirectional"),
    *("bus", "taxi", "HOV", "mwyEntry", "mwyExit"),
}
"""Lane types that a drive goes on to besides the type it is on."""


class CorridorConfig(Config, frozen=True, kw_only=True):
    """Where the drive begins and which way it goes; `road` "auto" looks for the longest drive.

    `against`: the lane is driven against its own direction.
    """

    road: str = "auto"
    lane: int | None = None
    s_m: Annotated[float, msgspec.Meta(ge=0.0)] | None = None
    route: tuple[str, ...] = ()
    lane_type: str = "driving"
    spacing_m: Annotated[float, msgspec.Meta(ge=0.01, le=5.0)] = 0.1
    lateral_m: Annotated[float, msgspec.Meta(ge=2.0, le=100.0)] = 20.0
    against: bool = False


class Route:
    """Walks from the start over links and junctions, one piece of at most 200 m at a time."""

    def __init__(self, road_map: RoadMap, config: CorridorConfig) -> None:
        self._map = road_map
        self._wishes = [str(road) for road in config.route]
        for road in self._wishes:
            road_map.road(road)
        self.start, self._s_m = _start(road_map, config)
        self._waiting = _cut(road_map, self.start, self._s_m)
        self._place = self.start
        self._skip_wish(self.start)
        self._seen: set[Place] = set()
        self.is_closed = False
        self._pieces: dict[tuple[Any, ...], LanePiece] = {}

    def advance(self) -> LanePiece | None:
        """Return the next piece, None at a dead end."""
        for _ in range(MOST_EMPTY_SECTIONS):
            if self._waiting:
                return self._piece(*self._waiting.pop(0))
            step = self._choose(following(self._map, self._place))
            if step is None:
                self._check_wishes()
                return None
            self.is_closed |= step in self._seen
            if not self._wishes:
                self._seen.add(step)
            self._place = step
            self._waiting = _cut(self._map, step, None)
        return None

    def _check_wishes(self) -> None:
        if self._wishes:
            raise MapError(
                f"{self._map.path}: route: road {self._wishes[0]} is not reached, "
                f"the drive ends on road {self._place.road_id} lane {self._place.lane_id}"
            )

    def _piece(self, place: Place, s_from_m: float, s_to_m: float) -> LanePiece:
        """Return the piece, the same object on every lap."""
        key = (place, s_from_m, s_to_m)
        if key not in self._pieces:
            piece = LanePiece(self._map.roads[place.road_id], place, s_from_m, s_to_m)
            if not piece.length_m <= LONGEST_PER_S * max(abs(s_to_m - s_from_m), 1.0):
                raise MapError(
                    f"{self._map.path}: road {place.road_id} lane {place.lane_id}: {piece.length_m:.3g} m "
                    f"long from s = {s_from_m:g} to {s_to_m:g}: its width or elevation cannot be meant"
                )
            self._pieces[key] = piece
        return self._pieces[key]

    def _choose(self, ways: tuple[Place, ...]) -> Place | None:
        """Return the way that the wished route takes, else the straightest one that can be driven."""
        own = section_of(self._map, self._place).lanes[self._place.lane_id].type
        usable = [way for way in ways if self._type(way) in DRIVABLE | {own}]
        if not self._wishes or not usable:
            return usable[0] if usable else None
        if usable[0].road_id == self._place.road_id:
            return usable[0]
        for way in usable:
            if self._wishes[0] == way.road_id:
                self._skip_wish(way)
                return way
        for way in usable:
            if any(beyond.road_id == self._wishes[0] for beyond in self._beyond(way)):
                return way
        if len(usable) == 1:
            return usable[0]
        names = ", ".join(dict.fromkeys(way.road_id for way in usable))
        raise MapError(
            f"{self._map.path}: route: road {self._wishes[0]} does not follow road {self._place.road_id} "
            f"lane {self._place.lane_id}; following roads: {names}"
        )

    def _type(self, place: Place) -> str:
        return section_of(self._map, place).lanes[place.lane_id].type

    def _beyond(self, place: Place) -> tuple[Place, ...]:
        """Return what follows the road of `place`, along its first lane links."""
        for _ in range(MOST_EMPTY_SECTIONS):
            ways = following(self._map, place)
            if not ways or ways[0].road_id != place.road_id:
                return ways
            place = ways[0]
        return ()

    def _skip_wish(self, place: Place) -> None:
        while self._wishes and self._wishes[0] == place.road_id:
            self._wishes.pop(0)


def _start(road_map: RoadMap, config: CorridorConfig) -> tuple[Place, float | None]:
    if config.road == "auto":
        return auto_start(road_map, config.lane_type), None
    lane = config.lane if config.lane is not None else _outer_lane(road_map, config)
    place = place_at(road_map, config.road, lane, config.s_m)
    return (replace(place, direction=-place.direction) if config.against else place), config.s_m


def _outer_lane(road_map: RoadMap, config: CorridorConfig) -> int:
    """Return the outermost lane of the type, of those driven along s if there are any."""
    road = road_map.road(config.road)
    s = config.s_m or 0.0
    section = road.sections[max(0, sum(section.start_m <= s for section in road.sections) - 1)]
    ids = section.of_type(config.lane_type)
    if not ids:
        types = ", ".join(sorted({lane.type for lane in section.lanes.values() if lane.id != 0}))
        raise MapError(
            f"{road_map.path}: road {road.id} has no lane of type {config.lane_type} at s = {s:g} m; "
            f"types: {types or 'none'}"
        )
    return max(ids, key=lambda i: (road.direction(i), abs(i)))


def _cut(road_map: RoadMap, place: Place, s_m: float | None) -> list[tuple[Place, float, float]]:
    """Return the section's stretches of at most 200 m in driving order."""
    start, end = span(road_map, place)
    if s_m is not None:
        start = s_m
    if abs(end - start) < SHORTEST_M:
        return []
    edges = np.linspace(start, end, int(np.ceil(abs(end - start) / PIECE_M)) + 1)
    return [(place, float(a), float(b)) for a, b in itertools.pairwise(edges)]
