"""Actions at work: how they begin, when they are done, and what is kept in step with others."""

from collections.abc import Callable
from math import inf

from msgspec.structs import replace

from vsensor.errors import StoryError
from vsensor.world.openscenario.action_data import (
    Action,
    GapAction,
    LaneChange,
    LaneOffset,
    NoAction,
    ParameterAction,
    Position,
    RouteAction,
    SpeedAction,
    Teleport,
    Trajectory,
)
from vsensor.world.openscenario.bodies import Body, Follow
from vsensor.world.openscenario.following import gap_reached
from vsensor.world.openscenario.places import route_for, spot_for
from vsensor.world.openscenario.shapes import Lateral, Speed, seconds_for, seconds_within
from vsensor.world.openscenario.spots import Spot
from vsensor.world.openscenario.state import Running
from vsensor.world.openscenario.towing import hang
from vsensor.world.openscenario.trajectories import begin_trajectory, leave_path
from vsensor.world.openscenario.work import Work

DEFAULT_LANE_OFFSET_S = 3.0
"""A lane offset without a limit of its acceleration takes so long."""


def begin(work: Work, node: int, action: Action, actor: int) -> None:
    """Begin an action of an entity; one that goes on is put among the running."""
    if isinstance(action, ParameterAction):
        _set_parameter(work, action)
        return
    if isinstance(action, NoAction):
        return
    if isinstance(action, Teleport):
        _teleport(work, action.position, actor)
        hang(work, work.leader(actor))
        return
    number = work.next_number
    body = work.anchored(work.leader(actor))
    if body is None:
        work.say(f"{work.story.entities[actor].name} has no place: it does nothing")
        return
    actor = work.leader(actor)
    work.next_number += 1
    goes_on = _BEGINNERS[type(action)](work, action, actor, body, number)
    if goes_on:
        work.running.append(Running(number, node, actor))


def _set_parameter(work: Work, action: ParameterAction) -> None:
    if action.how == "set":
        work.parameters[action.name] = action.value
        return
    try:
        value = float(work.parameters.get(action.name, "0"))
    except ValueError:
        work.say(f"parameter {action.name} is no number: it is left")
        return
    operand = float(action.value)
    work.parameters[action.name] = repr(value + operand if action.how == "add" else value * operand)


def _teleport(work: Work, position: Position, actor: int) -> None:
    """Put an entity down; it keeps its speed."""
    spot = spot_for(work, position)
    actor = work.leader(actor)
    before = work.anchored(actor)
    if actor == work.ego:
        if work.tracks.is_off_road(spot):
            name = work.story.entities[actor].name
            raise StoryError(f"{position.where}: {name} starts off the road: a place on a lane was expected")
        spot = work.tracks.owned(spot)
    fresh = Body(
        track=spot.track,
        t_ns=work.t_ns,
        s_m=spot.s_m,
        lateral=Lateral(spot.offset_m, spot.offset_m),
        turn_rad=spot.turn_rad,
    )
    if before is not None:
        fresh = replace(fresh, speed=before.speed, long_by=before.long_by, follow=before.follow)
        fresh = replace(fresh, driven_m=before.driven_m, changes=before.changes)
    work.put(actor, fresh)


def _speed(work: Work, action: SpeedAction, actor: int, body: Body, number: int) -> bool:
    t_s = work.t_ns / 1e9
    now = body.speed.value(t_s) if body.path is None else _speed_now(work, actor)
    target = action.value
    if action.ref >= 0:
        other = work.motion(work.leader(action.ref))
        target = action.factor * (0.0 if other is None else other.speed_mps) + action.value
    target = max(target, 0.0)
    dynamics = action.dynamics
    if dynamics.dimension == "distance" and dynamics.shape != "step":
        # Every shape is symmetric, so its mean speed is the mean of both ends.
        mean = (now + target) / 2.0
        seconds = dynamics.value / mean if mean > 0.0 else 0.0
    else:
        seconds = seconds_for(dynamics.shape, dynamics.dimension, dynamics.value, target - now)
    shape = dynamics.shape if seconds > 0.0 else "step"
    speed = Speed(now if seconds > 0.0 else target, target, shape, t_s, seconds)
    follow = Follow(work.leader(action.ref), action.factor, action.value) if action.continuous else None
    work.put(actor, replace(body, speed=speed, follow=follow, long_by=number, turn_rad=body.turn_rad))
    return follow is not None or seconds > 0.0


def _speed_now(work: Work, actor: int) -> float:
    motion = work.motion(actor)
    return 0.0 if motion is None else motion.speed_mps


def _gap(work: Work, action: GapAction, actor: int, body: Body, number: int) -> bool:
    now = body.speed.value(work.t_ns / 1e9)
    speed = Speed(now, now, "step", work.t_ns / 1e9, 0.0)
    work.put(actor, replace(body, speed=speed, follow=Follow(action.ref, gap=action), long_by=number))
    return True


def _lane_change(work: Work, action: LaneChange, actor: int, body: Body, number: int) -> bool:
    here, spot = work.place(actor), work.spot(actor)
    assert here is not None
    assert spot is not None
    target: int | None = action.lane
    if action.ref >= 0:
        other = work.place(work.leader(action.ref))
        target = None if other is None else work.tracks.lanes_from(other, action.lane)
        if other is not None and other.road != here.road and target is not None:
            target = work.tracks.lanes_from(here, action.lane)
    if target is None or not work.tracks.has_lane(here.road, here.s_m, target):
        said = f"{work.story.entities[actor].name}: there is no lane to change to on road {here.road}"
        if actor == work.ego:
            raise StoryError(f"{work.story.path}: {said} at {work.t_ns / 1e9:.2f} s")
        work.say(said)
        return False
    after = work.tracks.changed(Spot(spot.track, spot.s_m, spot.offset_m), target, body.changes + 1)
    end = _direction(work, after) * action.offset_m
    body = replace(body, track=after.track, s_m=after.s_m, changes=body.changes + 1)
    dynamics = action.dynamics
    by_distance = dynamics.dimension == "distance" and dynamics.shape != "step"
    if by_distance:
        lateral = Lateral(after.offset_m, end, dynamics.shape, after.s_m, dynamics.value, by_distance=True)
    else:
        change = end - after.offset_m
        seconds = seconds_for(dynamics.shape, dynamics.dimension, dynamics.value, change)
        lateral = _lateral(after.offset_m, end, dynamics.shape, work.t_ns / 1e9, seconds)
    work.put(actor, replace(body, lateral=lateral, lat_by=number, path=None))
    return lateral.length > 0.0


def _direction(work: Work, spot: Spot) -> int:
    place, _ = work.tracks.corridor(spot.track).place(spot.s_m)
    return place.direction


def _lateral(start: float, end: float, shape: str, t_s: float, seconds: float) -> Lateral:
    if seconds <= 0.0:
        return Lateral(end, end)
    return Lateral(start, end, shape, t_s, seconds)


def _lane_offset(work: Work, action: LaneOffset, actor: int, body: Body, number: int) -> bool:
    spot = work.spot(actor)
    assert spot is not None
    direction = _direction(work, spot)
    end = direction * action.value_m
    if action.ref >= 0:
        other = work.spot(work.leader(action.ref))
        base = 0.0 if other is None else _direction(work, other) * other.offset_m
        end = direction * (base + action.value_m)
    change = end - spot.offset_m
    seconds = DEFAULT_LANE_OFFSET_S
    if action.shape == "step" or change == 0.0:
        seconds = 0.0
    elif action.max_acceleration_mps2 is not None and action.max_acceleration_mps2 < inf:
        seconds = seconds_within(action.shape, change, action.max_acceleration_mps2)
    lateral = _lateral(spot.offset_m, end, action.shape, work.t_ns / 1e9, seconds)
    work.put(actor, replace(body, lateral=lateral, lat_by=number, path=None))
    return seconds > 0.0


def _route(work: Work, action: RouteAction, actor: int, body: Body, number: int) -> bool:
    spot = work.spot(actor)
    assert spot is not None
    _, roads = route_for(work, action.waypoints)
    after = work.tracks.routed(spot, roads, body.changes + 1)
    shift = after.s_m - spot.s_m
    lateral = body.lateral
    if lateral.by_distance:
        lateral = replace(lateral, begin=lateral.begin + shift)
    body = replace(body, track=after.track, s_m=after.s_m, lateral=lateral, changes=body.changes + 1)
    work.put(actor, body)
    return False


_BEGINNERS: dict[type, Callable[..., bool]] = {
    SpeedAction: _speed,
    GapAction: _gap,
    LaneChange: _lane_change,
    LaneOffset: _lane_offset,
    RouteAction: _route,
    Trajectory: begin_trajectory,
}

LONGITUDINAL = (SpeedAction, GapAction)


def is_done(work: Work, one: Running, action: Action) -> bool:
    """Return whether an action has come to its end, or another one has taken over."""
    body, motion = work.body(one.actor), work.motion(one.actor)
    if body is None or motion is None or body.is_ended:
        return True
    t_s = work.t_ns / 1e9
    if isinstance(action, LONGITUDINAL):
        if body.long_by != one.number:
            return True
        if isinstance(action, GapAction):
            return not action.continuous and gap_reached(work, one.actor, action)
        return body.follow is None and t_s >= body.speed.until_s - 1e-9
    if body.lat_by != one.number:
        return True
    if isinstance(action, Trajectory):
        return body.path is None
    if isinstance(action, LaneOffset) and action.continuous:
        return False if action.ref >= 0 else body.lateral.is_done(t_s, motion.s_m)
    return body.lateral.is_done(t_s, motion.s_m)


def stop(work: Work, one: Running, action: Action) -> None:
    """Stop an action that goes on: the entity keeps the speed and the offset that it has now."""
    body, motion = work.anchored(one.actor), work.motion(one.actor)
    if body is None or motion is None:
        return
    if isinstance(action, LONGITUDINAL) and body.long_by == one.number:
        speed = Speed(motion.speed_mps, motion.speed_mps, "step", work.t_ns / 1e9, 0.0)
        work.put(one.actor, replace(body, speed=speed, follow=None, long_by=-1))
    elif body.lat_by == one.number and body.path is not None:
        leave_path(work, one.actor)
    elif body.lat_by == one.number:
        lateral = Lateral(motion.offset_m, motion.offset_m)
        work.put(one.actor, replace(body, lateral=lateral, lat_by=-1))
