"""Which lines a picture's points lie on: lines of one road run side by side, so they are found together.

Of each heading, bend and pitch that a road may have, the points' offsets from it are counted in bins across.
Where it is the road's, the points of each line fall into one bin or two; the fullest bins (their sum, each to
the power of 1.5) say which it is. What runs in no line of the road, as arrows, tar, kerbs and cars, is spread
over all bins.
"""

from dataclasses import dataclass
from math import radians

import numpy as np

from vsensor.types import Array
from vsensor.video.ridge.config import RidgeConfig
from vsensor.video.ridge.ground import Ground
from vsensor.video.ridge.paint import Points

BIN_M = 0.05
LANES_APART_M = 1.2
"""Of lines nearer to each other than this only the stronger one helps to find the road's shape: which of
the two a point belongs to is known once the shape is."""
STRIPES_APART_M = 0.2
"""With the shape known, two lines are so far apart at least: the stripes of a double marking."""
TOGETHER = 0.3
"""Stripes of a double marking are seen side by side: in this part of the rows of the one with fewer."""
STRONG = 3.0
"""A point's vote grows with its strength up to this."""
SLOPES = np.linspace(-0.16, 0.16, 17)
BENDS_PER_M = np.array([0.0, 0.003, -0.003, 0.008, -0.008, 0.018, -0.018, 0.035, -0.035])
PITCHES_RAD = np.radians([0.0, 0.4, -0.4, 0.8, -0.8, 1.2, -1.2])
FINE_SLOPES = np.array([0.0, 0.005, -0.005, 0.01, -0.01])
FINE_BENDS_PER_M = np.array([0.0, 0.001, -0.001, 0.002, -0.002])
MOST_PITCH = 3.5
"""A body pitches by so many of its standard deviations at most."""
UNLIKELY = 0.03
"""A pitch of one standard deviation takes this part of a shape's score, more the square of it."""
KNOWN = 1.1
"""A shape near the last picture's is taken before another one that is as good."""
MOST_LINES = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """How a road runs from below the camera on, and the body's pitch (nose down positive)."""

    slope: float = 0.0
    bend_per_m: float = 0.0
    pitch_rad: float = 0.0


def pitched(ground: Ground, ahead_m: Array, aside_m: Array, pitch_rad: Array | float) -> tuple[Array, Array]:
    """Return where on the road places really are that a level body would see at `ahead_m`, `aside_m`."""
    s, c, h = np.sin(pitch_rad), np.cos(pitch_rad), ground.height_m
    scale = h / np.maximum(ahead_m * s + h * c, 0.01 * h)
    return scale * (ahead_m * c - h * s), scale * aside_m


def votes(points: Points) -> Array:
    """Return each point's vote (N,)."""
    return np.minimum(points.strength, STRONG) / STRONG


def search(
    config: RidgeConfig, ground: Ground, points: Points, known: Shape | None, rest_rad: float
) -> tuple[Shape, Array]:
    """Return the road's shape and the lines (L, 2) on it: offset at the camera, votes; strongest first.

    `known` is the last picture's shape, `rest_rad` the body's pitch at rest.
    """
    start = known or Shape(pitch_rad=rest_rad)
    weight = votes(points)
    coarse = _grid(SLOPES, BENDS_PER_M, np.array([start.pitch_rad]))
    if known is not None:
        coarse = np.vstack([[known.slope, known.bend_per_m, known.pitch_rad], coarse])
    best = _best(config, ground, points, weight, coarse, rest_rad, KNOWN if known else 1.0)
    fine = best + _grid(
        0.6 * (SLOPES[1] - SLOPES[0]) * np.array([0, 1, -1]), FINE_BENDS_PER_M[:3], PITCHES_RAD
    )
    most_rad = MOST_PITCH * radians(config.pitch_std_deg)
    fine[:, 2] = np.clip(fine[:, 2], rest_rad - most_rad, rest_rad + most_rad)
    best = _best(config, ground, points, weight, fine, rest_rad)
    best = _best(
        config, ground, points, weight, best + _grid(FINE_SLOPES, FINE_BENDS_PER_M, np.zeros(1)), rest_rad
    )
    counted = _counted(config, ground, points, weight, best[None])[0]
    shape = Shape(slope=float(best[0]), bend_per_m=float(best[1]), pitch_rad=float(best[2]))
    return shape, _peaks(config, counted, LANES_APART_M)


def stripes(config: RidgeConfig, points: Points, offset_m: Array) -> Array:
    """Return the offsets (L,) of all lines, stripes apart, of points at `offset_m` (N,)."""
    bins = _bins(config)
    at = np.clip(offset_m / BIN_M + 0.5 * bins, 0.0, bins - 1.001)
    low = at.astype(np.int64)
    weight, part = votes(points), at - low
    counted = np.bincount(low, weight * (1.0 - part), bins).astype(np.float64)
    counted += np.bincount(low + 1, weight * part, bins)
    counted[[0, -2, -1]] = 0.0
    kept: list[float] = []
    for offset, _ in _peaks(config, counted, STRIPES_APART_M).tolist():
        if all(_are_two(config, points, offset_m, offset, other) for other in kept):
            kept.append(offset)
    return np.array(kept)


def _are_two(config: RidgeConfig, points: Points, offset_m: Array, one_m: float, other_m: float) -> bool:
    """Return whether two peaks are two lines, not parts of one that the shape does not follow."""
    if abs(one_m - other_m) > config.double_m:
        return True
    rows = [set(points.row[np.abs(offset_m - at) < STRIPES_APART_M / 2].tolist()) for at in (one_m, other_m)]
    return len(rows[0] & rows[1]) > TOGETHER * min(len(rows[0]), len(rows[1]))


def _grid(slopes: Array, bends: Array, pitches: Array) -> Array:
    """Return all combinations (H, 3)."""
    return np.stack(np.meshgrid(slopes, bends, pitches, indexing="ij"), axis=-1).reshape(-1, 3)


def _best(
    config: RidgeConfig,
    ground: Ground,
    points: Points,
    weight: Array,
    shapes: Array,
    rest_rad: float,
    first: float = 1.0,
) -> Array:
    """Return the shape (3,) of the fullest bins; the score of the first one is raised by a factor."""
    counted = _counted(config, ground, points, weight, shapes)
    near = _blurred(counted)
    score = (near * np.sqrt(near)).sum(axis=1)
    pitched_by = (shapes[:, 2] - rest_rad) / radians(config.pitch_std_deg)
    score *= 1.0 - UNLIKELY * np.minimum(pitched_by * pitched_by, 6.0)
    score[0] *= first
    return np.asarray(shapes[int(score.argmax())])


def _counted(config: RidgeConfig, ground: Ground, points: Points, weight: Array, shapes: Array) -> Array:
    """Return how many votes fall into each bin across (H, B), each shared by the two nearest bins."""
    slope, bend, pitch = (column[:, None] for column in shapes.T)
    if np.ptp(pitch) == 0.0:
        pitch = pitch[:1]
    ahead, aside = pitched(ground, points.ahead_m, points.aside_m, pitch)
    offset = aside - ahead * (slope + 0.5 * bend * ahead)
    bins = _bins(config)
    at = offset / BIN_M + 0.5 * bins
    np.clip(at, 0.0, bins - 1.001, out=at)
    low = at.astype(np.int64)
    part = at - low
    low += bins * np.arange(len(shapes))[:, None]
    size = len(shapes) * bins
    counted = np.bincount(low.ravel(), (weight * (1.0 - part)).ravel(), size)
    counted += np.bincount(low.ravel() + 1, (weight * part).ravel(), size + 1)[:size]
    counted = counted.reshape(len(shapes), bins)
    counted[:, [0, -2, -1]] = 0.0
    return np.asarray(counted)


def _blurred(counted: Array) -> Array:
    """Return votes (H, B) shared with the neighbours: a line scores the same wherever bins begin."""
    blurred = 3.0 * counted
    for shift, weight in ((1, 2.0), (2, 1.0)):
        blurred[:, shift:] += weight * counted[:, :-shift]
        blurred[:, :-shift] += weight * counted[:, shift:]
    return np.asarray(blurred / 9.0)


def _bins(config: RidgeConfig) -> int:
    return 2 * round(config.aside_m / BIN_M) + 2


def _peaks(config: RidgeConfig, counted: Array, apart_m: float) -> Array:
    """Return offset and votes (L, 2) of the fullest bins with their neighbours, strongest first."""
    three = np.convolve(counted, [1.0, 1.0, 1.0, 1.0, 1.0], "same")
    bins, apart = len(counted), round(apart_m / BIN_M)
    found = []
    for _ in range(MOST_LINES):
        at = int(three.argmax())
        if three[at] < 0.4 * config.least_rows:
            break
        near = slice(max(at - 2, 0), at + 3)
        votes_near = counted[near]
        middle = float((np.arange(bins)[near] * votes_near).sum() / max(float(votes_near.sum()), 1e-9))
        found.append(((middle - 0.5 * bins) * BIN_M, float(three[at])))
        three[max(at - apart, 0) : at + apart + 1] = 0.0
    return np.array(found).reshape(-1, 2)
