"""Polynomials through line points: least squares by QR on a scaled abscissa, any order 1 to 9.

x in [x_min, x_max] ──► t = (x - centre) / half in [-1, 1], basis T_k(t) (Chebyshev: condition
below 10 at any order, where raw powers over 200 m have 1e7 at order 3 and 1e22 at order 9)
coefficients and covariance ──► powers of x, by the binomial theorem, in closed form
"""

from itertools import pairwise
from math import comb, sqrt
from typing import Annotated, Literal

import msgspec
import numpy as np
from scipy.linalg import lapack

from vsensor.schema import Config
from vsensor.types import Array, Fit, LinePoints, frozen

MAX_ORDER = 9
UNRESOLVED = 1e-9
"""A basis polynomial whose part outside the lower ones is below this fraction is not resolved."""
NEAR_M = 5.0
"""Weighting "range": the standard deviation grows as hypot(5 m, x), as the pixel grid's does."""
SMOOTH_M = 0.02
"""Misfit that smooth errors of the error model leave, which no shorter fit makes smaller."""
NEAREST_M = 15.0
"""Nobody reads y at x = 0 of a line that begins farther ahead or is shorter than twice the way to it."""
ONE_THREAD = 8000
"""Entries of a matrix that OpenBLAS (from 8192) gives to several threads: on a busy machine that
costs 5 ms a fit, and the last digits then depend on the number of cores."""

_BINOMIAL = np.array([[comb(i, j) for j in range(MAX_ORDER + 1)] for i in range(MAX_ORDER + 1)], float)
_POWER = np.maximum(np.subtract.outer(np.arange(MAX_ORDER + 1), np.arange(MAX_ORDER + 1)), 0)
_UPPER = np.triu(np.ones((MAX_ORDER + 2, MAX_ORDER + 2)))


def _chebyshev_to_powers() -> Array:
    """Return (10, 10): column k holds the coefficients of T_k(t) by powers of t, whole numbers."""
    table = np.zeros((MAX_ORDER + 1, MAX_ORDER + 1))
    table[0, 0] = table[1, 1] = 1.0
    for k in range(2, MAX_ORDER + 1):
        table[1:, k] = 2.0 * table[:-1, k - 1]
        table[:, k] -= table[:, k - 2]
    return table


_CHEBYSHEV = _chebyshev_to_powers()


class LaneFitConfig(Config, frozen=True, kw_only=True):
    """How lines are fitted.

    `order` of the polynomial; fewer points, or points too close together for it, lower it. It is also
    lowered until the noise of the points (`sigma_y_m`, the pixel grid) leaves y at the vehicle, which
    is what the bus carries, a standard deviation of at most `max_std_at_ego_m`: a cubic through one
    dash at 60 m would pass the vehicle at 60 m, too. Exact points keep the order.
    `weighting`: "uniform"; "sigma" by each point's own standard deviation; "range" by one that grows
    with the range. A line of fewer points or shorter than `min_length_m` is no line, nor is one that
    no road has: `max_offset_m`, `max_slope`, `max_curvature_per_m`, all at x = 0.
    Where the polynomial passes the points by more than `max_misfit_m` (root mean square, beyond what
    their noise explains) the line bends in a way that it cannot follow, as behind a corner: the fit
    then ends nearer, where it can. So it does where what it misses ahead moves y at the vehicle, which
    is not seen, by more than `max_misfit_at_ego_m`: a cubic through a straight and the bend behind it may
    be near all points and pass the vehicle by metres.
    """

    order: Annotated[int, msgspec.Meta(ge=1, le=MAX_ORDER)] = 3
    weighting: Literal["uniform", "sigma", "range"] = "uniform"
    min_points: Annotated[int, msgspec.Meta(ge=2, le=10_000)] = 8
    max_std_at_ego_m: Annotated[float, msgspec.Meta(gt=0.0, le=1e12)] = 0.1
    max_offset_m: Annotated[float, msgspec.Meta(gt=0.0, le=1e12)] = 30.0
    max_slope: Annotated[float, msgspec.Meta(gt=0.0, le=1e12)] = 2.0
    max_curvature_per_m: Annotated[float, msgspec.Meta(gt=0.0, le=1e12)] = 0.2
    min_length_m: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 3.0
    max_misfit_m: Annotated[float, msgspec.Meta(gt=0.0, le=1e12)] = 0.15
    max_misfit_at_ego_m: Annotated[float, msgspec.Meta(gt=0.0, le=1e12)] = 0.5


def fit_lines(config: LaneFitConfig, lines: LinePoints, sigma_y_m: Array) -> tuple[Fit | None, ...]:
    """Fit every line; `sigma_y_m` (N,) is each point's lateral standard deviation, 0 = not known."""
    x_m, y_m = lines.points_ego_m[:, 0].copy(), lines.points_ego_m[:, 1].copy()
    return tuple(
        fit(config, x_m[start:stop], y_m[start:stop], sigma_y_m[start:stop])
        for start, stop in pairwise(lines.starts.tolist())
    )


def fit(config: LaneFitConfig, x_m: Array, y_m: Array, sigma_y_m: Array) -> Fit | None:
    """Fit one line through points (N,) in any order; None = too few points, or too short a line.

    Points that are not finite are left out, and those beyond the place up to which the polynomial
    follows the line. The covariance takes the errors of the points as independent: from `sigma_y_m`
    with weighting "sigma", from the residuals otherwise.
    """
    if not (np.isfinite(x_m).all() and np.isfinite(y_m).all()):
        good = np.isfinite(x_m) & np.isfinite(y_m)
        x_m, y_m, sigma_y_m = x_m[good], y_m[good], sigma_y_m[good]
    while True:
        found = _fit(config, x_m, y_m, sigma_y_m)
        if found is None or (share := _followed(config, found, sigma_y_m)) >= 1.0:
            return found
        kept = x_m <= found.x_min_m + share * (found.x_max_m - found.x_min_m)
        x_m, y_m, sigma_y_m = x_m[kept], y_m[kept], sigma_y_m[kept]


def operator(config: LaneFitConfig, x_m: Array) -> Array:
    """Return (order + 1, N): what a fit makes of points at `x_m` (N,): coefficients = operator @ y.

    That of the full order, without the limits of what a line may be; "sigma" weights are uniform here.
    """
    x_min, x_max = float(x_m.min()), float(x_m.max())
    centre, half = 0.5 * (x_min + x_max), 0.5 * (x_max - x_min)
    weight, _ = _weight(config, x_m, np.zeros(len(x_m)))
    order = min(config.order, len(x_m) - 1)
    inverse = np.linalg.pinv(_basis(order, (x_m - centre) / half, weight).T)
    return _raw_from_chebyshev(order + 1, centre, half) @ (inverse if weight is None else inverse * weight)


def _followed(config: LaneFitConfig, found: Fit, sigma_y_m: Array) -> float:
    """Return the share of its length on which a fit may follow its line; the misfit grows as length^4."""
    if not found.residual_std_m > SMOOTH_M:  # NaN: as many coefficients as points
        return 1.0
    misfit_m = _beyond(found.residual_std_m, _noise_m(sigma_y_m, None))
    at_ego_m = _beyond(misfit_m, SMOOTH_M) * _lever(found) if _is_near(found) else 0.0
    too_large = max(misfit_m / config.max_misfit_m, at_ego_m / config.max_misfit_at_ego_m)
    return 1.0 if too_large <= 1.0 else min(max(too_large**-0.25, 0.5), 0.9)


def _beyond(rms: float, known: float) -> float:
    """Return what is left of a root mean square without a known part of it."""
    return sqrt(max(rms * rms - known * known, 0.0))


def _is_near(found: Fit) -> bool:
    """Return whether the polynomial says where the line is beside the vehicle."""
    return found.x_min_m <= min(NEAREST_M, 0.5 * (found.x_max_m - found.x_min_m))


def _lever(found: Fit) -> float:
    """Return how many times larger than its root mean square a misfit is at x = 0.

    Of points all along a line, what a polynomial misses first is the Legendre polynomial one above its
    order, P_n(t): 1 / sqrt(2 n + 1) in the mean on the seen length, and steep beyond it.
    """
    half = 0.5 * (found.x_max_m - found.x_min_m)
    t, size = (found.x_min_m + half) / half, len(found.coefficients)
    before, value = 1.0, t
    for k in range(1, size):
        before, value = value, ((2 * k + 1) * t * value - k * before) / (k + 1)
    return abs(value) * sqrt(2 * size + 1)


def _fit(config: LaneFitConfig, x_m: Array, y_m: Array, sigma_y_m: Array) -> Fit | None:
    """Fit one polynomial to all points (N,), which are finite."""
    if len(x_m) < config.min_points:
        return None
    x_min, x_max = float(x_m.min()), float(x_m.max())
    if x_max - x_min < max(config.min_length_m, 1e-6):
        return None
    centre, half = 0.5 * (x_min + x_max), 0.5 * (x_max - x_min)
    weight, known = _weight(config, x_m, sigma_y_m)
    t = (x_m - centre) / half
    triangle = _triangle(min(config.order, len(x_m) - 1), t, y_m, weight)
    noise_m = 1.0 if known else _noise_m(sigma_y_m, weight)
    for size in range(_resolved(triangle), 1, -1):
        solution, inverse, squares = _solve(triangle, size)
        to_raw = _raw_from_chebyshev(size, centre, half)
        root = to_raw @ inverse  # root @ root.T = covariance for unit noise
        if size == 2 or noise_m * sqrt(float(root[0] @ root[0])) <= config.max_std_at_ego_m:
            break
    else:
        return None
    coefficients = to_raw @ solution
    if not _is_plausible(config, coefficients):
        return None
    free = len(x_m) - size
    variance = squares / free if free > 0 else np.nan
    covariance = (1.0 if known else variance) * (root @ root.T)
    if weight is not None:
        residual = y_m - np.einsum("k,kn", solution, _basis(size - 1, t, None))
        variance = float(residual @ residual) / free if free > 0 else np.nan
    return Fit(
        coefficients=frozen(coefficients),
        covariance=frozen(covariance),
        x_min_m=x_min,
        x_max_m=x_max,
        residual_std_m=sqrt(variance),
        points=len(x_m),
    )


def _weight(config: LaneFitConfig, x_m: Array, sigma_y_m: Array) -> tuple[Array | None, bool]:
    """Return the factor of each row (None = 1), and whether it is one over a known deviation."""
    if config.weighting == "sigma" and sigma_y_m.min() > 0.0:
        return 1.0 / sigma_y_m, True
    if config.weighting == "range":
        return NEAR_M / np.sqrt(NEAR_M**2 + x_m * x_m), False
    return None, False


def _noise_m(sigma_y_m: Array, weight: Array | None) -> float:
    """Return the root mean square of the weighted rows' noise."""
    rows = sigma_y_m if weight is None else weight * sigma_y_m
    return sqrt(float(rows @ rows) / len(rows))


def _is_plausible(config: LaneFitConfig, coefficients: Array) -> bool:
    """Return whether a line of a road can look like this from a vehicle on it."""
    c0, c1, c2 = (*coefficients.tolist(), 0.0)[:3]
    straight = abs(c0) <= config.max_offset_m and abs(c1) <= config.max_slope
    return bool(straight and 2.0 * abs(c2) <= config.max_curvature_per_m)


def _triangle(order: int, t: Array, y: Array, weight: Array | None) -> Array:
    """Return R of the QR of the weighted basis with y as its last column, which so becomes Q'y."""
    rows = _basis(order, t, weight, extra=1)
    rows[-1] = y if weight is None else weight * y
    step = ONE_THREAD // len(rows)
    if len(y) <= step:
        return _upper(rows)
    return _upper(np.hstack([_upper(rows[:, at : at + step]).T for at in range(0, len(y), step)]))


def _upper(rows: Array) -> Array:
    """Return R of the QR of `rows.T`; the R of stacked R's of blocks is the R of the whole."""
    factors, _, _, _ = lapack.dgeqrf(rows.T, overwrite_a=1)
    corner = factors[: len(rows)]
    return np.asarray(corner * _UPPER[: len(corner), : len(rows)])  # below it lie the reflectors


def _resolved(triangle: Array) -> int:
    """Return how many of the basis polynomials the points can tell apart."""
    diagonal = np.abs(triangle[:, :-1].diagonal())
    resolved = diagonal > UNRESOLVED * diagonal[0]
    return len(resolved) if resolved.all() else int(np.argmin(resolved))


def _solve(triangle: Array, size: int) -> tuple[Array, Array, float]:
    """Return Chebyshev coefficients (size,), R^-1 (size, size), weighted sum of squared residuals.

    The basis is nested: a lower order is a leading block of the same R.
    """
    inverse, _ = lapack.dtrtri(triangle[:size, :size])
    rest = triangle[size:, -1]
    return inverse @ triangle[:size, -1], inverse, float(rest @ rest)


def _basis(order: int, t: Array, weight: Array | None, extra: int = 0) -> Array:
    """Return the weighted basis (order + 1 + extra, N); its transpose has the layout LAPACK wants.

    The `extra` rows are left for the caller to fill.
    """
    basis = np.empty((order + 1 + extra, len(t)))
    basis[0] = 1.0 if weight is None else weight
    np.multiply(t, basis[0], out=basis[1])
    twice = t + t
    for k in range(2, order + 1):
        np.multiply(twice, basis[k - 1], out=basis[k])
        basis[k] -= basis[k - 2]
    return basis


def _raw_from_chebyshev(size: int, centre: float, half: float) -> Array:
    """Return (size, size): powers of x from T_k((x - centre) / half), by the binomial theorem."""
    shift = _BINOMIAL[:size, :size].T * (-centre) ** _POWER[:size, :size].T
    return np.asarray((shift * half ** -np.arange(float(size))) @ _CHEBYSHEV[:size, :size])
