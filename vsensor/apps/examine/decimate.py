"""Fewer points for a plot, none of the peaks lost: the first, last, least and largest value of each bin."""

import numpy as np

from vsensor.types import Array, IntArray

BINS = 1500
"""About as many as a plot has pixels across."""


def decimated(x: Array, y: Array, low: float = -np.inf, high: float = np.inf, bins: int = BINS) -> IntArray:
    """Return the places of points (K,), in order of x, that show (x, y) (N,) from `low` to `high`.

    Of each of `bins` equal stretches of x first, last, least and largest y; a stretch without a value leaves
    a gap: its first place, where y is NaN. Points whose x is NaN are left out; so few that nothing is gained
    are all there.
    """
    order: IntArray = np.argsort(x, kind="stable")
    order = order[np.isfinite(x[order]) & (x[order] >= low) & (x[order] <= high)]
    if len(order) <= 4 * bins:
        return order
    first, last = x[order[0]], x[order[-1]]
    part = (x[order] - first) / (last - first) if last > first else np.zeros(len(order))
    edge = np.flatnonzero(np.diff(np.minimum((part * bins).astype(np.int64), bins - 1), prepend=-1))
    values = y[order]
    known = np.isfinite(values)
    least = _first_of(np.where(known, values, np.inf), edge, np.minimum)
    largest = _first_of(np.where(known, values, -np.inf), edge, np.maximum)
    ends = np.append(edge[1:], len(order)) - 1
    kept = np.unique(np.concatenate([edge, least, largest, ends]))
    places: IntArray = order[kept]
    return places


def _first_of(values: Array, edge: IntArray, reduce: np.ufunc) -> IntArray:
    """Return the place of each bin's extreme; bins begin at `edge`."""
    best = reduce.reduceat(values, edge)
    counts = np.diff(np.append(edge, len(values)))
    hits = np.flatnonzero(values == np.repeat(best, counts))
    places: IntArray = hits[np.searchsorted(hits, edge)]
    return places
