"""Which lane follows which: over sections, road links and junctions, in the direction of driving."""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from vsensor.errors import MapError
from vsensor.types import Array
from vsensor.world.opendrive.lanes import Lane, Section
from vsensor.world.opendrive.road import Connection, Road, RoadMap

SAME_PLACE_M = 0.2
"""Two lanes without a link are one where their middles meet this closely (real files leave links out)."""

SAME_JOINT_M = 0.5
"""A link leads on only to a lane whose middle starts this close to this one's end: a drive does not
jump. Real files link lanes that end (1.75 m aside, where the lane's width is 0) and far roads."""

LONG_DRIVE_M = 10_000.0
"""Longer drives count as this long when the longest is looked for: the search stays short on big maps."""

MOST_SEARCHED = 5000
"""Roads of a map among which the longest drive is looked for; of a huge one the first ones."""

LOOK_AHEAD_M = 50.0
"""How far along a way its change of heading counts when the straightest one is looked for."""


@dataclass(frozen=True, slots=True)
class Place:
    """A lane within one section; `direction` +1 drives along s, -1 against it."""

    road_id: str
    section: int
    lane_id: int
    direction: int


def section_of(road_map: RoadMap, place: Place) -> Section:
    """Return the section that the place is in."""
    return road_map.roads[place.road_id].sections[place.section]


def span(road_map: RoadMap, place: Place) -> tuple[float, float]:
    """Return s where the drive enters the section and where it leaves it."""
    section = section_of(road_map, place)
    ends = section.start_m, section.end_m
    return ends if place.direction > 0 else (ends[1], ends[0])


def place_at(road_map: RoadMap, road_id: str | int, lane_id: int, s_m: float | None) -> Place:
    """Return the place of a lane at s (None: where its drive begins); raises MapError naming what exists."""
    road = road_map.road(road_id)
    along = road.direction(lane_id) > 0
    s = s_m if s_m is not None else (0.0 if along else road.length_m)
    if not 0.0 <= s <= road.length_m:
        raise MapError(
            f"{road_map.path}: road {road.id} has no s = {s:g} m: 0 to {road.length_m:.3f} m was expected"
        )
    number = max(0, sum(section.start_m <= s for section in road.sections) - 1)
    section = road.sections[number]
    if lane_id == 0 or lane_id not in section.lanes:
        known = ", ".join(str(i) for i in section.ids if i != 0)
        raise MapError(
            f"{road_map.path}: road {road.id} has no lane {lane_id} at s = {s:g} m; lanes: {known or 'none'}"
        )
    reversed_lane = section.lanes[lane_id].reversed
    return Place(road.id, number, lane_id, road.direction(lane_id, reversed_lane=reversed_lane))


def following(road_map: RoadMap, place: Place) -> tuple[Place, ...]:
    """Return the places that the drive can go on to, the straightest first; none at a dead end."""
    road = road_map.roads[place.road_id]
    number = place.section + place.direction
    if 0 <= number < len(road.sections):
        return _linked(road_map, place, road, number, place.direction, place.direction)
    link = road.link(place.direction)
    if link is None or link.id not in (road_map.connections if link.is_junction else road_map.roads):
        return ()
    if link.is_junction:
        return _through_junction(road_map, place, road_map.connections[link.id])
    return _linked(road_map, place, *_entry(road_map.roads[link.id], link.contact), place.direction)


def _entry(road: Road, contact: str) -> tuple[Road, int, int]:
    """Return road, section, direction of a drive that enters the road at this end."""
    return (road, 0, 1) if contact == "start" else (road, len(road.sections) - 1, -1)


def _linked(
    road_map: RoadMap, place: Place, road: Road, number: int, direction: int, side: int
) -> tuple[Place, ...]:
    """Return the places of the next section that the lane's links name, or those that it meets."""
    before, after = section_of(road_map, place), road.sections[number]
    lane = before.lanes[place.lane_id]
    if road.id == place.road_id and after.lanes.get(place.lane_id) is lane:  # the other side changed
        return (Place(road.id, number, place.lane_id, direction),)
    linked = [Place(road.id, number, i, direction) for i in lane.linked(side) if i != 0 and i in after.lanes]
    return _near(road_map, place, linked) or _meeting(road_map, place, road, number, direction)


def _near(road_map: RoadMap, place: Place, ways: Iterable[Place]) -> tuple[Place, ...]:
    """Return those ways that begin where the place ends, and go on in its direction."""
    return tuple(way for way in dict.fromkeys(ways) if _is_near(road_map, place, way))


def _is_near(road_map: RoadMap, place: Place, way: Place) -> bool:
    if way.road_id == place.road_id and way.section == place.section + place.direction:  # cheaper
        s = np.array([span(road_map, way)[0]])
        here = section_of(road_map, place).centre(s, place.lane_id)[0]
        entry = section_of(road_map, way).centre(s, way.lane_id)[0]
        return bool(abs(entry[0] - here[0]) < SAME_JOINT_M)
    end, heading = lane_end(road_map, place, leaving=True)
    start, entry_heading = lane_end(road_map, way, leaving=False)
    return bool(np.linalg.norm(start - end) < SAME_JOINT_M and math.cos(entry_heading - heading) > 0.0)


def _meeting(road_map: RoadMap, place: Place, road: Road, number: int, direction: int) -> tuple[Place, ...]:
    """Return the lane of the same type, open in this direction, whose middle meets this one's end."""
    own_type = section_of(road_map, place).lanes[place.lane_id].type
    here = lane_end(road_map, place, leaving=True)[0]
    found = []
    for i in road.sections[number].of_type(own_type):
        other = Place(road.id, number, i, direction)
        gap = float(np.linalg.norm(lane_end(road_map, other, leaving=False)[0] - here))
        if _open(road, other, road.sections[number].lanes[i].reversed) and gap < SAME_PLACE_M:
            found.append((gap, other))
    return tuple(other for _, other in sorted(found, key=lambda item: item[0])[:1])


def _open(road: Road, place: Place, reversed_lane: bool) -> bool:
    return road.direction(place.lane_id, reversed_lane=reversed_lane) == place.direction


def lane_end(road_map: RoadMap, place: Place, *, leaving: bool) -> tuple[Array, float]:
    """Return the middle of the lane (3,) where it leaves or enters its section, and the heading there."""
    s = np.array([span(road_map, place)[1 if leaving else 0]])
    road, section = road_map.roads[place.road_id], section_of(road_map, place)
    t, slope, _ = section.centre(s, place.lane_id)
    heading = float(road.heading(s)[0] + math.atan(float(slope[0])))
    return road.point(s, t)[0], heading + (0.0 if place.direction > 0 else math.pi)


def _through_junction(
    road_map: RoadMap, place: Place, connections: tuple[Connection, ...]
) -> tuple[Place, ...]:
    ways = _near(road_map, place, (way for c in connections for way in _ways(road_map, place, c)))
    if len(ways) < 2:
        return ways
    _, heading = lane_end(road_map, place, leaving=True)
    return tuple(sorted(ways, key=lambda way: abs(_turn(road_map, way, heading))))


def _ways(road_map: RoadMap, place: Place, connection: Connection) -> Iterator[Place]:
    """Yield the places behind one connection that the lane is linked to."""
    if connection.incoming == place.road_id:
        road, number, direction = _entry(road_map.roads[connection.connecting], connection.contact)
        yield from _lanes(road_map, place, road, number, direction, connection.lanes)
    elif connection.direct and connection.connecting == place.road_id:
        back = tuple((to, start) for start, to in connection.lanes)
        incoming = road_map.roads[connection.incoming]
        for contact in ("start", "end"):  # which of its ends is in the junction shows in where it lies
            yield from _lanes(road_map, place, *_entry(incoming, contact), back)


def _lanes(
    road_map: RoadMap,
    place: Place,
    road: Road,
    number: int,
    direction: int,
    links: tuple[tuple[int, int], ...],
) -> Iterator[Place]:
    if not links:
        yield from _meeting(road_map, place, road, number, direction)
    for start, to in links:
        if start == place.lane_id and to != 0 and to in road.sections[number].lanes:
            yield Place(road.id, number, to, direction)


def _turn(road_map: RoadMap, place: Place, heading_rad: float) -> float:
    """Return the change of heading over a way's first 50 m, wrapped to +-pi."""
    road = road_map.roads[place.road_id]
    start, _ = span(road_map, place)
    s = np.array([min(max(start + place.direction * LOOK_AHEAD_M, 0.0), road.length_m)])
    there = float(road.heading(s)[0]) + (0.0 if place.direction > 0 else math.pi)
    return math.remainder(there - heading_rad, 2 * math.pi)


def drivable(road_map: RoadMap, lane_type: str = "driving") -> Iterator[Place]:
    """Yield every place of a lane type, the outermost lanes of each section first; of MOST_SEARCHED roads."""
    for road in itertools.islice(road_map.roads.values(), MOST_SEARCHED):
        for number, section in enumerate(road.sections):
            for i in sorted(section.of_type(lane_type), key=abs, reverse=True):
                direction = road.direction(i, reversed_lane=section.lanes[i].reversed)
                yield Place(road.id, number, i, direction)


def auto_start(road_map: RoadMap, lane_type: str = "driving") -> Place:
    """Return where the longest drive along lanes of this type begins, on the outermost such lane.

    Length is that of the reference lines, each place once, along the straightest way; of equal ones
    the outermost lane, then one along s, then the first in the file. Raises MapError if there is no
    such lane.
    """
    ways = _Ways(road_map, lane_type)
    first = list(itertools.islice(drivable(road_map, lane_type), 2))
    if not first:
        types = sorted({lane.type for road in road_map.roads.values() for lane in _all_lanes(road)})
        raise MapError(f"{road_map.path}: no lane of type {lane_type}; types: {', '.join(types)}")
    best, best_key = first[0], (0.0, False, 0)
    for place in drivable(road_map, lane_type):
        if road_map.roads[place.road_id].junction == "-1" or len(first) == 1:
            key = (_reach(road_map, place, ways), _outermost(road_map, place, lane_type), place.direction)
            if key > best_key:
                best, best_key = place, key
            if best_key >= (LONG_DRIVE_M, True, 1):  # nothing is better
                break
    return best


def _all_lanes(road: Road) -> Iterator[Lane]:
    return (lane for section in road.sections for lane in section.lanes.values() if lane.id != 0)


class _Ways:
    """The straightest way on from places of one lane type, each looked for when it is asked for first."""

    def __init__(self, road_map: RoadMap, lane_type: str) -> None:
        self._map, self._lane_type = road_map, lane_type
        self._known: dict[Place, Place | None] = {}

    def after(self, place: Place) -> Place | None:
        """Return the place that follows, None at the end or where traffic does not go this way."""
        if place not in self._known:
            self._known[place] = self._straightest(place)
        return self._known[place]

    def _straightest(self, place: Place) -> Place | None:
        road, lane = self._map.roads[place.road_id], section_of(self._map, place).lanes[place.lane_id]
        if place.direction != road.direction(place.lane_id, reversed_lane=lane.reversed):
            return None
        ways = following(self._map, place)
        of_type = (w for w in ways if section_of(self._map, w).lanes[w.lane_id].type == self._lane_type)
        return next(of_type, None)


def _reach(road_map: RoadMap, place: Place, ways: _Ways) -> float:
    """Return the length of the drive from `place`, each place counted once, at most LONG_DRIVE_M."""
    seen: set[Place] = set()
    length = 0.0
    step: Place | None = place
    while step is not None and step not in seen and length < LONG_DRIVE_M:
        seen.add(step)
        entry, leave = span(road_map, step)
        length += abs(leave - entry)
        step = ways.after(step)
    return round(min(length, LONG_DRIVE_M), 3)


def _outermost(road_map: RoadMap, place: Place, lane_type: str) -> bool:
    """Return whether the lane is the outermost of its type on its side."""
    same_side = [i for i in section_of(road_map, place).of_type(lane_type) if i * place.lane_id > 0]
    return place.lane_id == max(same_side, key=abs)
