"""What lies in the shadow of a box: the points behind it, in a convex volume that begins at its near faces.

Directions are looked at as two tangents to the axis that most of them share: so each box is a rectangle
of tangents outside which it hides nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vsensor.raycast.boxes import FACES, Solids
from vsensor.raycast.pieces import cross
from vsensor.types import Array, BoolArray, IntArray

FAR_LIMIT = 1.0 - 1e-5
"""Fraction of the segment that is tested: embree's float32 hits the point's own surface from 3e-6 down."""

Judge = Callable[[int, IntArray], BoolArray]
"""Which of these points (their places) what is in this box (its place) hides."""

_MASK_SIZE = 400_000  # box and point pairs in one mask: 0.4 MB
_NEAR_M = 1e-6  # depth from which tangents are used
_OTHERS = np.array([[1, 2], [2, 0], [0, 1]])  # the axes beside each axis
_BITS = 2 ** np.arange(6)


def _outline_table() -> tuple[IntArray, IntArray]:
    """Return, by which faces are turned to the camera (a number of six bits), outline and faces.

    The outline (64, 2, 6): first and second corner of the edges between a face that is turned to the
    camera and one that is not, counterclockwise as the camera sees them; the faces (64, 3). Both are
    filled up with what does no harm: edges from a corner to itself, and faces that are there twice.
    """
    outline = np.zeros((64, 2, 6), dtype=np.int64)
    faces = np.zeros((64, 3), dtype=np.int64)
    for code in range(1, 64):
        front = [face for face in range(6) if code >> face & 1]
        if any(face + 3 in front for face in front):
            continue  # opposite faces are never both turned to the camera
        edges = {
            (int(p), int(q))
            for face in front
            for p, q in zip(FACES[face], np.roll(FACES[face], -1), strict=True)
        }
        border = sorted((p, q) for p, q in edges if (q, p) not in edges)
        outline[code, :, : len(border)] = np.array(border).T
        faces[code] = (front * 3)[:3]
    return outline, faces


_OUTLINE_EDGES, _FRONTFACES = _outline_table()


@dataclass(frozen=True, slots=True)
class Chart:
    """Directions as two tangents (2, N) to a depth (N,) along the signed axis that most share."""

    axis: int
    sign: float
    depth_m: Array
    tangents: Array

    def pick(self, which: IntArray) -> "Chart":
        """Return the chart of these directions."""
        return Chart(self.axis, self.sign, self.depth_m[which], self.tangents.take(which, axis=1))


def chart_of(directions: Array) -> Chart:
    """Return the chart of directions (3, N); one that points beside or behind has infinite tangents.

    So it lies in no rectangle but that of a box which reaches there too, and only such a box hides it.
    """
    total = directions.sum(axis=1)
    axis = int(np.abs(total).argmax())
    sign = 1.0 if total[axis] >= 0.0 else -1.0
    depth = sign * directions[axis]
    ahead = depth > _NEAR_M
    if ahead.all():
        return Chart(axis, sign, depth, directions[_OTHERS[axis]] / depth)
    tangents = directions[_OTHERS[axis]] / np.where(ahead, depth, 1.0)
    return Chart(axis, sign, depth, np.where(ahead, tangents, np.inf))


def rectangles(chart: Chart, corners_m: Array) -> tuple[Array, Array, IntArray]:
    """Return lower and upper tangents (2, M) of boxes by their corners, and which can hide, nearest first."""
    depth = chart.sign * corners_m[:, :, chart.axis]
    near = depth.min(axis=1)
    in_front = near > _NEAR_M  # a box that reaches beside or behind the camera has no outline
    others = corners_m[:, :, _OTHERS[chart.axis]] / np.where(in_front[:, None], depth, 1.0)[:, :, None]
    low = np.where(in_front[:, None], others.min(axis=1), -np.inf).T
    high = np.where(in_front[:, None], others.max(axis=1), np.inf).T
    in_view = (low <= chart.tangents.max(axis=1)[:, None]) & (high >= chart.tangents.min(axis=1)[:, None])
    possible = in_view[0] & in_view[1] & (near <= np.fmax.reduce(chart.depth_m, initial=0.0))
    possible &= depth.max(axis=1) >= np.fmin.reduce(chart.depth_m, initial=0.0)
    nearest_first = near.argsort(kind="stable")
    return low, high, nearest_first[possible[nearest_first]]


def shadow(
    directions: Array,
    chart: Chart,
    low: Array,
    high: Array,
    solids: Solids,
    free: BoolArray,
    judge: Judge | None = None,
) -> None:
    """Take out of `free` the segments (3, N) that end in the shadow of a box; the boxes come nearest first.

    A point is tried only against boxes in whose rectangle it lies, and not again once it is hidden.
    With a judge it is hidden only where that confirms it.
    """
    a, b = chart.tangents
    low_a, low_b, high_a, high_b = low[0, :, None], low[1, :, None], high[0, :, None], high[1, :, None]
    normals, least = shadow_bounds(solids)
    rows = max(1, _MASK_SIZE // len(free))
    for start in range(0, len(normals), rows):
        some = slice(start, start + rows)
        inside = (a >= low_a[some]) & (a <= high_a[some]) & (b >= low_b[some]) & (b <= high_b[some])
        for box, candidates in enumerate(inside, start):
            candidates &= free
            tried = candidates.nonzero()[0]
            if not len(tried):
                continue
            in_shadow = (normals[box] @ directions.take(tried, axis=1) >= least[box]).all(axis=0)
            if judge is None:
                free[tried] = ~in_shadow
            elif in_shadow.any():
                tried = tried[in_shadow]
                free[tried] = ~judge(box, tried)


def shadow_bounds(solids: Solids) -> tuple[Array, Array]:
    """Return the planes (M, 9, 3) and bounds (M, 9, 1) of the boxes' shadows: normals @ d >= bounds.

    A shadow is bounded by the planes through the camera and the edges of the outline, at most six,
    and by the faces turned to the camera, at most three:

        camera o-------+------------------    the segment o -> d passes the face's plane at
                       | box   shadow         t = height / -(n . d), which is to be at most FAR_LIMIT
                       +------------------
    """
    code = solids.is_front @ _BITS
    box = np.arange(len(code))[:, None]
    first, second = _OUTLINE_EDGES[code].transpose(1, 0, 2)
    edges = cross(solids.corners_m[box, second], solids.corners_m[box, first])
    face = _FRONTFACES[code]
    least = np.zeros((len(code), 9, 1))
    least[:, 6:, 0] = solids.heights_m[box, face] / FAR_LIMIT
    return np.concatenate([edges, -solids.normals[box, face]], axis=1), least
