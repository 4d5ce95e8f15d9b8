"""Correlation time and length of the error, from products of its normal scores.

time   rho(tau) = a exp(-tau / T): the slope of log rho over the lags where rho is large enough to know;
       a below 1 is what is white, as rounding on the bus
range  rho(d) = exp(-d^2 / (2 length^2)) between two ranges of one image
"""

import numpy as np

from vsensor.field.tune.blocks import LAGS
from vsensor.types import Array

LEAST_RHO = 0.2
LEAST_PAIRS = 50


def time_curve(sums: np.ndarray, period_s: float) -> tuple[Array, Array]:
    """Return lags (K,) in s and correlation (K,), of sums (lags, 3, R) over all ranges; NaN unknown."""
    product, before, after = sums.sum(axis=-1).T
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.array(LAGS) * period_s, product / np.sqrt(before * after)


def correlation_time_s(sums: np.ndarray, period_s: float) -> float:
    """Return T in s, at least a tenth of the period; half a period where already one lag knows nothing."""
    lags, rho = time_curve(sums, period_s)
    known = np.isfinite(rho)
    below = np.flatnonzero(known & (rho < LEAST_RHO))
    use = known & (np.arange(len(rho)) < (below[0] if len(below) else len(rho)))
    if use.sum() < 2:
        first = rho[0] if known.any() and rho[0] > 0.0 else 0.0
        return float(-lags[0] / np.log(max(first, 1e-4))) if first < 1.0 else float(lags[-1])
    # d(log rho) = d rho / rho, and the noise of rho falls with its size: weights rho^2 suit both
    weight = rho[use] ** 2
    slope = _slope(lags[use], np.log(rho[use]), weight)
    return float(-1.0 / slope) if slope < -1e-6 else 1e3


def _slope(x: Array, y: Array, weight: Array) -> float:
    mean_x, mean_y = np.average(x, weights=weight), np.average(y, weights=weight)
    return float(np.sum(weight * (x - mean_x) * (y - mean_y)) / np.sum(weight * (x - mean_x) ** 2))


def range_curve(sums: np.ndarray, range_m: Array) -> tuple[Array, Array]:
    """Return distances (K,) in m and correlation (K,) of all pairs of ranges that are known, of (3, R, R)."""
    product, square, pairs = sums
    with np.errstate(invalid="ignore", divide="ignore"):
        rho = product / np.sqrt(square * square.T)
    distance = np.abs(range_m[:, None] - range_m[None, :])
    use = (pairs >= LEAST_PAIRS) & np.isfinite(rho) & (distance > 0.0)
    return distance[use], rho[use]


def correlation_length_m(sums: np.ndarray, range_m: Array) -> float:
    """Return the length in m of the squared-exponential that fits best where rho > 0.2."""
    distance, rho = range_curve(sums, range_m)
    use = (rho > LEAST_RHO) & (rho < 1.0)
    if not use.any():
        step = float(np.diff(range_m).min()) if len(range_m) > 1 else 1.0
        return 1e3 if len(rho) and rho.min() >= 1.0 else step
    # through the origin: -log rho = d^2 / (2 length^2)
    weight, x = rho[use] ** 2, distance[use] ** 2
    slope = np.sum(weight * x * -np.log(rho[use])) / np.sum(weight * x * x)
    return float(min(1.0 / np.sqrt(2.0 * max(slope, 1e-12)), 1e3))
