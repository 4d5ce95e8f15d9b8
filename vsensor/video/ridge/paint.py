r"""Paint on the road: places of the grid that are lighter than the road on both sides of them.

level     ____              response = centre - mean of the sides, none where one side is as light
         /    \             edges    = where the level is halfway between paint and that side's road
________/      \________    centre   = middle of the edges: no side's shade moves it
side  ..centre..  side
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vsensor.image import import_opencv
from vsensor.types import Array, BoolArray, IntArray
from vsensor.video.ridge.config import RidgeConfig
from vsensor.video.ridge.ground import Ground, Levels

GUARD_M, SIDE_M = 0.04, 0.15
"""Road beside a marking begins so far from its edge, and so much of it is looked at."""
GUARD_PX, SIDE_PX = 0.8, 1.2
"""The same in pixels, where the lens blurs the edge by more."""
ONE_SIDED = 0.4
"""A side may be lighter than the other: of the mean response this part must be left on each."""
APART_M = 0.1
"""Of two responses nearer than this only the stronger one is a stripe."""
LEAST_LEVELS = 2.0
"""A stripe is at least so many grey levels lighter than the road: the picture knows whole ones."""
BLUR_PX2 = 0.6
"""Variance of what lens and interpolation mix of rows of pixels. A stripe thinner than a pixel is brighter in
the nearer rows, where it is wider, so it seems to be where it is there: farther aside by this over the square
of the number of rows to the horizon (as measured: 10 mm at 38 m, 355 x 288 pixels)."""
WIDEST_M, THINNEST_M = 0.5, 0.05
RUN_M, RUN_ROWS, RUN_ASIDE_M = 0.8, 7, 0.1
"""A stripe of paint is so long at least, as far as that fits into so many rows, and goes no farther aside."""
NOISE_EVERY = 3
"""Of so many places one is looked at for the noise."""
MOST_POINTS = 1500
"""A picture of more has no road in it; the strongest are enough."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Middles of stripes in rows of the grid (N,): `row`, `ahead_m`, `aside_m` as of a level body.

    `width_m` between the edges, `strength` the response over the least that counts (1 and more), `column`.
    """

    row: IntArray
    column: IntArray
    ahead_m: Array
    aside_m: Array
    width_m: Array
    strength: Array

    def only(self, chosen: BoolArray | IntArray) -> "Points":
        """Return some of the points."""
        return Points(
            row=self.row[chosen],
            column=self.column[chosen],
            ahead_m=self.ahead_m[chosen],
            aside_m=self.aside_m[chosen],
            width_m=self.width_m[chosen],
            strength=self.strength[chosen],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Stencil:
    """The filter of rows `first` to `last`, in columns: half a centre, and where a side begins and ends."""

    first: int
    last: int
    half: int
    begin: int
    end: int


def stencils(config: RidgeConfig, ground: Ground) -> tuple[Stencil, ...]:
    """Return the filter of each run of rows; it is the same length on the road, wider where pixels are."""
    across, step = ground.across_m, ground.step_m
    half = np.rint(np.maximum(0.5 * config.paint_m, 0.5 * across) / step).astype(int)
    begin = half + 1 + np.rint(np.maximum(GUARD_M, GUARD_PX * across) / step).astype(int)
    end = begin + np.rint(np.maximum(SIDE_M, SIDE_PX * across) / step).astype(int)
    sizes = np.column_stack([half, begin, end])
    cuts = [0, *(np.flatnonzero((np.diff(sizes, axis=0) != 0).any(axis=1)) + 1).tolist(), len(sizes)]
    return tuple(
        Stencil(first=a, last=b, half=int(sizes[a, 0]), begin=int(sizes[a, 1]), end=int(sizes[a, 2]))
        for a, b in pairwise(cuts)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """What the filter makes of the levels: `value` (K, M), the road's levels on both sides (K, M).

    `noise` (K,) is the deviation of the value where there is no paint.
    """

    value: Levels
    right: Levels
    left: Levels
    noise: Array


def respond(filters: tuple[Stencil, ...], ground: Ground, levels: Levels) -> Response:
    """Return how much lighter each place is than the road on both its sides; 0 where that is not seen."""
    rows, columns = levels.shape
    sums = np.zeros((rows, columns + 1))
    np.cumsum(levels, axis=1, out=sums[:, 1:])
    value, right, left = (np.zeros((rows, columns), np.float32) for _ in range(3))
    noise = np.zeros(rows)
    for stencil in filters:
        part, reach = sums[stencil.first : stencil.last], stencil.end
        if columns <= 2 * reach:
            continue
        at = slice(reach, columns - reach)

        def mean(begin: int, end: int, part: Array = part, reach: int = reach) -> Array:
            """Return the mean of columns j + begin to j + end, its end left out."""
            width = columns - 2 * reach
            high, low = part[:, reach + end :][:, :width], part[:, reach + begin :][:, :width]
            return (high - low) / (end - begin)

        centre = mean(-stencil.half, stencil.half + 1)
        low, high = mean(-stencil.end, 1 - stencil.begin), mean(stencil.begin, stencil.end)
        found = centre - 0.5 * (low + high)
        seen = ground.seen[stencil.first : stencil.last]
        whole = seen[:, : columns - 2 * reach] & seen[:, 2 * reach :]
        noise[stencil.first : stencil.last] = _noise(found, whole)
        found[centre - np.maximum(low, high) < ONE_SIDED * found] = 0.0
        value[stencil.first : stencil.last, at] = found
        right[stencil.first : stencil.last, at], left[stencil.first : stencil.last, at] = low, high
        value[stencil.first : stencil.last, at][~whole] = 0.0
    return Response(value=value, right=right, left=left, noise=noise)


def _noise(found: Array, whole: BoolArray) -> Array:
    """Return the deviation of a response in each row, of its median: paint is the smaller part of a road."""
    size = np.where(whole, np.abs(found), np.inf)[:, ::NOISE_EVERY]
    size.sort(axis=1)
    middle = whole[:, ::NOISE_EVERY].sum(axis=1) // 2
    return np.asarray(1.4826 * np.where(middle > 2, size[np.arange(len(size)), middle], 0.0))


def find(config: RidgeConfig, ground: Ground, filters: tuple[Stencil, ...], levels: Levels) -> Points:
    """Return the stripes of every row of the grid."""
    cv2 = import_opencv("the video's lines")
    response = respond(filters, ground, levels)
    least = _least(config, response)
    reach = 2 * round(APART_M / ground.step_m) + 1
    highest = np.asarray(cv2.dilate(response.value, np.ones((1, reach), np.uint8)))
    row, column = np.nonzero((response.value >= highest) & (response.value > least))
    paint = _in_a_run(ground, row, column, response.value.shape)
    row, column = row[paint], column[paint]
    strength = response.value[row, column] / least[row, column]
    if len(row) > MOST_POINTS:
        kept = np.sort(np.argpartition(-strength, MOST_POINTS)[:MOST_POINTS])
        row, column, strength = row[kept], column[kept], strength[kept]
    aside, width = _edges(ground, levels, response, row, column)
    aside *= 1.0 - BLUR_PX2 * (ground.along_m[row] / ground.ahead_m[row]) ** 2
    points = Points(
        row=row,
        column=column,
        ahead_m=ground.ahead_m[row],
        aside_m=aside,
        width_m=width,
        strength=strength.astype(np.float64),
    )
    across = ground.across_m[row]
    return points.only(np.isfinite(aside) & (width > THINNEST_M) & (width < WIDEST_M + across))


def _in_a_run(ground: Ground, row: IntArray, column: IntArray, shape: tuple[int, ...]) -> BoolArray:
    """Return which stripes (N,) go on in the rows around them, as paint does and specks do not."""
    cv2 = import_opencv("the video's lines")
    hits = np.zeros(shape, np.uint8)
    hits[row, column] = 1
    wide = np.asarray(cv2.dilate(hits, np.ones((1, 2 * round(RUN_ASIDE_M / ground.step_m) + 1), np.uint8)))
    rows = np.asarray(cv2.boxFilter(wide, cv2.CV_16S, (1, RUN_ROWS), normalize=False))
    least = np.clip(RUN_M / (ground.ahead_m * (ground.growth - 1.0)), 2.0, 0.6 * RUN_ROWS)
    return np.asarray(rows[row, column] >= least[row])


def _least(config: RidgeConfig, response: Response) -> Levels:
    """Return the response (K, M) that paint has at least: above the row's noise, and no faint stain."""
    road = 0.5 * (response.left + response.right)
    least = np.maximum(config.least_contrast * road, (config.noise_factor * response.noise)[:, None])
    return np.asarray(np.maximum(least, LEAST_LEVELS), np.float32)


def _edges(
    ground: Ground, levels: Levels, response: Response, row: IntArray, column: IntArray
) -> tuple[Array, Array]:
    """Return middle (from the camera's foot) and width of stripes (N,) in metres; NaN without two edges."""
    reach = round(0.5 * (WIDEST_M + 0.2) / ground.step_m)
    offsets = np.arange(-reach, reach + 1)
    columns = np.clip(column[:, None] + offsets, 0, levels.shape[1] - 1)
    profile = levels[row[:, None], columns].astype(np.float64)
    near = np.abs(offsets) <= 3
    top = profile[:, near].max(axis=1)
    low = _crossing(profile[:, reach::-1], 0.5 * (top + response.right[row, column]))
    high = _crossing(profile[:, reach:], 0.5 * (top + response.left[row, column]))
    middle = ground.aside_m[column] + 0.5 * (high - low) * ground.step_m
    return middle, (high + low) * ground.step_m


def _crossing(profile: Array, level: Array) -> Array:
    """Return where profiles (N, P) first fall below a level (N,), in samples; NaN where they do not."""
    below = profile < level[:, None]
    below[:, 0] = False
    first = below.argmax(axis=1)
    at = np.arange(len(profile))
    before, after = profile[at, np.maximum(first - 1, 0)], profile[at, first]
    part = np.divide(before - level, before - after, out=np.zeros(len(at)), where=before > after)
    return np.where(first > 0, first - 1 + np.clip(part, 0.0, 1.0), np.nan)
