"""Trajectories being driven: how one begins, and how its driver comes back onto a lane."""

from math import pi, remainder

from msgspec.structs import replace

from vsensor.errors import StoryError, VsensorError
from vsensor.world.openscenario.action_data import Trajectory
from vsensor.world.openscenario.bodies import Body, way_on
from vsensor.world.openscenario.paths import PathRun
from vsensor.world.openscenario.places import point_for, spot_for
from vsensor.world.openscenario.shapes import Lateral, Speed
from vsensor.world.openscenario.spots import Spot
from vsensor.world.openscenario.state import STEP_NS
from vsensor.world.openscenario.work import Work


def begin_trajectory(work: Work, action: Trajectory, actor: int, body: Body, number: int) -> bool:
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
    motion = work.motion(actor)
    now = 0.0 if motion is None else motion.speed_mps
    speed = body.speed if not action.timed else Speed(now, now, "step", work.t_ns / 1e9, 0.0)
    work.put(actor, replace(body, path=run, speed=speed, lat_by=number))
    return True


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
