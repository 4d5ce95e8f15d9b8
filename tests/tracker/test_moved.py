"""A polynomial moved by the vehicle's motion: closed forms, and rigid motion as an invariant."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import polynomial

from tests.tracker.images import line
from vsensor.tracker.moved import HERE, Moved, aside_m, beside, driven, fit_now, x_now

motions = st.builds(
    lambda x, y, h: Moved(x_m=x, y_m=y, heading_rad=h, path_m=math.hypot(x, y)),
    st.floats(-5.0, 40.0),
    st.floats(-3.0, 3.0),
    st.floats(-0.3, 0.3),
)


def seen_from(moved, x, y):
    """Return points (x, y) of then as the vehicle has them now."""
    c, s = math.cos(moved.heading_rad), math.sin(moved.heading_rad)
    return c * (x - moved.x_m) + s * (y - moved.y_m), c * (y - moved.y_m) - s * (x - moved.x_m)


def arc(radius_m, x, aside_m):
    """Return y of a circle about (0, radius), at the distance `aside_m` left of the driven path."""
    return radius_m - np.sqrt((radius_m - aside_m) ** 2 - x**2)


@given(motions, st.floats(-8.0, 8.0), st.floats(-0.5, 0.5))
def test_a_straight_line_stays_exact_under_any_motion(moved, offset_m, slope):
    fit = fit_now(line(offset_m, slope, x_max_m=90.0), moved, 1.0)
    x = np.array([5.0, 50.0, 89.0])
    now_x, now_y = seen_from(moved, x, offset_m + slope * x)
    np.testing.assert_allclose(polynomial.polyval(now_x, fit.coefficients), now_y, atol=1e-9)
    assert fit.x_max_m == pytest.approx(seen_from(moved, 90.0, offset_m + slope * 90.0)[0])


@given(st.floats(-5.0, 60.0), st.floats(-2.0, 2.0), st.integers(2, 10))
def test_without_turning_a_polynomial_of_any_order_is_shifted_exactly(x_m, y_m, size):
    coefficients = 2.0 * 0.02 ** np.arange(size)
    fit = line(*coefficients, x_max_m=90.0)
    now = fit_now(fit, Moved(x_m=x_m, y_m=y_m), 0.0)
    x = np.linspace(max(x_m, 4.0), 90.0, 20)
    np.testing.assert_allclose(
        polynomial.polyval(x - x_m, now.coefficients), polynomial.polyval(x, coefficients) - y_m, atol=1e-7
    )


@given(motions)
def test_a_turned_cubic_of_a_road_stays_within_a_centimetre_where_it_was_seen(moved):
    c = (1.75, 0.02, 1.0 / 600.0, -1e-6)  # radius 300 m
    now = fit_now(line(*c, x_max_m=80.0), moved, 1.0)
    x = np.linspace(max(4.0, moved.x_m), 80.0, 100)
    now_x, now_y = seen_from(moved, x, polynomial.polyval(x, c))
    np.testing.assert_allclose(polynomial.polyval(now_x, now.coefficients), now_y, atol=0.01)


@pytest.mark.parametrize(("radius_m", "bound_m"), [(100.0, 0.05), (200.0, 0.005), (500.0, 5e-4)])
def test_a_line_of_a_bend_driven_without_seeing_it_stays_beside_the_vehicle(radius_m, bound_m):
    # the lane's left line is a circle about the same centre as the path: now it looks as it did then
    x = np.linspace(4.0, 50.0, 200)
    fit = line(*polynomial.polyfit(x, arc(radius_m, x, 1.75), 3), x_max_m=50.0)
    for path_m in (1.0, 10.0, 30.0):
        moved = driven(20.0, 20.0 / radius_m, path_m / 20.0)
        now = fit_now(fit, moved, path_m / 20.0)
        ahead = np.linspace(max(now.x_min_m, 0.0), now.x_max_m, 50)
        error = polynomial.polyval(ahead, now.coefficients) - arc(radius_m, ahead, 1.75)
        assert np.abs(error).max() < bound_m


def test_a_motion_in_many_steps_is_the_motion_in_one():
    whole, steps = driven(20.0, 0.2, 2.0), HERE
    for _ in range(50):
        steps = steps.further(driven(20.0, 0.2, 0.04))
    for name in ("x_m", "y_m", "heading_rad", "path_m"):
        assert getattr(steps, name) == pytest.approx(getattr(whole, name), abs=1e-12)


def test_a_full_circle_ends_where_it_began():
    moved = driven(10.0, 0.5, 4.0 * math.pi)
    assert (moved.x_m, moved.y_m) == pytest.approx((0.0, 0.0), abs=1e-12)


@given(motions)
def test_the_place_beside_the_vehicle_and_the_distance_to_a_point_agree_with_the_moved_polynomial(moved):
    fit = line(1.75, 0.02, 1.0 / 600.0, -1e-6, x_min_m=-10.0, x_max_m=80.0)
    y, slope = beside(fit, moved)
    assert aside_m(fit, moved, 0.0, y) == pytest.approx(0.0, abs=1e-9)
    assert aside_m(fit, moved, 0.0, y + 0.5) == pytest.approx(0.5, rel=0.2)
    assert aside_m(fit, moved, 0.0, y - 0.5) == pytest.approx(-0.5, rel=0.2)
    now = fit_now(fit, moved, 0.0)
    assert (y, slope) == pytest.approx(tuple(now.coefficients[:2]), abs=0.01)


def test_the_covariance_is_that_of_moved_lines():
    rng = np.random.default_rng(1)
    mean, root = np.array([1.75, 0.4, 5e-4, -1e-6]), np.diag([0.05, 2e-3, 5e-5, 4e-7])
    moved = Moved(x_m=15.0, y_m=0.5, heading_rad=-0.4)  # no path: nothing unknown is added
    fit = line(*mean, x_max_m=80.0)
    object.__setattr__(fit, "covariance", root @ root.T)
    drawn = [
        fit_now(line(*(mean + root @ rng.standard_normal(4)), x_max_m=80.0), moved, 0.0) for _ in range(4000)
    ]
    for x in (0.0, 20.0, 60.0):
        spread = np.std([one.y_at(x) for one in drawn])
        assert fit_now(fit, moved, 0.0).std_at(x) == pytest.approx(spread, rel=0.05)  # 4000 draws: 1.1 %


def test_the_longer_and_farther_a_line_was_not_seen_the_less_is_known_of_it():
    fit = line(1.75, 0.0)
    stds = [fit_now(fit, driven(20.0, 0.0, t), t).std_at(20.0) for t in (0.0, 0.5, 1.0, 2.0)]
    assert stds == sorted(stds)
    assert 0.2 < stds[-1] < 0.5
    standing = [fit_now(fit, HERE, t).std_at(20.0) for t in (0.0, 2.0)]
    assert standing[0] < standing[1]


def test_a_line_that_lies_behind_or_turned_across_is_none():
    assert fit_now(line(1.75, x_max_m=30.0), Moved(x_m=30.5), 1.0) is None
    assert fit_now(line(1.75), Moved(heading_rad=1.5), 1.0) is None
    assert beside(line(1.75), Moved(heading_rad=1.5)) is None


def test_the_range_moves_with_the_line_and_begins_at_the_vehicle_where_it_began_behind():
    fit = line(1.75, x_min_m=4.0, x_max_m=50.0)
    assert fit_now(fit, Moved(x_m=3.0), 0.1).x_min_m == pytest.approx(1.0)
    now = fit_now(fit, Moved(x_m=20.0), 0.1)
    assert (now.x_min_m, now.x_max_m) == pytest.approx((0.0, 30.0))
    assert x_now(fit, Moved(x_m=20.0), 50.0) == pytest.approx(30.0)
