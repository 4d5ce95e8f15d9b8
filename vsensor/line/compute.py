"""One tick: the truth, what is sensed of it, and the frames that leave."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from vsensor import faults, latency
from vsensor import sensor as sensing
from vsensor import state as machine
from vsensor import transmit as sending
from vsensor.faults import NO_EFFECTS, NO_FAULTS, Command, Effects, Fault, FaultState, spoiled_lines
from vsensor.profile import Profile
from vsensor.sensor import Lap, Sensor, no_lap
from vsensor.signals import VehicleConfig, values_from
from vsensor.sources import Inputs, Source
from vsensor.sources.live import LiveDrive
from vsensor.state import Causes, StateConfig
from vsensor.transmit import TransmitState, Transmitter
from vsensor.types import (
    Frame,
    LaneEstimate,
    Output,
    SensorMode,
    SignalValues,
    Snapshot,
    Tick,
)

Sense: TypeAlias = Callable[
    [Sensor, sensing.SensorState, Snapshot, Tick, Lap], tuple[sensing.SensorState, sensing.Sensed]
]
"""What looks at the snapshot: `sensor.sense`, or what stands in its place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LineState:
    """Everything that a run remembers: save it, and the run restarts at any tick.

    `up_since`: the tick of the sensor's start or last reset, where its clock and counters begin.
    `frozen`: the image that stands while a fault lets it.
    """

    source: Any
    sensor: sensing.SensorState
    machine: machine.SensorState
    transmit: TransmitState
    images: tuple[latency.Image, ...] = ()
    faults: FaultState = NO_FAULTS
    up_since: int = 0
    frozen: latency.Image | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Computed:
    """One tick computed ahead of its slot; which state goes on depends on whether its frames were sent."""

    output: Output
    state_if_sent: LineState
    state_if_dropped: LineState


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """Source, sensor and transmitter of a scenario, compiled; `timeline`: the faults that it plans.

    `sense` makes the lines of a snapshot; everything after it is the same whoever made them.
    """

    source: Source
    sensor: Sensor
    vehicle: VehicleConfig
    state_config: StateConfig
    transmitter: Transmitter
    latency_ns: int = 0
    timeline: tuple[Fault, ...] = ()
    sense: Sense = sensing.sense

    @property
    def profile(self) -> Profile:
        """The profile that the frames follow."""
        return self.transmitter.profile

    def initial_state(self) -> LineState:
        """Return the state before the first tick."""
        return LineState(
            source=self.source.initial_state(),
            sensor=sensing.initial_state(),
            machine=machine.initial_state(),
            transmit=sending.initial_state(self.transmitter),
            faults=faults.initial_state(self.timeline),
        )

    def compute(
        self,
        state: LineState,
        tick: Tick,
        inputs: Inputs = (),
        lap: Lap = no_lap,
        commands: Sequence[Command] = (),
    ) -> Computed | None:
        """Compute one tick: one image, and the frames of all send slots until the next; None at the end.

        The frames are in the order in which they leave, each with its own due_ns. Those of an image carry
        its index and time stamp; with a latency that is an image exposed that long before. `commands`
        inject faults and clear them, from this tick on.
        """
        effects = NO_EFFECTS
        if commands or not state.faults.is_quiet:
            state, effects = self._disturbed(state, tick, commands)
        source_state, snapshot = self.source.advance(state.source, tick, () if effects.is_deaf else inputs)
        lap("world")
        if snapshot is None:
            return None
        since = _since(tick, state.up_since)
        sensor_state, sensed = self._sense(state, snapshot, effects, tick, lap)
        images, image = self._delayed(state, snapshot, sensed.estimate, since)
        frozen = (state.frozen or image) if effects.is_frozen else None
        machine_state = machine.advance(
            self.state_config, state.machine, self._causes(snapshot, sensed, image is not None, effects), tick
        )
        values = self._values(_dated(frozen or image, tick, since), machine_state.mode, effects)
        transmit_state, frames = state.transmit, tuple[Frame, ...]()
        if not effects.is_off:
            slot = since if since is tick else replace(since, t_ns=tick.t_ns)
            transmit_state, frames = sending.transmit_image(
                self.transmitter, state.transmit, values, slot, effects.frames
            )
        lap("signals+codec")
        output = Output(
            tick=tick,
            snapshot=snapshot,
            observation=sensed.observation,
            detections=sensed.detections,
            estimate=sensed.estimate,
            values=values,
            frames=frames,
            camera_ego=sensed.camera_ego,
        )
        after = LineState(
            source=source_state,
            sensor=sensor_state,
            machine=machine_state,
            transmit=transmit_state,
            images=images,
            faults=state.faults,
            up_since=state.up_since,
            frozen=frozen,
        )
        dropped = replace(after, transmit=state.transmit)
        return Computed(output=output, state_if_sent=after, state_if_dropped=dropped)

    def _disturbed(
        self, state: LineState, tick: Tick, commands: Sequence[Command]
    ) -> tuple[LineState, Effects]:
        """Return the state with the faults of this tick, and what they do; a reset begins anew here."""
        known, effects = faults.advance(state.faults, commands, tick, state.transmit.spoiled)
        state = replace(state, faults=known)
        if not (effects.restarts or effects.is_off):
            return state, effects
        fresh = sensing.initial_state()
        return replace(
            state,
            sensor=replace(fresh, motion=state.sensor.motion),  # the body goes on swinging
            transmit=sending.restarted(self.transmitter, state.transmit),
            images=(),
            up_since=tick.index,
            frozen=None,
        ), effects

    def _sense(
        self, state: LineState, snapshot: Snapshot, effects: Effects, tick: Tick, lap: Lap
    ) -> tuple[sensing.SensorState, sensing.Sensed]:
        """Return what the sensor sees of the truth; nothing through a cover."""
        seen = snapshot
        if effects.is_covered:
            seen = replace(snapshot, scene=replace(snapshot.scene, markings=()))
        sensor_state, sensed = self.sense(self.sensor, state.sensor, seen, tick, lap)
        if state.up_since or effects.lines:
            estimate = replace(sensed.estimate, image_index=tick.index - state.up_since)
            sensed = replace(sensed, estimate=spoiled_lines(effects.lines, estimate))
        return sensor_state, sensed

    def _delayed(
        self, state: LineState, snapshot: Snapshot, estimate: LaneEstimate, tick: Tick
    ) -> tuple[tuple[latency.Image, ...], latency.Image | None]:
        """Return the images on their way, and the one that leaves now; None while there is none yet."""
        newest = latency.Image(estimate=estimate, ego=snapshot.ego, environment=snapshot.scene.environment)
        pose = self.profile.geometry.pose
        return latency.delayed(state.images, newest, self.latency_ns, pose, tick)

    def _causes(
        self, snapshot: Snapshot, sensed: sensing.Sensed, has_image: bool, effects: Effects
    ) -> Causes:
        """Return what the sensor's state follows from."""
        watches = self.state_config.blocked_after_s is not None
        return Causes(
            degraded=sensed.estimate.degraded,
            environment=snapshot.scene.environment,
            speed_mps=snapshot.ego.speed_mps,
            has_image=has_image,
            covered=effects.is_covered,
            hidden=watches and machine.all_hidden(sensed.observation),
            failed=effects.has_failed,
            reset=effects.restarts or effects.is_off,
            forced=SensorMode.INIT if effects.is_off else None,
        )

    def _values(self, image: latency.Image, mode: SensorMode, effects: Effects) -> SignalValues:
        """Return what is sent of an image in this state."""
        estimate = machine.reported(self.state_config, mode, image.estimate)
        values = values_from(self.vehicle, estimate, image.ego, mode, image.environment)
        return {**values, **effects.overrides} if effects.overrides else values

    def uneven(self, period_ns: int) -> tuple[str, ...]:
        """Say which messages the slots of `period_ns` cannot send at even times, in one sentence if any."""
        slot_ns = self.transmitter.slot_period_ns(period_ns)
        wrong = [plan for plan in self.profile.messages if any(t % slot_ns for t in plan.sending.times_ns)]
        if not wrong:
            return ()
        first = wrong[0]
        return (
            f"cycle_ms = {period_ns / 1e6:g}: {len(wrong)} messages ({first.layout.name} every "
            f"{first.cycle_ns / 1e6:g} ms, ...) are no multiple of it and leave in the next slot, unevenly",
        )

    def accepts(self, frame: Frame) -> bool:
        """Return whether a frame that was heard decodes, CRC included, as ours or as one listened to."""
        if isinstance(self.source, LiveDrive) and self.source.accepts(frame):
            return True
        return self.profile.decode(frame, check=True) is not None

    @property
    def needs_bus(self) -> bool:
        """Whether what moves the vehicle comes from a bus."""
        return isinstance(self.source, LiveDrive) and self.source.needs_bus

    @property
    def is_fd(self) -> bool:
        """Whether a message that is sent or listened to is CAN FD."""
        listens = isinstance(self.source, LiveDrive) and self.source.listener.is_fd
        return listens or any(plan.layout.is_fd for plan in self.profile.messages)

    def remarks(self, state: LineState) -> tuple[str, ...]:
        """Say what went wrong in the world on the way, for the end of a run."""
        return self.source.remarks(state.source)


def _since(tick: Tick, up_since: int) -> Tick:
    """Return the tick as the sensor counts it, from its start or last reset."""
    if not up_since:
        return tick
    index = tick.index - up_since
    return Tick(index=index, t_ns=index * tick.period_ns, period_ns=tick.period_ns)


def _dated(image: latency.Image | None, tick: Tick, since: Tick) -> latency.Image:
    """Return the image with its time as the sensor counts it; what is sent before there is one."""
    if image is None:
        return latency.NO_IMAGE
    if since is tick:
        return image
    exposed_at_ns = image.estimate.exposed_at_ns - (tick.t_ns - since.t_ns)
    return replace(image, estimate=replace(image.estimate, exposed_at_ns=exposed_at_ns))
