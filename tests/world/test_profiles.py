"""Speed and offset profiles against closed forms."""

import pytest
from scipy.integrate import quad

from vsensor.errors import ConfigError
from vsensor.world.profiles import LinearProfile, SmoothProfile

SPEED = [(0.0, 36.0), (10.0, 72.0), (15.0, 72.0), (17.0, 0.0)]


def test_a_number_is_constant_for_all_times():
    profile = LinearProfile.of(90, "ego.speed_kmh", 1 / 3.6)
    assert profile.value(-5.0) == profile.value(1e6) == 25.0
    assert profile.slope(3.0) == 0.0
    assert profile.integral(1e6) == 25.0e6


@pytest.mark.parametrize("t_s", [-2.0, 0.0, 3.7, 10.0, 12.5, 16.1, 17.0, 100.0])
def test_the_integral_of_a_linear_profile_equals_quadrature(t_s):
    profile = LinearProfile.of(SPEED, "speed", 1 / 3.6)
    expected = quad(profile.value, 0.0, t_s, points=[10.0, 15.0, 17.0] if t_s > 0 else None, limit=200)[0]
    assert profile.integral(t_s) == pytest.approx(expected, abs=1e-7)  # m, quadrature's own error


def test_the_slope_is_the_change_of_the_value():
    profile = LinearProfile.of(SPEED, "speed")
    assert profile.slope(5.0) == pytest.approx(3.6)
    assert profile.slope(16.0) == pytest.approx(-36.0)
    assert profile.slope(20.0) == 0.0


def test_a_smooth_profile_rests_at_every_point():
    profile = SmoothProfile.of([(0.0, 0.0), (4.0, 3.5), (6.0, 3.5)], "offset")
    for t_s, value in ((0.0, 0.0), (4.0, 3.5), (6.0, 3.5)):
        assert profile.derivatives(t_s) == pytest.approx((value, 0.0, 0.0), abs=1e-12)


def test_the_derivatives_of_a_smooth_profile_equal_differences():
    profile = SmoothProfile.of([(1.0, -0.5), (5.0, 3.5)], "offset")
    for t_s in (1.3, 2.0, 3.0, 4.9):
        before, here, after = (profile.derivatives(t_s + d) for d in (-1e-5, 0.0, 1e-5))
        assert here[1] == pytest.approx((after[0] - before[0]) / 2e-5, abs=1e-8)
        assert here[2] == pytest.approx((after[1] - before[1]) / 2e-5, abs=1e-8)


def test_times_that_do_not_rise_are_refused_by_name():
    with pytest.raises(ConfigError, match=r"ego\.speed_kmh: times must rise, but 5 s comes after 5 s"):
        LinearProfile.of([(0.0, 1.0), (5.0, 2.0), (5.0, 3.0)], "ego.speed_kmh")


def test_an_empty_profile_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"ego\.offset_m: an empty list"):
        SmoothProfile.of([], "ego.offset_m")
