"""A vehicle under way: its body and its actuators as one value, and beside it what its steps are wrong by.

steps of 5 ms    o-o-o-o-o-o-o-o    goes on from tick to tick
steps of 10 ms   o---o---o---o      the same inputs; both start from one place every CHECKED_S
                               |    a fifteenth of what lies between them is the error of the fine one:
                               |    of fourth order, the coarse one's is 16 times as large (Richardson)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import atan, hypot

from vsensor.world.vehicle.actuators import RELEASED, Pedals, Speeds, Wheels
from vsensor.world.vehicle.single_track import SingleTrack
from vsensor.world.vehicle.step import KINEMATIC_MPS, LEVEL, Tilt, VehicleState, integrated

CHECKED_S = 60.0
TIMES_AS_WRONG = 16.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Trip:
    """The vehicle now; `steering_rad` of the front wheels as they stand, `coarse` driven in longer steps.

    `error_m` is the largest error of the place so far, within `checked_s` since both were in one place.
    """

    body: VehicleState
    coarse: VehicleState
    speed_mps: float = 0.0
    pedals: Pedals = RELEASED
    steering_rad: float = 0.0
    lateral_acceleration_mps2: float = 0.0
    checked_s: float = 0.0
    error_m: float = 0.0

    @property
    def acceleration_mps2(self) -> float:
        """What drive and brakes give together."""
        return self.pedals.acceleration_mps2

    @classmethod
    def begins(cls, body: VehicleState, speed_mps: float = 0.0, steering_rad: float = 0.0) -> "Trip":
        """Return a trip from this state on."""
        across = speed_mps * body.yaw_rate_radps
        return cls(
            body=body,
            coarse=body,
            speed_mps=speed_mps,
            steering_rad=steering_rad,
            lateral_acceleration_mps2=across,
        )


def cornering(
    vehicle: SingleTrack, x_m: float, y_m: float, heading_rad: float, speed_mps: float, curvature_per_m: float
) -> Trip:
    """Return a trip that begins in a steady bend, linear tyres: the rear axle goes in the direction given."""
    rate = speed_mps * curvature_per_m
    if speed_mps < KINEMATIC_MPS:
        aside, steering = 0.0, atan(vehicle.wheelbase_m * curvature_per_m)
    else:
        force = vehicle.mass * speed_mps * rate * vehicle.front_m / vehicle.wheelbase_m
        aside = -force / vehicle.rear_stiffness  # direction of the rear axle in the vehicle
        steering = rate / vehicle.steady_yaw_rate(speed_mps, 1.0)
    body = VehicleState(
        x_m=x_m,
        y_m=y_m,
        yaw_rad=heading_rad - aside,
        lateral_mps=speed_mps * aside + vehicle.rear_m * rate,
        yaw_rate_radps=rate,
    )
    return Trip.begins(body, speed_mps, steering)


def pulled(
    vehicle: SingleTrack, trip: Trip, asked_mps2: float, asked_rad: float, dt_s: float, tilt: Tilt = LEVEL
) -> Trip:
    """Return the trip after a tick: the pedals ask for an acceleration, the driver for an angle."""
    speeds = Speeds.towards(trip.speed_mps, trip.pedals, asked_mps2, vehicle.actuators, dt_s)
    return _gone(vehicle, trip, speeds, asked_rad, dt_s, tilt)


def steered(
    vehicle: SingleTrack,
    trip: Trip,
    speeds_mps: Sequence[float],
    asked_rad: float,
    dt_s: float,
    tilt: Tilt = LEVEL,
) -> Trip:
    """Return the trip after a tick in which the speed goes evenly between two values, whatever they are."""
    return _gone(vehicle, trip, Speeds.between(speeds_mps[0], speeds_mps[1], dt_s), asked_rad, dt_s, tilt)


def _gone(
    vehicle: SingleTrack, trip: Trip, speeds: Speeds, asked_rad: float, dt_s: float, tilt: Tilt
) -> Trip:
    wheels = Wheels.asked(trip.steering_rad, asked_rad, vehicle.actuators)
    body = integrated(vehicle, trip.body, speeds, wheels, dt_s, tilt)
    coarse = integrated(vehicle, trip.coarse, speeds, wheels, dt_s, tilt, twice=False)
    apart = hypot(body.x_m - coarse.x_m, body.y_m - coarse.y_m)
    checked_s = trip.checked_s + dt_s
    is_over = checked_s >= CHECKED_S - 1e-6
    speed, pedals, steering = speeds.at(dt_s)[0], speeds.pedals(dt_s), wheels.at(dt_s)
    return Trip(
        body=body,
        coarse=body if is_over else coarse,
        speed_mps=speed,
        pedals=pedals,
        steering_rad=steering,
        lateral_acceleration_mps2=_across(vehicle, body, speed, pedals.acceleration_mps2, steering),
        checked_s=0.0 if is_over else checked_s,
        error_m=max(trip.error_m, apart / (TIMES_AS_WRONG - 1.0)),
    )


def _across(
    vehicle: SingleTrack, body: VehicleState, speed: float, acceleration: float, steering: float
) -> float:
    """Return the lateral acceleration of the centre of gravity that the tyres give, m/s^2."""
    lateral, rate = body.lateral_mps, body.yaw_rate_radps
    if speed < KINEMATIC_MPS:
        return speed * rate
    if vehicle.is_linear:
        a11, a12, _, _ = vehicle.matrix(speed)
        push = vehicle.front_stiffness * steering / vehicle.mass
        return a11 * lateral + (a12 + speed) * rate + push
    return sum(vehicle.forces(lateral, rate, vehicle.inputs(speed, steering, acceleration))) / vehicle.mass


def grip_used(vehicle: SingleTrack, trip: Trip) -> tuple[float, float]:
    """Return by how much front and rear tyres slip, 1 = where the side force is largest."""
    if trip.speed_mps < KINEMATIC_MPS:
        return 0.0, 0.0
    body = trip.body
    return vehicle.grip_used(
        trip.speed_mps, body.lateral_mps, body.yaw_rate_radps, trip.steering_rad, trip.acceleration_mps2
    )


def placed(trip: Trip, body: VehicleState) -> Trip:
    """Return the trip from another place on, its error as it was."""
    return replace(trip, body=body, coarse=body, checked_s=0.0)
