"""A driver: follows a path by looking ahead along it, and keeps the speed that is wanted. A pure function.

                   . - * - .
   path   * - * - '         ' - *     places where the driver looks: one a period, up to preview_s
offset {  :                           ahead; each counts by how much the path turns there
          o===>                       vehicle; its own motion and wheels count, too
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import floor, sqrt
from typing import Annotated

import msgspec
import numpy as np

from vsensor.schema import Config
from vsensor.types import Array
from vsensor.world.profiles import LinearProfile
from vsensor.world.vehicle.preview import Gains, gains_at
from vsensor.world.vehicle.single_track import SingleTrack
from vsensor.world.vehicle.step import KINEMATIC_MPS
from vsensor.world.vehicle.trip import Trip
from vsensor.world.vehicle.tyres import GRAVITY_MPS2

PERIOD_NS = 40_000_000
"""A driver acts every 40 ms, however often the sensor looks."""

PERIOD_S = PERIOD_NS * 1e-9
LOOKS_EVERY = 2
"""It looks at the path at every second of its periods: one turn stands for both."""

SLOWEST_MPS = 3.0
SPEED_STEP_MPS = 1.0
LARGEST_STEERING_RAD = 0.7
"""Front wheels turn no farther: 40 degrees."""

MOST_OF_FRICTION = 0.9
MOST_ACROSS = 0.95
MOST_SOFTNESS_RAD = 0.1
"""Tyres that slip more than that are at their end, and no steering gets more from them."""

QUICKEST_PEDAL_PER_S = 1.0


class DriverConfig(Config, frozen=True, kw_only=True):
    """`[driver]`: how far it looks ahead, and how quickly it comes back to its path (rad/s: 2 is in 2 s)."""

    preview_s: Annotated[float, msgspec.Meta(ge=0.5, le=10)] = 4.0
    quickness_radps: Annotated[float, msgspec.Meta(ge=0.3, le=5)] = 2.0


@dataclass(frozen=True, slots=True)
class Seen:
    """The path as the driver sees it: the rear axle is `offset_m` to its left, turned by `heading_rad`.

    `turns_rad` (N,): by how much the path turns between the places of `Driver.distances_m` (N + 1,).
    `pull_mps2`: that of the road's tilt to the left.
    """

    offset_m: float
    heading_rad: float
    turns_rad: Array
    pull_mps2: float = 0.0


@dataclass(frozen=True, slots=True)
class Order:
    """What a driver asks for, and its whole state: front wheels and acceleration."""

    steering_rad: float = 0.0
    acceleration_mps2: float = 0.0


class Driver:
    """A driver who knows the vehicle; gains are made once for each metre per second that is driven."""

    def __init__(self, vehicle: SingleTrack, config: DriverConfig | None = None) -> None:
        self._vehicle, self._config = vehicle, config or DriverConfig()
        self._count = max(1, round(self._config.preview_s / (LOOKS_EVERY * PERIOD_S)))
        self._times_s = LOOKS_EVERY * PERIOD_S * np.arange(self._count + 1)
        self._gains: dict[int, Gains] = {}
        lag_s = max(vehicle.actuators.drive_lag_s, vehicle.actuators.brake_lag_s)
        self._pedal_per_s = min(QUICKEST_PEDAL_PER_S, 0.25 / lag_s) if lag_s else QUICKEST_PEDAL_PER_S

    def distances_m(self, speed_mps: float, acceleration_mps2: float = 0.0) -> Array:
        """Return where the driver looks (N + 1,), from 0 on, at this speed and acceleration."""
        t = self._times_s
        slow_s = 0.0 if speed_mps < SLOWEST_MPS else float(t[-1])  # from then on it is taken as SLOWEST_MPS
        if acceleration_mps2 < 0.0:
            slow_s = max(speed_mps - SLOWEST_MPS, 0.0) / -acceleration_mps2
        early: Array = np.minimum(t, np.float64(slow_s))
        return speed_mps * early + 0.5 * acceleration_mps2 * early * early + SLOWEST_MPS * (t - early)

    def wanted(self, speeds: LinearProfile, t_s: float) -> tuple[float, float]:
        """Return the speed of a profile now, and the acceleration as it will be when pedals have acted."""
        actuators = self._vehicle.actuators
        braking = speeds.slope(t_s + actuators.brake_lag_s)
        driving = speeds.slope(t_s + actuators.drive_lag_s)
        return speeds.value(t_s), braking if braking < 0.0 else max(driving, 0.0)

    def order(self, last: Order, trip: Trip, seen: Seen, speeds: Sequence[float]) -> Order:
        """Return what is asked for until the next period.

        `speeds`: the speed and the acceleration that are wanted, as `wanted` gives them.
        """
        gains = self.gains(trip.speed_mps)
        ahead = float(gains.preview @ seen.turns_rad) + gains.pull * seen.pull_mps2
        wheels = last.steering_rad - float(gains.feedback @ self._felt(last, trip, seen)) - ahead
        pedal = speeds[1] + self._pedal_per_s * (speeds[0] - trip.speed_mps)
        most = self.most_mps2(trip)
        return Order(
            min(max(wheels, -LARGEST_STEERING_RAD), LARGEST_STEERING_RAD),
            min(max(pedal, -most), most),
        )

    def _felt(self, last: Order, trip: Trip, seen: Seen) -> Array:
        """Return the state (STATES,) of a vehicle with linear tyres that goes as this one does.

        It has the same forces and the same path of the rear axle; what the tyres slip more is taken off.
        """
        body, front, rear = trip.body, 0.0, 0.0
        if not self._vehicle.is_linear and trip.speed_mps >= KINEMATIC_MPS:
            inputs = self._vehicle.inputs(trip.speed_mps, trip.steering_rad, trip.acceleration_mps2)
            softness = self._vehicle.softness(body.lateral_mps, body.yaw_rate_radps, inputs)
            front, rear = (min(max(one, -MOST_SOFTNESS_RAD), MOST_SOFTNESS_RAD) for one in softness)
        return np.array(
            [
                body.lateral_mps + trip.speed_mps * rear,
                body.yaw_rate_radps,
                trip.steering_rad - front + rear,
                seen.offset_m,
                seen.heading_rad - rear,
                last.steering_rad - front + rear,
            ]
        )

    def most_mps2(self, trip: Trip) -> float:
        """Return how hard a driver brakes and drives: what the road gives beside the side forces."""
        limit = MOST_OF_FRICTION * self._vehicle.friction * GRAVITY_MPS2
        across = min(abs(trip.lateral_acceleration_mps2) / limit, MOST_ACROSS)
        return limit * sqrt(1.0 - across * across)

    def gains(self, speed_mps: float) -> Gains:
        """Return the gains at a speed, on the line between those of the whole m/s below and above."""
        place = max(speed_mps, SLOWEST_MPS) / SPEED_STEP_MPS
        below = floor(place)
        share = place - below
        low, high = self._made(below), self._made(below + 1)
        return Gains(
            low.feedback + share * (high.feedback - low.feedback),
            low.preview + share * (high.preview - low.preview),
            low.pull + share * (high.pull - low.pull),
        )

    def _made(self, step: int) -> Gains:
        if step not in self._gains:
            speed_mps, count = step * SPEED_STEP_MPS, LOOKS_EVERY * self._count
            made = gains_at(self._vehicle, speed_mps, PERIOD_S, count, self._config.quickness_radps)
            preview = made.preview.reshape(-1, LOOKS_EVERY).mean(axis=1)
            self._gains[step] = replace(made, preview=preview)
        return self._gains[step]
