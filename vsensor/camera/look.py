"""What the optics let the sensor see: pinhole projection, pixel grid, occlusion, and back (P1 2.1).

    markings near -> painted -> in the image -> not hidden -> nearest pixel centre -> back to the road
    (exact points)                                            (u, v and the true depth)

Optical frame: x right, y down, z forward. Pixels: u right, v down, centres at integers, so the image
is [-0.5, width - 0.5) x [-0.5, height - 0.5).
"""

from dataclasses import dataclass
from math import hypot, radians, sqrt, tan
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from vsensor import raycast, scene
from vsensor.schema import Config
from vsensor.transforms import CAMERA_FROM_FORWARD_LEFT_UP, Rigid, compose, invert, rotation_from_rpy
from vsensor.types import (
    Array,
    BoolArray,
    CodeArray,
    EgoState,
    IntArray,
    LinePoints,
    Observation,
    Scene,
    Snapshot,
    Unseen,
)

OPTICAL_CENTRE_M = 1e-9
"""A depth up to this counts as the optical centre or behind it: no projection, NaN."""

SIGMA_FLOOR_M = 1e-3
"""The grid's lateral standard deviation is at least this, so that no near point outweighs all others."""

_METHODS: dict[str, raycast.Method] = {"auto": "auto", "boxes": "shadow", "embree": "embree"}

Pixels = Annotated[int, Meta(ge=16, le=16384)]
MountX = Annotated[float, Meta(ge=-5.0, le=15.0)]
MountY = Annotated[float, Meta(ge=-2.0, le=2.0)]
MountZ = Annotated[float, Meta(ge=0.2, le=5.0)]


class CameraConfig(Config, frozen=True, kw_only=True):
    """A camera on the body; `model = "none"` bypasses it: points are taken as they are (P1 3.4).

    Defaults: 1280 x 800 at 52 degrees is a common class of forward lane cameras (fx = 1312 px, so a
    pixel is 76 mm wide at 100 m); 1.9 m ahead of the rear axle and 1.35 m up is behind the mirror of a
    mid-size car. `hfov_deg` is the full horizontal field of view. `position_m` is x, y, z on the body,
    the angles are about its axes (pitch positive nose down). `min_range_m` is the least depth.
    `occlusion`: boxes = shadow test, embree = rays, auto = whichever is faster for the scene.
    """

    model: Literal["pinhole", "none"] = "pinhole"
    width_px: Pixels = 1280
    height_px: Pixels = 800
    hfov_deg: Annotated[float, Meta(gt=1.0, lt=175.0)] = 52.0
    position_m: tuple[MountX, MountY, MountZ] = (1.9, 0.0, 1.35)
    roll_deg: Annotated[float, Meta(ge=-180.0, le=180.0)] = 0.0
    pitch_deg: Annotated[float, Meta(ge=-90.0, le=90.0)] = 0.0
    yaw_deg: Annotated[float, Meta(ge=-180.0, le=180.0)] = 0.0
    min_range_m: Annotated[float, Meta(ge=0.01, le=50.0)] = 0.5
    pixel_grid: bool = True
    occlusion: Literal["auto", "none", "boxes", "embree"] = "auto"


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A camera as the stage uses it: focal lengths and centre in pixels, pose on the body."""

    config: CameraConfig
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    camera_from_body: Rigid

    @classmethod
    def from_config(cls, config: CameraConfig) -> "Camera":
        """Compile a configuration: fx = width / (2 tan(hfov / 2)), square pixels (P1 eq. 2.1-2.3)."""
        focal_px = config.width_px / (2.0 * tan(radians(config.hfov_deg) / 2.0))
        angles = (radians(config.roll_deg), radians(config.pitch_deg), radians(config.yaw_deg))
        body_from_mount = Rigid(rotation_from_rpy(*angles), np.array(config.position_m))
        camera_from_mount = Rigid(CAMERA_FROM_FORWARD_LEFT_UP, np.zeros(3))
        return cls(
            config=config,
            fx_px=focal_px,
            fy_px=focal_px,
            cx_px=(config.width_px - 1) / 2.0,
            cy_px=(config.height_px - 1) / 2.0,
            camera_from_body=compose(camera_from_mount, invert(body_from_mount)),
        )


def camera_from_ego(camera: Camera, ego: EgoState) -> Rigid:
    """Return the camera's pose against the road-level ego frame: the body rolls, pitches, heaves under it.

    The body turns about the ego origin (road level, rear axle) and is then lifted by its heave.
    """
    if not (ego.body_roll_rad or ego.body_pitch_rad or ego.body_heave_m):
        return camera.camera_from_body
    rotation = rotation_from_rpy(ego.body_roll_rad, ego.body_pitch_rad, 0.0)
    return compose(camera.camera_from_body, invert(Rigid(rotation, np.array([0.0, 0.0, ego.body_heave_m]))))


def project(camera: Camera, points_camera_m: Array) -> Array:
    """Return pixels (N, 2) of points (N, 3) in the optical frame; NaN at and behind the optical centre.

    u = fx x / z + cx, v = fy y / z + cy (P1 eq. 2.16, 2.17 with the errata's frame).
    """
    x, y, z = points_camera_m.T
    depth = np.where(z > OPTICAL_CENTRE_M, z, np.nan)
    u = camera.fx_px * (x / depth) + camera.cx_px
    v = camera.fy_px * (y / depth) + camera.cy_px
    return np.array((u, v)).T


def unproject(camera: Camera, pixels: Array, depth_m: Array) -> Array:
    """Return points (N, 3) in the optical frame of pixels (N, 2) with the true depth (N,), exact.

    The inverse of `project` (P1 eq. 2.23 with the errata's frame).
    """
    u, v = pixels.T
    x = (u - camera.cx_px) / camera.fx_px * depth_m
    y = (v - camera.cy_px) / camera.fy_px * depth_m
    return np.array((x, y, depth_m)).T


def in_image(camera: Camera, pixels: Array) -> BoolArray:
    """Return which pixels (N, 2) lie in the image, the left and upper edge included; NaN does not."""
    u, v = pixels.T
    inside: BoolArray = (u >= -0.5) & (u < camera.config.width_px - 0.5)
    inside &= (v >= -0.5) & (v < camera.config.height_px - 0.5)
    return inside


def observe(camera: Camera, scene_config: scene.SceneConfig, snapshot: Snapshot) -> Observation:
    """Return what is seen of the markings near the pose, and for every point that is not, why."""
    candidates = scene.near(scene_config, snapshot.ego, snapshot.scene)
    painted = _painted(snapshot.scene, candidates)
    reason = np.where(painted, np.uint8(Unseen.SEEN), np.uint8(Unseen.NO_PAINT))
    seen = painted.nonzero()[0]
    points = candidates.points_ego_m.T.take(seen, axis=1)
    sigma = np.zeros(len(seen))
    if camera.config.model != "none":
        codes, points, sigma = _look(camera, scene_config, snapshot, points)
        reason[seen] = codes
        seen = seen[codes == Unseen.SEEN]
    lines, sigma = _lines(candidates, seen, points, sigma)
    kind, colour, width_m = _nearest_paint(snapshot.scene, lines, candidates)
    for array in (reason, sigma, kind, colour, width_m):
        array.flags.writeable = False
    return Observation(
        lines=lines,
        sigma_y_m=sigma,
        kind=kind,
        colour=colour,
        width_m=width_m,
        candidates=candidates,
        reason=reason,
    )


def _painted(surroundings: Scene, candidates: LinePoints) -> BoolArray:
    """Return (N,) whether there is paint at each candidate."""
    edges = candidates.starts.tolist()
    parts = [
        surroundings.markings[place].painted[candidates.index[start:stop]]
        for place, start, stop in zip(candidates.marking.tolist(), edges, edges[1:], strict=False)
    ]
    return np.concatenate(parts) if parts else np.zeros(0, dtype=bool)


def _look(
    camera: Camera, scene_config: scene.SceneConfig, snapshot: Snapshot, points: Array
) -> tuple[CodeArray, Array, Array]:
    """Return for points (3, N) of the ego frame the reason each is unseen (N,).

    With it, of the M that are seen, where they appear to be, (3, M) in the ego frame, and their
    lateral standard deviation (M,).
    """
    to_camera = camera_from_ego(camera, snapshot.ego)
    optical = to_camera.rotation @ points
    optical += to_camera.translation[:, None]
    pixels = project(camera, optical.T)
    codes = np.where(in_image(camera, pixels), np.uint8(Unseen.SEEN), np.uint8(Unseen.OUTSIDE_IMAGE))
    codes[optical[2] < camera.config.min_range_m] = Unseen.BEHIND_CAMERA
    seen = (codes == Unseen.SEEN).nonzero()[0]
    if camera.config.occlusion != "none":
        hidden = _hidden(camera, scene_config, snapshot, to_camera, points.take(seen, axis=1).T)
        codes[seen[hidden]] = Unseen.OCCLUDED
        seen = seen[~hidden]
    if not camera.config.pixel_grid:
        return codes, points.take(seen, axis=1), np.zeros(len(seen))
    depth = optical[2].take(seen)
    centres = np.rint(pixels.T.take(seen, axis=1))
    appearing = unproject(camera, centres.T, depth).T
    appearing -= to_camera.translation[:, None]
    return codes, to_camera.rotation.T @ appearing, _grid_sigma_y_m(camera, to_camera, depth)


def _hidden(
    camera: Camera, scene_config: scene.SceneConfig, snapshot: Snapshot, to_camera: Rigid, points: Array
) -> BoolArray:
    """Return which points (N, 3) of the ego frame an obstacle hides from the camera."""
    obstacles = scene.obstacles_near(scene_config, snapshot.ego, snapshot.scene)
    if not obstacles or not len(points):
        return np.zeros(len(points), dtype=bool)
    boxes = raycast.boxes_in(scene.world_from_ego(snapshot.ego), obstacles)
    return raycast.hidden(invert(to_camera).translation, points, boxes, _METHODS[camera.config.occlusion])


def _grid_sigma_y_m(camera: Camera, to_camera: Rigid, depth_m: Array) -> Array:
    """Return the standard deviation of ego y from rounding u and v, uniform within half a pixel."""
    per_depth = hypot(to_camera.rotation[0, 1] / camera.fx_px, to_camera.rotation[1, 1] / camera.fy_px)
    return np.maximum(depth_m * (per_depth / sqrt(12.0)), SIGMA_FLOOR_M)


def _lines(
    candidates: LinePoints, seen: IntArray, points: Array, sigma_y_m: Array
) -> tuple[LinePoints, Array]:
    """Return the seen points (3, M) as lines with x increasing along each, and their deviations.

    The grid of a pitched or turned camera moves points along x too; on a coarse one they can swap.
    """
    starts = seen.searchsorted(candidates.starts)
    index = candidates.index[seen]
    line = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    if ((points[0, 1:] <= points[0, :-1]) & (line[1:] == line[:-1])).any():
        order = np.lexsort((points[0], line))
        index, points, sigma_y_m = index[order], points[:, order], sigma_y_m[order]
    for array in (starts, index, points):
        array.flags.writeable = False
    return LinePoints(
        marking=candidates.marking, starts=starts, index=index, points_ego_m=points.T
    ), sigma_y_m


def _nearest_paint(
    surroundings: Scene, lines: LinePoints, candidates: LinePoints
) -> tuple[CodeArray, CodeArray, Array]:
    """Return kind, colour and width of each line at its nearest seen point, else at its nearest candidate."""
    kind, colour, width = [], [], []
    firsts, ends = lines.starts.tolist(), candidates.starts.tolist()
    for line, place in enumerate(lines.marking.tolist()):
        start, stop = firsts[line], firsts[line + 1]
        at = lines.index[start] if start < stop else candidates.index[ends[line]]
        marking = surroundings.markings[place]
        kind.append(marking.kind[at])
        colour.append(marking.colour[at])
        width.append(marking.width_m[at])
    return np.array(kind, dtype=np.uint8), np.array(colour, dtype=np.uint8), np.array(width, dtype=np.float64)
