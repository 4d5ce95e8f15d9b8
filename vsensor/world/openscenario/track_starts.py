"""Where tracks begin.

A track begins where its road begins as driven, so that two vehicles on one lane have one corridor. The
carrier of the sensor has its own: it begins 20 m behind it, and the borders keep their groups when it
changes lanes, so that a line on the bus stays the same line.
"""

from dataclasses import replace

from vsensor.world.opendrive.network import Place, following, section_of
from vsensor.world.opendrive.road import RoadMap
from vsensor.world.openscenario.spots import OwnFrom, Track

BEHIND_M = 20.0
INSIDE_M = 1e-6
"""How far inside a section that does not end the road a track against s begins."""

GROUPS_PER_CHANGE = 100_000


class TrackStarts:
    """Names the track that somebody at a place is on."""

    def __init__(self, road_map: RoadMap) -> None:
        self._road_map = road_map
        self._names: dict[Track, Track] = {}
        self._known: dict[Place, tuple[int, float]] = {}

    def shared(self, place: Place, route: tuple[str, ...]) -> Track:
        """Return the track of all who are on a lane."""
        if place not in self._known:
            self._known[place] = self._first(place)
        lane, s_m = self._known[place]
        return self._named(Track(place.road_id, lane, s_m, place.direction, route))

    def own(self, place: Place, s_m: float, route: tuple[str, ...], before: OwnFrom) -> Track:
        """Return the track of the sensor's carrier, that goes on from another one."""
        section = section_of(self._road_map, place)
        start = s_m - place.direction * BEHIND_M
        low, high = section.start_m, section.end_m
        if place.section < len(self._road_map.roads[place.road_id].sections) - 1:
            high -= INSIDE_M
        start = min(max(start, low), high)
        groups = tuple((lane, group) for lane, group in before.groups if lane in section.lanes)
        first = before.changes * GROUPS_PER_CHANGE
        own = Track(place.road_id, place.lane_id, start, place.direction, route, groups, first, is_own=True)
        return self._named(own)

    def _named(self, track: Track) -> Track:
        """Return the same object for equal tracks: it is found without comparing."""
        return self._names.setdefault(track, track)

    def _first(self, place: Place) -> tuple[int, float]:
        """Return the lane and s where the way along a lane begins on its road."""
        road = self._road_map.roads[place.road_id]
        while 0 <= place.section - place.direction < len(road.sections):
            before = self._before(place)
            if before is None:
                break
            place = before
        section = road.sections[place.section]
        if place.direction > 0:
            return place.lane_id, section.start_m
        is_last = place.section == len(road.sections) - 1
        return place.lane_id, section.end_m if is_last else section.end_m - INSIDE_M

    def _before(self, place: Place) -> Place | None:
        number = place.section - place.direction
        lanes = self._road_map.roads[place.road_id].sections[number].lanes
        own = section_of(self._road_map, place).lanes[place.lane_id]
        for lane in (*own.linked(-place.direction), place.lane_id):
            if lane != 0 and lane in lanes:
                candidate = replace(place, section=number, lane_id=lane)
                if place in following(self._road_map, candidate)[:1]:
                    return candidate
        return None
