"""What a video shows, as the sensor's own CAN frames: its estimates go in where the sensor's would.

pictures ─► estimates ─► VideoDrive (speed, yaw rate) ─► Line: state, signals, profile, counters, CRCs ─► Loop
                    └──► `sense` in place of the sensor's ──^
"""

import contextlib
from bisect import bisect_right
from collections.abc import Callable, Sequence
from math import gcd

import numpy as np

from vsensor import sensor as sensing
from vsensor.camera import CameraConfig
from vsensor.line import Line
from vsensor.profile import Profile
from vsensor.run import RunOptions, Say, keep_memory, open_run_bus, play_line, say_start, warm_up
from vsensor.runner import Summary
from vsensor.sensor import Lap, Sensed, Sensor, SensorConfig
from vsensor.signals import VehicleConfig
from vsensor.sinks.log import LogSink
from vsensor.sources import Inputs
from vsensor.state import StateConfig
from vsensor.transmit import Transmitter, common_ns
from vsensor.transmit.schedule import FINEST_SLOT_NS
from vsensor.types import (
    Detections,
    EgoState,
    Environment,
    LaneEstimate,
    LinePoints,
    Observation,
    Scene,
    Snapshot,
    Tick,
    frozen,
)
from vsensor.video.types import Motion

CYCLE_NS = 40_000_000
"""The sensor's own cycle, where the pictures' does not go with that of the messages."""
SLACK_NS = 1_000
"""A picture this little after a tick is its own: a video's times are rounded."""


class VideoDrive:
    """A source whose drive is a video: the motion of CAN where there is one, no scene."""

    notes: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()

    def __init__(
        self,
        estimates: Sequence[LaneEstimate],
        motions: Sequence[Motion],
        picture_ns: int,
        environment: Environment,
    ) -> None:
        """Take estimates and motions of the pictures in their order, and the time from one to the next."""
        self.estimates, self._motions, self._environment = estimates, motions, environment
        self._times_ns = [one.exposed_at_ns for one in estimates]
        self.end_ns = self._times_ns[-1] + picture_ns

    @property
    def duration_s(self) -> float:
        """Time until the last picture ends."""
        return self.end_ns / 1e9

    def place(self, t_ns: int) -> int:
        """Return which picture is the newest at a time; -1 before the first."""
        return bisect_right(self._times_ns, t_ns + SLACK_NS) - 1

    def initial_state(self) -> None:
        """Return nothing: a tick's time says all."""

    def advance(self, state: None, tick: Tick, inputs: Inputs) -> tuple[None, Snapshot | None]:
        """Return the motion at a tick; None after the last picture."""
        if tick.t_ns >= self.end_ns:
            return None, None
        place = self.place(tick.t_ns)
        motion = self._motions[place] if place >= 0 else Motion()
        ego = EgoState(
            t_ns=tick.t_ns,
            position_world_m=_ORIGIN,
            speed_mps=motion.speed_mps,
            yaw_rate_radps=motion.yaw_rate_radps,
            acceleration_mps2=motion.acceleration_mps2,
            lateral_acceleration_mps2=motion.speed_mps * motion.yaw_rate_radps,
        )
        scene = Scene(markings=(), environment=self._environment)
        return None, Snapshot(t_ns=tick.t_ns, ego=ego, scene=scene)

    def remarks(self, state: None) -> tuple[str, ...]:
        """Return nothing: what there is to say was said before."""
        return ()

    def sense(
        self,
        sensor: Sensor,
        state: sensing.SensorState,
        snapshot: Snapshot,
        tick: Tick,
        lap: Lap = sensing.no_lap,
    ) -> tuple[sensing.SensorState, Sensed]:
        """Return the newest picture's lines, in the place of `sensor.sense`."""
        place = self.place(tick.t_ns)
        estimate = self.estimates[place] if place >= 0 else _nothing(tick)
        return state, Sensed(observation=_UNOBSERVED, detections=_undetected(tick), estimate=estimate)


def video_line(drive: VideoDrive, camera: CameraConfig, vehicle: VehicleConfig, profile: Profile) -> Line:
    """Return the line that sends a video through a profile; raises ConfigError for what cannot be sent.

    The sensor is available from the first picture on: its camera was there before the video began.
    """
    return Line(
        source=drive,
        sensor=Sensor.of(SensorConfig(camera=camera, wheelbase_m=vehicle.wheelbase_m)),
        vehicle=vehicle,
        state_config=StateConfig(init_s=0.0),
        transmitter=Transmitter(profile, vehicle, camera.position_m[0]),
        sense=drive.sense,
    )


def tick_ns(profile: Profile, picture_ns: int) -> int:
    """Return the time between ticks: a picture's where the messages' times go with it, else the sensor's."""
    common = common_ns(profile.messages)
    return picture_ns if gcd(common, picture_ns) >= FINEST_SLOT_NS else CYCLE_NS


def send_video(
    line: Line,
    drive: VideoDrive,
    options: RunOptions,
    say: Say,
    stopped: Callable[[], bool],
    *,
    period_ns: int,
) -> Summary:
    """Send a line to its end, in real time on a bus, at once into a log alone; raises VsensorError."""
    with contextlib.ExitStack() as stack:
        bus = open_run_bus(options, line)
        if bus is not None:
            stack.callback(bus.close)
            bus.tell(say)
        keep_memory()
        warm_up(line, period_ns)
        sinks = [] if options.log is None else [LogSink(options.log)]
        for sink in sinks:
            stack.callback(sink.close)
        say_start(bus, line, say)
        for text in line.uneven(period_ns):
            say(text)
        summary = play_line(
            line,
            options,
            stack,
            say,
            stopped,
            period_ns=period_ns,
            ticks=-(-drive.end_ns // period_ns),
            bus=bus,
            sinks=sinks,
        )
    if bus is not None:
        summary.notes += bus.report()
    if options.log is not None:
        summary.notes.append(f"wrote {options.log}")
    return summary


_ORIGIN = frozen([0.0, 0.0, 0.0])
_NO_POINTS = LinePoints(
    marking=frozen([], np.int64),
    starts=frozen([0], np.int64),
    index=frozen([], np.int64),
    points_ego_m=frozen(np.zeros((0, 3))),
)
_NONE, _NO_CODES = frozen([]), frozen([], np.uint8)
_UNOBSERVED = Observation(
    lines=_NO_POINTS,
    sigma_y_m=_NONE,
    kind=_NO_CODES,
    colour=_NO_CODES,
    width_m=_NONE,
    candidates=_NO_POINTS,
    reason=_NO_CODES,
)


def _undetected(tick: Tick) -> Detections:
    return Detections(
        exposed_at_ns=tick.t_ns,
        lines=_NO_POINTS,
        sigma_y_m=_NONE,
        kind=_NO_CODES,
        colour=_NO_CODES,
        width_m=_NONE,
        operating_range_m=0.0,
    )


def _nothing(tick: Tick) -> LaneEstimate:
    return LaneEstimate(exposed_at_ns=tick.t_ns, image_index=tick.index, boundaries=())
