"""What stands still, in embree scenes that are kept: one for every cell of the world, whatever stands in it.

embree counts in float32: at the 5e6 m of a map grid that is half a metre. So what stands is cut into
cells, each with its own origin, once, when it is first seen; a camera that moves on builds nothing.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsensor.raycast.boxes import Boxes, box_triangles, boxes_in
from vsensor.raycast.meshes import hidden_by_pieces, triangles_of
from vsensor.raycast.pieces import Piece, pieces_of
from vsensor.transforms import Rigid
from vsensor.types import Array, BoolArray, Obstacle

KEPT = 4
"""Sets of obstacles whose scenes are kept, the least recently used goes first."""

_UPRIGHT = np.eye(3)


@dataclass(frozen=True, slots=True)
class _Standing:
    """Pieces and boxes relative to `origin_world_m`; `obstacles` keeps their ids valid."""

    obstacles: tuple[Obstacle, ...]
    origin_world_m: Array
    boxes: Boxes
    pieces: list[Piece]


_sets: OrderedDict[tuple[int, ...], _Standing] = OrderedDict()


def hidden_by_standing(
    world_from_frame: Rigid, obstacles: Sequence[Obstacle], origin_m: Array, points_m: Array
) -> BoolArray:
    """Return which points (N, 3) of a frame near the camera the standing obstacles hide.

    Boxes hide as solids (a camera in one sees nothing), meshes as surfaces. The scenes are found again
    by the obstacles' identity: give the same objects in the same order.
    """
    standing = _standing(tuple(obstacles))
    rotation = world_from_frame.rotation
    offset = world_from_frame.translation - standing.origin_world_m
    boxes = standing.boxes
    local = np.einsum("mij,mi->mj", boxes.rotation, rotation @ origin_m + offset - boxes.centre_m)
    if (np.abs(local) <= boxes.half_m).all(axis=1).any():
        return np.ones(len(points_m), dtype=bool)
    pieces = standing.pieces
    places = np.broadcast_to(-offset @ rotation, (len(pieces), 3))
    rotations = np.broadcast_to(rotation.T, (len(pieces), 3, 3))
    return hidden_by_pieces(pieces, places, rotations, origin_m, points_m)


def _standing(obstacles: tuple[Obstacle, ...]) -> _Standing:
    key = tuple(map(id, obstacles))
    if key not in _sets:
        _sets[key] = _built(obstacles)
        while len(_sets) > KEPT:
            _sets.popitem(last=False)
    _sets.move_to_end(key)
    return _sets[key]


def _built(obstacles: tuple[Obstacle, ...]) -> _Standing:
    centres = [one.centre_world_m for one in obstacles if np.isfinite(one.centre_world_m).all()]
    origin = np.rint(centres[0]) if centres else np.zeros(3)
    pose = Rigid(_UPRIGHT, origin)
    boxes = boxes_in(pose, [one for one in obstacles if one.mesh is None])
    parts = [box_triangles(boxes)]
    for one in obstacles:
        if one.mesh is not None:
            place = boxes_in(pose, [one])
            parts.append(triangles_of(one.mesh) @ place.rotation[0].T + place.centre_m[0])
    triangles = np.concatenate(parts)
    return _Standing(obstacles, origin, boxes, pieces_of(triangles[np.isfinite(triangles).all(axis=(1, 2))]))
