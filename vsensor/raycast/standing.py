"""What stands still, in one embree scene that is kept, relative to the origin of a tile near the camera.

embree counts in float32: at the 5e6 m of a map grid that is half a metre. So the scene belongs to
the tile, TILE_M wide, that the camera is in; it is built when the camera enters the tile or what
stands there changes, and several are kept, so that a camera on the edge of two builds each once.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsensor.raycast import embree
from vsensor.raycast.boxes import FAR_LIMIT, Boxes, box_triangles, boxes_in
from vsensor.raycast.meshes import triangles_of
from vsensor.transforms import Rigid
from vsensor.types import Array, BoolArray, Obstacle

TILE_M = 500.0
SCENES_KEPT = 8

_UPRIGHT = np.eye(3)


@dataclass(frozen=True, slots=True)
class _Tile:
    """The scene relative to `origin_world_m`, and the boxes in it; `obstacles` keeps their ids valid."""

    obstacles: tuple[Obstacle, ...]
    origin_world_m: Array
    boxes: Boxes
    scene: embree.EmbreeScene


_Key = tuple[tuple[int, ...], bytes]
_tiles: OrderedDict[_Key, _Tile] = OrderedDict()


def hidden_by_standing(
    world_from_frame: Rigid, obstacles: Sequence[Obstacle], origin_m: Array, points_m: Array
) -> BoolArray:
    """Return which points (N, 3) of a frame near the camera the standing obstacles hide.

    Boxes hide as solids (a camera in one sees nothing), meshes as surfaces. The scene is found again
    by the obstacles' identity: give the same objects in the same order.
    """
    rotation = world_from_frame.rotation
    camera = rotation @ origin_m + world_from_frame.translation
    tile = _tile(tuple(obstacles), TILE_M * np.rint(camera / TILE_M))
    origin = camera - tile.origin_world_m
    boxes = tile.boxes
    local = np.einsum("mij,mi->mj", boxes.rotation, origin - boxes.centre_m)
    if (np.abs(local) <= boxes.half_m).all(axis=1).any():
        return np.ones(len(points_m), dtype=bool)
    if tile.scene is None:
        return np.zeros(len(points_m), dtype=bool)
    return embree.meets(tile.scene, origin, (points_m - origin_m) @ rotation.T, FAR_LIMIT)


def _tile(obstacles: tuple[Obstacle, ...], origin_world_m: Array) -> _Tile:
    key = (tuple(map(id, obstacles)), origin_world_m.tobytes())
    if key not in _tiles:
        _tiles[key] = _built(obstacles, origin_world_m)
        while len(_tiles) > SCENES_KEPT:
            _tiles.popitem(last=False)
    _tiles.move_to_end(key)
    return _tiles[key]


def _built(obstacles: tuple[Obstacle, ...], origin_world_m: Array) -> _Tile:
    pose = Rigid(_UPRIGHT, origin_world_m)
    boxes = boxes_in(pose, [one for one in obstacles if one.mesh is None])
    parts = [box_triangles(boxes)]
    for one in obstacles:
        if one.mesh is not None:
            place = boxes_in(pose, [one])
            parts.append(triangles_of(one.mesh) @ place.rotation[0].T + place.centre_m[0])
    triangles = np.concatenate(parts)
    triangles = triangles[np.isfinite(triangles).all(axis=(1, 2))]
    return _Tile(obstacles, origin_world_m, boxes, embree.build(triangles) if len(triangles) else None)
