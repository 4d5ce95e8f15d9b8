"""Points of painted lines in a picture: per row, what is brighter than the road on both sides of it.

A row of an upright picture is a distance on the road, so a marking's width in pixels is known for it: near
and far lines answer alike. The pose need only be roughly right for that.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsensor.camera import Camera, on_road, project
from vsensor.transforms import Rigid, transform
from vsensor.types import Array, BoolArray, IntArray

MARKING_M = 0.15
"""Lane markings are 0.10 to 0.30 m wide; the filter answers to half and to twice its own width."""
LEAST_WIDTH_PX = 1.5
MOST_ROWS = 120
PER_ROW = 12
"""So many points of a row are kept, the clearest."""
NOISE = 5.0
"""What stands out by so many deviations of its row is a point."""
LEAST_LEVELS = 4.0
"""And by so many of 256 grey levels: what a night picture's own rounding does not reach."""
BOXES = ((-1.0, 1.0), (-4.0, -2.0), (2.0, 4.0))
"""The marking, and the road left and right of it, in halves of its width."""

REACH = 3.2
"""The centre of a point is looked for within so many halves of the width, on both sides."""

FloatArray = NDArray[np.float32]
Grey = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Rows of the picture that are looked at (R,), and half the width of a marking there in pixels (R,).

    `edges` are for each end of BOXES where in the flat running sums (R, W + 1) it lies, to a part; `inside`
    (R, W) where all boxes lie in the picture.
    """

    v: IntArray
    half_px: Array
    edges: tuple[tuple[IntArray, FloatArray], ...]
    inside: BoolArray


def rows_of(camera: Camera, pose: Rigid, near_m: float, far_m: float) -> Rows:
    """Return the rows in which the road from `near_m` to `far_m` ahead of the rear axle lies, amid them."""
    v = np.arange(camera.config.height_px)
    middle = np.array((np.full(len(v), camera.cx_px), v.astype(float)))
    points, _, meets = on_road(camera, pose, middle)
    wanted = (points[0] >= near_m) & (points[0] <= far_m)
    road, v = points[:, wanted].T, v[meets][wanted]
    aside = np.array((0.0, MARKING_M / 2.0, 0.0))
    ends = [project(camera, transform(pose, road + side * aside)) for side in (-1.0, 1.0)]
    width_px = np.abs(ends[0] - ends[1])[:, 0]
    fine = np.isfinite(width_px)
    v, half_px = v[fine], np.maximum(width_px[fine], LEAST_WIDTH_PX) / 2.0
    if len(v) > MOST_ROWS:
        some = np.linspace(0, len(v) - 1, MOST_ROWS).round().astype(int)
        v, half_px = v[some], half_px[some]
    return _with_edges(v, half_px, camera.config.width_px)


def _with_edges(v: IntArray, half_px: Array, width: int) -> Rows:
    first = np.arange(len(v))[:, None] * (width + 1)
    inside = np.ones((len(v), width), bool)
    edges = []
    for end in (end for box in BOXES for end in box):
        shift = end * half_px + 0.5
        whole = np.floor(shift).astype(int)
        place = np.arange(width) + whole[:, None]
        inside &= (place >= 0) & (place < width)
        edges.append(((first + place.clip(0, width - 1)), (shift - whole)[:, None].astype(np.float32)))
    return Rows(v=v, half_px=half_px, edges=tuple(edges), inside=inside)


def line_points(grey: Grey, rows: Rows) -> Array:
    """Return points (N, 2) in pixels where a marking's centre may be."""
    if not len(rows.v):
        return np.zeros((0, 2))
    levels = grey[rows.v].astype(np.float32)
    sums = np.pad(np.cumsum(levels, axis=1, dtype=np.float32), ((0, 0), (1, 0))).ravel()
    steps = np.pad(levels, ((0, 0), (0, 1))).ravel()
    up_to = [sums.take(place) + steps.take(place) * part for place, part in rows.edges]
    centre, left, right = (
        (stop - start) / ((box[1] - box[0]) * rows.half_px)[:, None].astype(np.float32)
        for start, stop, box in zip(up_to[::2], up_to[1::2], BOXES, strict=True)
    )
    both = np.where(rows.inside, centre - (left + right) / 2.0, 0.0)
    least = centre - np.maximum(left, right)
    few = both[:, ::4]
    noise = 1.4826 * np.median(np.abs(few - np.median(few, axis=1, keepdims=True)), axis=1)
    clear = rows.inside & (least > np.maximum(NOISE * noise, LEAST_LEVELS)[:, None])
    clear[:, 1:-1] &= (both[:, 1:-1] >= both[:, :-2]) & (both[:, 1:-1] > both[:, 2:])
    row, u = np.nonzero(clear)
    kept = _clearest(row, u, both[row, u], 2.0 * rows.half_px)
    row, u = row[kept], u[kept]
    return np.array((_centroids(levels, row, u, both, rows.half_px), rows.v[row]), dtype=np.float64).T


def _clearest(row: IntArray, u: IntArray, strength: FloatArray, apart_px: Array) -> IntArray:
    """Return which peaks stay: none beside a clearer one of its row, PER_ROW of a row at most."""
    kept: list[int] = []
    taken: dict[int, list[int]] = {}
    for place in np.argsort(-strength, kind="stable").tolist():
        one, at = int(row[place]), int(u[place])
        others = taken.setdefault(one, [])
        if len(others) < PER_ROW and all(abs(at - other) > apart_px[one] for other in others):
            others.append(at)
            kept.append(place)
    return np.sort(np.array(kept, dtype=np.int64))


def _centroids(levels: FloatArray, row: IntArray, u: IntArray, both: FloatArray, half_px: Array) -> Array:
    """Return the centre of what is brighter than the road around each peak, to a part of a pixel.

    Twice: the first one is where the second one looks around, so that a wide marking lies all in it.
    """
    first = _centroid(levels, row, u, both[row, u], half_px[row])
    return _centroid(levels, row, np.rint(first).astype(np.int64), both[row, u], half_px[row])


def _centroid(levels: FloatArray, row: IntArray, u: IntArray, strength: FloatArray, half_px: Array) -> Array:
    if not len(u):
        return np.zeros(0)
    reach = np.maximum(2, np.rint(REACH * half_px)).astype(int)[:, None]
    steps = np.arange(-int(reach.max()), int(reach.max()) + 1)
    at = (u[:, None] + steps).clip(0, levels.shape[1] - 1)
    near = levels[row[:, None], at]
    ends = [levels[row, (u + side * reach[:, 0]).clip(0, levels.shape[1] - 1)] for side in (-1, 1)]
    road = np.minimum(*ends) + 0.25 * np.maximum(strength, 0.0)
    over = np.where(np.abs(steps) <= reach, np.maximum(near - road[:, None], 0.0), 0.0)
    total = over.sum(axis=1)
    return np.where(total > 0.0, u + (over * steps).sum(axis=1) / np.where(total > 0.0, total, 1.0), u)
