"""From pixels back to the road, and how far half a pixel moves a point sideways there.

true depth:    the point of the ray at the depth that is known                     error z / (2 f)
ground plane:  where the ray meets the road that the camera believes to be there   error z^2 / (2 f h)

        o camera                       the camera pitches by d: the ray seems steeper,
        |`-.__                         x becomes  h / tan(atan(h / x) + d)
      h |  d  `--.__`-.__
        |___________`--.__`--.__ road
                    seems    is
"""

from math import hypot, sqrt

import numpy as np

from vsensor.camera.optics import Camera, normalised
from vsensor.distortion import inverse_jacobian
from vsensor.transforms import Rigid, invert
from vsensor.types import Array, BoolArray

SIGMA_FLOOR_M = 1e-3
"""The grid's lateral standard deviation is at least this, so that no near point outweighs all others."""

HORIZON_M = 1000.0
"""A ray that meets the road at a greater depth is taken to miss it: there a pixel is hundreds of metres."""


def back_to_road(
    camera: Camera, to_camera: Rigid, pixels: Array, depth_m: Array
) -> tuple[Array, Array, BoolArray | None]:
    """Return where in the ego frame the things at pixels (2, N) and true depth (N,) appear to be.

    Points (3, M) and their sigma_y (M,) of the M that appear anywhere, and which those are (N,); None = all.
    `to_camera` is the camera's true pose; the ground plane knows neither it nor the depth.
    """
    if camera.assumed_from_ego is not None:
        return on_road(camera, camera.assumed_from_ego, pixels)
    x, y = normalised(camera, pixels.T)
    found = None
    if camera.distortion is None:
        sigma = _pinhole_sigma_y_m(camera, to_camera, depth_m)
    else:
        found = np.isfinite(x)  # a pixel's centre can lie outside a lens's range where its edge does not
        x, y, depth_m = x[found], y[found], depth_m[found]
        by_x, by_y = depth_m * to_camera.rotation[0, 1], depth_m * to_camera.rotation[1, 1]
        sigma = _sigma_y_m(camera, by_x, by_y, x, y)
    x *= depth_m
    y *= depth_m
    optical = np.array((x, y, depth_m))
    optical -= to_camera.translation[:, None]
    return to_camera.rotation.T @ optical, sigma, found


def on_road(camera: Camera, assumed_from_ego: Rigid, pixels: Array) -> tuple[Array, Array, BoolArray]:
    """Return where the rays of pixels (2, N) meet the plane z = 0 of the ego frame, for a camera so posed.

    Points (3, M) and their sigma_y (M,) of the M rays that do, and which those are (N,): not those at
    or above the horizon, nor those that meet the plane beyond HORIZON_M.
    """
    x, y = normalised(camera, pixels.T)
    rotation, origin = assumed_from_ego.rotation, invert(assumed_from_ego).translation
    ray = rotation.T @ np.array((x, y, np.ones(len(x))))  # its third optical coordinate is 1, so
    meets = ray[2] < -origin[2] / HORIZON_M  # the factor along it is the depth
    ray = ray.compress(meets, axis=1)
    depth_m = -origin[2] / ray[2]
    points = origin[:, None] + depth_m * ray
    points[2] = 0.0
    aside = ray[1] / ray[2]  # d(point) / dx = depth (a - ray a_z / ray_z), a the optical x axis; so for y
    by_x = depth_m * (rotation[0, 1] - aside * rotation[0, 2])
    by_y = depth_m * (rotation[1, 1] - aside * rotation[1, 2])
    return points, _sigma_y_m(camera, by_x, by_y, x[meets], y[meets]), meets


def _pinhole_sigma_y_m(camera: Camera, to_camera: Rigid, depth_m: Array) -> Array:
    """Return the standard deviation of ego y from rounding u and v, uniform within half a pixel."""
    per_depth = hypot(to_camera.rotation[0, 1] / camera.fx_px, to_camera.rotation[1, 1] / camera.fy_px)
    return np.maximum(depth_m * (per_depth / sqrt(12.0)), SIGMA_FLOOR_M)


def _sigma_y_m(camera: Camera, by_x: Array, by_y: Array, x: Array, y: Array) -> Array:
    """Return the same from dy / dx and dy / dy (N,) of the normalised coordinates x, y (N,)."""
    if camera.distortion is not None:
        xx, xy, yy = inverse_jacobian(camera.distortion, x, y)
        by_x, by_y = xx * by_x + xy * by_y, xy * by_x + yy * by_y
    per_pixel = np.hypot(by_x / camera.fx_px, by_y / camera.fy_px)
    return np.maximum(per_pixel / sqrt(12.0), SIGMA_FLOOR_M)
