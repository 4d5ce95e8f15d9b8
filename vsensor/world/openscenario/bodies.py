"""Where entities are at a time: on their tracks, with the speed and the offset that actions gave them.

A body holds what it did since `t_ns`: who drives on the middle of the lane is moved in closed form, who
is beside it or changes lanes by the midpoint rule from step to step of the storyboard:

    v^2 = along^2 + across^2       along = (1 - curvature * offset) ds/dt       across = d offset/dt
"""

from dataclasses import dataclass, replace
from math import atan2, cos, hypot, inf, pi, remainder, sin, sqrt

import numpy as np
from msgspec import Struct, structs

from vsensor.world.openscenario.action_data import GapAction
from vsensor.world.openscenario.paths import Path, PathRun
from vsensor.world.openscenario.rods import Rod
from vsensor.world.openscenario.shapes import Lateral, Speed
from vsensor.world.openscenario.spots import Spot, Track
from vsensor.world.openscenario.tracks import Tracks

STANDING = Speed()
ON_MIDDLE = Lateral()

SLOWEST_MPS = 1e-3
"""Below, a vehicle keeps its heading."""

ON_MIDDLE_M = 1e-9
NARROWEST = 0.05
"""Least of 1 - curvature * offset: nobody drives beyond the centre of a bend."""


@dataclass(frozen=True, slots=True)
class Follow:
    """A speed kept in step with another's: `factor` times its speed plus `value`; or a gap to it."""

    ref: int
    factor: float = 1.0
    value_mps: float = 0.0
    gap: GapAction | None = None


class Body(Struct, frozen=True, kw_only=True):
    """An entity's state at `t_ns`; `driven_m` is the way since the scenario began.

    `long_by` and `lat_by` say which running action moves it (-1 none); `path` is a trajectory that it is on;
    `rod` is what a trailer is drawn by, as it was at `t_ns`. A struct, like Motion: both are made anew for
    each vehicle that leaves its lane's middle at each step, and a frozen dataclass takes ten times as long.
    """

    track: Track
    t_ns: int
    s_m: float
    speed: Speed = STANDING
    lateral: Lateral = ON_MIDDLE
    turn_rad: float = 0.0
    driven_m: float = 0.0
    long_by: int = -1
    lat_by: int = -1
    follow: Follow | None = None
    path: PathRun | None = None
    changes: int = 0
    rod: Rod | None = None
    is_ended: bool = False


class Motion(Struct, frozen=True):
    """What a body does at a time: place, offset and its rates, speed and its rate, way driven."""

    s_m: float
    offset_m: float
    along_mps: float
    across_mps: float
    across_rate_mps2: float
    foot_mps: float
    speed_mps: float
    acceleration_mps2: float
    driven_m: float

    @property
    def turn_rad(self) -> float:
        """How far the path leaves the lane's direction to the left."""
        if hypot(self.along_mps, self.across_mps) < SLOWEST_MPS:
            return 0.0
        return atan2(self.across_mps, self.along_mps)


def spot_of(body: Body, motion: Motion) -> Spot:
    """Return the place of a body, its heading turned into its path, or as it was put down."""
    turn = motion.turn_rad
    if motion.speed_mps < SLOWEST_MPS:
        turn = body.turn_rad
    return Spot(body.track, motion.s_m, motion.offset_m, turn)


def motion_of(tracks: Tracks, body: Body, t_ns: int) -> Motion:
    """Return what a body on its track does at a time not before its own."""
    t_s, before_s = t_ns / 1e9, body.t_ns / 1e9
    speed, rate = body.speed.value(t_s), body.speed.slope(t_s)
    way = body.speed.way(t_s) - body.speed.way(before_s)
    lateral = body.lateral
    if body.path is not None:
        return _path_motion(tracks, body, body.path, t_ns)
    if body.is_ended:
        offset = lateral.end_m
        return Motion(body.s_m, offset, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, body.driven_m)
    if _is_straight(lateral, before_s, body.s_m):
        s_m, offset = body.s_m + way, lateral.end_m
        return Motion(s_m, offset, speed, 0.0, 0.0, speed, speed, rate, body.driven_m + way)
    half_s = (before_s + t_s) / 2.0
    middle_m = body.s_m + way / 2.0
    curvature = tracks.corridor(body.track).curvature(middle_m)
    offset, across, _ = _lateral_at(lateral, half_s, middle_m)
    s_m = body.s_m + way * _foot_share(lateral, curvature, offset, across, body.speed.value(half_s))
    offset, across, across_rate = _lateral_at(lateral, t_s, s_m)
    share = _foot_share(lateral, curvature, offset, across, speed)
    foot = speed * share
    if lateral.by_distance:
        turning = across * (across_rate - curvature * (1.0 - curvature * offset))  # half of d(1 / share^2)/ds
        foot_rate = rate * share - speed * turning * foot * share**3
        across, across_rate = across * foot, across_rate * foot * foot + across * foot_rate
    along = sqrt(max(speed * speed - across * across, 0.0))
    return Motion(s_m, offset, along, across, across_rate, foot, speed, rate, body.driven_m + way)


def _path_motion(tracks: Tracks, body: Body, run: PathRun, t_ns: int) -> Motion:
    """Return what a body on a trajectory does: on its track it is at the foot of where it is."""
    path = tracks.path(run)
    way, speed, rate = way_on(path, run, body, t_ns)
    point, heading, _ = path.at(way)
    before = way_on(path, run, body, body.t_ns)[0]
    s_m, offset, yaw = tracks.projected(body.track, body.s_m + way - before, np.array(point))
    turn = remainder(heading - yaw, 2 * pi)
    along, across = speed * cos(turn), speed * sin(turn)
    bend = max(1.0 - tracks.corridor(body.track).curvature(s_m) * offset, NARROWEST)
    driven = body.driven_m + way - before
    return Motion(s_m, offset, along, across, 0.0, along / bend, speed, rate, driven)


def way_on(path: Path, run: PathRun, body: Body, t_ns: int) -> tuple[float, float, float]:
    """Return distance along a trajectory, speed and its rate: by its times, or at the vehicle's speed."""
    if path.times_s is not None:
        return path.way_at((t_ns - run.from_ns) / 1e9)
    t_s = t_ns / 1e9
    way = run.started_m + body.speed.way(t_s) - body.speed.way(run.from_ns / 1e9)
    return way, body.speed.value(t_s), body.speed.slope(t_s)


def _is_straight(lateral: Lateral, t_s: float, s_m: float) -> bool:
    return abs(lateral.end_m) <= ON_MIDDLE_M and lateral.is_done(t_s, s_m)


def _lateral_at(lateral: Lateral, t_s: float, s_m: float) -> tuple[float, float, float]:
    return lateral.at(s_m if lateral.by_distance else t_s)


def _foot_share(lateral: Lateral, curvature: float, offset: float, slope: float, speed_mps: float) -> float:
    """Return the speed of the foot on the lane's middle per speed of the vehicle."""
    bend = max(1.0 - curvature * offset, NARROWEST)
    if lateral.by_distance:
        return 1.0 / hypot(bend, slope)
    if slope == 0.0:
        return 1.0 / bend
    if abs(slope) >= speed_mps:
        return 0.0
    return sqrt(1.0 - (slope / speed_mps) ** 2) / bend


def moved(tracks: Tracks, body: Body, t_ns: int) -> tuple[Body, Motion | None]:
    """Return the body at a later time, where it must be moved in steps, else as it is.

    With it what it does then, where that came out on the way (but for `foot_mps`, of the step's middle).
    """
    if body.is_ended:
        return body, None
    if body.path is not None:
        return anchored(tracks, body, t_ns), None
    if _is_straight(body.lateral, body.t_ns / 1e9, body.s_m):
        return body, None
    motion = motion_of(tracks, body, t_ns)
    after = structs.replace(body, t_ns=t_ns, s_m=motion.s_m, driven_m=motion.driven_m)
    lateral = body.lateral
    if lateral.is_done(t_ns / 1e9, motion.s_m) and lateral.length > 0.0:
        return structs.replace(after, lateral=Lateral(lateral.end_m, lateral.end_m)), None
    return after, motion


def anchored(tracks: Tracks, body: Body, t_ns: int) -> Body:
    """Return the body at a later time, so that its speed or track may be changed."""
    if body.t_ns == t_ns or body.is_ended:
        return body
    motion = motion_of(tracks, body, t_ns)
    path = body.path
    if path is not None and path.times_s is None:  # the speed may change from here on
        way = way_on(tracks.path(path), path, body, t_ns)[0]
        path = replace(path, from_ns=t_ns, started_m=way)
    return structs.replace(body, t_ns=t_ns, s_m=motion.s_m, driven_m=motion.driven_m, path=path)


def way_left_m(tracks: Tracks, body: Body, s_m: float, look_m: float) -> float:
    """Return the way to the end of the track as far as one looks, inf beyond."""
    corridor = tracks.corridor(body.track)
    return inf if corridor.reaches(s_m + look_m) else corridor.length_m - s_m
