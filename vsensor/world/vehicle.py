"""A vehicle that is steered: the linear single-track model, about the rear axle's path.

       <------ wheelbase L ------>
       <-- lr --><----- lf ------>
    rear axle   centre of        front axle
       o---------gravity----------/  front wheels turned by delta, left positive
       x, y, yaw                     slip at each axle: side force = stiffness * slip angle

Below KINEMATIC_MPS the tyres roll without slip, so the model does not divide by a speed near 0.
"""

from dataclasses import dataclass
from math import ceil, cos, sin, sqrt, tan
from typing import Annotated

import msgspec

from vsensor.errors import ConfigError
from vsensor.schema import Config

KINEMATIC_MPS = 3.0
"""Below it slip is left out: at 3 m/s it changes the yaw rate of the default vehicle by 0.8 %."""

STEP_S = 0.005
STEP_OF_MODE = 0.25
"""A step is at most so much of the fastest mode's time constant: RK4 is then right to 1e-5 of it."""

SLOWEST_CRITICAL_MPS = 100.0

_Stiffness = Annotated[float, msgspec.Meta(ge=1e3, le=2e6)]


class DynamicsConfig(Config, frozen=True, kw_only=True):
    """`[dynamics]`: what moves a steered vehicle; stiffnesses are those of a whole axle.

    `steering_ratio` is the angle of the steering wheel per angle of the front wheels.
    """

    mass_kg: Annotated[float, msgspec.Meta(ge=100, le=60_000)] = 1600.0
    yaw_inertia_kgm2: Annotated[float, msgspec.Meta(ge=50, le=1e6)] = 2600.0
    cg_to_front_axle_m: Annotated[float, msgspec.Meta(gt=0, le=15)] = 1.25
    front_stiffness_npr: _Stiffness = 120_000.0
    rear_stiffness_npr: _Stiffness = 150_000.0
    steering_ratio: Annotated[float, msgspec.Meta(ge=1, le=50)] = 15.0


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleState:
    """Rear axle at `x_m`, `y_m`, heading `yaw_rad`; `lateral_mps` of the centre of gravity, to the left."""

    x_m: float
    y_m: float
    yaw_rad: float
    lateral_mps: float = 0.0
    yaw_rate_radps: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleTrack:
    """A vehicle ready to drive: mass kg, yaw inertia kg m^2, distances m, axle stiffnesses N/rad."""

    mass: float
    inertia: float
    front_m: float
    rear_m: float
    front_stiffness: float
    rear_stiffness: float

    @classmethod
    def of(cls, config: DynamicsConfig, wheelbase_m: float) -> "SingleTrack":
        """Compile; raises ConfigError for a centre of gravity off the wheelbase and for one that spins."""
        if config.cg_to_front_axle_m >= wheelbase_m:
            raise ConfigError(
                f"dynamics.cg_to_front_axle_m = {config.cg_to_front_axle_m:g}: less than the wheelbase of "
                f"{wheelbase_m:g} m was expected"
            )
        vehicle = cls(
            mass=config.mass_kg,
            inertia=config.yaw_inertia_kgm2,
            front_m=config.cg_to_front_axle_m,
            rear_m=wheelbase_m - config.cg_to_front_axle_m,
            front_stiffness=config.front_stiffness_npr,
            rear_stiffness=config.rear_stiffness_npr,
        )
        gradient = vehicle.understeer_gradient
        if gradient < 0.0 and sqrt(-wheelbase_m / gradient) < SLOWEST_CRITICAL_MPS:
            raise ConfigError(
                f"dynamics: oversteers, it spins from {sqrt(-wheelbase_m / gradient):.0f} m/s on; more "
                "rear_stiffness_npr or a smaller cg_to_front_axle_m was expected"
            )
        return vehicle

    @property
    def wheelbase_m(self) -> float:
        """Distance of the axles."""
        return self.front_m + self.rear_m

    @property
    def understeer_gradient(self) -> float:
        """Steering angle that is needed per lateral acceleration beside the geometric one, rad per m/s^2."""
        load = self.rear_m / self.front_stiffness - self.front_m / self.rear_stiffness
        return self.mass / self.wheelbase_m * load

    def steady_yaw_rate(self, speed_mps: float, steering_rad: float) -> float:
        """Return the yaw rate of steady cornering: v delta / (L + K v^2), rad/s."""
        return speed_mps * steering_rad / (self.wheelbase_m + self.understeer_gradient * speed_mps**2)

    def matrix(self, speed_mps: float) -> tuple[float, float, float, float]:
        """Return a11, a12, a21, a22 of d/dt (lateral speed, yaw rate) at a forward speed, linear tyres."""
        front, rear = self.front_stiffness, self.rear_stiffness
        moment = self.rear_m * rear - self.front_m * front
        damping = self.front_m**2 * front + self.rear_m**2 * rear
        return (
            -(front + rear) / (self.mass * speed_mps),
            moment / (self.mass * speed_mps) - speed_mps,
            moment / (self.inertia * speed_mps),
            -damping / (self.inertia * speed_mps),
        )


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
