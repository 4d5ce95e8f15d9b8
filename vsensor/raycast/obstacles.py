"""Obstacles of every kind at once, each by the way that suits it: boxes, meshes, what stands still."""

from collections.abc import Callable, Sequence

import numpy as np

from vsensor.raycast.boxes import Method, boxes_in, hidden
from vsensor.raycast.meshes import hidden_by_meshes
from vsensor.raycast.standing import hidden_by_standing
from vsensor.transforms import Rigid
from vsensor.types import Array, BoolArray, Obstacle

KEEP_FROM_BOXES = 40
"""Standing boxes in view from which their kept scene is faster than to take them as moving ones."""


def hidden_by_obstacles(
    world_from_frame: Rigid,
    origin_m: Array,
    points_m: Array,
    near: Sequence[Obstacle],
    standing: Sequence[Obstacle] = (),
    method: Method = "auto",
) -> BoolArray:
    """Return which of `points_m` (N, 3) are hidden from `origin_m` (3,), both in a frame near the camera.

    `near` are the obstacles in reach; `standing` all that never move, the same objects every time, as
    their scene is kept. "shadow" takes a mesh as its bounding box, "embree" everything by rays.
    """
    if not near or not len(points_m):
        return np.zeros(len(points_m), dtype=bool)
    boxes, meshes, kept = list(near), [], False
    if method != "shadow":
        still = [one for one in near if not one.is_moving]
        kept = len(still) >= KEEP_FROM_BOXES or any(one.mesh is not None for one in still)
        moving = [one for one in near if one.is_moving] if kept else near
        boxes = [one for one in moving if one.mesh is None]
        meshes = [one for one in moving if one.mesh is not None]
    result = hidden(origin_m, points_m, boxes_in(world_from_frame, boxes), method)
    if meshes:
        _add(result, points_m, lambda rest: hidden_by_meshes(world_from_frame, meshes, origin_m, rest))
    if kept:
        everything = tuple(standing) or tuple(one for one in near if not one.is_moving)
        _add(result, points_m, lambda rest: hidden_by_standing(world_from_frame, everything, origin_m, rest))
    return result


def _add(result: BoolArray, points_m: Array, test: Callable[[Array], BoolArray]) -> None:
    """Try the points that are still free, and mark those that are not."""
    rest = (~result).nonzero()[0]
    if len(rest):
        result[rest] = test(points_m.take(rest, axis=0))
