"""A vehicle that drifts out of its lane as in a standard test, until what an ECU asks for steers it.

    start_s         curve of radius R          straight on at the lateral speed
    --------------  ~~~~~~~~~~~~~~~~~~~~~~~~   ------------------------------->
    along the lane  a robot steers             hands off: the wheels stay as the lane's bend needs them,
                                               the ECU's steering request moves them

At the end of the curve the front tyre's outer side is `distance_m` from the lane's edge, and the vehicle
moves across the lane at `lateral_mps`; there the robot lets go. What the ECU asks for before moves nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import msgspec

from vsensor.errors import ConfigError
from vsensor.schema import Config
from vsensor.sources.control import Motion, Pose
from vsensor.sources.listening import Listened, News
from vsensor.sources.map_drive import MapDrive
from vsensor.sources.moving import grip_troubles, motion_of, step_remarks
from vsensor.sources.steering import SteeringControl
from vsensor.sources.troubles import NO_TROUBLES, Troubles
from vsensor.types import EgoState, Snapshot, Tick
from vsensor.world.lane_edge import edge_beside, tyre_to_edge
from vsensor.world.vehicle import SingleTrack, Tilt, Trip, VehicleState, steered

SLOWEST_MPS = 5.0


class DepartureConfig(Config, frozen=True, kw_only=True):
    """`[departure]`: a drift out of the lane, with [ego] control = "departure".

    `radius_m` of the curve into the drift; `distance_m` from the front tyre's outer side to the lane's edge
    (the marking's inner border) where the curve ends and the robot lets go; `start_s` where it begins.
    With `keeps_steering` the robot never does: for a warning that no steering puts off.
    """

    side: Literal["left", "right"] = "left"
    lateral_mps: Annotated[float, msgspec.Meta(gt=0, le=3)] = 0.5
    radius_m: Annotated[float, msgspec.Meta(ge=50, le=1e5)] = 1200.0
    distance_m: Annotated[float, msgspec.Meta(ge=0, le=3)] = 0.75
    start_s: Annotated[float, msgspec.Meta(ge=0, le=600)] = 3.0
    keeps_steering: bool = False

    @property
    def is_left(self) -> bool:
        """Whether the vehicle leaves its lane to the left."""
        return self.side == "left"

    def release_s(self, speed_mps: float) -> float:
        """Return when the curve ends and the robot lets go."""
        return self.start_s + self.lateral_mps * self.radius_m / speed_mps**2


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """The offset from the lane's middle: held, then with a constant acceleration, then a constant speed."""

    from_m: float
    rate_mps: float
    start_s: float
    release_s: float

    def derivatives(self, t_s: float) -> tuple[float, float, float]:
        """Return value, first and second time derivative at `t_s`."""
        spent, span = t_s - self.start_s, self.release_s - self.start_s
        if spent <= 0.0:
            return self.from_m, 0.0, 0.0
        if spent < span:
            bend = self.rate_mps / span
            return self.from_m + bend * spent**2 / 2.0, bend * spent, bend
        return self.from_m + self.rate_mps * (spent - span / 2.0), self.rate_mps, 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Departing:
    """The vehicle once the robot has let go, None before; `hands_off_rad` of its front wheels."""

    trip: Trip | None = None
    t_ns: int = 0
    hands_off_rad: float = 0.0
    troubles: Troubles = NO_TROUBLES


class DepartureControl:
    """Moves the vehicle along the drive's drift until the robot lets go, then as the ECU asks."""

    def __init__(
        self, drive: MapDrive, config: DepartureConfig, vehicle: SingleTrack, steering: SteeringControl
    ) -> None:
        self._drive, self._vehicle, self._steering = drive, vehicle, steering
        self.needs, self.senses = steering.needs, steering.senses
        self._release_s = config.release_s(drive.speed_mps(0.0))
        self._keeps_steering = config.keeps_steering

    def initial(self, start: Pose) -> Departing:
        """Return the state before the first tick."""
        return Departing()

    def advance(
        self, state: Departing, listened: Listened, news: Sequence[News], tick: Tick, tilt: Tilt
    ) -> tuple[Departing, Motion]:
        """Return the vehicle at the tick."""
        t_s = tick.t_ns * 1e-9
        if state.trip is None:
            ego = self._drive.ego(t_s)
            lets_go = t_s >= self._release_s and not self._keeps_steering
            return (self._let_go(ego) if lets_go else state), _motion_of(ego)
        asked = self._steering.angle(listened, state.hands_off_rad, unasked=state.hands_off_rad)
        speed = self._drive.speed_mps(t_s)
        seconds = (tick.t_ns - state.t_ns) * 1e-9
        trip = steered(self._vehicle, state.trip, (state.trip.speed_mps, speed), asked, seconds, tilt)
        troubles = state.troubles.noted(grip_troubles(self._vehicle, trip), tick.t_ns)
        return replace(state, trip=trip, t_ns=tick.t_ns, troubles=troubles), motion_of(trip)

    def remarks(self, state: Departing) -> tuple[str, ...]:
        """Say where the tyres lost their grip, and the error of the steps."""
        if state.trip is None:
            return ()
        return (*state.troubles.sentences(), *step_remarks(state.trip))

    def _let_go(self, ego: EgoState) -> Departing:
        """Return the vehicle as the robot leaves it, its wheels as steady cornering needs them."""
        x, y, _ = ego.position_world_m.tolist()
        turn = ego.yaw_rate_radps
        vehicle = VehicleState(
            x_m=x,
            y_m=y,
            yaw_rad=ego.yaw_rad,
            lateral_mps=self._vehicle.rear_m * turn,
            yaw_rate_radps=turn,
        )
        hands_off_rad = turn / self._vehicle.steady_yaw_rate(ego.speed_mps, 1.0)
        trip = Trip.begins(vehicle, ego.speed_mps, hands_off_rad)
        return Departing(trip=trip, t_ns=ego.t_ns, hands_off_rad=hands_off_rad)


def drift_of(drive: MapDrive, config: DepartureConfig, wheelbase_m: float, width_m: float) -> Drift:
    """Return the drift that brings the tyre `distance_m` from the lane's edge where its curve ends.

    Raises ConfigError where the speed is not constant, the lane has no such edge, or no room for it.
    """
    speed = drive.speed_mps(0.0)
    release_s = config.release_s(max(speed, SLOWEST_MPS))
    if speed < SLOWEST_MPS or drive.speed_mps(release_s) != speed:
        raise ConfigError(f"ego.speed_kmh: departure: a constant speed from {3.6 * SLOWEST_MPS:g} km/h on")
    sign = 1.0 if config.is_left else -1.0
    ego = drive.ego(0.0)
    snapshot = Snapshot(t_ns=0, ego=ego, scene=drive.scene(0.0, 0.0))
    edge = edge_beside(snapshot, config.is_left, wheelbase_m)
    tyre = None if edge is None else tyre_to_edge(snapshot, edge, config.is_left, wheelbase_m, width_m)
    if tyre is None:
        raise ConfigError(f"departure.side: the lane has no edge to the {config.side}")
    # Where the curve ends the front axle is off the rear one's path by the heading that it has won.
    curve_m = config.lateral_mps**2 * config.radius_m / (2.0 * speed**2)
    ahead_m = wheelbase_m * config.lateral_mps / speed
    from_m = tyre.distance_m - config.distance_m - curve_m - ahead_m
    if from_m < -tyre.distance_m:
        raise ConfigError(
            f"departure.distance_m = {config.distance_m:g}: the drift would begin {abs(from_m):.2f} m from "
            "the lane's middle, out of it"
        )
    return Drift(
        from_m=sign * from_m,
        rate_mps=sign * config.lateral_mps,
        start_s=config.start_s,
        release_s=release_s,
    )


def _motion_of(ego: EgoState) -> Motion:
    x, y, _ = ego.position_world_m.tolist()
    return Motion(
        pose=Pose(x_m=x, y_m=y, yaw_rad=ego.yaw_rad),
        speed_mps=ego.speed_mps,
        yaw_rate_radps=ego.yaw_rate_radps,
        acceleration_mps2=ego.acceleration_mps2,
    )
