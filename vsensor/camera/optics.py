"""The camera compiled: from points to pixels and back, exact both ways.

Optical frame: x right, y down, z forward. Pixels: u right, v down, centres at integers, so the image
is [-0.5, width - 0.5) x [-0.5, height - 0.5).
"""

from dataclasses import dataclass
from math import radians, tan

import numpy as np

from vsensor.camera.config import DEFAULT_HFOV_DEG, CameraConfig
from vsensor.distortion import Distortion, distort, undistort
from vsensor.transforms import CAMERA_FROM_FORWARD_LEFT_UP, Rigid, compose, invert, rotation_from_rpy
from vsensor.types import Array, BoolArray, EgoState

OPTICAL_CENTRE_M = 1e-9
"""A depth up to this counts as the optical centre or behind it: no projection, NaN."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A camera as the stage uses it: focal lengths and centre in pixels, lens, pose on the body.

    `assumed_from_ego` is where the inverse takes the camera to be, in the road-level ego frame; None =
    the inverse knows the true depth.
    """

    config: CameraConfig
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: Distortion | None
    camera_from_body: Rigid
    assumed_from_ego: Rigid | None

    @classmethod
    def from_config(cls, config: CameraConfig) -> "Camera":
        """Compile a configuration: fx = width / (2 tan(hfov / 2)), square pixels (P1 eq. 2.1-2.3)."""
        fx, fy, cx, cy = _intrinsics(config)
        is_flat = config.inverse == "ground_plane"
        return cls(
            config=config,
            fx_px=fx,
            fy_px=fy,
            cx_px=cx,
            cy_px=cy,
            distortion=Distortion.of(config.distortion),
            camera_from_body=_mounted(
                config.roll_deg, config.pitch_deg, config.yaw_deg, np.array(config.position_m)
            ),
            assumed_from_ego=_assumed(config) if is_flat else None,
        )


def _intrinsics(config: CameraConfig) -> tuple[float, float, float, float]:
    """Return fx, fy, cx, cy in pixels, as given or of the angle of view."""
    fx, fy, cx, cy = config.fx_px, config.fy_px, config.cx_px, config.cy_px
    if fx is not None and fy is not None and cx is not None and cy is not None:
        return fx, fy, cx, cy
    hfov_deg = DEFAULT_HFOV_DEG if config.hfov_deg is None else config.hfov_deg
    focal_px = config.width_px / (2.0 * tan(radians(hfov_deg) / 2.0))
    return focal_px, focal_px, (config.width_px - 1) / 2.0, (config.height_px - 1) / 2.0


def _mounted(roll_deg: float, pitch_deg: float, yaw_deg: float, position_m: Array) -> Rigid:
    """Return the optical frame against the frame that a camera is mounted in."""
    body_from_mount = Rigid(
        rotation_from_rpy(radians(roll_deg), radians(pitch_deg), radians(yaw_deg)), position_m
    )
    return compose(Rigid(CAMERA_FROM_FORWARD_LEFT_UP, np.zeros(3)), invert(body_from_mount))


def _assumed(config: CameraConfig) -> Rigid:
    """Return the pose that the inverse takes the camera to have: the mount's where nothing else is said."""

    def said(value: float | None, mounted: float) -> float:
        return mounted if value is None else value

    x, y, z = config.position_m
    return _mounted(
        said(config.assumed_roll_deg, config.roll_deg),
        said(config.assumed_pitch_deg, config.pitch_deg),
        config.yaw_deg,
        np.array([x, y, said(config.assumed_height_m, z)]),
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
    """Return pixels (N, 2) of points (N, 3) in the optical frame.

    NaN at and behind the optical centre, and outside the lens's monotone range.
    u = fx x / z + cx, v = fy y / z + cy (P1 eq. 2.16, 2.17 with the errata's frame); with distortion
    x / z, y / z are first moved by it (P2 eq. 2.14, 2.15).
    """
    x, y, z = points_camera_m.T
    depth = np.where(z > OPTICAL_CENTRE_M, z, np.nan)
    x, y = x / depth, y / depth
    if camera.distortion is not None:
        x, y = distort(camera.distortion, x, y)
    x *= camera.fx_px
    y *= camera.fy_px
    x += camera.cx_px
    y += camera.cy_px
    return np.array((x, y)).T


def normalised(camera: Camera, pixels: Array) -> tuple[Array, Array]:
    """Return x / z and y / z (N,) of what is seen at pixels (N, 2); NaN where the lens shows nothing."""
    u, v = pixels.T
    x, y = u - camera.cx_px, v - camera.cy_px
    x /= camera.fx_px
    y /= camera.fy_px
    return (x, y) if camera.distortion is None else undistort(camera.distortion, x, y)


def unproject(camera: Camera, pixels: Array, depth_m: Array) -> Array:
    """Return points (N, 3) in the optical frame of pixels (N, 2) with the true depth (N,), exact.

    The inverse of `project` (P1 eq. 2.21-2.23 with the errata's frame).
    """
    x, y = normalised(camera, pixels)
    return np.array((x * depth_m, y * depth_m, depth_m)).T


def in_image(camera: Camera, pixels: Array) -> BoolArray:
    """Return which pixels (N, 2) lie in the image (P1 eq. 2.18), left and upper edge included; not NaN."""
    u, v = pixels.T
    inside: BoolArray = (u >= -0.5) & (u < camera.config.width_px - 0.5)
    inside &= (v >= -0.5) & (v < camera.config.height_px - 0.5)
    return inside
