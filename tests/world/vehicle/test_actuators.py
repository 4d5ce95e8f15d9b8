"""Lag and the fastest turning of the front wheels, pedals, and coming to a stop, in closed form."""

from math import exp, inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.world.vehicle.actuators import Actuators, Pedals, Speeds, Wheels


def test_wheels_without_lag_are_where_they_are_asked_to_be_at_once():
    assert Wheels.asked(0.1, 0.3, Actuators()).at(0.0) == 0.3


def test_wheels_follow_with_a_lag_of_first_order():
    wheels = Wheels.asked(0.1, 0.3, Actuators(steering_lag_s=0.2))
    assert wheels.at(0.2) == pytest.approx(0.3 - 0.2 * exp(-1.0), rel=1e-14)


def test_wheels_turn_at_their_fastest_until_the_lag_is_slower():
    """0.2 rad at 0.5 rad/s and 0.1 s: 0.05 rad before the end, after 0.3 s, the lag's rate is 0.5 rad/s."""
    wheels = Wheels.asked(0.0, -0.2, Actuators(steering_lag_s=0.1, steering_rate_radps=0.5))
    assert wheels.at(0.3) == pytest.approx(-0.15, rel=1e-12)
    assert wheels.at(0.1) == pytest.approx(-0.05, rel=1e-12)
    assert wheels.at(0.4) == pytest.approx(-0.2 + 0.05 * exp(-1.0), rel=1e-12)
    assert (wheels.at(0.3 + 1e-6) - wheels.at(0.3)) / 1e-6 == pytest.approx(-0.5, rel=1e-4)


@given(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(0, 0.3), st.floats(0.05, 3), st.floats(0.01, 1))
def test_wheels_in_two_ticks_are_where_they_are_after_one(start, asked, lag, fastest, dt):
    actuators = Actuators(steering_lag_s=lag, steering_rate_radps=fastest)
    once = Wheels.asked(start, asked, actuators).at(2 * dt)
    halfway = Wheels.asked(start, asked, actuators).at(dt)
    assert Wheels.asked(halfway, asked, actuators).at(dt) == pytest.approx(once, abs=1e-12)


def test_pedals_follow_with_a_lag_of_first_order_and_the_speed_with_them():
    """The throttle is let go and the brakes come on: each as its own lag says."""
    actuators = Actuators(drive_lag_s=0.5, brake_lag_s=0.2)
    speeds = Speeds.towards(20.0, Pedals(1.0, 0.0), -3.0, actuators, 2.0)
    engine, brakes = exp(-4.0), exp(-10.0)
    speed = 20.0 + 0.5 * (1.0 - engine) - 6.0 + 3.0 * 0.2 * (1.0 - brakes)
    assert speeds.at(2.0) == pytest.approx((speed, engine - 3.0 + 3.0 * brakes), rel=1e-12)
    assert speeds.pedals(2.0) == Pedals(pytest.approx(engine), pytest.approx(-3.0 + 3.0 * brakes))


def test_a_vehicle_that_brakes_stops_and_stays():
    speeds = Speeds.towards(1.0, Pedals(0.0, -4.0), -4.0, Actuators(brake_lag_s=0.15), 1.0)
    assert speeds.stops_s == pytest.approx(0.25, abs=1e-12)
    assert speeds.at(0.2)[0] == pytest.approx(0.2)
    assert speeds.at(0.3) == speeds.at(1.0) == (0.0, 0.0)


@pytest.mark.parametrize(("asked", "expected"), [(-2.0, 0.5), (0.5, inf)])
def test_a_vehicle_that_goes_on_does_not_stop(asked, expected):
    assert Speeds.towards(1.0, Pedals(), asked, Actuators(), 1.0).stops_s == pytest.approx(expected)


def test_a_speed_that_is_passed_is_found_and_one_that_is_not_is_the_end():
    speeds = Speeds.between(2.0, 6.0, 2.0)
    assert speeds.reaches_s(3.0, 2.0) == pytest.approx(0.5, abs=1e-12)
    assert speeds.reaches_s(7.0, 2.0) == 2.0
