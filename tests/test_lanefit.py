from math import comb

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.lines import line_points
from vsensor.lanefit import LaneFitConfig, fit, fit_lines

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
X_M = np.arange(5.0, 105.0, 0.1)
CUBIC = np.array([1.75, 0.01, 2e-4, -1e-6])


def polynomial(coefficients, x):
    return np.polynomial.polynomial.polyval(x, coefficients)


def fitted(x, y, sigma=None, **config):
    return fit(LaneFitConfig(**ANY | config), x, y, np.zeros(len(x)) if sigma is None else sigma)


def shifted(coefficients, by):
    """Return the coefficients of y(x - by), by the binomial theorem."""
    size = len(coefficients)
    return np.array(
        [sum(coefficients[i] * comb(i, j) * (-by) ** (i - j) for i in range(j, size)) for j in range(size)]
    )


# --- the coefficients -------------------------------------------------------------------------------


@pytest.mark.parametrize("order", range(1, 10))
@pytest.mark.parametrize("weighting", ["uniform", "sigma", "range"])
def test_a_polynomial_of_any_order_is_recovered_over_5_to_200_m(order, weighting):
    x = np.linspace(5.0, 200.0, 1000)
    true = np.random.default_rng(order).normal(size=order + 1) / 100.0 ** np.arange(order + 1)
    y = polynomial(true, x)
    found = fitted(x, y, sigma=0.01 + 1e-4 * x, order=order, weighting=weighting)
    terms = 200.0 ** np.arange(order + 1)  # compared by what each coefficient adds at 200 m
    # rounding y alone moves coefficients this far: T_n((x - 102.5) / 97.5) written in powers of
    # x / 200 has coefficients of the sum |T_n(3.1 i)|, 130 at order 3, 9e6 at order 9
    growth = np.abs(np.polynomial.chebyshev.chebval(3.1j, [0.0] * order + [1.0]))
    tolerance = max(1e-12, 4.0 * np.finfo(float).eps * growth) * np.abs(y).max()
    np.testing.assert_allclose(found.coefficients * terms, true * terms, rtol=0.0, atol=tolerance)
    np.testing.assert_allclose([found.y_at(at) for at in x[::50]], y[::50], rtol=0.0, atol=tolerance)


@pytest.mark.parametrize("order", [1, 2, 3, 5, 9])
def test_the_fit_of_noisy_points_is_the_least_squares_solution_in_fifty_digits(order):
    x = np.linspace(5.0, 105.0, 41)
    y = polynomial(CUBIC, x) + np.random.default_rng(order).normal(0.0, 0.05, 41)
    found = fitted(x, y, order=order)
    with mpmath.workdps(50):
        rows = mpmath.matrix([[mpmath.mpf(at) ** j for j in range(order + 1)] for at in x])
        normal = rows.T * rows
        solution = mpmath.lu_solve(normal, rows.T * mpmath.matrix(list(y)))
        residual = mpmath.matrix(list(y)) - rows * solution
        variance = (residual.T * residual)[0] / (41 - order - 1)
        covariance = variance * mpmath.inverse(normal)
        expected = np.array([float(value) for value in solution])
        expected_covariance = np.array(covariance.tolist(), dtype=float)
    std = np.sqrt(np.diag(expected_covariance))
    # far below what the points themselves leave open
    np.testing.assert_allclose((found.coefficients - expected) / std, 0.0, atol=1e-8)
    np.testing.assert_allclose(
        found.covariance / np.outer(std, std), expected_covariance / np.outer(std, std), atol=1e-8
    )
    assert found.residual_std_m == pytest.approx(float(mpmath.sqrt(variance)), rel=1e-9)


@pytest.mark.parametrize("weighting", ["sigma", "range"])
def test_a_weighted_fit_is_the_uniform_fit_of_points_repeated_by_their_weight(weighting):
    x = np.array([5.0, 20.0, 33.0, 47.0, 60.0, 80.0])
    y = polynomial(CUBIC, x) + np.array([0.1, -0.2, 0.3, 0.1, -0.3, 0.2])
    times = np.array([9, 4, 1, 4, 9, 1])
    sigma = 1.0 / np.sqrt(times)
    repeated = fitted(np.repeat(x, times), np.repeat(y, times), order=2)
    if weighting == "sigma":
        found = fitted(x, y, sigma=sigma, order=2, weighting="sigma")
        np.testing.assert_allclose(found.coefficients, repeated.coefficients, rtol=1e-10)
        np.testing.assert_allclose(
            found.covariance * repeated.residual_std_m**2, repeated.covariance, rtol=1e-9
        )
    else:
        by_sigma = fitted(x, y, sigma=np.hypot(5.0, x), order=2, weighting="sigma")
        found = fitted(x, y, order=2, weighting="range")
        np.testing.assert_allclose(found.coefficients, by_sigma.coefficients, rtol=1e-10)


def test_weighting_by_sigma_without_a_sigma_is_uniform():
    y = polynomial(CUBIC, X_M) + np.random.default_rng(1).normal(0.0, 0.05, len(X_M))
    uniform, by_sigma = fitted(X_M, y), fitted(X_M, y, weighting="sigma")
    np.testing.assert_array_equal(by_sigma.coefficients, uniform.coefficients)
    np.testing.assert_array_equal(by_sigma.covariance, uniform.covariance)


def test_the_residual_is_that_of_the_points_whatever_their_weights():
    y = polynomial(CUBIC, X_M) + np.random.default_rng(2).normal(0.0, 0.05, len(X_M))
    for weighting in ("uniform", "sigma", "range"):
        found = fitted(X_M, y, sigma=np.full(len(X_M), 0.3), weighting=weighting)
        rest = y - polynomial(found.coefficients, X_M)
        assert found.residual_std_m == pytest.approx(np.sqrt(rest @ rest / (len(X_M) - 4)), rel=1e-9)


# --- invariants -------------------------------------------------------------------------------------

noise = st.integers(0, 2**32 - 1)


def noisy(seed):
    return polynomial(CUBIC, X_M) + np.random.default_rng(seed).normal(0.0, 0.05, len(X_M))


@given(noise, st.sampled_from(["uniform", "sigma", "range"]))
def test_mirrored_points_flip_the_sign_of_every_coefficient(seed, weighting):
    sigma = 0.01 + 1e-3 * X_M
    found = fitted(X_M, noisy(seed), sigma=sigma, weighting=weighting)
    mirrored = fitted(X_M, -noisy(seed), sigma=sigma, weighting=weighting)
    np.testing.assert_array_equal(mirrored.coefficients, -found.coefficients)
    np.testing.assert_array_equal(mirrored.covariance, found.covariance)


@given(noise, st.floats(-50.0, 50.0))
def test_points_moved_along_x_give_the_moved_polynomial(seed, by):
    found, moved = fitted(X_M, noisy(seed)), fitted(X_M + by, noisy(seed))
    expected = shifted(found.coefficients, by)
    terms = 100.0 ** np.arange(4)
    np.testing.assert_allclose(moved.coefficients * terms, expected * terms, rtol=1e-9, atol=1e-9)
    assert moved.std_at(30.0 + by) == pytest.approx(found.std_at(30.0), rel=1e-6)


@pytest.mark.parametrize("order", [1, 3, 9])
def test_a_line_of_many_points_fitted_in_blocks_is_the_fit_of_all_its_points(order):
    x = np.linspace(5.0, 105.0, 5003)
    y = polynomial(CUBIC, x) + np.random.default_rng(5).normal(0.0, 0.05, len(x))
    found = fitted(x, y, order=order)
    numpy_fit = np.polynomial.Polynomial.fit(x, y, order)
    rest = y - numpy_fit(x)
    np.testing.assert_allclose([found.y_at(at) for at in x[::100]], numpy_fit(x[::100]), atol=1e-9)
    assert found.residual_std_m == pytest.approx(np.sqrt(rest @ rest / (len(x) - order - 1)), rel=1e-9)
    assert found.points == 5003


@given(noise)
def test_the_order_of_the_points_does_not_matter(seed):
    shuffled = np.random.default_rng(seed).permutation(len(X_M))
    found, other = fitted(X_M, noisy(seed)), fitted(X_M[shuffled], noisy(seed)[shuffled])
    np.testing.assert_allclose(other.coefficients, found.coefficients, rtol=1e-8, atol=1e-12)
    assert (other.x_min_m, other.x_max_m) == (found.x_min_m, found.x_max_m)


def test_the_extent_is_that_of_the_points():
    found = fitted(np.array([30.0, 7.0, 81.0, 12.0]), np.zeros(4), order=1)
    assert (found.x_min_m, found.x_max_m, found.points) == (7.0, 81.0, 4)


@pytest.mark.parametrize("weighting", ["uniform", "sigma", "range"])
def test_the_covariance_is_the_scatter_of_many_fits(weighting):
    x, random = np.linspace(5.0, 80.0, 60), np.random.default_rng(3)
    sigma = np.full(60, 0.05) if weighting == "uniform" else 0.02 * np.hypot(5.0, x) / 5.0
    fits = [
        fitted(x, polynomial(CUBIC, x) + sigma * random.standard_normal(60), sigma=sigma, weighting=weighting)
        for _ in range(3000)
    ]
    scatter = np.cov(np.array([found.coefficients for found in fits]).T)
    stated = np.mean([found.covariance for found in fits], axis=0)
    std = np.sqrt(np.diag(stated))
    # 3000 fits know a variance to sqrt(2 / 3000) = 2.6 %: four times that
    np.testing.assert_allclose(scatter / np.outer(std, std), stated / np.outer(std, std), atol=0.105)
    for at in (5.0, 40.0, 80.0):
        y = [found.y_at(at) for found in fits]
        assert np.std(y) == pytest.approx(np.mean([found.std_at(at) for found in fits]), rel=0.055)


# --- too little to fit ------------------------------------------------------------------------------


@pytest.mark.parametrize("distinct", [2, 3, 4, 5])
@pytest.mark.parametrize("repeats", [1, 4])
def test_too_few_distinct_points_lower_the_order(distinct, repeats):
    x = np.repeat(np.linspace(5.0, 50.0, distinct), repeats)
    found = fitted(x, polynomial(CUBIC, x), order=3)
    assert len(found.coefficients) == min(distinct, 4)
    np.testing.assert_allclose([found.y_at(at) for at in x], polynomial(CUBIC, x), atol=1e-12)


def test_points_at_one_x_are_no_line():
    assert fitted(np.full(20, 7.0), np.linspace(0.0, 1.0, 20)) is None


@pytest.mark.parametrize("count", [0, 1])
def test_no_point_and_a_single_point_are_no_line(count):
    assert fitted(np.full(count, 7.0), np.zeros(count)) is None


def test_fewer_points_than_the_minimum_are_no_line():
    x = np.linspace(5.0, 50.0, 12)
    assert fitted(x[:11], x[:11], min_points=12) is None
    assert fitted(x, x, min_points=12) is not None


def test_a_line_shorter_than_the_minimum_is_no_line():
    x = np.linspace(5.0, 8.0, 31)
    assert fitted(x, x, min_length_m=3.01) is None
    assert fitted(x, x, min_length_m=3.0) is not None


def test_as_many_points_as_coefficients_leave_the_covariance_unknown():
    x = np.array([5.0, 20.0, 40.0, 60.0])
    found = fitted(x, polynomial(CUBIC, x))
    np.testing.assert_allclose(found.coefficients, CUBIC, rtol=1e-9)
    assert np.isnan(found.covariance).all()
    assert np.isnan(found.residual_std_m)
    assert np.isnan(found.std_at(20.0))


def one_dash_far_ahead():
    x = np.arange(60.0, 64.0, 0.1)
    return x, polynomial(CUBIC, x) + np.random.default_rng(4).normal(0.0, 0.02, len(x)), np.full(len(x), 0.02)


def test_a_fit_whose_order_fell_is_the_fit_of_that_order():
    x, y, sigma = one_dash_far_ahead()
    found, straight = fitted(x, y, sigma=sigma, max_std_at_ego_m=1.0), fitted(x, y, order=1)
    assert len(found.coefficients) == 2
    np.testing.assert_allclose(found.coefficients, straight.coefficients, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, straight.covariance, rtol=1e-9)
    assert found.residual_std_m == pytest.approx(straight.residual_std_m)


@pytest.mark.parametrize("weighting", ["uniform", "sigma", "range"])
def test_the_order_falls_step_by_step_with_the_limit_at_the_vehicle_but_a_straight_line_is_kept(weighting):
    x, y, sigma = one_dash_far_ahead()
    sizes = [
        len(fitted(x, y, sigma=sigma, weighting=weighting, max_std_at_ego_m=limit).coefficients)
        for limit in (1e9, 30.0, 1.0, 1e-6)
    ]
    assert sizes == [4, 3, 2, 2]


def test_points_without_a_finite_place_are_left_out():
    y = polynomial(CUBIC, X_M)
    x, y = X_M.copy(), y.copy()
    x[3], y[40], y[50], y[60] = np.nan, np.nan, np.inf, -np.inf
    found = fitted(x, y)
    assert found.points == len(X_M) - 4
    np.testing.assert_allclose(found.coefficients, CUBIC, rtol=1e-9)


def corner(at_m, slope):
    """A line that is straight up to a place and leaves it with another slope."""
    return 1.75 + slope * np.maximum(X_M - at_m, 0.0)


@pytest.mark.parametrize("slope", [1.0, -1.0])
@pytest.mark.parametrize("at_m", [30.0, 60.0])
def test_a_line_around_a_corner_is_reported_only_as_far_as_a_cubic_follows_it(at_m, slope):
    y = corner(at_m, slope)
    whole, found = fitted(X_M, y), fitted(X_M, y, max_misfit_m=0.15)
    assert whole.x_max_m == X_M[-1]
    assert whole.residual_std_m > 0.5
    assert found.x_min_m == X_M[0]
    assert at_m - 5.0 < found.x_max_m < at_m + 30.0
    assert found.residual_std_m <= 0.15
    used = found.x_max_m >= X_M
    assert found.points == used.sum()
    best = np.polynomial.polynomial.polyfit(X_M[used], y[used], 3)
    np.testing.assert_allclose(found.y_at(at_m), polynomial(best, at_m), atol=1e-9)


def bend(radius_m, from_m):
    """A line that is straight up to a place and goes on as a circle; seen from 6 m on."""
    x = np.arange(6.0, from_m + 0.8 * radius_m, 0.1)
    return x, 1.75 + radius_m - np.sqrt(radius_m**2 - np.maximum(x - from_m, 0.0) ** 2)


@pytest.mark.parametrize("from_m", [20.0, 25.0, 30.0])
@pytest.mark.parametrize("radius_m", [16.0, 20.0, 30.0])
def test_a_line_that_goes_into_a_bend_is_right_beside_the_vehicle(radius_m, from_m):
    x, y = bend(radius_m, from_m)
    anywhere, found = (
        fitted(x, y, max_misfit_m=0.15),
        fitted(x, y, max_misfit_m=0.15, max_misfit_at_ego_m=0.5),
    )
    assert abs(anywhere.y_at(0.0) - 1.75) > 0.5
    assert abs(found.y_at(0.0) - 1.75) < 0.3
    assert from_m - 5.0 < found.x_max_m < anywhere.x_max_m


def test_a_misfit_of_the_next_order_is_as_large_at_the_vehicle_as_it_is_taken_to_be():
    t = (X_M - 55.0) / 50.0
    quartic, quartic_at_ego = (np.polynomial.legendre.legval(at, [0, 0, 0, 0, 1]) for at in (t, -1.1))
    found = fitted(X_M, polynomial(CUBIC, X_M) + quartic)
    wrong_m = abs(found.y_at(0.0) - CUBIC[0] - quartic_at_ego)
    assert wrong_m > 2.0
    at_ego_m = dict(max_misfit_at_ego_m=1.01 * wrong_m), dict(max_misfit_at_ego_m=0.97 * wrong_m)
    whole, shorter = (fitted(X_M, polynomial(CUBIC, X_M) + quartic, **limit) for limit in at_ego_m)
    assert whole.x_max_m == X_M[-1]
    assert shorter.x_max_m < X_M[-1]


def test_a_line_that_begins_far_ahead_is_not_shortened_for_what_nobody_reads():
    x, y = bend(60.0, 20.0)
    far = x > 25.0
    assert fitted(x[far], y[far], max_misfit_at_ego_m=1e-6).x_max_m == x[-1]


def test_a_line_that_a_cubic_follows_keeps_its_whole_range():
    y = polynomial(CUBIC, X_M) + 0.1 * np.sin(X_M)
    assert fitted(X_M, y, max_misfit_m=0.15).x_max_m == X_M[-1]


def test_noise_that_is_known_does_not_shorten_a_line():
    y = polynomial(CUBIC, X_M) + np.random.default_rng(5).normal(scale=0.3, size=len(X_M))
    assert fitted(X_M, y, sigma=np.full(len(X_M), 0.3), max_misfit_m=0.15).x_max_m == X_M[-1]
    assert fitted(X_M, y, max_misfit_m=0.15) is None or fitted(X_M, y, max_misfit_m=0.15).x_max_m < X_M[-1]


@given(
    st.lists(st.tuples(st.floats(-20, 250), st.floats(-20, 20)), max_size=30),
    st.integers(1, 9),
    st.sampled_from(["uniform", "sigma", "range"]),
)
def test_any_points_give_a_line_through_finite_numbers_or_none_and_no_warning(points, order, weighting):
    x = np.array([at for at, _ in points])
    y = np.array([at for _, at in points])
    found = fitted(x, y, sigma=np.full(len(x), 0.02), order=order, weighting=weighting)
    if found is None:
        assert len(x) < 2 or np.ptp(x) < 1e-5
    else:
        assert np.isfinite(found.coefficients).all()
        assert 2 <= len(found.coefficients) <= min(order + 1, len(np.unique(x)))


# --- all lines of an image --------------------------------------------------------------------------


def test_every_line_is_fitted_on_its_own_and_a_line_without_points_is_none():
    y = polynomial(CUBIC, X_M)
    lines = line_points((X_M, y), (X_M[:0], y[:0]), (X_M, y - 3.5), (X_M[:5], y[:5]))
    first, second, third, fourth = fit_lines(LaneFitConfig(), lines, np.zeros(len(lines.points_ego_m)))
    np.testing.assert_allclose(first.coefficients, CUBIC, rtol=1e-9)
    np.testing.assert_allclose(third.coefficients, CUBIC - [3.5, 0, 0, 0], rtol=1e-9)
    assert second is None
    assert fourth is None
    assert fit_lines(LaneFitConfig(), line_points(), np.zeros(0)) == ()


def test_what_a_fit_returns_cannot_be_changed():
    found = fitted(X_M, polynomial(CUBIC, X_M))
    for array in (found.coefficients, found.covariance):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


# --- what is a line ---------------------------------------------------------------------------------


def test_one_far_dash_gives_a_straight_line_and_a_long_line_a_cubic():
    noise = np.random.default_rng(4)
    dash, whole = np.arange(60.0, 66.0, 0.1), np.arange(60.0, 160.0, 0.1)
    for x, size in ((dash, 2), (whole, 4)):
        y = polynomial(CUBIC, x) + noise.normal(scale=0.02, size=len(x))
        assert len(fit(LaneFitConfig(), x, y, np.full(len(x), 0.02)).coefficients) == size


def test_the_order_is_kept_where_the_line_reaches_the_vehicle_or_the_points_are_exact():
    x = np.arange(0.0, 6.0, 0.1)
    assert len(fit(LaneFitConfig(), x, polynomial(CUBIC, x), np.full(len(x), 0.02)).coefficients) == 4
    far = x + 60.0
    assert len(fit(LaneFitConfig(), far, polynomial(CUBIC, far), np.zeros(len(x))).coefficients) == 4


def test_the_chosen_order_is_the_largest_whose_noise_at_the_vehicle_stays_within_the_limit():
    x = np.arange(20.0, 50.0, 0.1)
    sigma = np.full(len(x), 0.03)
    stds = []
    for order in (1, 2, 3):
        basis = np.vander(x, order + 1, increasing=True)
        stds.append(0.03 * np.sqrt(np.linalg.inv(basis.T @ basis)[0, 0]))
    for order, limit in ((1, (stds[0] + stds[1]) / 2), (2, (stds[1] + stds[2]) / 2), (3, 1.1 * stds[2])):
        found = fit(LaneFitConfig(max_std_at_ego_m=limit), x, polynomial(CUBIC, x), sigma)
        assert len(found.coefficients) == order + 1


@pytest.mark.parametrize(
    "coefficients", [(31.0, 0.0, 0.0, 0.0), (0.0, -2.1, 0.0, 0.0), (0.0, 0.0, 0.11, 0.0)]
)
def test_a_polynomial_that_no_road_near_the_vehicle_can_have_is_no_line(coefficients):
    assert fit(LaneFitConfig(), X_M, polynomial(coefficients, X_M), np.zeros(len(X_M))) is None
    less = 0.9 * np.array(coefficients)
    assert fit(LaneFitConfig(), X_M, polynomial(less, X_M), np.zeros(len(X_M))) is not None
