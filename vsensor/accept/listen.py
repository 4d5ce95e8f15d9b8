"""`vsensor accept`: a log or a live bus through the same judges."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from vsensor.accept.config import LimitsConfig
from vsensor.accept.stream import Stream
from vsensor.accept.verdict import Judgement, Verdict, verdict_of
from vsensor.bus import open_bus
from vsensor.logs import Columns, LogTable, read_log
from vsensor.logs.table import Record, columns_from
from vsensor.profile import Profile
from vsensor.types import Frame

CHUNK_FRAMES = 1 << 16
_LISTEN_S = 0.01  # a busy bus of 1 Mbit/s has 80 frames then, a socket holds some thousand
_JUDGE_S = 1.0


def accept_log(path: Path, profiles: Sequence[Profile], limits: LimitsConfig) -> Judgement:
    """Judge a recording by each profile. Raises LogError."""
    table = read_log(path)
    said = table.report.problems()
    verdicts = []
    for profile in profiles:
        columns, remark = _one_bus(table, profile)
        verdicts.append(judged(columns, profile, limits))
        said += remark
    return Judgement(source=str(path), verdicts=tuple(verdicts), remarks=tuple(said))


def judged(columns: Columns, profile: Profile, limits: LimitsConfig) -> Verdict:
    """Judge frames in memory."""
    stream = Stream(profile, limits)
    for first in range(0, len(columns.t_ns), CHUNK_FRAMES):
        stream.take(columns.taken(slice(first, first + CHUNK_FRAMES)))
    stream.end()
    return verdict_of(stream)


def accept_bus(
    specification: str,
    profiles: Sequence[Profile],
    limits: LimitsConfig,
    *,
    duration_s: float | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> Judgement:
    """Listen to a bus and judge it by each profile; sends nothing. Raises BusError if it cannot be opened.

    Ends after `duration_s`, or when `stopped` says so.
    """
    streams = [Stream(profile, limits) for profile in profiles]
    is_fd = any(plan.layout.is_fd for profile in profiles for plan in profile.messages)
    stopped()  # from here on Ctrl-C is a question, and what was heard is judged
    with open_bus(specification, fd=is_fd) as bus:
        bus.drain()  # what waited before is not of this time
        end_ns = None if duration_s is None else time.monotonic_ns() + round(duration_s * 1e9)
        heard: list[Frame] = []
        judged_ns = time.monotonic_ns()
        while not stopped() and (end_ns is None or time.monotonic_ns() < end_ns):
            time.sleep(_LISTEN_S)
            heard += bus.drain()
            if time.monotonic_ns() - judged_ns > _JUDGE_S * 1e9:
                _take(streams, heard)
                heard, judged_ns = [], time.monotonic_ns()
        _take(streams, heard + bus.drain())
        said = bus.report()
    for stream in streams:
        stream.end()
    verdicts = tuple(verdict_of(stream) for stream in streams)
    return Judgement(source=specification, verdicts=verdicts, remarks=tuple(said))


def _take(streams: Sequence[Stream], heard: Sequence[Frame]) -> None:
    columns = columns_of_frames(heard)
    for stream in streams:
        stream.take(columns)


def columns_of_frames(frames: Sequence[Frame]) -> Columns:
    """Return frames as columns, `due_ns` their time."""
    return columns_from(
        [
            Record(
                frame.due_ns,
                frame.arbitration_id,
                min(frame.channel, 255),
                frame.is_extended | frame.is_fd << 1 | frame.is_error << 4 | frame.is_remote << 5,
                frame.data,
            )
            for frame in frames
        ]
    )


def _one_bus(table: LogTable, profile: Profile) -> tuple[Columns, list[str]]:
    """Return the frames of the channel that has most of the profile's, and what is said of the others."""
    ids = [plan.layout.arbitration_id for plan in profile.messages]
    mine = np.isin(table.arbitration_id, ids) & table.data_frames()
    counts = np.bincount(table.channel[mine], minlength=1)
    best = int(counts.argmax())
    others = [table.channel_names[k] for k in np.flatnonzero(counts).tolist() if k != best]
    name = table.channel_names[best]
    said = [f"judged on channel {name}; the ids are on {', '.join(others)}, too"] if others else []
    return table.columns.taken(table.channel == best), said
