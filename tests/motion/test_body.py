"""The body on its springs against closed forms and a general solver of differential equations."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.roads import ego
from vsensor.draws import Draws
from vsensor.motion import BumpConfig, MotionConfig, MotionState, advance, initial_state, load_motion
from vsensor.transforms import rotation_from_rpy
from vsensor.types import Tick

WHEELBASE_M = 2.8
CONFIG = MotionConfig(body=True)
SOLVED = {"rtol": 1e-11, "atol": 1e-13}
"""Of the general solver: its own error is then some 1e-10 of the result."""


def driven(times_s, config=CONFIG, speed_mps=20.0, **states):
    """Return (ego, state) at each time; states are functions of time, or values."""
    motion, draws = load_motion(config, WHEELBASE_M), Draws(1)
    state, found = initial_state(), []
    for index, t in enumerate(times_s):
        values = {name: value(t) if callable(value) else value for name, value in states.items()}
        speed = speed_mps(t) if callable(speed_mps) else speed_mps
        tick = Tick(index=index, t_ns=round(t * 1e9), period_ns=40_000_000)
        state, moved = advance(motion, state, ego(speed_mps=speed, **values), draws, tick)
        found.append((moved, state))
    return found


def angles(found):
    """Return pitch and roll (N, 2) in rad."""
    return np.array([(moved.body_pitch_rad, moved.body_roll_rad) for moved, _ in found])


def middle_heave_m(moved):
    """Return how much the middle between the axles is lifted."""
    rotation = rotation_from_rpy(moved.body_roll_rad, moved.body_pitch_rad, 0.0)
    return (rotation @ [WHEELBASE_M / 2, 0.0, 0.0])[2] + moved.body_heave_m


def second_order(times_s, hz, damping, force, foot=None, foot_rate=None):
    """Return z(t) of z'' + 2 d w z' + w^2 z = w^2 (force + foot) + 2 d w foot', at rest on force(0)."""
    w = 2 * math.pi * hz
    foot, foot_rate = foot or (lambda t: 0.0), foot_rate or (lambda t: 0.0)

    def rates(t, state):
        z, rate = state
        return [rate, w**2 * (force(t) + foot(t) - z) + 2 * damping * w * (foot_rate(t) - rate)]

    start = [force(0.0), 0.0]
    solved = solve_ivp(rates, (0, times_s[-1]), start, "DOP853", t_eval=times_s, max_step=0.002, **SOLVED)
    return solved.y[0]


# Acceleration


@pytest.mark.parametrize("acceleration", [-6.0, -0.5, 2.5])
def test_the_settled_lean_is_exactly_the_gain_times_the_acceleration(acceleration):
    def step(t):
        return acceleration if t > 0 else 0.0

    (moved, _) = driven([0.0, 0.04, 60.0], acceleration_mps2=step, lateral_acceleration_mps2=step)[-1]
    assert moved.body_pitch_rad == -math.radians(0.15) * acceleration
    assert moved.body_roll_rad == math.radians(0.4) * acceleration


def test_braking_lowers_the_nose_and_a_bend_to_the_left_lowers_the_right_side():
    (moved, _) = driven([0.0], acceleration_mps2=-5.0, lateral_acceleration_mps2=3.0)[-1]
    rotation = rotation_from_rpy(moved.body_roll_rad, moved.body_pitch_rad, 0.0)
    assert (rotation @ [1.0, 0.0, 0.0])[2] < 0.0
    assert (rotation @ [0.0, -1.0, 0.0])[2] < 0.0


def test_a_drive_begins_settled():
    found = angles(driven(np.arange(100) * 0.04, acceleration_mps2=-4.0, lateral_acceleration_mps2=1.0))
    assert (found == found[0]).all()


def test_a_jump_overshoots_by_what_the_damping_ratio_says():
    def jump(t):
        return -1.0 if t > 0 else 0.0

    times = np.concatenate([[0.0], 1e-6 + np.arange(1000) * 1e-3])
    pitch = angles(driven(times, acceleration_mps2=jump))[:, 0] / math.radians(0.15)
    overshoot = math.exp(-math.pi * 0.35 / math.sqrt(1 - 0.35**2))
    assert pitch.max() - 1.0 == pytest.approx(overshoot, abs=1e-4)  # 1 ms beside the peak: 4e-5
    damped_hz = 1.4 * math.sqrt(1 - 0.35**2)
    assert times[pitch.argmax()] == pytest.approx(0.5 / damped_hz, abs=1e-3)


def test_accelerations_that_are_linear_between_ticks_are_solved_exactly():
    times = np.cumsum(np.concatenate([[0.0], np.random.default_rng(5).uniform(0.005, 0.2, 60)]))
    values = np.random.default_rng(6).normal(0.0, 3.0, (2, len(times)))

    def along(t):
        return float(np.interp(t, times, values[0]))

    def across(t):
        return float(np.interp(t, times, values[1]))

    found = angles(driven(times, acceleration_mps2=along, lateral_acceleration_mps2=across))
    times = np.round(times, 9)
    pitch = second_order(times, 1.4, 0.35, lambda t: -math.radians(0.15) * along(t))
    roll = second_order(times, 1.6, 0.35, lambda t: math.radians(0.4) * across(t))
    np.testing.assert_allclose(found, np.column_stack([pitch, roll]), atol=1e-9)  # rad


def test_long_and_short_ticks_give_the_same():
    def ramp(t):
        return -2.0 * t

    fine = driven(np.arange(401) / 100, acceleration_mps2=ramp, lateral_acceleration_mps2=ramp)
    coarse = driven([0.0, 1.5, 4.0], acceleration_mps2=ramp, lateral_acceleration_mps2=ramp)
    np.testing.assert_allclose(angles(fine)[[0, 150, 400]], angles(coarse), rtol=0, atol=1e-15)


def test_a_tick_of_minutes_leaves_the_body_settled():
    (moved, state) = driven([0.0, 0.04, 600.0], acceleration_mps2=lambda t: -t / 100, speed_mps=0.0)[-1]
    assert moved.body_pitch_rad == pytest.approx(math.radians(0.15) * 6.0, rel=1e-3)
    assert all(map(math.isfinite, (state.pitch.real, state.heave.real, moved.body_heave_m)))


def test_an_acceleration_that_is_not_known_leaves_the_last_one():
    def lost(t):
        return -3.0 if t < 0.5 else math.nan

    found = angles(driven(np.arange(50) * 0.04, acceleration_mps2=lost, lateral_acceleration_mps2=lost))
    assert (found == found[0]).all()


def test_the_body_pitches_about_the_middle_between_the_axles():
    (moved, _) = driven([0.0], acceleration_mps2=-8.0)[-1]
    assert moved.body_pitch_rad > 0.02
    assert middle_heave_m(moved) == pytest.approx(0.0, abs=1e-15)


def test_motion_of_the_source_stays_and_the_springs_are_added():
    (still, _), (moved, _) = (
        driven([0.0], acceleration_mps2=-3.0, body_pitch_rad=pitch, body_roll_rad=roll, body_heave_m=heave)[0]
        for pitch, roll, heave in ((0.0, 0.0, 0.0), (0.01, -0.02, 0.03))
    )
    assert moved.body_pitch_rad == still.body_pitch_rad + 0.01
    assert moved.body_roll_rad == still.body_roll_rad - 0.02
    assert moved.body_heave_m == still.body_heave_m + 0.03


# Bumps


BUMPS = (
    BumpConfig(at_m=6.0, length_m=0.4, height_m=0.05),
    BumpConfig(at_m=9.0, length_m=8.0, height_m=-0.04),
    BumpConfig(at_m=10.0, length_m=1.0, height_m=0.03),
)


def road(s_m, bumps):
    """Return height and slope of the road."""
    height = slope = 0.0
    for bump in bumps:
        phase = 2 * math.pi * (s_m - bump.at_m) / bump.length_m
        if 0 < phase < 2 * math.pi:
            height += bump.height_m / 2 * (1 - math.cos(phase))
            slope += bump.height_m * math.pi / bump.length_m * math.sin(phase)
    return height, slope


@pytest.mark.parametrize("speed_mps", [20.0, 3.0, -4.0])
@pytest.mark.parametrize("period_s", [0.04, 0.5])
def test_bumps_lift_one_axle_after_the_other_as_the_solver_says(speed_mps, period_s):
    bumps = BUMPS
    if speed_mps < 0:  # backwards over what begins between the axles and behind
        bumps = (BumpConfig(at_m=1.0, length_m=0.5, height_m=0.05),)
    config = MotionConfig(body=True, bumps=bumps)
    times = np.arange(round(3.0 / period_s) + 1) * period_s

    def axles(t):
        rear, front = road(speed_mps * t, bumps), road(speed_mps * t + WHEELBASE_M, bumps)
        return np.array(rear), np.array(front)

    def lift(t, k):
        return speed_mps**k * sum(axles(t))[k] / 2

    def tilt(t, k):
        rear, front = axles(t)
        return speed_mps**k * (rear - front)[k] / WHEELBASE_M

    found = driven(times, config, speed_mps)
    heave = second_order(times, 1.3, 0.35, lambda t: 0.0, lambda t: lift(t, 0), lambda t: lift(t, 1))
    pitch = second_order(times, 1.4, 0.35, lambda t: 0.0, lambda t: tilt(t, 0), lambda t: tilt(t, 1))
    assert np.ptp(pitch) > 1e-3  # rad: something happened
    # the solver steps over the ends of a bump, where the height's second derivative jumps
    np.testing.assert_allclose(angles(found)[:, 0], pitch, rtol=0, atol=1e-8)
    np.testing.assert_allclose([middle_heave_m(moved) for moved, _ in found], heave, rtol=0, atol=1e-8)


def test_the_front_axle_meets_a_bump_first_and_raises_the_nose():
    config = MotionConfig(body=True, bumps=(BumpConfig(at_m=12.8, length_m=0.5, height_m=0.05),))
    pitch = angles(driven(np.arange(200) / 100, config, 20.0))[:, 0]
    assert (pitch[:51] == 0.0).all()  # the front axle is there after 10 m
    assert pitch[52] < 0.0
    assert np.diff(pitch)[51:64].min() < 0.0 < np.diff(pitch)[64:68].max()  # the rear one 2.8 m later


def test_whoever_stops_on_a_bump_stays_lifted():
    bump = BumpConfig(at_m=6.0, length_m=4.0, height_m=0.1)  # the rear axle stops on its top
    config = MotionConfig(body=True, bumps=(bump,))

    def speed(t):
        return 8.0 if t <= 0.96 else 0.0  # 0.96 s and half a tick of 0.08 s: 8 m

    found = driven(np.arange(400) * 0.08, config, speed)
    assert found[-1][1].driven_m == pytest.approx(8.0)
    assert angles(found)[-1, 0] == pytest.approx(0.1 / WHEELBASE_M, abs=1e-12)
    assert middle_heave_m(found[-1][0]) == pytest.approx(0.05, abs=1e-12)


def test_a_drive_that_begins_on_a_bump_begins_settled_there():
    config = MotionConfig(body=True, bumps=(BumpConfig(at_m=1.8, length_m=2.0, height_m=0.1),))
    found = driven(np.arange(50) * 0.04, config, 0.0)
    assert angles(found)[0, 0] == pytest.approx(-0.1 / WHEELBASE_M)
    assert middle_heave_m(found[0][0]) == pytest.approx(0.05)
    np.testing.assert_allclose(angles(found), angles(found)[[0]].repeat(50, axis=0), atol=1e-16)


def test_backwards_over_bumps_is_the_same_in_one_tick_as_in_many():
    motion = load_motion(MotionConfig(body=True, bumps=BUMPS), WHEELBASE_M)
    vehicle, draws = ego(speed_mps=-10.0), Draws(1)

    def backed(period_ns):
        state = MotionState(t_ns=0, driven_m=25.0, speed_mps=-10.0)
        for t_ns in range(period_ns, 2 * 10**9 + 1, period_ns):
            tick = Tick(index=0, t_ns=t_ns, period_ns=period_ns)
            state, moved = advance(motion, state, vehicle, draws, tick)
        return moved.body_pitch_rad, middle_heave_m(moved)

    assert abs(backed(2 * 10**9)[0]) > 1e-5
    np.testing.assert_allclose(backed(2 * 10**9), backed(10**7), rtol=0, atol=1e-13)


def test_the_way_is_that_of_a_linear_speed():
    found = driven(np.arange(101) * 0.04, CONFIG, lambda t: 10.0 + 2.0 * t)
    assert found[-1][1].driven_m == pytest.approx(10.0 * 4 + 4.0**2, rel=1e-14)


def test_ten_thousand_bumps_are_found_by_place_not_by_order_in_the_file():
    places = np.random.default_rng(2).permutation(10_000) * 5.0
    config = MotionConfig(body=True, bumps=tuple(BumpConfig(at_m=at) for at in places))
    motion = load_motion(config)
    assert [bump.from_m for bump in motion.bumps.near(1000.2, 1011.0)] == [1000.0, 1005.0, 1010.0]
