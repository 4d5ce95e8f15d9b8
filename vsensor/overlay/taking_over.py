"""Close the loop: a recorded drive up to a time of the log, from there the ECU steers.

    log time < take-over   the pose is the log's
    from there             a single-track vehicle goes on from the recorded state: no step in place, heading,
                           speed, yaw rate. Its speed stays the recorded one, its steering is the ECU's; until
                           the first request the wheels stay as the recorded yaw rate needs them.
The road is the one that is laid along the recorded path.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from vsensor.overlay.following import UNKNOWN_NS, Following, pose_at
from vsensor.overlay.moved_frames import LATERAL
from vsensor.overlay.synth import Made, Wish
from vsensor.sources import Inputs
from vsensor.sources.control import SPEED, WHEEL, YAW_RATE
from vsensor.sources.drive import RecordedDrive
from vsensor.sources.listening import Listened, Listener
from vsensor.sources.steering import SteeringControl
from vsensor.types import Snapshot, Tick
from vsensor.world.dead_reckoning import Pose
from vsensor.world.laid_road import POINT_STEP_M, LaidRoad
from vsensor.world.vehicle import KINEMATIC_MPS, SingleTrack, Trip, VehicleState, steered

FARTHEST_M = 20.0
"""Farther from the lane's middle nothing is seen of the road."""
SEARCH_M = 5.0
"""The road's point abreast lies so near the one before, plus what was driven."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Taken:
    """The log's time of the next tick, what was heard; the vehicle (None: the log's) and how it is driven."""

    log_ns: int
    listened: Listened = field(default_factory=Listened)
    vehicle: Trip | None = None
    s_m: float = 0.0
    steering_rad: float = 0.0


class TakingOver(Following):
    """The source: the drive of a log up to `from_ns` of its time, from there a vehicle that is steered."""

    def __init__(
        self,
        drive: RecordedDrive,
        from_ns: int,
        control: SteeringControl,
        vehicle: SingleTrack,
        listener: Listener,
        steering_ratio: float,
    ) -> None:
        super().__init__(drive)
        self._ratio = steering_ratio
        self.from_ns, self.listener = from_ns, listener
        self._control, self._vehicle = control, vehicle

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done with the drive, and what is listened to."""
        return (*super().notes, *self.listener.lines())

    def initial_state(self) -> Taken:  # type: ignore[override]
        """Return the state before the first tick."""
        return Taken(log_ns=int(self.drive.drive.path.t_ns[0]))

    def placed(self, state: Taken, wish: Wish) -> Taken:  # type: ignore[override]
        """Return the state at the log's time of the wish; elsewhere the recorded vehicle is taken anew."""
        return replace(state, log_ns=wish.log_ns, vehicle=None if wish.is_cut else state.vehicle)

    def steering(self, state: Taken) -> float | None:  # type: ignore[override]
        """Return the angle of the front wheels, once the vehicle is steered."""
        return None if state.vehicle is None else state.vehicle.steering_rad

    def advance(  # type: ignore[override]
        self, state: Taken, tick: Tick, inputs: Inputs
    ) -> tuple[Taken, Snapshot]:
        """Return the truth at the tick: the log's, or that of the steered vehicle."""
        listened, _ = self.listener.hear(state.listened, inputs, tick)
        recorded, beyond_ns = pose_at(self.drive.drive.path, state.log_ns)
        after = replace(state, listened=listened, log_ns=state.log_ns + tick.period_ns)
        if state.log_ns < self.from_ns:
            after, snapshot = replace(after, vehicle=None), self.drive.seen(recorded, tick.t_ns)
        elif state.vehicle is None:
            after = self._taken(after, recorded)
            snapshot = self.drive.seen(recorded, tick.t_ns)
        else:
            after, snapshot = self._driven(after, state.vehicle, recorded, tick)
        stale = (SPEED, YAW_RATE) if beyond_ns > UNKNOWN_NS else ()
        return after, replace(snapshot, stale=stale)

    def _taken(self, state: Taken, recorded: Pose) -> Taken:
        """Return the state with the recorded vehicle in it, its wheels as steady cornering needs them."""
        turn = recorded.yaw_rate_radps
        body = VehicleState(
            x_m=recorded.x_m,
            y_m=recorded.y_m,
            yaw_rad=recorded.yaw_rad,
            lateral_mps=self._vehicle.rear_m * turn,  # the rear axle follows its heading, as in the path
            yaw_rate_radps=turn,
        )
        steering = self.steady_rad(recorded.speed_mps, turn)
        vehicle = Trip.begins(body, recorded.speed_mps, steering)
        return replace(state, vehicle=vehicle, s_m=recorded.s_m, steering_rad=steering)

    def steady_rad(self, speed_mps: float, yaw_rate_radps: float) -> float:
        """Return the angle of the front wheels of a steady bend, 0 where the vehicle hardly moves."""
        if speed_mps < KINEMATIC_MPS:
            return 0.0
        return yaw_rate_radps / self._vehicle.steady_yaw_rate(speed_mps, 1.0)

    def recorded(self, log_ns: int) -> dict[str, float]:
        """Return how the recorded vehicle moves at the log's time, in the quantities of MovedFrames."""
        pose, _ = pose_at(self.drive.drive.path, log_ns)
        steering = self.steady_rad(pose.speed_mps, pose.yaw_rate_radps)
        return self._told(pose.speed_mps, pose.yaw_rate_radps, steering)

    def simulated(self, made: Made) -> dict[str, float]:
        """Return how the steered vehicle moves in an image, in the quantities of MovedFrames."""
        assert made.ego is not None
        return self._told(made.ego.speed_mps, made.ego.yaw_rate_radps, made.steering_rad)

    def _told(self, speed_mps: float, yaw_rate_radps: float, steering_rad: float) -> dict[str, float]:
        return {
            YAW_RATE: yaw_rate_radps,
            LATERAL: speed_mps * yaw_rate_radps,
            WHEEL: steering_rad * self._ratio,
        }

    def _driven(self, state: Taken, before: Trip, recorded: Pose, tick: Tick) -> tuple[Taken, Snapshot]:
        """Return the state and the truth after a cycle with the wheels as they were asked for."""
        steering = self._control.angle(state.listened, state.steering_rad)
        speeds = before.speed_mps, recorded.speed_mps
        trip = steered(self._vehicle, before, speeds, steering, tick.period_ns * 1e-9)
        vehicle = trip.body
        step_m = sum(speeds) / 2.0 * tick.period_ns * 1e-9
        s_m, off_m = _abreast(self.drive.road, vehicle, state.s_m, step_m)
        pose = replace(
            recorded,
            x_m=vehicle.x_m,
            y_m=vehicle.y_m,
            yaw_rad=vehicle.yaw_rad,
            s_m=s_m,
            yaw_rate_radps=vehicle.yaw_rate_radps,
        )
        snapshot = self.drive.seen(pose, tick.t_ns)
        if off_m > FARTHEST_M:
            snapshot = replace(snapshot, scene=replace(snapshot.scene, markings=()))
        return replace(state, vehicle=trip, s_m=s_m, steering_rad=steering), snapshot


def _abreast(road: LaidRoad, vehicle: VehicleState, s_m: float, step_m: float) -> tuple[float, float]:
    """Return the road's length abreast of a vehicle, and how far off the lane's middle it is."""
    centre_m, s_first_m = road.centre_world_m, road.s_first_m
    count = len(centre_m)
    first = min(max(int((s_m - SEARCH_M - s_first_m) / POINT_STEP_M), 0), count - 1)
    last = min(max(int((s_m + step_m + SEARCH_M - s_first_m) / POINT_STEP_M) + 1, first + 1), count)
    away = np.hypot(centre_m[first:last, 0] - vehicle.x_m, centre_m[first:last, 1] - vehicle.y_m)
    nearest = int(np.argmin(away))
    return s_first_m + (first + nearest) * POINT_STEP_M, float(away[nearest])
