"""A vehicle that an ECU steers over the bus: the closed loop."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from vsensor.sources.control import REQUEST, SPEED, WHEEL, Motion, Pose, hold_ns
from vsensor.sources.listening import ListenConfig, Listened, News
from vsensor.sources.moving import grip_troubles, motion_of, step_remarks
from vsensor.sources.troubles import NO_TROUBLES, Troubles
from vsensor.types import Tick
from vsensor.world.vehicle import LARGEST_STEERING_RAD, SingleTrack, Tilt, Trip, VehicleState, steered


@dataclass(frozen=True, slots=True, kw_only=True)
class Steered:
    """The vehicle at the tick `t_ns`; `start_ns` is when the first frame came, None before."""

    trip: Trip
    t_ns: int = 0
    start_ns: int | None = None
    troubles: Troubles = NO_TROUBLES


class SteeringControl:
    """The single-track model, steered from the bus; it stands until the first frame of the steering comes.

    Its speed is the scenario's, whose time counts from there, or comes from the bus. "Not available" lets
    the front wheels go straight.
    """

    def __init__(
        self,
        config: ListenConfig,
        vehicle: SingleTrack,
        ratio: float,
        speed_mps: Callable[[float], float],
    ) -> None:
        self._vehicle = vehicle
        self._ratio = ratio
        self._speed = speed_mps
        self._hold_ns = hold_ns(config)
        self._from_bus = config.speed == "bus"
        self._steering, self.needs, self.senses, self.wanted = steering_inputs(config)

    def initial(self, start: Pose) -> Steered:
        """Return a vehicle that stands at the start."""
        return Steered(trip=Trip.begins(VehicleState(x_m=start.x_m, y_m=start.y_m, yaw_rad=start.yaw_rad)))

    def advance(
        self, state: Steered, listened: Listened, news: Sequence[News], tick: Tick, tilt: Tilt
    ) -> tuple[Steered, Motion]:
        """Return the vehicle, driven on since the tick before."""
        start_ns = state.start_ns
        if start_ns is None and any(self._steering in item.values for item in news):
            start_ns = tick.t_ns
        seconds = max(tick.t_ns - state.t_ns, 0) * 1e-9
        speed = self._speed_at(listened, tick.t_ns, start_ns)
        steering = self.angle(listened)
        is_moving = state.start_ns is not None
        speeds = (state.trip.speed_mps, speed) if is_moving else (0.0, 0.0)
        trip = steered(self._vehicle, state.trip, speeds, steering, seconds, tilt)
        if not is_moving:
            trip = replace(trip, speed_mps=speed)
        troubles = state.troubles.noted(grip_troubles(self._vehicle, trip), tick.t_ns)
        return Steered(trip=trip, t_ns=tick.t_ns, start_ns=start_ns, troubles=troubles), motion_of(trip)

    def remarks(self, state: Steered) -> tuple[str, ...]:
        """Say where the tyres lost their grip, and the error of the steps."""
        return (*state.troubles.sentences(), *step_remarks(state.trip))

    def angle(self, listened: Listened, before_first: float = 0.0, unasked: float = 0.0) -> float:
        """Return the angle of the front wheels.

        `before_first`: before the first request; `unasked`: without one since, or with one that is too old.
        """
        last = listened.quantities.get(self._steering)
        if last is None:
            return before_first
        if last.is_lost or listened.now_ns - last.t_ns > self._hold_ns:
            return unasked
        angle = last.value / (self._ratio if self._steering == WHEEL else 1.0)
        return min(max(angle, -LARGEST_STEERING_RAD), LARGEST_STEERING_RAD)

    def _speed_at(self, listened: Listened, t_ns: int, start_ns: int | None) -> float:
        if start_ns is None:
            return 0.0
        if not self._from_bus:
            return self._speed((t_ns - start_ns) * 1e-9)
        last = listened.quantities.get(SPEED)
        if last is None or listened.now_ns - last.t_ns > self._hold_ns:
            return 0.0
        return last.value


def steering_inputs(
    config: ListenConfig,
) -> tuple[str, tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the steering's quantity, and what a steered vehicle needs, what its sensor senses, all of it.

    What an ECU asks for is no input of the sensor, so it does not lack it.
    """
    steering = REQUEST if config.steering == "request" else WHEEL
    speed = (SPEED,) if config.speed == "bus" else ()
    senses = (*((WHEEL,) if steering == WHEEL else ()), *speed)
    return steering, (steering, *speed), senses, (steering, *speed)
