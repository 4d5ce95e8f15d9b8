r"""How much of every pixel a polygon covers: the exact area, not a number of samples.

Each edge adds, in every cell that it crosses, the area between itself and the cell's right side; summed
from left to right that is the covered area. Edges carry a weight, so polygons may share edges, overlap,
or be more or less opaque: what comes out is the sum of weight times area.

    +----+----+----+       dy: the part of the row's height that the edge crosses in this cell
    |    | \  |    |       f:  mean place of the edge in the cell, 0 left to 1 right
    |    |  \ | 1  |       this cell gets dy (1 - f), all cells to its right get dy
    +----+----+----+

OpenCV's fillPoly also draws the outline: a stripe 2 px wide came out 3.05 px wide, antialiased 3.50, at
four times the resolution 2.26. Far stripes would be too bright, and their edges, which are measured, wrong.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vsensor.types import Array, IntArray

FloatImage = NDArray[np.floating[Any]]


class Edges(NamedTuple):
    """Directed edges of polygons, (N,) each: from (x0, y0) to (x1, y1), pixels with centres at integers.

    Seen in the image, polygons turn clockwise for a positive `weight`. All finite.
    """

    x0: Array
    y0: Array
    x1: Array
    y1: Array
    weight: Array


class Patch(NamedTuple):
    """A part of the image: `values` (h, w), the first row and column in the image."""

    top: int
    left: int
    values: FloatImage

    def of(self, image: FloatImage) -> FloatImage:
        """Return the view of an image (H, W) or (H, W, C) that the patch lies on."""
        height, width = self.values.shape
        return image[self.top : self.top + height, self.left : self.left + width]


def chained(*parts: Edges) -> Edges:
    """Return all edges in one."""
    return Edges(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def between(start: Array, stop: Array, weight: Array) -> Edges:
    """Return the edges from pixels (N, 2) to others."""
    return Edges(start[:, 0], start[:, 1], stop[:, 0], stop[:, 1], weight)


def outline(pixels: Array, weight: float = 1.0) -> Edges:
    """Return the edges of one polygon (N, 2)."""
    return between(pixels, np.roll(pixels, -1, axis=0), np.full(len(pixels), weight))


def coverage(edges: Edges, width_px: int, height_px: int) -> Patch:
    """Return the sum of weight times covered area, for the part of the image where there is any."""
    x0, y0, x1, y1, weight = _upright(edges)
    y0, y1, x0, x1 = _cut(y0, y1, x0, x1, height_px)
    is_beside = y1 > y0
    adds = is_beside & (np.minimum(x0, x1) < width_px)  # an edge right of the image covers nothing in it
    if not adds.any():
        return Patch(0, 0, np.zeros((0, 0), dtype=np.float32))
    rightmost = max(x0[is_beside].max(), x1[is_beside].max())
    x0, y0, x1, y1, weight = (values[adds] for values in (x0, y0, x1, y1, weight))
    top, bottom = int(y0.min()), int(np.ceil(y1.max()))
    left = int(np.clip(min(x0.min(), x1.min()), 0, width_px - 1))
    right = int(np.clip(np.ceil(rightmost), left + 1, width_px))
    row, xa, xb, dy = _rows(x0, y0 - top, x1, y1 - top, weight)
    values = _deposited(row, xa - left, xb - left, dy, right - left, bottom - top)
    return Patch(top, left, values)


def _upright(edges: Edges) -> Edges:
    """Return the edges downwards, the weight's sign turned where one went down; origin at the corner."""
    x0, y0, x1, y1, weight = edges
    up = y1 < y0
    return Edges(
        np.where(up, x1, x0) + 0.5,
        np.where(up, y1, y0) + 0.5,
        np.where(up, x0, x1) + 0.5,
        np.where(up, y0, y1) + 0.5,
        np.where(up, weight, -weight),
    )


def _cut(y0: Array, y1: Array, x0: Array, x1: Array, height: float) -> tuple[Array, Array, Array, Array]:
    """Return the edges cut to the rows of the image."""
    slope = (x1 - x0) / np.where(y1 > y0, y1 - y0, 1.0)
    low, high = y0.clip(0.0, height), y1.clip(0.0, height)
    return low, high, x0 + (low - y0) * slope, x1 + (high - y1) * slope


def _parts(low: Array, high: Array) -> tuple[IntArray, IntArray, Array, Array]:
    """Return, for intervals cut at the integers, the interval, the integer below, and both ends."""
    first = np.floor(low).astype(np.int64)
    count = np.maximum(np.ceil(high).astype(np.int64) - first, 1)
    which = np.repeat(np.arange(len(low)), count)
    cell = first[which] + np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    return which, cell, np.maximum(low[which], cell), np.minimum(high[which], cell + 1)


def _rows(x0: Array, y0: Array, x1: Array, y1: Array, weight: Array) -> tuple[IntArray, Array, Array, Array]:
    """Return the edges cut at the rows: row, x at both ends (lower first), weighted height."""
    slope = (x1 - x0) / (y1 - y0)
    which, row, low, high = _parts(y0, y1)
    xa = x0[which] + (low - y0[which]) * slope[which]
    xb = x0[which] + (high - y0[which]) * slope[which]
    return row, np.minimum(xa, xb), np.maximum(xa, xb), (high - low) * weight[which]


def _deposited(row: IntArray, xa: Array, xb: Array, dy: Array, width: int, height: int) -> FloatImage:
    """Return the summed areas (height, width) of pieces that lie in one row each, x from xa to xb.

    What lies left of the image covers it from its first column on; what lies right of it does not.
    """
    run = xb - xa
    per_px = dy / np.where(run > 0.0, run, 1.0)
    low, high = xa.clip(0.0, width), xb.clip(0.0, width)
    outside = np.where(run > 0.0, (xb.clip(max=0.0) - xa.clip(max=0.0)) * per_px, 0.0)
    which, column, start, stop = _parts(low, high)
    is_steep = run[which] <= 0.0
    part = np.where(is_steep, dy[which], (stop - start) * per_px[which])
    place = 0.5 * (start + stop) - column
    cell = row[which] * (width + 2) + column
    cells = np.concatenate([cell, cell + 1, row * (width + 2)])
    deposits = np.concatenate([part * (1.0 - place), part * place, outside])
    total = np.bincount(cells, deposits, minlength=height * (width + 2)).reshape(height, width + 2)
    return np.cumsum(total, axis=1)[:, :width].astype(np.float32)
