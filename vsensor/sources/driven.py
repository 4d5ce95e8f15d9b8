"""A drive over a map by a vehicle and its driver: real paths, bends that are cut or not, pedals that lag.

    plan, map --lane_path--> turns ahead, offset --driver--> wheels, acceleration --trip--> x, y, yaw
    --placing--> Foot on the route --> Snapshot; every 40 ms, and to each tick in between

The state is a value: saved at any tick and begun from there again, the drive is the same to the last bit. The
driver acts on its own clock, so the path does not depend on the cycle of the sensor.
"""

from dataclasses import dataclass, replace
from math import cos, floor, pi, remainder

import numpy as np

from vsensor.signals import VehicleConfig
from vsensor.sources import Inputs
from vsensor.sources.lane_path import LanePath
from vsensor.sources.manoeuvres import Plan
from vsensor.sources.map_drive import MapDrive
from vsensor.sources.moving import grip_troubles, motion_of, step_remarks
from vsensor.sources.placing import FARTHEST_M, Foot, Ground
from vsensor.sources.troubles import NO_TROUBLES, Troubles
from vsensor.types import EgoState, Scene, Snapshot, Tick
from vsensor.world.vehicle import (
    PERIOD_NS,
    Driver,
    DriverConfig,
    DynamicsConfig,
    Order,
    Seen,
    SingleTrack,
    Trip,
    cornering,
    pulled,
)

WIDTH_STEP_M = 10.0
LOOKED_AT_M = 100_000.0
"""So far the lanes of manoeuvres are looked for beforehand: a circuit has no end."""
OFF_LANE = "the vehicle was off its lane, a wheel beyond a border,"
OFF_ROUTE = f"the vehicle was off the route, over {FARTHEST_M:g} m away or against it,"


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenState:
    """Vehicle, place and driver at `t_ns`; the driver acts next at `next_ns`; what was met on the way."""

    trip: Trip
    foot: Foot
    order: Order
    t_ns: int = 0
    next_ns: int = 0
    off_path_m: float = 0.0
    farthest_off_m: float = 0.0
    troubles: Troubles = NO_TROUBLES


class DrivenDrive:
    """The source: a vehicle on a map, its driver, and what `drive` shows of the road around it."""

    def __init__(
        self,
        drive: MapDrive,
        plan: Plan,
        driver: DriverConfig,
        dynamics: DynamicsConfig,
        vehicle: VehicleConfig,
    ) -> None:
        """Compile vehicle, driver and path; raises ConfigError."""
        self.drive, self.plan = drive, plan
        self._track = SingleTrack.of(dynamics, vehicle.wheelbase_m)
        self._driver = Driver(self._track, driver)
        self._path = LanePath(drive.corridor, plan.shifts, drive.lane_offset)
        self._ground = Ground(drive.corridor)
        self._half_width_m = vehicle.width_m / 2.0
        self._lane_widths: dict[int, float] = {}

    @property
    def notes(self) -> tuple[str, ...]:
        """Where the drive begins, and who drives."""
        tyres = "linear" if self._track.is_linear else f"nonlinear, friction {self._track.friction:g}"
        return (
            *self.drive.notes,
            f"a driver drives: {tyres} tyres, {len(self.plan.shifts)} changes of lane",
        )

    @property
    def findings(self) -> tuple[str, ...]:
        """What was found in the map, and lanes that manoeuvres name and the road has not."""
        lanes, found = 0, list(self.drive.findings)
        corridor = self.drive.corridor
        for shift in self.plan.shifts:
            lanes += shift.lanes_left
            is_there = (
                shift.end_m > LOOKED_AT_M
                or not corridor.reaches(shift.end_m)
                or corridor.lane_beside(shift.end_m, lanes) is not None
            )
            if shift.lanes_left and not is_there:
                found.append(
                    f"{shift.key}: no such lane at {shift.end_m:.0f} m, so it drives beside the road's lanes"
                )
        return tuple(found)

    @property
    def duration_s(self) -> float:
        """Time until the road ends, at the speeds that are wanted."""
        return self.drive.duration_s

    def initial_state(self) -> DrivenState:
        """Return the vehicle at the start, at its first speed, in the steady bend of the road there."""
        speed = self.plan.speeds.value(0.0)
        _, heading, offset = self._path.looked(np.array([0.0, 0.1]))
        pose = self.drive.corridor.pose(0.0, offset)
        x, y, _ = pose.position_world_m[0].tolist()
        curvature = float(pose.curvature_per_m[0]) if speed > 0.0 else 0.0
        trip = cornering(self._track, x, y, heading, speed, curvature)
        foot = self._ground.foot(Foot(s_m=0.0), 0.0, x, y, trip.body.yaw_rad)
        return DrivenState(trip=trip, foot=foot, order=Order(trip.steering_rad, 0.0))

    def start(self) -> EgoState:
        """Return the vehicle at the start, standing."""
        return self.drive.start()

    def advance(self, state: DrivenState, tick: Tick, inputs: Inputs) -> tuple[DrivenState, Snapshot | None]:
        """Return the truth at `tick.t_ns`; None once the road has ended."""
        while True:
            if state.t_ns == state.next_ns:
                state = self._decided(state)
            if state.t_ns >= tick.t_ns:
                break
            state = self._moved(state, min(tick.t_ns, state.next_ns))
        foot, troubles = state.foot, self._troubles(state)
        state = replace(state, troubles=state.troubles.noted(troubles, tick.t_ns))
        if not self.drive.corridor.reaches(max(foot.s_m, 0.0)):
            return state, None
        scene = self.drive.scene(tick.t_ns * 1e-9, foot.s_m) if foot.is_on_route else Scene(markings=())
        ego = self._ground.ego(foot, motion_of(state.trip), tick.t_ns)
        return state, Snapshot(t_ns=tick.t_ns, ego=ego, scene=scene)

    def remarks(self, state: DrivenState) -> tuple[str, ...]:
        """Say what went wrong, how well the path was kept, and the error of the steps."""
        kept = f"driver: at most {state.farthest_off_m:.3f} m off the path"
        return (*state.troubles.sentences(), kept, *step_remarks(state.trip))

    def _moved(self, state: DrivenState, to_ns: int) -> DrivenState:
        """Return the state at a time, what the driver asks for held."""
        seconds = (to_ns - state.t_ns) * 1e-9
        order, foot = state.order, state.foot
        trip = pulled(
            self._track, state.trip, order.acceleration_mps2, order.steering_rad, seconds, foot.tilt
        )
        step_m = 0.5 * (state.trip.speed_mps + trip.speed_mps) * seconds
        body = trip.body
        foot = self._ground.foot(foot, step_m, body.x_m, body.y_m, body.yaw_rad)
        return replace(state, trip=trip, foot=foot, t_ns=to_ns)

    def _decided(self, state: DrivenState) -> DrivenState:
        """Return the state after the driver has looked; off the route nothing is seen, and the brakes act."""
        after = replace(state, next_ns=state.next_ns + PERIOD_NS)
        if not state.foot.is_on_route:
            order = Order(state.order.steering_rad, -self._driver.most_mps2(state.trip))
            return replace(after, order=order)
        seen = self._seen(state)
        wanted = self._driver.wanted(self.plan.speeds, state.t_ns * 1e-9)
        off_m = abs(seen.offset_m)
        return replace(
            after,
            order=self._driver.order(state.order, state.trip, seen, wanted),
            off_path_m=seen.offset_m,
            farthest_off_m=max(state.farthest_off_m, off_m),
        )

    def _seen(self, state: DrivenState) -> Seen:
        """Return the path ahead as the driver sees it."""
        foot, trip, tilt = state.foot, state.trip, state.foot.tilt
        ahead_m = self._driver.distances_m(trip.speed_mps, trip.acceleration_mps2)
        turns, direction, offset = self._path.looked(foot.s_m + ahead_m)
        heading = remainder(trip.body.yaw_rad - direction, 2.0 * pi)
        return Seen(
            offset_m=(foot.offset_m - offset) * cos(heading),
            heading_rad=heading / tilt.turn,
            turns_rad=turns / tilt.turn,
            pull_mps2=tilt.pull_mps2,
        )

    def _troubles(self, state: DrivenState) -> tuple[str, ...]:
        found = grip_troubles(self._track, state.trip)
        if not state.foot.is_on_route:
            return (OFF_ROUTE, *found)
        room_m = self._lane_width(state.foot.s_m) / 2.0 - self._half_width_m
        return (OFF_LANE, *found) if abs(state.off_path_m) > max(room_m, 0.0) else found

    def _lane_width(self, s_m: float) -> float:
        """Return the driven lane's width, looked up every 10 m (the map takes 0.4 ms)."""
        place = floor(max(s_m, 0.0) / WIDTH_STEP_M)
        if place not in self._lane_widths:
            if len(self._lane_widths) > 1000:
                self._lane_widths.clear()
            self._lane_widths[place] = self.drive.corridor.lane_width(place * WIDTH_STEP_M)
        return self._lane_widths[place]
