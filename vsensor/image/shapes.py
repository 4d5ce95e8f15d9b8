"""Where stripes and boxes are in the image: edges of polygons in pixels, by `camera.project` alone."""

from typing import NamedTuple

import numpy as np

from vsensor.camera import Camera, project
from vsensor.image.coverage import Edges, between, chained, outline
from vsensor.transforms import Rigid, compose, transform
from vsensor.types import Array, BoolArray

NEAR_M = 0.3
"""What is less deep is cut off: the projection runs away towards the camera."""

_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_FACES = (  # corners around each face, and its normal
    ((0, 1, 3, 2), (-1.0, 0.0, 0.0)),
    ((4, 5, 7, 6), (1.0, 0.0, 0.0)),
    ((0, 1, 5, 4), (0.0, -1.0, 0.0)),
    ((2, 3, 7, 6), (0.0, 1.0, 0.0)),
    ((0, 2, 6, 4), (0.0, 0.0, -1.0)),
    ((1, 3, 7, 5), (0.0, 0.0, 1.0)),
)
_STEPS = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]  # a lens bends edges: each is drawn in eight parts


class Face(NamedTuple):
    """A side of a box that is turned to the camera: its edges, outward normal (3,), and depth in m."""

    edges: Edges
    normal_ego: Array
    depth_m: float


def stripe_edges(
    camera: Camera, pose: Rigid, points_ego_m: Array, width_m: Array, opacity: Array
) -> Edges | None:
    """Return the outline of a stripe by its centre (N, 3), of which each point has a width and an opacity.

    `pose` is camera_from_ego. A point stands for the stripe from half way to the one before to half way
    to the next. None if nothing is ahead of the camera, or nothing is painted.
    """
    count = len(points_ego_m)
    if count < 2 or not opacity.any():
        return None
    bounds = np.concatenate(
        [points_ego_m[:1], 0.5 * (points_ego_m[1:] + points_ego_m[:-1]), points_ego_m[-1:]]
    )
    half_m = 0.5 * np.concatenate([width_m[:1], 0.5 * (width_m[1:] + width_m[:-1]), width_m[-1:]])
    along = np.empty_like(bounds)
    along[1:-1], along[0], along[-1] = (
        bounds[2:] - bounds[:-2],
        bounds[1] - bounds[0],
        bounds[-1] - bounds[-2],
    )
    length = np.hypot(along[:, 0], along[:, 1])
    across = np.zeros_like(bounds)
    across[:, 0], across[:, 1] = -along[:, 1], along[:, 0]
    across *= (half_m / np.where(length > 0.0, length, 1.0))[:, None]
    centre = transform(pose, bounds)
    is_ahead = centre[:, 2] >= NEAR_M
    if not is_ahead.any():
        return None
    centre = _moved_ahead(centre, is_ahead)
    aside = across @ pose.rotation.T
    left, right = project(camera, centre + aside), project(camera, centre - aside)
    return _strip(left, right, _visible(left, right, opacity, is_ahead))


def polygon_edges(camera: Camera, pose: Rigid, points_ego_m: Array, opacity: float) -> Edges | None:
    """Return the outline of a flat polygon (N, 3) on the road, cut where it comes too near; `pose` as above.

    A lens bends edges: its points should lie close to each other. None if nothing of it is ahead.
    """
    points = _ahead_of_near(transform(pose, points_ego_m))
    if len(points) < 3 or opacity <= 0.0:
        return None
    pixels = project(camera, points)
    x, y = pixels.T
    if not np.isfinite(pixels).all():
        return None
    area = float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())  # twice; clockwise in the image is positive
    return outline(pixels if area > 0.0 else pixels[::-1], opacity)


def _ahead_of_near(points: Array) -> Array:
    """Return the part of a polygon (N, 3) that is as deep as NEAR_M or deeper."""
    depth = points[:, 2] - NEAR_M
    after, depth_after = np.roll(points, -1, axis=0), np.roll(depth, -1)
    kept = []
    for here, there, a, b in zip(points, after, depth.tolist(), depth_after.tolist(), strict=True):
        if a >= 0.0:
            kept.append(here)
        if (a >= 0.0) != (b >= 0.0):
            kept.append(here + a / (a - b) * (there - here))
    return np.array(kept).reshape(-1, 3)


def _moved_ahead(centre: Array, is_ahead: BoolArray) -> Array:
    """Return the bounds with those that are the first behind the near plane moved onto it."""
    moved = centre.copy()
    for step in (1, -1):
        ahead = np.roll(is_ahead, -step) & ~is_ahead
        ahead[-1 if step == 1 else 0] = False
        near = ahead.nonzero()[0]
        here, there = centre[near], centre[near + step]
        part = (NEAR_M - here[:, 2]) / (there[:, 2] - here[:, 2])
        moved[near] = here + part[:, None] * (there - here)
    return moved


def _visible(left: Array, right: Array, opacity: Array, is_ahead: BoolArray) -> Array:
    """Return the opacity of each cell, 0 where it is behind the camera or seen from below the road."""
    (xa, ya), (xb, yb), (xc, yc), (xd, yd) = left[:-1].T, left[1:].T, right[1:].T, right[:-1].T
    area = (xc - xa) * (yd - yb) - (xd - xb) * (yc - ya)  # twice; clockwise in the image is positive
    return np.where((is_ahead[:-1] | is_ahead[1:]) & (area > 0.0), opacity, 0.0)


def _strip(left: Array, right: Array, weight: Array) -> Edges | None:
    """Return the edges of cells between left (N + 1, 2) and right bounds; those shared by equals cancel."""
    kept = weight.nonzero()[0]
    if not len(kept):
        return None
    weights = weight[kept]
    step = np.diff(weight, prepend=0.0, append=0.0)
    ends = step.nonzero()[0]
    return chained(
        between(left[kept], left[kept + 1], weights),
        between(right[kept + 1], right[kept], weights),
        between(right[ends], left[ends], step[ends]),
    )


def box_faces(
    camera: Camera, pose: Rigid, ego_from_box: Rigid, size_m: tuple[float, float, float]
) -> list[Face]:
    """Return the faces of a box that are turned to the camera; `pose` is camera_from_ego."""
    camera_from_box = compose(pose, ego_from_box)
    corners = transform(camera_from_box, _CORNERS * np.abs(np.array(size_m)))
    found = []
    for places, normal in _FACES:
        face = corners[list(places)]
        outward = camera_from_box.rotation @ np.array(normal)
        if outward @ face[0] >= 0.0:
            continue  # turned away
        ahead = in_front(face)
        if not len(ahead):
            continue
        after = np.roll(ahead, -1, axis=0)
        pixels = project(camera, (ahead[:, None] + _STEPS * (after - ahead)[:, None]).reshape(-1, 3))
        if np.isfinite(pixels).all():
            depth_m = float(ahead[:, 2].mean())
            found.append(Face(outline(pixels), ego_from_box.rotation @ np.array(normal), depth_m))
    return found


def in_front(polygon_camera_m: Array) -> Array:
    """Return the part (M, 3) of a polygon (N, 3) at least NEAR_M deep, maybe (0, 3)."""
    kept: list[Array] = []
    for here, after in zip(polygon_camera_m, np.roll(polygon_camera_m, -1, axis=0), strict=True):
        if here[2] >= NEAR_M:
            kept.append(here)
        if (here[2] >= NEAR_M) != (after[2] >= NEAR_M):
            kept.append(here + (after - here) * ((NEAR_M - here[2]) / (after[2] - here[2])))
    return np.array(kept).reshape(-1, 3)
