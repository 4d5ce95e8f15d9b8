"""Meshes as surfaces of triangles: scenes per shape, the rays are moved into its frame.

A segment that meets a triangle, from either side, is hidden. So a closed mesh hides what lies inside
and behind it; a camera inside one sees what is in there with it and nothing outside.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsensor.errors import ConfigError
from vsensor.raycast.boxes import Boxes, boxes_in
from vsensor.raycast.pieces import Piece, meets, pieces_of
from vsensor.raycast.shadow import FAR_LIMIT
from vsensor.raycast.solids import hidden_within
from vsensor.transforms import Rigid
from vsensor.types import Array, BoolArray, IntArray, Mesh, Obstacle, frozen

SHAPES_KEPT = 64
"""Shapes whose scenes are kept, the least recently used goes first; 1280 triangles take some 0.3 MB."""

SLACK_M = 1e-3
"""Bounding boxes are larger by this, so that the float64 test of the box loses no float32 hit."""

_LARGEST_M = 1e6  # beyond that, float32 squares in embree lose the shape


@dataclass(frozen=True, slots=True)
class _Shape:
    """A mesh, kept so that its id stays valid, and its pieces ready for rays."""

    mesh: Mesh
    pieces: list[Piece]


_shapes: OrderedDict[int, _Shape] = OrderedDict()


def mesh_of(vertices_m: Array, faces: IntArray, where: str = "mesh") -> Mesh:
    """Return a mesh of vertices (V, 3) and triangles (F, 3) of places in it; both may be empty.

    Winding does not matter; triangles without area hide nothing. Raises ConfigError naming `where`
    for other shapes, vertices that are not finite or beyond 1000 km, places that are not there.
    """
    vertices = np.asarray(vertices_m, dtype=np.float64)
    corners = np.asarray(faces)
    vertices = vertices.reshape(-1, 3) if not vertices.size else vertices
    corners = corners.reshape(-1, 3).astype(np.int64) if not corners.size else corners
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ConfigError(f"{where}: vertices of shape {vertices.shape}: (V, 3) was expected")
    if corners.ndim != 2 or corners.shape[1] != 3 or corners.dtype.kind not in "iu":
        raise ConfigError(
            f"{where}: faces of shape {corners.shape}, {corners.dtype}: integers (F, 3) were expected"
        )
    bad = ~(np.abs(vertices) <= _LARGEST_M).all(axis=1)
    if bad.any():
        row = int(bad.argmax())
        raise ConfigError(
            f"{where}: vertex {row} is {vertices[row].tolist()}: metres up to 1000 km were expected"
        )
    if corners.size and (int(corners.min()) < 0 or int(corners.max()) >= len(vertices)):
        raise ConfigError(f"{where}: a face names a vertex beyond the {len(vertices)} that there are")
    return Mesh(vertices_m=frozen(vertices), faces=frozen(corners, np.int64))


def triangles_of(mesh: Mesh) -> Array:
    """Return the triangles (T, 3, 3) of a mesh in its own frame, those without area left out; checks it."""
    checked = mesh_of(mesh.vertices_m, mesh.faces)
    triangles = checked.vertices_m[checked.faces]
    sides = triangles[:, 1:] - triangles[:, :1]
    has_area = np.cross(sides[:, 0], sides[:, 1]).any(axis=1)
    return triangles[has_area]


def hidden_by_meshes(
    world_from_frame: Rigid, obstacles: Sequence[Obstacle], origin_m: Array, points_m: Array
) -> BoolArray:
    """Return which points (N, 3) of a frame near the camera the obstacles' meshes hide."""
    pieces, placed = [], []
    for obstacle in obstacles:
        if obstacle.mesh is not None:
            found = _shape(obstacle.mesh).pieces
            pieces += found
            placed += [obstacle] * len(found)
    boxes = boxes_in(world_from_frame, placed)
    return hidden_by_pieces(pieces, boxes.centre_m, boxes.rotation, origin_m, points_m)


def hidden_by_pieces(
    pieces: Sequence[Piece], places_m: Array, rotations: Array, origin_m: Array, points_m: Array
) -> BoolArray:
    """Return which points (N, 3) pieces hide whose frames have these origins (P, 3) and axes (P, 3, 3).

    Only segments that meet a piece's bounding box become rays.
    """
    if not pieces:
        return np.zeros(len(points_m), dtype=bool)
    offsets = np.array([piece.centre_m for piece in pieces])
    boxes = Boxes(
        places_m + np.einsum("mij,mj->mi", rotations, offsets),
        np.array([piece.half_m for piece in pieces]) + SLACK_M,
        rotations,
    )
    directions = points_m - origin_m

    def judge(box: int, tried: IntArray) -> BoolArray:
        rotation = boxes.rotation[box]
        origin = (origin_m - boxes.centre_m[box]) @ rotation
        return meets(pieces[box], origin, directions.take(tried, axis=0) @ rotation, FAR_LIMIT)

    return hidden_within(origin_m, points_m, boxes, judge)


def _shape(mesh: Mesh) -> _Shape:
    """Return the kept pieces of a mesh, built at its first use."""
    known = _shapes.get(id(mesh))
    if known is None:
        known = _shapes[id(mesh)] = _Shape(mesh, pieces_of(triangles_of(mesh)))
        while len(_shapes) > SHAPES_KEPT:
            _shapes.popitem(last=False)
    else:
        _shapes.move_to_end(id(mesh))
    return known
