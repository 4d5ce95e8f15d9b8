"""A recorded drive: ego motion from a CAN log, the road laid along the driven path."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from vsensor.errors import LogError
from vsensor.logs import LogTable, read_log
from vsensor.profile import Profile
from vsensor.schema import Config
from vsensor.sources import Inputs
from vsensor.sources.profiles import profiles_of
from vsensor.sources.weather import Weather
from vsensor.types import (
    NANOSECONDS_PER_SECOND,
    Array,
    EgoState,
    Environment,
    IntArray,
    Scene,
    Snapshot,
    Tick,
    frozen,
)
from vsensor.world.dead_reckoning import (
    DrivenPath,
    OffsetEstimate,
    Pose,
    common_times,
    integrated,
    resampled,
    yaw_rate_offset,
)
from vsensor.world.laid_road import LaidRoad, LaidRoadConfig, lay_road

SPEED = "ego.speed_mps"
YAW_RATE = "ego.yaw_rate_radps"
LONGEST_GAP_S = 1.0
"""A signal that is silent for longer leaves the path unknown; vehicle signals come every 10 to 100 ms."""
LARGEST = {SPEED: 150.0, YAW_RATE: 10.0}
"""No road vehicle is faster (m/s), or turns faster (rad/s): beyond it a profile or log is wrong."""
BEHIND_M = 20.0
LONGER_THAN_X = 1.3  # a road that turns by 60 degrees within the range is 1.2 times as long as its x


class DriveConfig(Config, frozen=True, kw_only=True):
    """`[drive]`: how a CAN log becomes a drive; `profile` may name several, `dbc` the database they map.

    `offset_m` is where the vehicle runs in its lane, to the left of the centre. `yaw_rate_offset_degps`
    is taken off the yaw rate, "auto" estimates it; `speed_factor` multiplies the speed. `start_s` and
    `stop_s` cut a part out, in seconds from the log's first frame. `channel` picks one of several buses.
    """

    profile: tuple[str, ...] = ("vehicle",)
    dbc: str | None = None
    channel: str | None = None
    offset_m: Annotated[float, msgspec.Meta(ge=-4, le=4)] = 0.0
    yaw_rate_offset_degps: Annotated[float, msgspec.Meta(ge=-20, le=20)] | Literal["auto"] = "auto"
    speed_factor: Annotated[float, msgspec.Meta(ge=0.5, le=2)] = 1.0
    start_s: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    stop_s: Annotated[float, msgspec.Meta(gt=0)] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Ego motion of a log: the path and the yaw-rate offset taken off.

    `notes` say what is in the log and what was done with it, `findings` what is wrong with it.
    """

    path: DrivenPath
    offset: OffsetEstimate
    notes: tuple[str, ...]
    findings: tuple[str, ...]


def load_drive(log: Path, config: DriveConfig, folder: Path = Path()) -> Drive:
    """Read the log and integrate the ego motion; relative names in `config` start from `folder`.

    Raises LogError (missing, unknown, infinite or silent signals, naming time and signal), ConfigError
    and DbcError (profile).
    """
    profiles = profiles_of(config.profile, config.dbc, folder)
    return drive_of(read_log(log), profiles, config)


def drive_of(table: LogTable, profiles: Sequence[Profile], config: DriveConfig) -> Drive:
    """Integrate the ego motion of a log that was read; raises as `load_drive`."""
    log = table.report.path
    signals = _signals(table, profiles, config)
    times_ns, speed = signals[SPEED]
    rate_ns, rate = signals[YAW_RATE]
    offset = _offset(config, rate_ns, rate, resampled(times_ns, speed, rate_ns))
    at_ns = common_times(times_ns, rate_ns)
    if len(at_ns) < 2:
        raise LogError(f"{log}: {SPEED} and {YAW_RATE} have no time in common")
    speed_at = resampled(times_ns, speed, at_ns) * config.speed_factor
    rate_at = resampled(rate_ns, rate, at_ns) - offset.offset_radps
    path = integrated(at_ns, speed_at, rate_at)
    removed = f"yaw-rate offset {np.degrees(offset.offset_radps):+.4f} deg/s removed ({offset.method}, "
    removed += f"{offset.seconds:.0f} s); {path.s_m[-1]:.0f} m driven"
    findings = table.report.problems()
    notes = [line for line in table.report.lines() if line not in findings]
    return Drive(path=path, offset=offset, notes=(*notes, removed), findings=tuple(findings))


def _offset(config: DriveConfig, t_ns: IntArray, rate: Array, speed: Array) -> OffsetEstimate:
    if config.yaw_rate_offset_degps == "auto":
        return yaw_rate_offset(t_ns, rate, speed)
    seconds = int(t_ns[-1] - t_ns[0]) / NANOSECONDS_PER_SECOND
    return OffsetEstimate(offset_radps=radians(config.yaw_rate_offset_degps), method="given", seconds=seconds)


def _signals(
    table: LogTable, profiles: Sequence[Profile], config: DriveConfig
) -> dict[str, tuple[IntArray, Array]]:
    """Return times (N,) and values (N,) of speed and yaw rate, in order of time, checked."""
    used = table.columns.taken(_chosen(table, config))
    found: dict[str, tuple[IntArray, Array]] = {}
    for profile in profiles:
        columns = profile.decode_arrays(
            used.arbitration_id, used.data, used.length, extended=(used.flags & 1).astype(bool)
        )
        for quantity in (SPEED, YAW_RATE):
            if quantity in columns and quantity not in found:
                column = columns[quantity]
                times = used.t_ns[column.rows]
                order = np.argsort(times, kind="stable")
                found[quantity] = (times[order], column.values[order])
    for quantity in (SPEED, YAW_RATE):
        if quantity not in found:
            raise LogError(_not_found(table, profiles, quantity))
        _check(table, quantity, *found[quantity])
    return found


def _chosen(table: LogTable, config: DriveConfig) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return a mask of the data frames of the chosen channel between start and stop."""
    since_s = (table.t_ns - table.report.first_ns) / NANOSECONDS_PER_SECOND
    mask = table.data_frames() & (since_s >= config.start_s)
    if config.stop_s is not None:
        mask &= since_s <= config.stop_s
    if config.channel is not None:
        if config.channel not in table.channel_names:
            names = ", ".join(table.channel_names)
            raise LogError(f"{table.report.path}: no channel {config.channel!r}; it has {names}")
        mask &= table.channel == table.channel_names.index(config.channel)
    chosen: np.ndarray[tuple[int], np.dtype[np.bool_]] = mask
    return chosen


def _not_found(table: LogTable, profiles: Sequence[Profile], quantity: str) -> str:
    """Say what was looked for and what the log holds instead."""
    looked = [
        f"{plan.layout.name} 0x{plan.layout.arbitration_id:X} (profile {profile.name})"
        for profile in profiles
        for plan in profile.messages
        if any(binding.quantity == quantity for binding in plan.told)
    ]
    path = table.report.path
    if not looked:
        names = ", ".join(profile.name for profile in profiles)
        return f"{path}: no signal carries {quantity} in the profile {names}"
    ids = np.unique(table.arbitration_id)
    shown = ", ".join(f"0x{number:X}" for number in ids[:8].tolist())
    more = f", ... ({len(ids)} ids)" if len(ids) > 8 else ""
    return f"{path}: {quantity} was looked for in {', '.join(looked)}, but the log holds {shown}{more}"


def _check(table: LogTable, quantity: str, t_ns: IntArray, values: Array) -> None:
    """Raise LogError for what no drive can be made of, naming the time and the signal."""

    def at(index: int) -> str:
        return f"{(int(t_ns[index]) - table.report.first_ns) / NANOSECONDS_PER_SECOND:.6f} s"

    path = table.report.path
    if len(t_ns) < 2:
        raise LogError(f"{path}: only {len(t_ns)} frame carries {quantity}; at least 2 are needed")
    wrong = np.flatnonzero(~(np.abs(values) <= LARGEST[quantity]))
    if len(wrong):
        k = int(wrong[0])
        raise LogError(
            f"{path}: {quantity} = {values[k]:g} at {at(k)}: a value of a driving vehicle was expected"
        )
    if quantity == SPEED and values.min() < -0.3:
        k = int(np.argmax(values < -0.3))
        raise LogError(
            f"{path}: the vehicle runs backwards at {at(k)}; cut that part out with start_s, stop_s"
        )
    gaps_s = np.diff(t_ns) / NANOSECONDS_PER_SECOND
    if gaps_s.max() > LONGEST_GAP_S:
        k = int(np.argmax(gaps_s))
        raise LogError(
            f"{path}: {quantity} is silent for {gaps_s[k]:.1f} s from {at(k)}; cut with start_s, stop_s"
        )


class RecordedDrive:
    """The source of a recorded drive: tick 0 is the first time at which speed and yaw rate are known."""

    def __init__(
        self,
        drive: Drive,
        road: LaidRoad,
        environment: Environment | Weather | None = None,
        range_m: float = 100.0,
    ) -> None:
        self.drive = drive
        self.road = road
        self._weather = Weather.of(environment)
        self._view_m = LONGER_THAN_X * range_m + BEHIND_M
        self._start_ns = int(drive.path.t_ns[0])
        self._stop_ns = int(drive.path.t_ns[-1])

    @classmethod
    def load(
        cls,
        log: Path,
        config: DriveConfig,
        road: LaidRoadConfig,
        folder: Path = Path(),
        environment: Environment | Weather | None = None,
        range_m: float = 100.0,
    ) -> "RecordedDrive":
        """Read a log and lay its road; raises as `load_drive`."""
        drive = load_drive(log, config, folder)
        return cls(drive, lay_road(road, drive.path, config.offset_m), environment, range_m)

    @property
    def findings(self) -> tuple[str, ...]:
        """What is wrong with the log, as sentences."""
        return self.drive.findings

    @property
    def notes(self) -> tuple[str, ...]:
        """What is in the log and what was done with it, as sentences."""
        return self.drive.notes

    @property
    def duration_s(self) -> float:
        """Length of the drive."""
        return (self._stop_ns - self._start_ns) / NANOSECONDS_PER_SECOND

    def initial_state(self) -> None:
        """Return the state, which is nothing: the pose follows from the tick alone."""
        return None

    def remarks(self, state: None) -> tuple[str, ...]:
        """Return nothing: what is wrong with the log is in `findings`."""
        return ()

    def advance(self, state: None, tick: Tick, inputs: Inputs) -> tuple[None, Snapshot | None]:
        """Return the truth at `tick.t_ns` after the start of the drive; None beyond its end."""
        now_ns = self._start_ns + tick.t_ns
        if now_ns > self._stop_ns:
            return None, None
        return None, self.seen(self.drive.path.at(now_ns), tick.t_ns)

    def seen(self, pose: Pose, t_ns: int, s_m: float | None = None) -> Snapshot:
        """Return the truth of a vehicle at `pose`; `s_m`: the road's length abreast, if it left the path."""
        ego = EgoState(
            t_ns=t_ns,
            position_world_m=frozen((pose.x_m, pose.y_m, 0.0)),
            yaw_rad=pose.yaw_rad,
            speed_mps=pose.speed_mps,
            yaw_rate_radps=pose.yaw_rate_radps,
            acceleration_mps2=pose.acceleration_mps2,
            lateral_acceleration_mps2=pose.speed_mps * pose.yaw_rate_radps,
        )
        s_m = pose.s_m if s_m is None else s_m
        markings = self.road.markings_window(s_m - BEHIND_M, s_m + self._view_m)
        scene = Scene(markings=markings, environment=self._weather.at(t_ns / NANOSECONDS_PER_SECOND))
        return Snapshot(t_ns=t_ns, ego=ego, scene=scene)
