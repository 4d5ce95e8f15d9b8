"""The single-track model: steady cornering, understeer, yaw frequency in closed form; paths against scipy."""

from dataclasses import replace
from math import acos, cos, exp, hypot, log, pi, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from vsensor.errors import ConfigError
from vsensor.world.vehicle import KINEMATIC_MPS, DynamicsConfig, SingleTrack, VehicleState, driven, moved

WHEELBASE_M = 2.8
VEHICLE = SingleTrack.of(DynamicsConfig(), WHEELBASE_M)
START = VehicleState(x_m=0.0, y_m=0.0, yaw_rad=0.0)


def after(seconds, speed, steering, state=START, vehicle=VEHICLE, tick_s=0.04):
    """Return the state after so long at constant speed and steering, in ticks."""
    for _ in range(round(seconds / tick_s)):
        state = driven(vehicle, state, (speed, speed), steering, tick_s)
    return state


def oscillating(speed):
    """Return the yaw rates (N,) of the vehicle at 20 ms steps after a push, front wheels straight."""
    state, rates = replace(START, yaw_rate_radps=0.1), []
    for _ in range(60):
        rates.append(state.yaw_rate_radps)
        state = driven(VEHICLE, state, (speed, speed), 0.0, 0.02)
    return np.array(rates)


@pytest.mark.parametrize("speed", [5.0, 20.0, 40.0])
def test_steady_cornering_has_the_textbooks_yaw_rate(speed):
    # Balance of forces and moments: m v r = Ff + Fr, lf Ff = lr Fr; slip angles give delta - L r / v.
    k = VEHICLE.mass / WHEELBASE_M * (1.55 / 120_000 - 1.25 / 150_000)
    wanted = speed * 0.01 / (WHEELBASE_M + k * speed**2)
    assert after(20.0, speed, 0.01).yaw_rate_radps == pytest.approx(wanted, rel=1e-9)
    assert VEHICLE.steady_yaw_rate(speed, 0.01) == pytest.approx(wanted, rel=1e-12)


def test_the_understeer_gradient_is_the_extra_angle_per_lateral_acceleration():
    speed, steering = 30.0, 0.02
    rate = after(20.0, speed, steering).yaw_rate_radps
    extra = steering - WHEELBASE_M * rate / speed
    assert extra / (speed * rate) == pytest.approx(VEHICLE.understeer_gradient, rel=1e-9)
    assert VEHICLE.understeer_gradient == pytest.approx(2.619e-3, abs=1e-6)


def test_the_yaw_oscillates_with_the_textbooks_frequency_and_damping():
    """Free motion of second order obeys r[k+1] = a r[k] + b r[k-1]; a and b say frequency and damping."""
    speed, h = 40.0, 0.02
    r = oscillating(speed)
    (a, b), *_ = np.linalg.lstsq(np.column_stack([r[1:-1], r[:-2]]), r[2:], rcond=None)
    decay = -log(-b) / (2.0 * h)  # D w0
    damped = acos(a / (2.0 * exp(-decay * h))) / h
    front, rear, lf, lr, m, inertia = 120e3, 150e3, 1.25, 1.55, 1600.0, 2600.0
    # Mitschke, Dynamik der Kraftfahrzeuge: yaw eigenfrequency and damping of the linear single track.
    w2 = front * rear * (lf + lr) ** 2 / (m * inertia * speed**2) + (lr * rear - lf * front) / inertia
    d = (m * (lf**2 * front + lr**2 * rear) + inertia * (front + rear)) / (2 * m * inertia * speed)
    assert hypot(decay, damped) == pytest.approx(sqrt(w2), rel=1e-5)
    assert decay == pytest.approx(d, rel=1e-5)


@pytest.mark.parametrize("speed", [KINEMATIC_MPS, 8.0, 45.0])
def test_slip_and_yaw_rate_follow_the_matrix_exponential(speed):
    a = np.array(VEHICLE.matrix(speed)).reshape(2, 2)
    b = np.array([120e3 / 1600.0, 1.25 * 120e3 / 2600.0]) * 0.03
    t = 0.4
    forced = np.linalg.solve(a, (expm(a * t) - np.eye(2)) @ b)
    state = after(t, speed, 0.03)
    assert (state.lateral_mps, state.yaw_rate_radps) == pytest.approx(tuple(forced), rel=1e-4, abs=1e-7)


def test_the_path_of_the_rear_axle_is_that_of_the_equations_of_motion():
    def rates(t, y):
        _, _, yaw, lateral, rate = y
        v = 15.0 + 4.0 * t
        ff = -120e3 * ((lateral + 1.25 * rate) / v - 0.03)
        fr = -150e3 * (lateral - 1.55 * rate) / v
        aside = lateral - 1.55 * rate
        return [
            v * cos(yaw) - aside * sin(yaw),
            v * sin(yaw) + aside * cos(yaw),
            rate,
            (ff + fr) / 1600.0 - v * rate,
            (1.25 * ff - 1.55 * fr) / 2600.0,
        ]

    wanted = solve_ivp(rates, (0.0, 3.0), [0.0] * 5, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    state = START
    for k in range(75):
        speeds = 15.0 + 4.0 * 0.04 * k, 15.0 + 4.0 * 0.04 * (k + 1)
        state = driven(VEHICLE, state, speeds, 0.03, 0.04)
    found = (state.x_m, state.y_m, state.yaw_rad, state.lateral_mps, state.yaw_rate_radps)
    assert found == pytest.approx(tuple(wanted), abs=1e-5)  # 55 m driven, turned by 0.6 rad


def test_below_walking_speed_the_rear_axle_runs_on_the_circle_of_the_steering_geometry():
    steering = 0.3
    radius = WHEELBASE_M / tan(steering)
    state = after(2 * pi * radius / 2.0 / 4.0, 2.0, steering, tick_s=2 * pi * radius / 2.0 / 400.0)
    assert (state.x_m, state.y_m, state.yaw_rad) == pytest.approx((radius, radius, pi / 2), abs=1e-9)
    assert state.lateral_mps == pytest.approx(1.55 * state.yaw_rate_radps)


def test_a_vehicle_that_stands_stays_where_it_is():
    assert after(1.0, 0.0, 0.4) == START


@pytest.mark.parametrize("speed", [1.0, 10.0, 40.0])
def test_mirrored_steering_drives_the_mirrored_path(speed):
    left, right = after(1.0, speed, 0.02), after(1.0, speed, -0.02)
    assert (left.x_m, left.y_m, left.yaw_rad) == pytest.approx((right.x_m, -right.y_m, -right.yaw_rad))
    assert left.y_m > 0.0


@given(
    st.floats(-10, 80),
    st.floats(-10, 80),
    st.floats(-0.7, 0.7),
    st.sampled_from([(400.0, 5e5), (60_000.0, 3e4), (1600.0, 1.2e5)]),
)
def test_whatever_a_vehicle_is_asked_it_stays_finite_and_within_its_circle(start, end, steering, one):
    mass, stiffness = one
    vehicle = SingleTrack.of(
        DynamicsConfig(mass_kg=mass, front_stiffness_npr=stiffness, rear_stiffness_npr=1.3 * stiffness),
        WHEELBASE_M,
    )
    state = START
    for _ in range(25):
        state = driven(vehicle, state, (start, end), steering, 0.04)
    assert abs(state.yaw_rate_radps) <= 1.5 * 80.0 * abs(tan(steering)) / WHEELBASE_M
    assert hypot(state.x_m, state.y_m) <= 5.0 * max(abs(start), abs(end), 1.0)


@given(st.floats(-60, 60), st.floats(-7, 7), st.floats(-3, 3))
def test_an_arc_in_two_halves_is_the_arc(distance, turn, yaw):
    half = moved(*moved(1.0, 2.0, yaw, distance / 2, turn / 2), distance / 2, turn / 2)
    assert half == pytest.approx(moved(1.0, 2.0, yaw, distance, turn), abs=1e-9)


def test_an_arc_ends_on_its_circle():
    assert moved(0.0, 0.0, 0.0, 10 * pi / 2, pi / 2) == pytest.approx((10.0, 10.0, pi / 2), abs=1e-12)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"cg_to_front_axle_m": 2.8}, "less than the wheelbase of 2.8 m"),
        ({"rear_stiffness_npr": 60_000.0}, "oversteers, it spins from"),
    ],
)
def test_a_vehicle_that_cannot_be_driven_is_refused(keys, said):
    with pytest.raises(ConfigError, match=said):
        SingleTrack.of(DynamicsConfig(**keys), WHEELBASE_M)
