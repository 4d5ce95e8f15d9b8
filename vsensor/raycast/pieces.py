"""Surfaces of triangles in pieces for embree: each near its own origin, and what float32 found confirmed.

Of a triangle that is narrow as the camera sees it, edge-on or a splinter, float32 cannot tell where it
ends: the planes through the camera and its sides are nearly one, and it seems to go on beyond its tip:

    camera o ------- - - -|=========|- - - - x     the plane holds o: x is "met", decimetres beside it

So a hit on such a triangle counts only if float64 finds it, too; else that ray is tried against all
triangles of the piece in float64.
"""

from dataclasses import dataclass

import numpy as np

from vsensor.raycast import embree
from vsensor.types import Array, BoolArray, IntArray

CELL_M = 100.0
"""Pieces are at most about this large: float32 places a point 100 m from their centre within 4e-6 m."""

TRUSTED_M = 5e-5
"""A hit that may be wrong by more is confirmed: half the band of 1e-4 m that is allowed."""

ROUNDING = 2.0**-23  # of float32, both ways
_CELLS_OF_ONE = 64  # a triangle that reaches into more goes into that of its middle
_EDGE_ON_M = 1e-7  # a camera as near to a triangle's plane sees nothing of it
_BLOCK = 500_000  # triangle and ray pairs at once: 12 MB


@dataclass(frozen=True, slots=True)
class Piece:
    """Triangles (T, 3, 3) relative to the centre (3,) of their bounding box, with their scene.

    `slant` (T, 3): normals with the length of height / base, the narrowest angle as seen straight on.
    """

    centre_m: Array
    half_m: Array
    triangles_m: Array
    slant: Array
    scene: embree.EmbreeScene


def pieces_of(triangles_m: Array) -> list[Piece]:
    """Return the pieces of triangles (T, 3, 3), all finite; none of none.

    A surface of up to CELL_M stays whole. Of a larger one a triangle belongs to every cell that it
    reaches into: so those that share an edge meet without a gap in the piece where a ray passes it.
    """
    if not len(triangles_m):
        return []
    a, b, c = triangles_m[:, 0], triangles_m[:, 1], triangles_m[:, 2]
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    if (high.max(axis=0) - low.min(axis=0) <= CELL_M).all():
        return [_piece(triangles_m)]
    places, cells = _cells(low, high)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    order = cell.ravel().argsort(kind="stable")
    edges = np.cumsum(np.bincount(cell.ravel()))[:-1]
    return [_piece(triangles_m[some]) for some in np.split(places[order], edges)]


def meets(piece: Piece, origin_m: Array, directions_m: Array, far: float) -> BoolArray:
    """Return which segments origin -> origin + far * direction (N, 3) meet a triangle, from either side.

    Coordinates relative to the piece's centre. A direction that holds NaN meets nothing.
    """
    first = embree.first_met(piece.scene, origin_m, directions_m, far)
    met = first >= 0
    places = met.nonzero()[0]
    if not len(places):
        return met
    which, directions = first[places], directions_m.take(places, axis=0)
    length = np.sqrt(np.einsum("ki,ki->k", directions, directions))
    reach_m = np.abs(origin_m).max() + piece.half_m.max()
    angle = np.abs(np.einsum("ki,ki->k", piece.slant.take(which, axis=0), directions))
    doubtful = (angle * TRUSTED_M < ROUNDING * reach_m * length).nonzero()[0]
    if len(doubtful):
        directions = directions.take(doubtful, axis=0)
        sure = _meet_one(piece.triangles_m.take(which[doubtful], axis=0) - origin_m, directions, far)
        rest = (~sure).nonzero()[0]
        if len(rest):
            sure[rest] = _meet_any(piece.triangles_m - origin_m, directions[rest], far)
        met[places[doubtful]] = sure
    return met


def _piece(triangles_m: Array) -> Piece:
    corners = triangles_m.reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    centre = 0.5 * (low + high)
    near = triangles_m - centre
    sides = np.roll(near, -1, axis=1) - near
    normals = cross(sides[:, 0], sides[:, 1])
    longest = np.einsum("tij,tij->ti", sides, sides).max(axis=1)
    slant = normals / np.where(longest > 0.0, longest, 1.0)[:, None]
    return Piece(centre, 0.5 * (high - low), near, slant, embree.build(near))


def _cells(low_m: Array, high_m: Array) -> tuple[IntArray, IntArray]:
    """Return places (K,) of triangles and the cells (K, 3) that each reaches into, by their bounds (T, 3)."""
    first = np.floor(low_m / CELL_M - 1e-6).astype(np.int64)
    span = np.floor(high_m / CELL_M + 1e-6).astype(np.int64) - first + 1
    wide = span.prod(axis=1, dtype=np.float64) > _CELLS_OF_ONE
    first[wide] = np.floor(0.5 * (low_m[wide] + high_m[wide]) / CELL_M).astype(np.int64)
    span[wide] = 1
    count = span.prod(axis=1)
    places = np.repeat(np.arange(len(span)), count)
    number = np.arange(len(places)) - np.repeat(np.cumsum(count) - count, count)
    _, ny, nz = span[places].T
    steps = np.stack([number // (ny * nz), number // nz % ny, number % nz], axis=1)
    return places, first[places] + steps


def _meet_one(triangles_m: Array, directions_m: Array, far: float) -> BoolArray:
    """Return whether each segment 0 -> far * direction (K, 3) meets its own triangle of (K, 3, 3)."""
    planes, height, normal = _cone(triangles_m)
    a, b, c = np.einsum("kij,kj->ik", planes, directions_m)
    return _within(a, b, c, height, normal, far)


def _meet_any(triangles_m: Array, directions_m: Array, far: float) -> BoolArray:
    """Return whether each segment 0 -> far * direction (K, 3) meets any triangle of (T, 3, 3)."""
    planes, height, normal = _cone(triangles_m)
    met = np.zeros(len(directions_m), dtype=bool)
    rays = max(1, _BLOCK // len(triangles_m))
    for start in range(0, len(directions_m), rays):
        a, b, c = np.moveaxis(planes @ directions_m[start : start + rays].T, 1, 0)
        met[start : start + rays] = _within(a, b, c, height[:, None], normal[:, None], far).any(axis=0)
    return met


def _cone(triangles_m: Array) -> tuple[Array, Array, Array]:
    """Return the planes (T, 3, 3) through the origin and each side, a . (b x c), and the normal's length."""
    a, b, c = np.moveaxis(triangles_m, 1, 0)
    planes = np.stack([cross(b, c), cross(c, a), cross(a, b)], axis=1)
    normals = cross(b - a, c - a)
    height = np.einsum("ti,ti->t", a, normals)
    return planes, height, np.sqrt(np.einsum("ti,ti->t", normals, normals))


def _within(a: Array, b: Array, c: Array, height: Array, normal: Array, far: float) -> BoolArray:
    """Return where a segment passes between the planes (volumes a, b, c) and reaches the triangle.

    It is met at height / (a + b + c) of the direction, as a + b + c = normal . direction.
    """
    inside = ((a >= 0.0) & (b >= 0.0) & (c >= 0.0)) | ((a <= 0.0) & (b <= 0.0) & (c <= 0.0))
    along = (a + b + c) * np.sign(height)
    reached = (np.abs(height) > _EDGE_ON_M * normal) & (along > 0.0) & (np.abs(height) <= far * along)
    met: BoolArray = inside & reached
    return met


def cross(a: Array, b: Array) -> Array:
    """Return the cross products along the last axis; np.cross takes two to eight times as long."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    np.subtract(ay * bz, az * by, out=product[..., 0])
    np.subtract(az * bx, ax * bz, out=product[..., 1])
    np.subtract(ax * by, ay * bx, out=product[..., 2])
    return product
