"""Positions of a scenario in the world, at the time when they are asked for."""

from math import cos, pi, remainder, sin

import numpy as np

from vsensor.errors import StoryError
from vsensor.types import Array
from vsensor.world.openscenario.action_data import Position
from vsensor.world.openscenario.spots import Spot
from vsensor.world.openscenario.work import Work

LARGEST_OFFSET_M = 1000.0
FARTHEST_M = 100_000.0
"""No place is looked for farther along the roads: a circuit has no end."""


def spot_for(work: Work, position: Position) -> Spot:
    """Return the place on a road that a position means; raises StoryError for one on none."""
    if position.kind in ("road", "lane", "world"):
        if position not in work.tracks.fixed:
            work.tracks.fixed[position] = _fixed(work, position)
        return work.tracks.fixed[position]
    if position.kind == "route":
        return _turned(work, _on_route(work, position), position)
    if work.spot(position.ref) is None:
        raise StoryError(f"{position.where}: {work.story.entities[position.ref].name} has no place yet")
    if position.kind in ("relative_road", "relative_lane"):
        return _turned(work, _beside(work, position), position)
    point, heading = _point_beside(work, position)
    x, y, z = point.tolist()
    return work.tracks.world_spot(x, y, z, heading, position.where)


def _fixed(work: Work, position: Position) -> Spot:
    if position.kind != "world":
        return _turned(work, _on_road(work, position), position)
    heading = position.orientation.heading_rad if position.orientation else None
    return work.tracks.world_spot(position.x_m, position.y_m, position.z_m, heading, position.where)


def point_for(work: Work, position: Position) -> Array | None:
    """Return the point (3,) that a position means; None where it refers to what has no place."""
    if position.kind == "world":
        return np.array([position.x_m, position.y_m, _height(work, position)])
    if position.ref >= 0 and work.spot(position.ref) is None:
        return None
    if position.kind in ("relative_world", "relative_object"):
        return _point_beside(work, position)[0]
    return work.tracks.pose(spot_for(work, position))[0]


def _height(work: Work, position: Position) -> float:
    """Return z of a point of the world: its own, else the road's below it, else 0."""
    if position.z_m is not None:
        return position.z_m
    try:
        return float(work.tracks.pose(spot_for(work, position))[0][2])
    except StoryError:
        return 0.0


def _road_length(work: Work, position: Position) -> float:
    road = work.tracks.road_map.roads.get(position.road)
    if road is None:
        known = ", ".join(list(work.tracks.road_map.roads)[:20])
        raise StoryError(f"{position.where}: road {position.road} is not in the map; roads: {known}")
    return road.length_m


def _on_road(work: Work, position: Position) -> Spot:
    length_m = _road_length(work, position)
    if not -1e-6 <= position.s_m <= length_m + 1e-6:
        raise StoryError(
            f"{position.where}: s = {position.s_m:g} m is off road {position.road}: 0 to {length_m:.3f} m"
        )
    s_m = min(max(position.s_m, 0.0), length_m)
    if abs(position.t_m) > LARGEST_OFFSET_M:
        raise StoryError(f"{position.where}: {position.t_m:g} m is beside every road")
    if position.lane is None:
        return work.tracks.spot_at(position.road, s_m, position.t_m)
    if not work.tracks.has_lane(position.road, s_m, position.lane):
        raise StoryError(
            f"{position.where}: road {position.road} has no lane {position.lane} at s = {s_m:g} m"
        )
    return work.tracks.lane_spot(position.road, position.lane, s_m, position.t_m)


def _beside(work: Work, position: Position) -> Spot:
    """Return a place so far along the road or lane from another entity's."""
    here, spot = work.place(position.ref), work.spot(position.ref)
    assert here is not None
    assert spot is not None
    length_m = work.tracks.road_map.roads[here.road].length_m
    s_m = here.s_m + position.s_m
    if not 0.0 <= s_m <= length_m:
        return _along(work, position, spot)
    if position.kind == "relative_road":
        return work.tracks.spot_at(here.road, s_m, work.tracks.t_of(here) + position.t_m, here.direction)
    lane = _lane_beside(work, position, work.tracks.lane_of(here) or here.lane, here.road, s_m)
    return work.tracks.lane_spot(here.road, lane, s_m, position.t_m, direction=here.direction)


def _along(work: Work, position: Position, spot: Spot) -> Spot:
    """Return a place beyond the end of the other's road, along its track."""
    track, s_m = spot.track, spot.s_m + position.s_m * spot.track.direction
    corridor = work.tracks.corridor(track)
    if abs(position.s_m) > FARTHEST_M:
        raise StoryError(f"{position.where}: {position.s_m:g} m: at most {FARTHEST_M:g} m were expected")
    if not corridor.reaches(s_m):
        raise StoryError(f"{position.where}: the road ends before it")
    place, road_s = corridor.place(s_m)
    if position.kind == "relative_road" or not position.lane:
        offset = spot.offset_m if position.kind == "relative_road" else 0.0
        return Spot(track, s_m, offset + place.direction * position.t_m)
    lane = _lane_beside(work, position, place.lane_id, place.road_id, road_s)
    return work.tracks.lane_spot(place.road_id, lane, road_s, position.t_m, direction=place.direction)


def _lane_beside(work: Work, position: Position, lane: int, road: str, s_m: float) -> int:
    """Return the lane so many ids from another, 0 not counted."""
    wanted = lane
    for _ in range(min(abs(position.lane or 0), 64)):
        wanted += 1 if (position.lane or 0) > 0 else -1
        wanted += (1 if (position.lane or 0) > 0 else -1) if wanted == 0 else 0
    if not work.tracks.has_lane(road, s_m, wanted):
        raise StoryError(f"{position.where}: road {road} has no lane {wanted} at s = {s_m:g} m")
    return wanted


def _point_beside(work: Work, position: Position) -> tuple[Array, float]:
    """Return the point and heading so far from another entity, along the world's axes or its own."""
    pose = work.pose(position.ref)
    assert pose is not None
    point, heading = pose
    dx, dy = position.x_m, position.y_m
    if position.kind == "relative_object":
        dx, dy = dx * cos(heading) - dy * sin(heading), dx * sin(heading) + dy * cos(heading)
    there = point + np.array([dx, dy, position.z_m or 0.0])
    orientation = position.orientation
    if orientation is None:
        return there, heading
    return there, orientation.heading_rad + (heading if orientation.relative else 0.0)


def _on_route(work: Work, position: Position) -> Spot:
    """Return the place so far along a route."""
    if position.ref >= 0:
        spot = work.spot(position.ref)
        assert spot is not None
        return spot
    first, route = route_for(work, position.waypoints)
    start = work.tracks.lane_spot(
        first.track.road, first.track.lane, first.track.s_m, direction=first.track.direction, route=route
    )
    s_m = first.s_m + position.s_m
    corridor = work.tracks.corridor(start.track)
    if not 0.0 <= position.s_m <= FARTHEST_M or not corridor.reaches(s_m):
        raise StoryError(f"{position.where}: pathS = {position.s_m:g} m is not on the route")
    place, road_s = corridor.place(s_m)
    if position.lane is None:
        spot = work.tracks.spot_at(place.road_id, road_s, position.t_m, place.direction)
    elif not work.tracks.has_lane(place.road_id, road_s, position.lane):
        raise StoryError(f"{position.where}: road {place.road_id} has no lane {position.lane} there")
    else:
        spot = work.tracks.lane_spot(
            place.road_id, position.lane, road_s, position.t_m, direction=place.direction
        )
    return spot


def route_for(work: Work, waypoints: tuple[Position, ...]) -> tuple[Spot, tuple[str, ...]]:
    """Return the first place of a route, and the roads to come by."""
    spots = [spot_for(work, one) for one in waypoints]
    roads = [work.tracks.road_spot(spot).road for spot in spots]
    return spots[0], tuple(road for k, road in enumerate(roads) if k == 0 or roads[k - 1] != road)


def _turned(work: Work, spot: Spot, position: Position) -> Spot:
    """Return the place with the heading that the position gives, driven the other way if it heads so."""
    orientation = position.orientation
    if orientation is None:
        return spot
    _, yaw = work.tracks.pose(spot)
    turn = remainder(orientation.heading_rad - (0.0 if orientation.relative else yaw), 2 * pi)
    if abs(turn) <= pi / 2:
        return Spot(spot.track, spot.s_m, spot.offset_m, turn)
    place, s_m = work.tracks.corridor(spot.track).place(spot.s_m)
    other = work.tracks.lane_spot(
        place.road_id, place.lane_id, s_m, place.direction * spot.offset_m, direction=-place.direction
    )
    return Spot(other.track, other.s_m, other.offset_m, remainder(turn - pi, 2 * pi))
