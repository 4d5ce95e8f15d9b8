"""One tick: the truth, what is sensed of it, and the frames that leave."""

from dataclasses import dataclass
from typing import Any

from vsensor import latency
from vsensor import sensor as sensing
from vsensor import state as machine
from vsensor import transmit as sending
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


@dataclass(frozen=True, slots=True, kw_only=True)
class LineState:
    """Everything that a run remembers: save it, and the run restarts at any tick."""

    source: Any
    sensor: sensing.SensorState
    machine: machine.SensorState
    transmit: TransmitState
    images: tuple[latency.Image, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Computed:
    """One tick computed ahead of its slot; which state goes on depends on whether its frames were sent."""

    output: Output
    state_if_sent: LineState
    state_if_dropped: LineState


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """Source, sensor and transmitter of a scenario, compiled."""

    source: Source
    sensor: Sensor
    vehicle: VehicleConfig
    state_config: StateConfig
    transmitter: Transmitter
    latency_ns: int = 0

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
        )

    def compute(
        self, state: LineState, tick: Tick, inputs: Inputs = (), lap: Lap = no_lap
    ) -> Computed | None:
        """Compute one tick: one image, and the frames of all send slots until the next; None at the end.

        The frames are in the order in which they leave, each with its own due_ns. Those of an image carry
        its index and time stamp; with a latency that is an image exposed that long before.
        """
        source_state, snapshot = self.source.advance(state.source, tick, inputs)
        lap("world")
        if snapshot is None:
            return None
        sensor_state, sensed = sensing.sense(self.sensor, state.sensor, snapshot, tick, lap)
        images, image = self._delayed(state, snapshot, sensed.estimate, tick)
        machine_state = machine.advance(
            self.state_config, state.machine, self._causes(snapshot, sensed, image is not None), tick
        )
        values = self._values(image or latency.NO_IMAGE, machine_state.mode)
        transmit_state, frames = sending.transmit_image(self.transmitter, state.transmit, values, tick)
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
        return Computed(
            output=output,
            state_if_sent=LineState(
                source=source_state,
                sensor=sensor_state,
                machine=machine_state,
                transmit=transmit_state,
                images=images,
            ),
            state_if_dropped=LineState(
                source=source_state,
                sensor=sensor_state,
                machine=machine_state,
                transmit=state.transmit,
                images=images,
            ),
        )

    def _delayed(
        self, state: LineState, snapshot: Snapshot, estimate: LaneEstimate, tick: Tick
    ) -> tuple[tuple[latency.Image, ...], latency.Image | None]:
        """Return the images on their way, and the one that leaves now; None while there is none yet."""
        newest = latency.Image(estimate=estimate, ego=snapshot.ego, environment=snapshot.scene.environment)
        pose = self.profile.geometry.pose
        return latency.delayed(state.images, newest, self.latency_ns, pose, tick)

    def _causes(self, snapshot: Snapshot, sensed: sensing.Sensed, has_image: bool) -> Causes:
        """Return what the sensor's state follows from."""
        watches = self.state_config.blocked_after_s is not None
        return Causes(
            degraded=sensed.estimate.degraded,
            environment=snapshot.scene.environment,
            speed_mps=snapshot.ego.speed_mps,
            has_image=has_image,
            hidden=watches and machine.all_hidden(sensed.observation),
        )

    def _values(self, image: latency.Image, mode: SensorMode) -> SignalValues:
        """Return what is sent of an image in this state."""
        estimate = machine.reported(self.state_config, mode, image.estimate)
        return values_from(self.vehicle, estimate, image.ego, mode, image.environment)

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
        return self.source.remarks(state.source) if isinstance(self.source, LiveDrive) else ()
