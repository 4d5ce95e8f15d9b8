"""Places on the ways of entities, and on the road below them."""

from dataclasses import dataclass

import numpy as np
from msgspec import Struct

from vsensor.world.opendrive.road import RoadMap


class Track(Struct, frozen=True, cache_hash=True):
    """Names a corridor: lane `lane` of a road from s on, along s (+1) or against it, over wished roads.

    `groups` are those of borders known before, by lane, `first_group` the first for the others. A struct, as
    corridors are looked up by it some ten times a vehicle and step.
    """

    road: str
    lane: int
    s_m: float
    direction: int
    route: tuple[str, ...] = ()
    groups: tuple[tuple[int, int], ...] = ()
    first_group: int = 0
    is_own: bool = False


@dataclass(frozen=True, slots=True)
class Spot:
    """A place on a track: distance, offset to the left of the way driven, heading turned to the left."""

    track: Track
    s_m: float
    offset_m: float = 0.0
    turn_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class RoadSpot:
    """The same place on the road: s, the lane of the track, the direction driven, the offset in t from it."""

    road: str
    s_m: float
    lane: int
    direction: int
    offset_m: float


@dataclass(frozen=True, slots=True)
class OwnFrom:
    """What a new track of the sensor's carrier goes on from: groups by lane, and how many were before."""

    groups: tuple[tuple[int, int], ...]
    changes: int


def section_number(road_map: RoadMap, road_id: str, s_m: float) -> int:
    """Return which section of a road s lies in."""
    sections = road_map.road(road_id).sections
    return max(0, sum(section.start_m <= s_m for section in sections) - 1)


def lane_at(road_map: RoadMap, road_id: str, s_m: float, t_m: float) -> int | None:
    """Return the lane that t lies on; None outside all."""
    section = road_map.roads[road_id].sections[section_number(road_map, road_id, s_m)]
    borders, _ = section.borders(np.array([s_m]), section.ids)
    for lane in sorted((i for i in section.ids if i != 0), key=abs):
        low, high = sorted((float(borders[section.inner(lane)][0]), float(borders[lane][0])))
        if low <= t_m <= high and high > low:
            return lane
    return None
