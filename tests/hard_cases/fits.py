"""Polynomial fits at their limits, against least squares in 120 digits.

Powers of x cannot say more than their float64 coefficients hold: over 5 m at 100 m, order 9, the terms
of the sum are 1e12 times the sum. So what is bounded is the error of y over the rounding of that sum,
eps * sum |c_k x^k|; the bus has order 3 at most, and there the error is stated in metres as well.
"""

from functools import cache

import numpy as np

from tests.hard_cases import exact
from tests.hard_cases.exact import Row
from vsensor.lanefit import LaneFitConfig, fit

ANY = {"min_points": 2, "min_length_m": 0.0} | dict.fromkeys(
    (
        "max_std_at_ego_m",
        "max_offset_m",
        "max_slope",
        "max_curvature_per_m",
        "max_misfit_m",
        "max_misfit_at_ego_m",
    ),
    1e12,
)
SPANS_M = {"5 m at the vehicle": (0.0, 5.0), "5 m at 100 m": (95.0, 100.0), "200 m": (0.0, 200.0)}
ORDERS = tuple(range(1, 10))
CUBIC = (1.75, 0.01, 2e-4, -1e-6)
EPS = float(np.finfo(float).eps)


def noisy(x, seed=0, std_m=1e-5):
    """Return y of a cubic with noise: without it, every order would find the cubic.

    More than 0.1 mm, order 9 over 5 m at 100 m, give positions at the vehicle that no limit lets pass.
    """
    return np.polynomial.polynomial.polyval(x, CUBIC) + np.random.default_rng(seed).normal(0.0, std_m, len(x))


def error(x, y, order, sigma=None, weighting="uniform"):
    """Return the largest error of y over the points in m, and over the rounding of the sum of powers.

    The reference has the order of the fit that was found.
    """
    config = LaneFitConfig(**ANY, order=order, weighting=weighting)
    found = fit(config, x, y, np.zeros(len(x)) if sigma is None else sigma)
    true = exact.least_squares(x, y, len(found.coefficients) - 1, sigma)
    places = np.linspace(x.min(), x.max(), 25)
    difference = [a - exact.mp.mpf(float(b)) for a, b in zip(true, found.coefficients, strict=True)]
    errors = np.array([abs(float(exact.value_at(difference, at))) for at in places])
    sums = np.array([sum(abs(float(c)) * abs(at) ** k for k, c in enumerate(true)) for at in places])
    return float(errors.max()), float((errors / (EPS * sums)).max())


@cache
def span_errors(name, order):
    """Return `error` of noisy points over a span."""
    start, stop = SPANS_M[name]
    x = np.linspace(start, stop, 41)
    return error(x, noisy(x, order), order)


def _span_rows(name):
    in_metres = max(span_errors(name, order)[0] for order in ORDERS[:3])
    in_units = max(span_errors(name, order)[1] for order in ORDERS)
    return [
        Row(f"fit over {name}", "y, orders 1 to 3", in_metres, "m", 1e-13, "120 digits"),
        Row(f"fit over {name}", "y, orders 1 to 9", in_units, "roundings of its terms", 50.0, "120 digits"),
    ]


def few_points_error_m():
    """Return the error at the points of the polynomial through order + 1 points: it passes all of them."""
    worst = 0.0
    for order in ORDERS:
        x = np.linspace(5.0, 80.0, order + 1)
        y = noisy(x, order)
        found = fit(LaneFitConfig(**ANY, order=order), x, y, np.zeros(len(x)))
        sums = sum(abs(c) * x**k for k, c in enumerate(found.coefficients.tolist()))
        passed = [exact.value_at(found.coefficients.tolist(), at) for at in x]
        rest = np.array([abs(float(a - exact.mp.mpf(b))) for a, b in zip(passed, y.tolist(), strict=True)])
        worst = max(worst, float((rest / (EPS * sums)).max()))
    return worst


def outlier_error():
    """Return the error of y over the outlier, one point of 200 being 1e3 to 1e9 m off."""
    x = np.linspace(5.0, 100.0, 200)
    worst = 0.0
    for outlier_m in (1e3, 1e6, 1e9):
        for place in (0, 117):
            y = noisy(x)
            y[place] += outlier_m
            worst = max(worst, error(x, y, 3)[0] / outlier_m)
    return worst


def weights_over(decades, arrangement):
    """Return standard deviations of 60 points over so many decades: rising, falling or at random."""
    sigma = 10.0 ** np.linspace(-decades / 2, decades / 2, 60)
    if arrangement == "falling":
        return sigma[::-1].copy()
    return np.random.default_rng(5).permutation(sigma) if arrangement == "mixed" else sigma


def weighted_error(decades):
    """Return the error of y over what its points leave open (the exact fit's own standard deviation)."""
    x = np.linspace(5.0, 100.0, 60)
    worst = 0.0
    for arrangement in ("rising", "falling", "mixed"):
        sigma = weights_over(decades, arrangement)
        y = noisy(x, std_m=1.0) if decades < 3 else np.polynomial.polynomial.polyval(x, CUBIC)
        y = y + sigma * np.random.default_rng(6).standard_normal(60)
        for order in ORDERS[:5]:
            worst = max(worst, _error_over_std(x, y, order, sigma))
    return worst


def _error_over_std(x, y, order, sigma):
    found = fit(LaneFitConfig(**ANY, order=order, weighting="sigma"), x, y, sigma)
    size = len(found.coefficients)
    true = exact.least_squares(x, y, size - 1, sigma)
    covariance = exact.covariance(x, size - 1, sigma)
    difference = [a - exact.mp.mpf(float(b)) for a, b in zip(true, found.coefficients, strict=True)]
    ratios = []
    for at in x[::4]:
        row = exact.mp.matrix([exact.mp.mpf(float(at)) ** k for k in range(size)])
        std = exact.mp.sqrt((row.T * covariance * row)[0])
        ratios.append(abs(exact.value_at(difference, at)) / std)
    return exact.largest(ratios)


def rows():
    found = [row for name in SPANS_M for row in _span_rows(name)]
    found.append(
        Row(
            "order + 1 points",
            "y at the points",
            few_points_error_m(),
            "roundings of its terms",
            50.0,
            "the points",
        )
    )
    found.append(
        Row("one outlier of 1e3 to 1e9 m", "y over the outlier", outlier_error(), "", 1e-14, "120 digits")
    )
    for decades in (2, 6, 12):
        found.append(
            Row(
                f"weights over {decades} decades",
                "y over its standard deviation",
                weighted_error(decades),
                "",
                1e-6,
                "120 digits",
            )
        )
    return found
