"""The single-track model moved on in time: Runge-Kutta of fourth order in steps of fixed length.

A step never spans a kink of its inputs: it ends where the front wheels reach their fastest turning's end,
where the vehicle stops, and where it becomes so slow that it rolls without slip.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, cos, sin, sqrt, tan

from vsensor.world.vehicle.actuators import Speeds, Wheels
from vsensor.world.vehicle.single_track import Inputs, SingleTrack

KINEMATIC_MPS = 3.0
"""Below it slip is left out: at 3 m/s it changes the yaw rate of the default vehicle by 0.8 %."""

STEP_S = 0.007
STEP_OF_MODE = 0.5
"""A step is at most so much of the fastest mode's time constant."""

SHORTEST_S = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleState:
    """Rear axle at `x_m`, `y_m`, heading `yaw_rad`; `lateral_mps` of the centre of gravity, to the left."""

    x_m: float
    y_m: float
    yaw_rad: float
    lateral_mps: float = 0.0
    yaw_rate_radps: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Tilt:
    """How the road lies: a metre driven is `run` metres on the map, a turn about its normal `turn` there.

    `pull_mps2`: what gravity pulls to the left, across the vehicle along the road.
    """

    run: float = 1.0
    turn: float = 1.0
    pull_mps2: float = 0.0


LEVEL = Tilt()

_Five = tuple[float, float, float, float, float]


def driven(
    vehicle: SingleTrack,
    state: VehicleState,
    speeds_mps: tuple[float, float],
    steering_rad: float,
    dt_s: float,
) -> VehicleState:
    """Return the state after `dt_s` with the front wheels held, the speed going evenly between two values.

    On a level road. Backwards it rolls without slip.
    """
    speeds = Speeds.between(*speeds_mps, dt_s)
    return integrated(vehicle, state, speeds, Wheels(steering_rad, steering_rad), dt_s)


def integrated(
    vehicle: SingleTrack,
    state: VehicleState,
    speeds: Speeds,
    wheels: Wheels,
    dt_s: float,
    tilt: Tilt = LEVEL,
    twice: bool = True,
) -> VehicleState:
    """Return the state after `dt_s` along the courses of speed and front wheels.

    Steps are at most STEP_S long; without `twice` they are twice as long, to tell the error of a step.
    """
    y = (state.x_m, state.y_m, state.yaw_rad, state.lateral_mps, state.yaw_rate_radps)
    for begin, end in _smooth_parts(speeds, wheels, dt_s):
        slips = min(speeds.at(begin)[0], speeds.at(end)[0]) >= KINEMATIC_MPS - 1e-9
        count = ceil((end - begin) / (2.0 * _longest_step(vehicle, speeds, begin, end, slips)))
        steps = 2 * count if twice else count
        if slips:
            y = _slipping(vehicle, y, speeds, wheels, (begin, end), steps, tilt)
        else:
            y = _rolling(vehicle, y, speeds, wheels, (begin, end), steps, tilt)
    most = abs(speeds.at(dt_s)[0])  # aside: farther than 45 degrees no single track skids
    lateral = min(max(y[3], -most), most)
    return VehicleState(x_m=y[0], y_m=y[1], yaw_rad=y[2], lateral_mps=lateral, yaw_rate_radps=y[4])


def moved(
    x_m: float, y_m: float, yaw_rad: float, distance_m: float, turn_rad: float
) -> tuple[float, float, float]:
    """Return x, y, yaw after a circular arc: exact for constant speed and yaw rate, second order else."""
    half = turn_rad / 2.0
    chord = distance_m * (sin(half) / half if abs(half) > 1e-6 else 1.0 - half * half / 6.0)
    return x_m + chord * cos(yaw_rad + half), y_m + chord * sin(yaw_rad + half), yaw_rad + turn_rad


def _smooth_parts(speeds: Speeds, wheels: Wheels, dt_s: float) -> Iterator[tuple[float, float]]:
    """Yield the parts of a tick in which nothing has a kink."""
    kinks = (wheels.until_s, speeds.stops_s, speeds.reaches_s(KINEMATIC_MPS, dt_s))
    inside = sorted(t for t in kinks if SHORTEST_S < t < dt_s - SHORTEST_S)
    yield from ((a, b) for a, b in pairwise((0.0, *inside, dt_s)) if b > a)


def _longest_step(vehicle: SingleTrack, speeds: Speeds, begin: float, end: float, slips: bool) -> float:
    if not slips:
        return STEP_S
    slow = max(min(speeds.at(begin)[0], speeds.at(end)[0]), KINEMATIC_MPS)
    fast = max(speeds.at(begin)[0], speeds.at(end)[0], KINEMATIC_MPS)
    a11, a12, a21, a22 = vehicle.matrix(slow)
    rate = abs(a11) + abs(a22) + sqrt((abs(a12) + fast) * abs(a21))
    return min(STEP_S, STEP_OF_MODE / rate)


def _slipping(
    vehicle: SingleTrack,
    y: _Five,
    speeds: Speeds,
    wheels: Wheels,
    span: tuple[float, float],
    steps: int,
    tilt: Tilt,
) -> _Five:
    """Return the state after RK4 steps over a part of a tick."""
    rates, inputs = (_linear, _linear_inputs) if vehicle.is_linear else (_nonlinear, _nonlinear_inputs)
    h = (span[1] - span[0]) / steps
    after = inputs(vehicle, speeds, wheels, span[0])
    for k in range(steps):
        t = span[0] + k * h
        before, middle = after, inputs(vehicle, speeds, wheels, t + 0.5 * h)
        after = inputs(vehicle, speeds, wheels, t + h)
        k1 = rates(vehicle, y, before, tilt)
        k2 = rates(vehicle, _along(y, k1, 0.5 * h), middle, tilt)
        k3 = rates(vehicle, _along(y, k2, 0.5 * h), middle, tilt)
        k4 = rates(vehicle, _along(y, k3, h), after, tilt)
        y = _joined(y, k1, k2, k3, k4, h / 6.0)
    return y


def _along(y: _Five, rates: _Five, h: float) -> _Five:
    return (
        y[0] + h * rates[0],
        y[1] + h * rates[1],
        y[2] + h * rates[2],
        y[3] + h * rates[3],
        y[4] + h * rates[4],
    )


def _joined(y: _Five, a: _Five, b: _Five, c: _Five, d: _Five, sixth: float) -> _Five:
    return (
        y[0] + sixth * (a[0] + 2.0 * (b[0] + c[0]) + d[0]),
        y[1] + sixth * (a[1] + 2.0 * (b[1] + c[1]) + d[1]),
        y[2] + sixth * (a[2] + 2.0 * (b[2] + c[2]) + d[2]),
        y[3] + sixth * (a[3] + 2.0 * (b[3] + c[3]) + d[3]),
        y[4] + sixth * (a[4] + 2.0 * (b[4] + c[4]) + d[4]),
    )


def _linear_inputs(vehicle: SingleTrack, speeds: Speeds, wheels: Wheels, t_s: float) -> Inputs:
    """Return speed, a11, a12, a21, a22, and what the front wheels add to both accelerations."""
    speed = speeds.at(t_s)[0]
    push = vehicle.front_stiffness * wheels.at(t_s)
    a = vehicle.matrix(max(speed, KINEMATIC_MPS))
    return (speed, *a, push / vehicle.mass, vehicle.front_m * push / vehicle.inertia)


def _linear(vehicle: SingleTrack, y: _Five, inputs: Inputs, tilt: Tilt) -> _Five:
    _, _, yaw, lateral, yaw_rate = y
    speed, a11, a12, a21, a22, b1, b2 = inputs
    aside = lateral - vehicle.rear_m * yaw_rate  # of the rear axle
    c, s, ahead = cos(yaw), sin(yaw), tilt.run * speed
    return (
        ahead * c - aside * s,
        ahead * s + aside * c,
        tilt.turn * yaw_rate,
        a11 * lateral + a12 * yaw_rate + b1 + tilt.pull_mps2,
        a21 * lateral + a22 * yaw_rate + b2,
    )


def _nonlinear_inputs(vehicle: SingleTrack, speeds: Speeds, wheels: Wheels, t_s: float) -> Inputs:
    """Return what `forces` needs besides the motion."""
    speed, acceleration = speeds.at(t_s)
    return vehicle.inputs(speed, wheels.at(t_s), acceleration)


def _nonlinear(vehicle: SingleTrack, y: _Five, inputs: Inputs, tilt: Tilt) -> _Five:
    _, _, yaw, lateral, yaw_rate = y
    speed = inputs[0]
    front, rear = vehicle.forces(lateral, yaw_rate, inputs)
    aside = lateral - vehicle.rear_m * yaw_rate
    c, s, ahead = cos(yaw), sin(yaw), tilt.run * speed
    return (
        ahead * c - aside * s,
        ahead * s + aside * c,
        tilt.turn * yaw_rate,
        (front + rear) / vehicle.mass - speed * yaw_rate + tilt.pull_mps2,
        (vehicle.front_m * front - vehicle.rear_m * rear) / vehicle.inertia,
    )


def _rolling(
    vehicle: SingleTrack,
    y: _Five,
    speeds: Speeds,
    wheels: Wheels,
    span: tuple[float, float],
    steps: int,
    tilt: Tilt,
) -> _Five:
    """Return the state after steps without slip: yaw rate v tan(delta) / L; the same RK4 over x, y, yaw."""
    h = (span[1] - span[0]) / steps

    def turned(t_s: float) -> tuple[float, float]:
        speed = speeds.at(t_s)[0]
        return tilt.run * speed, speed * tan(wheels.at(t_s)) / vehicle.wheelbase_m

    x, y_m, yaw, _, _ = y
    ahead, rate = turned(span[0])
    for k in range(steps):
        t = span[0] + k * h
        before, rate_before = ahead, rate
        (middle, rate_middle), (ahead, rate) = turned(t + 0.5 * h), turned(t + h)
        r1, r2, r4 = tilt.turn * rate_before, tilt.turn * rate_middle, tilt.turn * rate
        y2, y3, y4 = yaw + 0.5 * h * r1, yaw + 0.5 * h * r2, yaw + h * r2
        x += h / 6.0 * (before * cos(yaw) + 2.0 * middle * (cos(y2) + cos(y3)) + ahead * cos(y4))
        y_m += h / 6.0 * (before * sin(yaw) + 2.0 * middle * (sin(y2) + sin(y3)) + ahead * sin(y4))
        yaw += h / 6.0 * (r1 + 4.0 * r2 + r4)
    return x, y_m, yaw, vehicle.rear_m * rate, rate
