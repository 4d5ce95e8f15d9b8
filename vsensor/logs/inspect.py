"""What is in a log: channels, messages, their cycles, counters and checksums, and the load of the bus."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.codec import Database
from vsensor.errors import LogError
from vsensor.logs.checksums import FoundChecksum, find_checksum
from vsensor.logs.convert import Progress, Replacing, table_through
from vsensor.logs.counters import FoundCounter, find_counters
from vsensor.logs.load import bits_of
from vsensor.logs.report import LogReport
from vsensor.logs.table import ERROR, EXTENDED, FD, REMOTE, Columns
from vsensor.types import IntArray

_GAP_CYCLES = 2.5
"""An interval of more cycles is a gap: at least one frame is missing, and a late one is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageSummary:
    """All frames of one id on one channel.

    `lengths` of the data, seen; `cycle_ms` the median interval, NaN for a single frame; `jitter_p99_ms` of
    the intervals' distance from it; `gaps` intervals of more than 2.5 cycles, `longest_gap_ms` of them;
    `duplicates` frames with time and data of the one before; `is_constant`: the data never change.
    """

    channel: str
    arbitration_id: int
    is_extended: bool
    name: str
    frames: int
    lengths: tuple[int, ...]
    is_fd: bool
    cycle_ms: float
    jitter_p99_ms: float
    gaps: int
    longest_gap_ms: float
    duplicates: int
    is_constant: bool
    counters: tuple[FoundCounter, ...]
    checksum: FoundChecksum | None

    def findings(self) -> list[str]:
        """Return what was found in the data, as words."""
        found = ["constant"] if self.is_constant and self.frames > 1 else []
        found += [self.checksum.text()] if self.checksum is not None else []
        return found + [counter.text() for counter in self.counters]


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelSummary:
    """One bus: frames of all kinds; `load`: part of the time they take, with no and with most stuff bits.

    NaN where all frames of the log have one time.
    """

    name: str
    frames: int
    load: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogSummary:
    """What is in a log; `bitrate_bps` is what the load was reckoned with."""

    report: LogReport
    bitrate_bps: float
    data_bitrate_bps: float
    channels: tuple[ChannelSummary, ...]
    messages: tuple[MessageSummary, ...]


def inspect_log(
    path: Path,
    *,
    database: Database | None = None,
    bitrate_bps: float = 500e3,
    data_bitrate_bps: float = 2e6,
    rate_hz: float | None = None,
    progress: Progress | None = None,
) -> LogSummary:
    """Return what is in a log; all of it is held in memory. Raises LogError if no frame can be read.

    `database` names the messages, and its data ids are tried; `rate_hz` gives times to text that has none.
    """
    table = table_through(path, rate_hz, progress)
    columns = table.columns
    names = _names(database)
    known = _data_ids(database)
    messages = [_message(columns.taken(rows), table.channel_names, names, known) for rows in _groups(columns)]
    return LogSummary(
        report=table.report,
        bitrate_bps=bitrate_bps,
        data_bitrate_bps=data_bitrate_bps,
        channels=tuple(_channels(columns, table.channel_names, bitrate_bps, data_bitrate_bps)),
        messages=tuple(messages),
    )


def _names(database: Database | None) -> Mapping[tuple[int, bool], str]:
    layouts = database.layouts.values() if database is not None else ()
    return {(one.arbitration_id, one.is_extended): one.name for one in layouts}


def _data_ids(database: Database | None) -> Callable[[], Iterable[int]]:
    layouts = database.layouts.values() if database is not None else ()
    ids = [one.e2e_data_id for one in layouts]
    return lambda: [one for one in ids if isinstance(one, int)]


def _groups(columns: Columns) -> list[IntArray]:
    """Return the rows of every message, in order of channel and id; error frames belong to none."""
    keys = columns.channel.astype(np.int64) << 30 | (columns.flags & EXTENDED).astype(np.int64) << 29
    keys |= columns.arbitration_id.astype(np.int64)
    keys[columns.flags & ERROR != 0] = -1
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    return np.split(order, starts)[1:]


def _message(
    own: Columns,
    channels: tuple[str, ...],
    names: Mapping[tuple[int, bool], str],
    known_ids: Callable[[], Iterable[int]],
) -> MessageSummary:
    identifier, is_extended = int(own.arbitration_id[0]), bool(own.flags[0] & EXTENDED)
    carrying = own.taken(own.flags & REMOTE == 0)
    steps = np.diff(own.t_ns) / 1e6
    cycle = float(np.median(steps)) if len(steps) else np.nan
    gaps = steps[steps > _GAP_CYCLES * cycle] if cycle > 0 else steps[:0]
    same = (np.diff(own.t_ns) == 0) & (own.data[1:] == own.data[:-1]).all(axis=1)
    lengths, counts = np.unique(carrying.length, return_counts=True)
    usual = int(lengths[counts.argmax()]) if len(lengths) else 0
    data = np.ascontiguousarray(carrying.data[carrying.length == usual][:, :usual])
    is_constant = len(lengths) < 2 and not (data != data[:1]).any()
    changing = bool(usual) and not is_constant
    return MessageSummary(
        channel=channels[int(own.channel[0])],
        arbitration_id=identifier,
        is_extended=is_extended,
        name=names.get((identifier, is_extended), ""),
        frames=len(own.t_ns),
        lengths=tuple(lengths.tolist()),
        is_fd=bool((own.flags & FD).any()),
        cycle_ms=cycle,
        jitter_p99_ms=float(np.quantile(np.abs(steps - cycle), 0.99)) if len(steps) else np.nan,
        gaps=len(gaps),
        longest_gap_ms=float(gaps.max()) if len(gaps) else 0.0,
        duplicates=int(np.count_nonzero(same)),
        is_constant=is_constant,
        counters=find_counters(data) if changing else (),
        checksum=find_checksum(data, identifier, known_ids) if changing else None,
    )


def _channels(
    columns: Columns, names: tuple[str, ...], bitrate_bps: float, data_bitrate_bps: float
) -> Iterable[ChannelSummary]:
    seconds = float(columns.t_ns.max() - columns.t_ns.min()) / 1e9 or np.nan
    for number in np.unique(columns.channel).tolist():
        own = columns.taken(columns.channel == number)
        load = [0.0, 0.0]
        for k, stuffed in enumerate((False, True)):
            nominal, fast = bits_of(own, stuffed=stuffed)
            load[k] = float(nominal.sum() / bitrate_bps + fast.sum() / data_bitrate_bps) / seconds
        yield ChannelSummary(name=names[number], frames=len(own.t_ns), load=(load[0], load[1]))


def write_json(path: Path, summary: LogSummary) -> None:
    """Write a summary; raises LogError."""
    log = Path(summary.report.path)
    if path.exists() and log.exists() and path.samefile(log):
        raise LogError(f"{path}: is the log that is read, so it cannot be written over")
    text = json.dumps(as_json(summary), indent=1) + "\n"
    with Replacing(path) as part:
        try:
            part.write_text(text, encoding="utf-8")
        except OSError as error:
            raise LogError(f"{path}: cannot be written: {error.strerror or error}") from None


def as_json(summary: LogSummary) -> dict[str, Any]:
    """Return a summary as plain values; a time or load that there is not is null."""
    report = summary.report
    return {
        "schema": "vsensor.log/1",
        "path": report.path,
        "frames": report.frames,
        "first_ns": report.first_ns,
        "last_ns": report.last_ns,
        "duration_s": (report.last_ns - report.first_ns) / 1e9,
        "repeated_timestamps": report.repeated_timestamps,
        "backward_timestamps": report.backward_timestamps,
        "error_frames": report.error_frames,
        "remote_frames": report.remote_frames,
        "problems": report.problems(),
        "bitrate_bps": summary.bitrate_bps,
        "data_bitrate_bps": summary.data_bitrate_bps,
        "channels": [
            {
                "name": one.name,
                "frames": one.frames,
                "load": _number(one.load[0]),
                "load_at_most": _number(one.load[1]),
            }
            for one in summary.channels
        ],
        "messages": [_message_json(one) for one in summary.messages],
    }


def _message_json(one: MessageSummary) -> dict[str, Any]:
    checksum = one.checksum
    field = checksum.guard.checksum_field if checksum is not None else None
    return {
        "channel": one.channel,
        "id": one.arbitration_id,
        "extended": one.is_extended,
        "name": one.name,
        "frames": one.frames,
        "lengths": list(one.lengths),
        "fd": one.is_fd,
        "cycle_ms": _number(one.cycle_ms),
        "jitter_p99_ms": _number(one.jitter_p99_ms),
        "gaps": one.gaps,
        "longest_gap_ms": one.longest_gap_ms,
        "duplicates": one.duplicates,
        "constant": one.is_constant,
        "counters": [
            {"low_bit": c.field.low_bit, "bits": c.field.length, "states": c.states} for c in one.counters
        ],
        "checksum": None
        if checksum is None
        else {
            "name": checksum.guard.name,
            "data_id": checksum.guard.data_id,
            "data_ids_that_fit": checksum.data_ids,
            "low_bit": None if field is None else field.low_bit,
            "bits": None if field is None else field.length,
            "wrong": checksum.wrong,
        },
    }


def _number(value: float) -> float | None:
    return None if np.isnan(value) else value
