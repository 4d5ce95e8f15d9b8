"""Actions at work: how they begin, when they are done, and what is kept in step with others."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, pi, remainder

from vsensor.errors import StoryError, VsensorError
from vsensor.world.openscenario.bodies import Body, Follow, way_on
from vsensor.world.openscenario.model import (
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
from vsensor.world.openscenario.paths import PathRun
from vsensor.world.openscenario.places import point_for, route_for, spot_for
from vsensor.world.openscenario.shapes import Lateral, Speed, seconds_for, seconds_within
from vsensor.world.openscenario.state import STEP_NS, Running
from vsensor.world.openscenario.towing import hang
from vsensor.world.openscenario.tracks import Spot
from vsensor.world.openscenario.work import Work

GAP_PULL_PER_S2 = 1.0
GAP_DAMPING_PER_S = 2.0
"""A gap is closed as by a critically damped spring of 1 rad/s, within the action's limits."""

GAP_REACHED_M = 0.1
GAP_SPEED_MPS = 0.1
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


def _trajectory(work: Work, action: Trajectory, actor: int, body: Body, number: int) -> bool:
    """Begin a trajectory: its points in the world are those of now."""
    times: tuple[float, ...] | None = None
    clothoid: tuple[float, float, float, float] | None
    if action.start is not None:
        spot = spot_for(work, action.start)
        point, heading = work.tracks.pose(spot)
        numbers = (heading, action.curvature_per_m, action.curvature_rate_per_m2, action.length_m)
        points, clothoid = [point], numbers
    else:
        found = [point_for(work, vertex.position) for vertex in action.vertices]
        points, clothoid = [point for point in found if point is not None], None
    from_ns = work.t_ns
    if action.timed:
        times = tuple(
            action.time_scale * (vertex.time_s or 0.0) + action.time_offset_s for vertex in action.vertices
        )
        from_ns = 0 if action.absolute else work.t_ns
    corners = tuple((float(x), float(y), float(z)) for x, y, z in points)
    run = PathRun(corners, times, clothoid, from_ns, 0.0)
    try:
        work.tracks.path(run)
    except ValueError as error:
        raise StoryError(f"{work.story.path}: trajectory {action.name}: {error}") from None
    now = _speed_now(work, actor)
    speed = body.speed if not action.timed else Speed(now, now, "step", work.t_ns / 1e9, 0.0)
    work.put(actor, replace(body, path=run, speed=speed, lat_by=number))
    return True


_BEGINNERS: dict[type, Callable[..., bool]] = {
    SpeedAction: _speed,
    GapAction: _gap,
    LaneChange: _lane_change,
    LaneOffset: _lane_offset,
    RouteAction: _route,
    Trajectory: _trajectory,
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
            return not action.continuous and _gap_reached(work, one.actor, action)
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


def finish_paths(work: Work) -> None:
    """Put those back on their lanes who have come to the end of a trajectory."""
    for entity, body in enumerate(work.bodies):
        if body is None or body.path is None:
            continue
        path = work.tracks.path(body.path)
        if path.times_s is not None:
            is_over = (work.t_ns - body.path.from_ns) / 1e9 >= float(path.times_s[0][-1])
        else:
            is_over = way_on(path, body.path, body, work.t_ns)[0] >= path.length_m
        if is_over:
            leave_path(work, entity)


def leave_path(work: Work, entity: int) -> None:
    """Let an entity follow the lane that it is on now, as far beside its middle as it is."""
    body, motion = work.anchored(entity), work.motion(entity)
    pose = work.pose(entity)
    assert body is not None
    assert body.path is not None
    assert motion is not None
    assert pose is not None
    path = work.tracks.path(body.path)
    speed = motion.speed_mps
    if path.times_s is not None:  # as fast as it came
        speed = path.way_at((work.t_ns - STEP_NS - body.path.from_ns) / 1e9)[1]
    try:
        x, y, z = pose[0].tolist()
        spot = work.tracks.world_spot(x, y, z, pose[1], "")
        spot = work.tracks.owned(spot) if entity == work.ego else spot
    except VsensorError:
        spot = Spot(body.track, motion.s_m, motion.offset_m)
    kept = Speed(speed, speed, "step", work.t_ns / 1e9, 0.0) if path.times_s is not None else body.speed
    lateral = Lateral(spot.offset_m, spot.offset_m)
    turn = remainder(spot.turn_rad, 2 * pi)
    body = replace(
        body, track=spot.track, s_m=spot.s_m, lateral=lateral, speed=kept, path=None, turn_rad=turn
    )
    work.put(entity, replace(body, t_ns=work.t_ns, changes=body.changes + 1))


def keep_in_step(work: Work) -> None:
    """Let those who follow another's speed or keep a gap go on for one step."""
    for entity, body in enumerate(work.bodies):
        if body is None or body.follow is None or body.is_ended:
            continue
        t_s, after_s = work.t_ns / 1e9, (work.t_ns + STEP_NS) / 1e9
        if (
            t_s < body.speed.until_s - 1e-9
            and body.follow.gap is None
            and body.speed.seconds > STEP_NS / 1e9 * 1.5
        ):
            continue  # still on its way to the other's speed
        now = body.speed.value(t_s)
        if body.follow.gap is not None:
            wanted = _gap_speed(work, entity, body.follow.gap, now)
        else:
            other = work.bodies[body.follow.ref]
            theirs = 0.0 if other is None or other.is_ended else other.speed.value(after_s)
            wanted = max(body.follow.factor * theirs + body.follow.value_mps, 0.0)
        if wanted == now and body.speed.until_s <= t_s:
            continue
        moved = work.anchored(entity)
        assert moved is not None
        work.put(entity, replace(moved, speed=Speed(now, wanted, "linear", t_s, after_s - t_s)))


def _gap_error(work: Work, entity: int, action: GapAction) -> tuple[float, float] | None:
    """Return how far the gap is too wide, and how fast it grows; None if the other is not on the way."""
    mine, place = work.motion(entity), work.place(action.ref)
    other, spot = work.motion(action.ref), work.spot(action.ref)
    ahead = work.ahead_m(entity, place, spot)
    if mine is None or other is None or ahead is None:
        return None
    sign = 1.0 if action.trails else -1.0
    gap = sign * ahead
    if action.freespace:
        heading = work.pose(entity)
        axis = 0.0 if heading is None else heading[1]
        (low, high), (other_low, other_high) = work.extent(entity, axis), work.extent(action.ref, axis)
        gap += other_low - high if action.trails else low - other_high
    wanted = action.metres if action.metres is not None else (action.seconds or 0.0) * mine.speed_mps
    return sign * (gap - wanted), other.speed_mps - mine.speed_mps


def _gap_reached(work: Work, entity: int, action: GapAction) -> bool:
    found = _gap_error(work, entity, action)
    return found is None or (abs(found[0]) < GAP_REACHED_M and abs(found[1]) < GAP_SPEED_MPS)


def _gap_speed(work: Work, entity: int, action: GapAction, now: float) -> float:
    found = _gap_error(work, entity, action)
    if found is None:
        return now
    own = work.story.entities[entity]
    most = own.max_acceleration_mps2 if action.max_acceleration_mps2 is None else action.max_acceleration_mps2
    least = (
        own.max_deceleration_mps2 if action.max_deceleration_mps2 is None else action.max_deceleration_mps2
    )
    top = own.max_speed_mps if action.max_speed_mps is None else action.max_speed_mps
    rate = GAP_PULL_PER_S2 * found[0] + GAP_DAMPING_PER_S * found[1]
    after = now + min(max(rate, -least), most) * STEP_NS / 1e9
    return min(max(after, 0.0), max(top, min(now, after)) if now > top else top)
