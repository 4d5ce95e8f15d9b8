"""`--overlay`: a scenario's lane sensor comes onto a log; what the log has of such a sensor is left out."""

import contextlib
from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np
from msgspec.structs import replace

from vsensor.config import load_scenario
from vsensor.errors import ConfigError
from vsensor.logs import Columns, LogTable, Notes, iter_chunks
from vsensor.logs.table import joined, table_from
from vsensor.overlay import (
    Desk,
    Elsewhere,
    Here,
    MovedFrames,
    Synth,
    TakingOver,
    Wish,
    camera_keys,
    heard_keys,
    synth_of,
    vehicle_profiles,
)
from vsensor.replay.choice import EXTENDED_KEY, Choice, keys_of
from vsensor.replay.options import ReplayOptions, log_time_ns, speed_of
from vsensor.replay.overlaid import Lay, Overlaid
from vsensor.replay.player import Player
from vsensor.replay.reading import Cut, Survey, times_at
from vsensor.replay.reel import Reel, Sendable
from vsensor.replay.sender import Sending
from vsensor.replay.smooth import Smooth, smoothed
from vsensor.replay.steered import Steered
from vsensor.replay.timeline import Order, in_order
from vsensor.types import BoolArray, Frame

Say = Callable[[str], None]
Ids = frozenset[tuple[int, bool]]

WARM_IMAGES = 5


class Listening:
    """Buses whose frames of the ECU are kept, with times from the replay's beginning."""

    def __init__(self, sending: Sending, heard: Ids) -> None:
        self._sending, self._keys, self._kept = sending, heard, list[Frame]()
        self.origin_ns: Callable[[], int] = lambda: 0

    def send(self, frame: Frame) -> bool:
        """Send now; False if the bus refused the frame."""
        return self._sending.send(frame)

    def drain(self) -> Sequence[Frame]:
        """Return what was heard since the last call; the ECU's is kept, too."""
        arrived = self._sending.drain()
        self._kept += [one for one in arrived if (one.arbitration_id, one.is_extended) in self._keys]
        return arrived

    def taken(self) -> Sequence[Frame]:
        """Return what was kept since the last call."""
        self.drain()
        origin_ns = self.origin_ns()
        taken = [replace(frame, due_ns=frame.due_ns - origin_ns) for frame in self._kept]
        self._kept.clear()
        return taken


class Overlay:
    """A sensor ready to be laid over a log; computed in a process of its own unless time is simulated."""

    def __init__(self, synth: Synth, lay: Lay, frames: MovedFrames | None, *, in_place: bool) -> None:
        """Start to compute; open buses after that. `frames` are told anew after a take-over."""
        self.synth, self.lay, self._frames = synth, lay, frames
        self.removed = 0  # frames of the log with the sensor's ids
        self._keys = _keys(lay.keys)
        self._desk: Desk = Here(synth) if in_place else Elsewhere(synth)
        self._over: Overlaid | None = None
        self._ears: Listening | None = None

    def without_camera(self, sendable: Sendable, chosen: Choice) -> Sendable:
        """Return `sendable` that leaves out what would leave as the sensor's own messages, and counts it."""

        def rest(columns: Columns) -> BoolArray:
            own = np.isin(keys_of(chosen.renamed(columns)), self._keys)
            self.removed += int(np.count_nonzero(own))
            mask: BoolArray = ~own
            if mask.any():
                mask[mask] = sendable(columns.taken(mask))
            return mask

        return rest

    def listening(self, sending: Sending) -> Sending:
        """Return the buses, heard where an ECU steers."""
        if isinstance(self.synth.source, TakingOver):
            self._ears = Listening(sending, self.lay.heard)
            return self._ears
        return sending

    def laid_over(self, reel: Reel) -> Overlaid:
        """Return the reel with the sensor's frames."""
        self._over = Overlaid(reel, self._desk, self.lay)
        source = self.synth.source
        if isinstance(source, TakingOver) and self._ears is not None and self._frames is not None:
            self._over.steered = Steered(
                from_ns=source.from_ns,
                ears=self._ears,
                frames=self._frames,
                recorded=source.recorded,
                simulated=source.simulated,
            )
        return self._over

    def played_by(self, player: Player) -> None:
        """Take the player's clock for what is heard."""
        if self._ears is not None:
            self._ears.origin_ns = lambda: player.origin_ns

    def lines(self) -> list[str]:
        """Return what it did, as sentences."""
        images = self._over.images if self._over else 0
        said = [f"{images} images of profile {self.synth.line.profile.name} laid over the log"]
        if self.removed:
            said.append(f"{self.removed} frames of the log with the sensor's ids left out")
        return [f"overlay: {text}" for text in (*said, *self._desk.remarks())]

    def close(self) -> None:
        """End the process."""
        self._desk.close()


def open_overlay(
    name: str, options: ReplayOptions, head: Survey, cut: Cut, say: Say, stack: contextlib.ExitStack
) -> Overlay:
    """Compile the sensor of a scenario for a log; closed with `stack`. Raises VsensorError subclasses."""
    scenario = load_scenario(name)
    over_ns = None
    if options.take_over is not None:
        over_ns = log_time_ns("--take-over", options.take_over, head.start_ns)
    synth = synth_of(scenario, lambda ids: _table(options, cut, ids), over_ns)
    _require_reached(options, synth, cut, head)
    frames = None if over_ns is None else MovedFrames(vehicle_profiles(scenario))
    keys = camera_keys(synth.line)
    lay = Lay(
        period_ns=synth.period_ns,
        speed=speed_of(options.speed),
        channel=_channel(head, keys),
        keys=keys,
        heard=heard_keys(synth),
    )
    for text in (*synth.source.notes, *synth.source.findings, *(frames.lines() if frames else ())):
        say(f"overlay: {text}")
    _warn(synth, lay, options, say)
    overlay = Overlay(synth, lay, frames, in_place=options.fast)
    stack.callback(overlay.close)
    return overlay


def _require_reached(options: ReplayOptions, synth: Synth, cut: Cut, head: Survey) -> None:
    """Refuse a take-over behind what is played: the ECU would never steer."""
    source = synth.source
    if not isinstance(source, TakingOver):
        return
    ends = [int(source.drive.drive.path.t_ns[-1]), *([] if cut.stop_ns is None else [cut.stop_ns])]
    if source.from_ns >= min(ends):
        ends_s = (min(ends) - head.start_ns) / 1e9
        raise ConfigError(f"--take-over {options.take_over}: what is played ends before, at {ends_s:.3f} s")


def _table(options: ReplayOptions, cut: Cut, ids: Ids) -> LogTable:
    """Read the frames of `ids`, and the log's first one, with the times at which the log is played."""
    notes, parts, keys = Notes(), list[Columns](), _keys(ids)
    order, smooth, read = Order(), Smooth(latest_ns={}), 0
    for columns in iter_chunks(options.path, notes=notes, untimed=cut.rate_hz is not None):
        if cut.rate_hz is not None:
            columns = columns._replace(t_ns=times_at(cut.rate_hz, read, len(columns.t_ns)))
        order, m_ns = in_order(order, columns.t_ns)
        if cut.cycles is not None:
            smooth, m_ns = smoothed(smooth, cut.cycles, keys_of(columns), m_ns)
        wanted = np.isin(keys_of(columns), keys)
        wanted[0] |= not read
        read += len(m_ns)
        parts.append(columns._replace(t_ns=m_ns).taken(wanted))
    return table_from(str(options.path), joined(parts), notes)


def _keys(ids: Ids) -> list[int]:
    return [number | EXTENDED_KEY * is_extended for number, is_extended in ids]


def _channel(head: Survey, keys: Ids) -> int:
    """Return the channel of the sensor's frames: where the log has such, else that of its first frame."""
    own = np.flatnonzero(np.isin(keys_of(head.columns), _keys(keys)))
    return int(head.columns.channel[own[0] if len(own) else 0])


def _warn(synth: Synth, lay: Lay, options: ReplayOptions, say: Say) -> None:
    """Say if an image takes longer to compute than there is time for at this speed."""
    if options.fast:
        return
    state, costs = synth.initial(), list[float]()
    log_ns = int(state.source.log_ns) if hasattr(state.source, "log_ns") else 0
    for index in range(WARM_IMAGES):
        began_s = perf_counter()
        state, _, _ = synth.compute(state, Wish(index, log_ns + index * lay.period_ns))
        costs.append(perf_counter() - began_s)
    every_ms, takes_ms = float(lay.period_ns / lay.speed / 1_000_000), min(costs) * 1e3
    if takes_ms > every_ms:
        say(
            f"--speed {options.speed}: an image every {every_ms:.1f} ms, and one takes {takes_ms:.1f} ms to "
            "compute: the replay will fall behind"
        )
