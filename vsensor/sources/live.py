"""A drive over a map whose vehicle, light and rain come from the bus.

    inputs --listening--> Listened, News --control--> Motion --placing--> Foot on the route --> Snapshot
    frames                 values, times              x, y, yaw            road below, what is near

`[ego] control`: "motion" integrates speed and yaw rate, "pose" takes the pose itself, "steering" drives a
single-track vehicle, "departure" does so once the vehicle drifts out of its lane, "lane" follows the lane as
without a bus and listens to light and rain alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vsensor.errors import ConfigError
from vsensor.profile import RAIN_OF_WIPER, Wiper
from vsensor.sources import Inputs, Source
from vsensor.sources.control import Control, Pose
from vsensor.sources.departing import DepartureConfig, DepartureControl, drift_of
from vsensor.sources.listening import ListenConfig, Listened, Listener, News
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.sources.placing import FARTHEST_M, Foot, Ground
from vsensor.sources.posing import PoseControl
from vsensor.sources.reckoning import MotionControl
from vsensor.sources.steering import SteeringControl, steering_inputs
from vsensor.sources.troubles import NO_TROUBLES, Troubles
from vsensor.types import Beam, EgoState, Environment, Frame, Light, Scene, Snapshot, Tick
from vsensor.world.vehicle import DynamicsConfig, SingleTrack

LIGHT, LOW_BEAM, HIGH_BEAM = "ego.light", "ego.low_beam", "ego.high_beam"
WIPER, INDICATOR = "ego.wiper", "ego.indicator"
ENVIRONMENT = (WIPER, LIGHT, LOW_BEAM, HIGH_BEAM)

OFF_ROUTE = "off the route"


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveState:
    """What was heard, the own state of control (or of the drive that needs none), the place on the route."""

    listened: Listened
    control: Any
    foot: Foot
    speed_mps: float = 0.0
    troubles: Troubles = NO_TROUBLES


class LiveDrive:
    """The source of a drive that listens; it needs a bus, without one the vehicle stands at the start."""

    def __init__(
        self, drive: MapDrive, listener: Listener, control: Control | None, alone: Source | None = None
    ) -> None:
        """Join map, bus and control; without one it is moved by `alone`, as without a bus (None: `drive`)."""
        self.drive = drive
        self._alone: Source = drive if alone is None else alone
        self.listener = listener
        self._control = control
        self._needs = () if control is None else control.needs
        self._unsensed = {INDICATOR} if control is None else {INDICATOR, *control.needs} - {*control.senses}
        self._watched = tuple(listener.channels)
        self._ground = Ground(drive.corridor)
        self._start = drive.start()
        if isinstance(control, PoseControl):
            self._ground.learn()

    @classmethod
    def load(
        cls,
        drive: MapDrive,
        ego: EgoConfig,
        listen: ListenConfig,
        dynamics: DynamicsConfig,
        wheelbase_m: float,
        folder: Path = Path(),
        departure: DepartureConfig | None = None,
        width_m: float = 1.85,
        alone: Source | None = None,
    ) -> "LiveDrive":
        """Load the profiles and build the control; raises ConfigError, DbcError."""
        _, steers_by, _, steering = steering_inputs(listen)
        needs, wanted = {
            "lane": ((), ()),
            "driver": ((), ()),
            "motion": (MotionControl.needs, MotionControl.wanted),
            "pose": (PoseControl.needs, PoseControl.wanted),
            "steering": (steers_by, steering),
            "departure": (steers_by, steering),
        }[ego.control]
        environment = ENVIRONMENT if listen.environment else ()
        listener = Listener.load(listen, folder, (*wanted, *environment, INDICATOR))
        listener.require(needs, f'ego.control = "{ego.control}"')
        control: Control | None = None
        if ego.control == "motion":
            control = MotionControl(listen, listener)
        elif ego.control == "pose":
            control = PoseControl(listener)
        elif ego.control == "steering":
            vehicle = SingleTrack.of(dynamics, wheelbase_m)
            control = SteeringControl(listen, vehicle, dynamics.steering_ratio, drive.speed_mps)
        elif ego.control == "departure":
            departure = departure or DepartureConfig()
            if ego.offset_m != 0.0:
                raise ConfigError('ego.offset_m: with control = "departure" [departure] says where it drives')
            drive.drift(drift_of(drive, departure, wheelbase_m, width_m))
            vehicle = SingleTrack.of(dynamics, wheelbase_m)
            steering_of = SteeringControl(listen, vehicle, dynamics.steering_ratio, drive.speed_mps)
            control = DepartureControl(drive, departure, vehicle, steering_of)
        return cls(drive, listener, control, alone)

    @property
    def needs_bus(self) -> bool:
        """Whether what moves the vehicle comes from the bus."""
        return self._control is not None

    @property
    def notes(self) -> tuple[str, ...]:
        """Where the drive begins and what is listened to."""
        return (*self._alone.notes, *self.listener.lines())

    @property
    def findings(self) -> tuple[str, ...]:
        """What was found in the map, as sentences."""
        return self._alone.findings

    @property
    def duration_s(self) -> float:
        """How long the drive takes is known only where it follows its lane."""
        return self._alone.duration_s if self._control is None else float("inf")

    def initial_state(self) -> LiveState:
        """Return the state before the first tick: nothing heard, standing at the start."""
        x, y, _ = self._start.position_world_m.tolist()
        pose = Pose(x_m=x, y_m=y, yaw_rad=self._start.yaw_rad)
        control = self._alone.initial_state() if self._control is None else self._control.initial(pose)
        return LiveState(listened=Listened(), control=control, foot=Foot(s_m=0.0))

    def start(self) -> EgoState:
        """Return the vehicle at the start, standing."""
        return self._start

    def accepts(self, frame: Frame) -> bool:
        """Return whether a frame tells something that is listened to, and passes its check."""
        return self.listener.accepts(frame)

    def advance(self, state: LiveState, tick: Tick, inputs: Inputs) -> tuple[LiveState, Snapshot | None]:
        """Return the truth at `tick.t_ns` as far as the bus tells; None once the route has ended."""
        listened, news = self.listener.hear(state.listened, inputs, tick)
        if self._control is None:
            inner, snapshot = self._alone.advance(state.control, tick, ())
            after = replace(state, listened=listened, control=inner)
        else:
            after, snapshot = self._moved(self._control, replace(state, listened=listened), news, tick)
        if snapshot is None:
            return after, None
        missing = tuple(name for name in self._watched if self._is_missing(listened, name))
        troubles = [name for name in missing if name in listened.quantities]
        troubles += [OFF_ROUTE] * (not after.foot.is_on_route)
        stale = tuple(name for name in missing if name not in self._unsensed)
        scene = replace(snapshot.scene, environment=self._seen(listened, tick))
        after = replace(after, troubles=after.troubles.noted(tuple(troubles), tick.t_ns))
        return after, replace(snapshot, scene=scene, stale=stale)

    def remarks(self, state: LiveState) -> tuple[str, ...]:
        """Say what went wrong on the way, for the end of a run."""
        unheard = [name for name in self._needs if name not in state.listened.quantities]
        said = [f"nothing was heard of {name}" for name in unheard]
        for name in state.troubles.met:
            when = state.troubles.when(name)
            if name == OFF_ROUTE:
                where = f"over {FARTHEST_M:g} m away, or against it"
                said.append(f"the vehicle was off the route ({where}) {when}: nothing was seen there")
            else:
                said.append(f"{name} was missing {when}")
        inner = self._alone if self._control is None else self._control
        return (*said, *inner.remarks(state.control))

    def _moved(
        self, control: Control, state: LiveState, news: Sequence[News], tick: Tick
    ) -> tuple[LiveState, Snapshot | None]:
        """Return state and truth after the control has moved the vehicle; None beyond the route's end."""
        last = state.foot
        inner, motion = control.advance(state.control, state.listened, news, tick, last.tilt)
        pose, step_m = motion.pose, motion.speed_mps * tick.period_ns * 1e-9
        foot = self._ground.foot(last, step_m, pose.x_m, pose.y_m, pose.yaw_rad)
        after = replace(state, control=inner, foot=foot, speed_mps=motion.speed_mps)
        if not self.drive.corridor.reaches(max(foot.s_m, 0.0)):
            return after, None
        scene = self.drive.scene(tick.t_ns * 1e-9, foot.s_m) if foot.is_on_route else Scene(markings=())
        ego = self._ground.ego(foot, motion, tick.t_ns)
        return after, Snapshot(t_ns=tick.t_ns, ego=ego, scene=scene)

    def _is_missing(self, listened: Listened, name: str) -> bool:
        """Return whether a quantity is missing that is needed, or that came before."""
        is_awaited = name in self._needs or name in listened.quantities
        return is_awaited and self.listener.is_missing(listened, name)

    def _seen(self, listened: Listened, tick: Tick) -> Environment:
        """Return light, rain and headlights: the bus's where it has told of them, else the scenario's."""
        known = {name: heard.value for name, heard in listened.quantities.items() if name in ENVIRONMENT}
        told = self.drive.weather.at(tick.t_ns * 1e-9)
        light, rain = told.light, told.rain
        if LIGHT in known:
            light = Light(int(known[LIGHT]))
        elif LOW_BEAM in known:
            light = Light.NIGHT if known[LOW_BEAM] >= 0.5 else Light.DAY
        if WIPER in known:
            rain = RAIN_OF_WIPER[Wiper(int(known[WIPER]))]
        return _lit(replace(told, light=light, rain=rain), known)


def _lit(air: Environment, known: Mapping[str, float]) -> Environment:
    """Return the environment with the headlights that the bus tells of, where they are no matter of course.

    Low beams alone stand for the light outside, see `_seen`.
    """
    if known.get(HIGH_BEAM, 0.0) >= 0.5:
        beam = Beam.HIGH
    elif LOW_BEAM in known and LIGHT in known:
        beam = Beam.LOW if known[LOW_BEAM] >= 0.5 else Beam.OFF
    else:
        return air
    return air if air.headlights is beam else replace(air, beam=beam)
