"""Where a camera points and how high it is, from the road that it saw: many pictures of two parallel lines.

line points ──► angles, roughly ──► a lane in each ──► medians: pitch, yaw without drift, width
of pictures     (vanishing.py)      (parallel.py)      height by a known width, or by speed

A picture's own pitch is that of the moment: the body nods, the road rises. The mount's is a drive's median.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import degrees, radians, sqrt

import msgspec
import numpy as np

from vsensor.camera import Camera, CameraConfig, normalised
from vsensor.errors import VideoError
from vsensor.types import Array
from vsensor.video.camera_file import VideoCamera
from vsensor.video.line_points import Grey, line_points, rows_of
from vsensor.video.parallel import LEAST_POINTS, Lane, Mount, fit_lane
from vsensor.video.types import Motion, Picture
from vsensor.video.upright import upright_camera, upright_grey
from vsensor.video.value import Value
from vsensor.video.vanishing import straightest

ROUGHLY = 40
"""So many pictures, spread over the video, give the angles roughly."""
NEAR_M, FAR_ROUGHLY_M, FAR_M = 3.0, 25.0, 55.0
"""From the rear axle: rows that are looked at, at first and then."""
LOOKS = 1
"""Looks at the same pictures, from the angles of the look before, before all pictures are looked at."""
DARK = 40
LEAST_LANES = 8
LEAST_SHARE = 0.1
"""Of the pictures so many show a lane, or there is nothing to tell a mount from."""
STRAIGHT_PER_M = 1.0 / 1200.0
"""Yaw is told from pictures of flatter bends where there are enough: a bend's beginning turns the line."""
SPEED_MPS = 20.0
"""Assumed for the drift across the lane where no CAN log tells the speed."""
BLOCK_S = 1.0
"""Pictures nearer to each other than this nod together: a block of them counts as one."""
NODS_RAD = radians(0.05)
"""The body nods by so much at least: no picture is surer of the mount than that."""
CHANGE_M = 1.0
"""A line that jumps by more between two pictures is another one: the lane was changed."""

Pictures = Callable[[], Iterable[Picture]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lanes:
    """The lanes of a video's pictures: their times (N,) in s, and one row of numbers each."""

    t_s: Array
    pitch_rad: Array
    yaw_rad: Array
    yaw_std_rad: Array
    pitch_std_rad: Array
    curvature_per_m: Array
    left_m: Array
    width_m: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """A mount found: `camera` with it, angles in degrees; `width_m` between the lines' centres so seen.

    `height_m` is None where nothing told it. `pictures` were looked at, `lanes` of them showed one; `seen` is
    what they showed with the height that was given.
    """

    camera: VideoCamera
    pitch_deg: Value
    yaw_deg: Value
    width_m: Value
    height_m: Value | None
    pictures: int
    lanes: int
    seen: Lanes


def find_mount(
    pictures: Pictures,
    camera: VideoCamera,
    name: str,
    *,
    lane_width_m: float | None = None,
    motions: Callable[[Array], Sequence[Motion]] | None = None,
    tick: Callable[[], object] = lambda: None,
) -> Found:
    """Return the mount that fits a video best; lens, position, roll stay as they are.

    `lane_width_m` is between the centres of both markings and gives the height; `motions` tells speed at
    times (N,) in s. Raises VideoError where few pictures show a lane, and where they are upside down.
    """
    upright = upright_camera(camera.config)
    start = mount_of(upright)
    some = spread(pictures, ROUGHLY)
    rough = roughly([picture.grey for picture in some], camera.config, start)
    if rough is None:
        raise VideoError(_nothing(some, camera.config, start, name))
    for _ in range(LOOKS):
        first, _ = look(some, camera.config, rough)
        if len(first.t_s) < LEAST_LANES:
            break
        rough = rough._replace(
            pitch_rad=float(np.median(first.pitch_rad)), yaw_rad=float(np.median(first.yaw_rad))
        )
    lanes, looked = look(pictures(), camera.config, rough, tick)
    if len(lanes.t_s) < max(LEAST_LANES, LEAST_SHARE * looked):
        raise VideoError(
            f"{name}: two lines of a lane in {len(lanes.t_s)} of {looked} pictures: too few to tell where "
            "the camera points; a drive between two painted lines was expected"
        )
    speed_mps = np.full(len(lanes.t_s), SPEED_MPS)
    if motions is not None:
        speed_mps = np.array([motion.speed_mps for motion in motions(lanes.t_s)])
    return _found(lanes, looked, camera, speed_mps, lane_width_m)


def _found(
    lanes: Lanes, looked: int, camera: VideoCamera, speed_mps: Array, lane_width_m: float | None
) -> Found:
    certainty = 1.0 / (NODS_RAD**2 + lanes.pitch_std_rad**2)
    pitch = _middle(np.degrees(lanes.pitch_rad), lanes.t_s, certainty)
    yaw = yaw_of(lanes, speed_mps)
    width = _middle(lanes.width_m, lanes.t_s, certainty)
    x, y, z = camera.config.position_m
    height = None
    if lane_width_m is not None:
        height = Value(value=z * lane_width_m / width.value, std=z * width.std / width.value)
        width = Value(value=lane_width_m, std=width.std * lane_width_m / width.value)
        z = height.value
    config = msgspec.structs.replace(
        camera.config,
        pitch_deg=round(pitch.value, 3),
        yaw_deg=round(yaw.value, 3),
        position_m=(x, y, round(z, 3)),
    )
    return Found(
        camera=VideoCamera(config, camera.vehicle),
        pitch_deg=pitch,
        yaw_deg=yaw,
        width_m=width,
        height_m=height,
        pictures=looked,
        lanes=len(lanes.t_s),
        seen=lanes,
    )


def mount_of(config: CameraConfig) -> Mount:
    """Return the mount that a camera file says."""
    return Mount(
        config.position_m, radians(config.roll_deg), radians(config.pitch_deg), radians(config.yaw_deg)
    )


def spread(pictures: Pictures, most: int) -> list[Picture]:
    """Return some pictures of all of a video: whenever there are twice as many, every other one goes."""
    kept: list[Picture] = []
    every = 1
    for picture in pictures():
        if picture.index % every == 0:
            kept.append(picture)
        if len(kept) == 2 * most:
            kept, every = kept[::2], 2 * every
    return kept


def roughly(greys: Sequence[Grey], config: CameraConfig, start: Mount) -> Mount | None:
    """Return the mount with its angles roughly right, None where the pictures show no lines."""
    rays_of = _looker(config, start, FAR_ROUGHLY_M)
    rays = [found for grey in greys if (found := rays_of(grey)).shape[1] >= 2 * LEAST_POINTS]
    if len(rays) < max(1, round(LEAST_SHARE * len(greys))):
        return None
    return straightest(rays, start)


def look(
    pictures: Iterable[Picture],
    config: CameraConfig,
    mount: Mount,
    tick: Callable[[], object] = lambda: None,
) -> tuple[Lanes, int]:
    """Return the lanes of all pictures that show one, and how many pictures there were."""
    rays_of, focal_px = _looker(config, mount, FAR_M), Camera.from_config(config).fx_px
    found: list[tuple[float, Lane]] = []
    looked = 0
    for picture in pictures:
        lane = fit_lane(rays_of(picture.grey), mount, focal_px)
        if lane is not None:
            found.append((picture.t_ns / 1e9, lane))
        looked += 1
        tick()

    def column(name: str) -> Array:
        return np.array([getattr(lane, name) for _, lane in found])

    columns = {name: column(name) for name in Lanes.__dataclass_fields__ if name != "t_s"}
    return Lanes(t_s=np.array([t_s for t_s, _ in found]), **columns), looked


def _looker(config: CameraConfig, mount: Mount, far_m: float) -> Callable[[Grey], Array]:
    """Return what gives the rays (3, N) of a picture's line points in the frame of the upright camera."""
    upright = msgspec.structs.replace(
        upright_camera(config), pitch_deg=degrees(mount.pitch_rad), yaw_deg=degrees(mount.yaw_rad)
    )
    camera = Camera.from_config(upright)
    rows = rows_of(camera, camera.camera_from_body, NEAR_M, far_m)

    def rays_of(grey: Grey) -> Array:
        x, y = normalised(camera, line_points(upright_grey(grey, config), rows))
        seen = np.isfinite(x)
        return np.array((x[seen], y[seen], np.ones(int(seen.sum()))))

    return rays_of


def yaw_of(lanes: Lanes, speed_mps: Array) -> Value:
    """Return the camera's yaw against the way the vehicle goes, in degrees.

    The lines of a picture show the camera against the lane: yaw and the vehicle's heading in it. The heading
    is the drift across the lane over the speed, and is taken off.
    """
    flat = np.abs(lanes.curvature_per_m) < STRAIGHT_PER_M
    used = flat if flat.sum() >= max(LEAST_LANES, 0.2 * len(flat)) else np.ones(len(flat), bool)
    heading = -drift_mps(lanes.t_s, lanes.left_m) / np.where(speed_mps > 1.0, speed_mps, np.nan)
    yaw_deg = np.degrees(lanes.yaw_rad - heading)
    used &= np.isfinite(yaw_deg)
    if not used.any():  # drives too slowly to tell heading from drift
        used, yaw_deg = np.ones(len(flat), bool), np.degrees(lanes.yaw_rad)
    return _middle(yaw_deg[used], lanes.t_s[used], 1.0 / lanes.yaw_std_rad[used] ** 2)


def drift_mps(t_s: Array, left_m: Array) -> Array:
    """Return how fast the left line moves away to the left (N,): slopes over a second on both sides.

    A jump to another line is no drift: the slope is of the points without one in between; 0 where alone.
    """
    lane = np.concatenate(([0], np.cumsum(np.abs(np.diff(left_m)) > CHANGE_M)))
    slopes = np.zeros(len(t_s))
    for place, now_s in enumerate(t_s.tolist()):
        near = (np.abs(t_s - now_s) <= BLOCK_S) & (lane == lane[place])
        if np.ptp(t_s[near]) > 0.5 * BLOCK_S:
            slopes[place] = np.polyfit(t_s[near] - now_s, left_m[near], 1)[0]
    return slopes


def _middle(values: Array, t_s: Array, weight: Array | None = None) -> Value:
    """Return the weighted median, and its deviation from blocks of pictures that nod together."""
    weight = np.ones(len(values)) if weight is None else weight
    order = np.argsort(values)
    below = np.cumsum(weight[order])
    median = float(values[order][np.searchsorted(below, below[-1] / 2.0)])
    spread = 1.4826 * float(np.median(np.abs(values - median)))
    blocks = len(np.unique(np.floor(t_s / BLOCK_S)))
    return Value(value=median, std=1.2533 * spread / sqrt(blocks))


def _nothing(some: Sequence[Picture], config: CameraConfig, start: Mount, name: str) -> str:
    """Return why no line was found: upside down, black, or there is none."""
    greys = [picture.grey for picture in some]
    turned_deg = config.roll_deg - 180.0 if config.roll_deg > 0.0 else config.roll_deg + 180.0
    if roughly(greys, msgspec.structs.replace(config, roll_deg=turned_deg), start) is not None:
        return (
            f"{name}: seems to be upside down; of a camera that hangs so the camera file says "
            f"roll_deg = {turned_deg:g}"
        )
    if max(int(grey.max()) for grey in greys) < DARK:
        return f"{name}: is black: no pixel is brighter than {DARK} of 255"
    return f"{name}: no painted lines in it: a drive between two painted lines was expected"
