"""The step against the equations of motion, written again and integrated by scipy to 1e-12."""

from dataclasses import dataclass, replace
from functools import cache
from math import atan, atan2, cos, hypot, log2, radians, sin, sqrt, tan

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from vsensor.world.vehicle import DynamicsConfig, SingleTrack, Tilt, Trip, VehicleState, grip_used, pulled
from vsensor.world.vehicle.actuators import Pedals, Speeds, Wheels
from vsensor.world.vehicle.step import integrated

WHEELBASE_M = 2.8
LF, LR, M, INERTIA, HEIGHT = 1.25, 1.55, 1600.0, 2600.0, 0.55
CF, CR = 120e3, 150e3
LAGS = {"steering_lag_s": 0.1, "steering_rate_degps": 30.0, "drive_lag_s": 0.3, "brake_lag_s": 0.15}
TICK_S = 0.04


@dataclass
class Road:
    """A textbook's equations of x, y, yaw, lateral speed, yaw rate, speed, wheels, drive, brakes."""

    asked_rad: float
    asked_mps2: float
    nonlinear: bool
    friction: float = 1.0

    def __call__(self, t, y):
        _, _, yaw, lateral, rate, speed, wheels, drive, brakes = y
        acceleration = drive + brakes
        front = wheels - (atan2 if self.nonlinear else lambda a, b: a / b)(lateral + LF * rate, speed)
        rear = -(atan2 if self.nonlinear else lambda a, b: a / b)(lateral - LR * rate, speed)
        if self.nonlinear:
            moved = M * acceleration * HEIGHT / WHEELBASE_M
            weight = M * 9.81 / WHEELBASE_M
            ff = self.magic(CF, weight * LR, -moved, acceleration, front) * cos(wheels)
            fr = self.magic(CR, weight * LF, moved, acceleration, rear)
        else:
            ff, fr = CF * front, CR * rear
        aside = lateral - LR * rate
        fastest = radians(30.0)
        return [
            speed * cos(yaw) - aside * sin(yaw),
            speed * sin(yaw) + aside * cos(yaw),
            rate,
            (ff + fr) / M - speed * rate,
            (LF * ff - LR * fr) / INERTIA,
            acceleration,
            min(max((self.asked_rad - wheels) / 0.1, -fastest), fastest),
            (max(self.asked_mps2, 0.0) - drive) / 0.3,
            (min(self.asked_mps2, 0.0) - brakes) / 0.15,
        ]

    def magic(self, stiffness, load, moved, acceleration, slip):
        d = sqrt((self.friction * (load + moved)) ** 2 * (1 - (acceleration / (self.friction * 9.81)) ** 2))
        ratio = (load + moved) / load
        b = stiffness * 1.25 * ratio / (1 + 0.25 * ratio**2) / (1.3 * d)
        return d * sin(1.3 * atan(b * slip + (b * slip - atan(b * slip))))


def orders(gentle):
    """Return (seconds, wheels, acceleration) of a minute: lane changes, bends, braking, to 3 or 6 m/s^2."""
    g = 2.0 if gentle else 4.0
    return [
        *((2.0, 0.0, 0.0), (1.0, 0.006 * g, 0.0), (2.0, -0.006 * g, 0.0), (1.0, 0.006 * g, 0.0)),
        *((4.0, 0.0, 1.5), (8.0, 0.009 * g, 0.0), (4.0, -0.004, -3.0), (8.0, -0.012 * g, 0.0)),
        *(
            (6.0, 0.0, 1.0),
            (2.0, 0.008 * g, 0.0),
            (2.0, -0.008 * g, 0.0),
            (10.0, 0.003, 0.5),
            (10.0, 0.0, -0.8),
        ),
    ]


def exact(start, plan, road):
    """Return the states (N, 9) after each part of the plan, by DOP853."""
    y, found = np.array([0.0, 0.0, 0.0, 0.0, 0.0, start, 0.0, 0.0, 0.0]), []
    for seconds, wheels, acceleration in plan:
        road.asked_rad, road.asked_mps2 = wheels, acceleration
        y = solve_ivp(road, (0.0, seconds), y, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        found.append(y)
    return np.array(found)


def stepped(start, plan, vehicle):
    """Return the trips after each part of the plan, in ticks."""
    trip, found = Trip.begins(VehicleState(x_m=0.0, y_m=0.0, yaw_rad=0.0), start), []
    for seconds, wheels, acceleration in plan:
        for _ in range(round(seconds / TICK_S)):
            trip = pulled(vehicle, trip, acceleration, wheels, TICK_S)
        found.append(trip)
    return found


@cache
def both(tyres, gentle=True):
    """Return the trips of a minute from 25 m/s on, and the exact states."""
    vehicle = SingleTrack.of(DynamicsConfig(tyres=tyres, **LAGS), WHEELBASE_M)
    plan = orders(gentle)
    return stepped(25.0, plan, vehicle), exact(25.0, plan, Road(0.0, 0.0, tyres == "nonlinear"))


def errors_m(trips, states):
    return [hypot(one.body.x_m - y[0], one.body.y_m - y[1]) for one, y in zip(trips, states, strict=True)]


@pytest.mark.parametrize("gentle", [True, False], ids=["ordinary", "hard"])
@pytest.mark.parametrize("tyres", ["linear", "nonlinear"])
def test_a_minute_of_driving_stays_within_a_micrometre_of_scipys_path(tyres, gentle):
    trips, states = both(tyres, gentle)
    assert sum(seconds for seconds, *_ in orders(True)) == 60.0
    assert max(abs(trip.lateral_acceleration_mps2) for trip in trips) > (3.0 if gentle else 6.0)
    assert max(errors_m(trips, states)) < 1e-6
    end, y = trips[-1], states[-1]
    pedals = end.pedals.drive_mps2, end.pedals.brake_mps2
    assert (end.speed_mps, end.steering_rad, *pedals) == pytest.approx(tuple(y[5:]), abs=1e-9)
    assert (end.body.lateral_mps, end.body.yaw_rate_radps) == pytest.approx(tuple(y[3:5]), abs=1e-8)


@pytest.mark.parametrize("tyres", ["linear", "nonlinear"])
def test_the_error_that_a_trip_reports_is_that_of_its_place(tyres):
    """Of hard driving, at 6 m/s^2."""
    trips, states = both(tyres, gentle=False)
    largest, reported = max(errors_m(trips, states)), trips[-1].error_m
    assert largest > 1e-8
    assert reported == pytest.approx(largest, rel=0.15)


@pytest.mark.parametrize("lag_s", [0.0, 0.1])
def test_half_the_step_leaves_a_sixteenth_of_the_error(lag_s):
    """Around a kink of the wheels, too: a step ends there. Nonlinear tyres, 7 m/s^2, brakes; 20 to 2.5 ms."""
    dynamics = {**LAGS, "steering_lag_s": lag_s}
    vehicle = SingleTrack.of(DynamicsConfig(tyres="nonlinear", **dynamics), WHEELBASE_M)
    start = VehicleState(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    speeds = Speeds.towards(25.0, Pedals(), -2.0, vehicle.actuators, 0.5)
    wheels = Wheels.asked(0.0, 0.08, vehicle.actuators)
    assert 0.0 < wheels.until_s < 0.5

    def end(step_s):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("vsensor.world.vehicle.step.STEP_S", step_s)
            return integrated(vehicle, start, speeds, wheels, 0.5)

    exact = end(0.0005)
    coarse, fine = (hypot(one.x_m - exact.x_m, one.y_m - exact.y_m) for one in (end(0.02), end(0.0025)))
    assert log2(coarse / fine) / 3.0 == pytest.approx(4.0, abs=0.5)


def test_on_a_banked_road_a_straight_path_needs_the_understeer_gradients_angle():
    """Steady: no yaw rate, the tyres hold the weight's part: wheels = -K * pull."""
    vehicle = SingleTrack.of(DynamicsConfig(), WHEELBASE_M)
    trip = Trip.begins(VehicleState(x_m=0.0, y_m=0.0, yaw_rad=0.0), 30.0)
    tilt = Tilt(pull_mps2=-0.5)
    for _ in range(250):
        trip = pulled(vehicle, trip, 0.0, 0.5 * vehicle.understeer_gradient, TICK_S, tilt)
    assert trip.body.yaw_rate_radps == pytest.approx(0.0, abs=1e-9)
    assert trip.lateral_acceleration_mps2 == pytest.approx(0.5, rel=1e-9)


def test_on_a_slope_a_metre_driven_is_less_on_the_map():
    vehicle = SingleTrack.of(DynamicsConfig(tyres="nonlinear"), WHEELBASE_M)
    trip = Trip.begins(VehicleState(x_m=0.0, y_m=0.0, yaw_rad=0.0), 20.0)
    trip = pulled(vehicle, trip, 0.0, 0.0, 1.0, Tilt(run=0.8))
    assert trip.body.x_m == pytest.approx(16.0, abs=1e-12)


def test_nonlinear_tyres_corner_steadily_as_their_inverse_says():
    """The axles share m a by their distances; each slips as its curve says for its force."""
    speed, steering = 25.0, 0.05
    vehicle = SingleTrack.of(DynamicsConfig(tyres="nonlinear"), WHEELBASE_M)
    trip = Trip.begins(VehicleState(x_m=0.0, y_m=0.0, yaw_rad=0.0), speed)
    for _ in range(300):
        trip = pulled(vehicle, trip, 0.0, steering, TICK_S)
    across = speed * trip.body.yaw_rate_radps
    assert across > 5.0

    def slip(tyres, force):
        slope, peak = tyres.grip(tyres.load, 0.0)
        return brentq(lambda angle: tyres.force(slope, peak, angle) - force, 0.0, 0.1, xtol=1e-14)

    front = slip(vehicle.front, M * across * LR / WHEELBASE_M / cos(steering))
    rear = slip(vehicle.rear, M * across * LF / WHEELBASE_M)
    aside = trip.body.lateral_mps / speed
    assert aside - LR * trip.body.yaw_rate_radps / speed == pytest.approx(-tan(rear), abs=1e-9)
    assert aside + LF * trip.body.yaw_rate_radps / speed == pytest.approx(tan(steering - front), abs=1e-9)


def test_a_vehicle_beyond_its_grip_says_which_tyres_slide_and_stays_finite():
    vehicle = SingleTrack.of(DynamicsConfig(tyres="nonlinear", friction=0.3, **LAGS), WHEELBASE_M)
    trip, most = Trip.begins(VehicleState(x_m=0.0, y_m=0.0, yaw_rad=0.0), 30.0), (0.0, 0.0)
    for _ in range(250):
        trip = pulled(vehicle, trip, 0.0, 0.3, TICK_S)
        most = tuple(map(max, most, grip_used(vehicle, trip)))
        assert abs(trip.lateral_acceleration_mps2) <= 0.3 * 9.81
        assert abs(trip.body.lateral_mps) <= trip.speed_mps
    assert most[0] > 1.0


def test_a_vehicle_that_spins_skids_by_45_degrees_at_most():
    """Wheels thrown from side to side, then the brakes, at 30 m/s: it turns round its own axis."""
    vehicle = SingleTrack.of(DynamicsConfig(tyres="nonlinear", **LAGS), WHEELBASE_M)
    trip, most = Trip.begins(VehicleState(x_m=0.0, y_m=0.0, yaw_rad=0.0), 30.0), 0.0
    for seconds, wheels, pedals in ((3.0, 0.08, 0.0), (3.0, -0.08, 0.0), (4.0, 0.03, -5.0)):
        for _ in range(round(seconds / TICK_S)):
            trip = pulled(vehicle, trip, pedals, wheels, TICK_S)
            most = max(most, abs(trip.body.lateral_mps) / trip.speed_mps)
    assert most == pytest.approx(1.0, abs=1e-12)


def test_an_error_is_counted_anew_every_minute():
    vehicle = SingleTrack.of(DynamicsConfig(tyres="nonlinear"), WHEELBASE_M)
    trip = replace(
        Trip.begins(VehicleState(x_m=0.0, y_m=0.0, yaw_rad=0.0), 20.0), checked_s=59.97, error_m=1e-9
    )
    trip = pulled(vehicle, trip, 0.0, 0.05, TICK_S)
    assert (trip.checked_s, trip.coarse) == (0.0, trip.body)
    assert trip.error_m >= 1e-9
