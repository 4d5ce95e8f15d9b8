"""A single-track vehicle moved on in time, by Runge-Kutta steps, or rolling without slip where it is slow."""

from dataclasses import dataclass
from math import ceil, cos, sin, sqrt, tan

from vsensor.world.vehicle.single_track import SingleTrack

KINEMATIC_MPS = 3.0
"""Below it slip is left out: at 3 m/s it changes the yaw rate of the default vehicle by 0.8 %."""

STEP_S = 0.005
STEP_OF_MODE = 0.25
"""A step is at most so much of the fastest mode's time constant: RK4 is then right to 1e-5 of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleState:
    """Rear axle at `x_m`, `y_m`, heading `yaw_rad`; `lateral_mps` of the centre of gravity, to the left."""

    x_m: float
    y_m: float
    yaw_rad: float
    lateral_mps: float = 0.0
    yaw_rate_radps: float = 0.0


def driven(
    vehicle: SingleTrack,
    state: VehicleState,
    speeds_mps: tuple[float, float],
    steering_rad: float,
    dt_s: float,
) -> VehicleState:
    """Return the state after `dt_s` with the front wheels held, the speed going evenly between two values.

    Fourth-order Runge-Kutta in steps of at most STEP_S. Backwards it rolls without slip.
    """
    start, end = speeds_mps
    fast = max(start, end, KINEMATIC_MPS)
    slow = max(min(start, end), KINEMATIC_MPS)
    a11, a12, a21, a22 = vehicle.matrix(slow)
    rate = abs(a11) + abs(a22) + sqrt((abs(a12) + fast) * abs(a21))
    steps = max(1, ceil(dt_s / STEP_S), ceil(dt_s * rate / STEP_OF_MODE))
    h = dt_s / steps
    for k in range(steps):
        before, after = (start + (end - start) * (k + part) / steps for part in (0, 1))
        state = _step(vehicle, state, before, after, steering_rad, h)
    return state


def moved(
    x_m: float, y_m: float, yaw_rad: float, distance_m: float, turn_rad: float
) -> tuple[float, float, float]:
    """Return x, y, yaw after a circular arc: exact for constant speed and yaw rate, second order else."""
    half = turn_rad / 2.0
    chord = distance_m * (sin(half) / half if abs(half) > 1e-6 else 1.0 - half * half / 6.0)
    return x_m + chord * cos(yaw_rad + half), y_m + chord * sin(yaw_rad + half), yaw_rad + turn_rad


def _step(
    vehicle: SingleTrack, state: VehicleState, before: float, after: float, steering_rad: float, h: float
) -> VehicleState:
    if min(before, after) < KINEMATIC_MPS:
        return _rolled(vehicle, state, before, after, steering_rad, h)
    middle = (before + after) / 2.0
    y0 = (state.x_m, state.y_m, state.yaw_rad, state.lateral_mps, state.yaw_rate_radps)
    k1 = _rates(vehicle, y0, before, steering_rad)
    k2 = _rates(vehicle, _along(y0, k1, h / 2.0), middle, steering_rad)
    k3 = _rates(vehicle, _along(y0, k2, h / 2.0), middle, steering_rad)
    k4 = _rates(vehicle, _along(y0, k3, h), after, steering_rad)
    x, y, yaw, lateral, yaw_rate = (
        y + h / 6.0 * (a + 2.0 * b + 2.0 * c + d) for y, a, b, c, d in zip(y0, k1, k2, k3, k4, strict=True)
    )
    return VehicleState(x_m=x, y_m=y, yaw_rad=yaw, lateral_mps=lateral, yaw_rate_radps=yaw_rate)


_Five = tuple[float, float, float, float, float]


def _along(y: _Five, rates: _Five, h: float) -> _Five:
    return (
        y[0] + h * rates[0],
        y[1] + h * rates[1],
        y[2] + h * rates[2],
        y[3] + h * rates[3],
        y[4] + h * rates[4],
    )


def _rates(vehicle: SingleTrack, y: _Five, speed: float, steering: float) -> _Five:
    _, _, yaw, lateral, yaw_rate = y
    a11, a12, a21, a22 = vehicle.matrix(speed)
    aside = lateral - vehicle.rear_m * yaw_rate  # of the rear axle
    c, s = cos(yaw), sin(yaw)
    return (
        speed * c - aside * s,
        speed * s + aside * c,
        yaw_rate,
        a11 * lateral + a12 * yaw_rate + vehicle.front_stiffness / vehicle.mass * steering,
        a21 * lateral
        + a22 * yaw_rate
        + vehicle.front_m * vehicle.front_stiffness / vehicle.inertia * steering,
    )


def _rolled(
    vehicle: SingleTrack, state: VehicleState, before: float, after: float, steering: float, h: float
) -> VehicleState:
    """Return the state after a step without slip: yaw rate v tan(delta) / L."""
    per_metre = tan(steering) / vehicle.wheelbase_m
    distance = (before + after) / 2.0 * h
    x, y, yaw = moved(state.x_m, state.y_m, state.yaw_rad, distance, distance * per_metre)
    yaw_rate = after * per_metre
    return VehicleState(
        x_m=x, y_m=y, yaw_rad=yaw, lateral_mps=vehicle.rear_m * yaw_rate, yaw_rate_radps=yaw_rate
    )
