"""Quantiles of binned errors, of their size and signed, and the intervals that correlated rows leave.

A cell's rows are far from independent. What counts is how much the share of errors below a quantile
varies from block to block of driving: with K of N errors of a block below it,

    var(share) = sum (K - p N)^2 / (sum N)^2      (the block bootstrap's variance, its limit of many draws)
    effective count = p (1 - p) / var(share)

An effective count n has a binomial interval for the share, and the quantiles at its ends are the interval of
the quantile. Few blocks know their variance badly: it is widened as Student's t. Its degrees of freedom are
those of squares that are not alike (Satterthwaite): what a block adds to the variance grows as N^2, which
leaves (sum N^2)^2 / sum N^4 of them; where N lies evenly between none and most that is 0.74 of the effective
number of blocks (sum N)^2 / sum N^2. One goes for the share itself.
"""

import numpy as np
from scipy import special

from vsensor.field.tune.grid import SIZES, signed_edges, size_edges
from vsensor.types import Array

CONFIDENCE = 0.95
FEWEST_BLOCKS = 3.0
ALIKE = 0.74
"""Degrees of freedom of a variance from blocks of unequal size, over their effective number: 20 / 27."""


def sizes_of(counts: np.ndarray) -> np.ndarray:
    """Return the counts of sizes (..., SIZES) of signed ones (..., 2 SIZES)."""
    return np.asarray(counts[..., SIZES:] + counts[..., SIZES - 1 :: -1])


def size_quantiles(counts: Array, levels: Array) -> Array:
    """Return quantiles of the size in units of the scale (L, ...), of counts (..., SIZES); NaN of nothing."""
    return _quantiles(counts, levels, size_edges())


def signed_quantiles(counts: Array, levels: Array) -> Array:
    """Return signed quantiles in units of the scale (S, ...), of counts (..., 2 SIZES); NaN of nothing."""
    return _quantiles(counts, levels, signed_edges())


def _quantiles(counts: Array, levels: Array, edges: Array) -> Array:
    """Interpolate linearly within bins; `levels` (L,) or (L, ...) like the counts without their bins."""
    flat = counts.reshape(-1, counts.shape[-1])
    wanted = np.broadcast_to(
        levels.reshape(len(levels), *levels.shape[1:], *([1] * (counts.ndim - levels.ndim))),
        (len(levels), *counts.shape[:-1]),
    ).reshape(len(levels), -1)
    found = np.full((len(levels), len(flat)), np.nan)
    for place, row in enumerate(flat):
        below = np.concatenate([[0.0], np.cumsum(row)])
        if below[-1] > 0.0:
            steps = np.flatnonzero(row > 0.0)
            x = np.append(edges[steps], edges[steps[-1] + 1])
            y = np.append(below[steps], below[-1]) / below[-1]
            bins = np.clip(np.searchsorted(y, wanted[:, place], side="right") - 1, 0, len(steps) - 1)
            part = (wanted[:, place] - y[bins]) / (y[bins + 1] - y[bins])
            width = edges[steps + 1] - edges[steps]  # an empty bin between two full ones holds nothing
            found[:, place] = x[bins] + np.clip(part, 0.0, 1.0) * width[bins]
    return found.reshape(len(levels), *counts.shape[:-1])


def effective_count(levels: Array, variance: Array, blocks: Array) -> Array:
    """Return the effective count (L, ...) of shares with that variance from so many effective blocks."""
    from scipy.stats import t

    p = levels.reshape(len(levels), *([1] * (variance.ndim - 1)))
    free = np.maximum(ALIKE * blocks - 1.0, 1.0)
    widening = (t.ppf(0.5 + 0.5 * CONFIDENCE, free) / special.ndtri(0.5 + 0.5 * CONFIDENCE)) ** 2
    few = blocks / np.maximum(blocks - 1.0, 0.5)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(p * (1.0 - p) / (variance * widening * few))


def share_interval(levels: Array, effective: Array) -> tuple[Array, Array]:
    """Return the 95 % interval (L, ...) of the share of n errors that lie below the true quantile of a level.

    That number is binomial with the effective count n: normal, corrected for its skewness (Cornish, Fisher).
    """
    p = levels.reshape(len(levels), *([1] * (effective.ndim - 1)))
    count = np.clip(np.nan_to_num(effective, nan=0.0, posinf=1e12), 1e-3, 1e12)
    z = special.ndtri(0.5 + 0.5 * CONFIDENCE)
    half = z * np.sqrt(p * (1.0 - p) / count)
    skew = (z**2 - 1.0) / 6.0 * (1.0 - 2.0 * p) / count
    return np.clip(p + skew - half, 0.0, 1.0), np.clip(p + skew + half, 0.0, 1.0)
