"""A log that is read from one place on, in runs of frames with their times in order; its beginning."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vsensor.errors import LogError
from vsensor.logs import Columns, Notes, iter_chunks
from vsensor.logs.table import joined
from vsensor.replay.beat import Beat
from vsensor.replay.choice import keys_of
from vsensor.replay.marks import Mark, Marks
from vsensor.replay.smooth import Smooth, smoothed
from vsensor.replay.timeline import Order, in_order
from vsensor.types import IntArray

SURVEY = 65536
"""Frames at the beginning of a log that are looked at before anything is sent: a quarter of a second."""
SKIPPED = 512
"""Frames read at a time on the way to a place: some 0.6 ms, between frames that are due."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cut:
    """What part of a log is played, and how often. Times are the log's own, None: its first and last frame.

    `rate_hz` gives frame k the time k / rate_hz instead of its own. `cycles` (ns by key, see choice.keys_of):
    spread batches by them; None: leave the times alone. `beat`: seams and seeks keep this rhythm.
    """

    start_ns: int | None = None
    stop_ns: int | None = None
    loops: int = 1
    rate_hz: float | None = None
    cycles: Mapping[int, int] | None = None
    beat: Beat | None = None


class Survey(NamedTuple):
    """The beginning of a log: frames with their times in order, channel numbers by name."""

    columns: Columns
    m_ns: IntArray
    channels: dict[str, int]

    @property
    def start_ns(self) -> int:
        """Time of the first frame: what a time "from the start" counts from."""
        return int(self.m_ns[0])


def survey(path: Path, rate_hz: float | None = None) -> Survey:
    """Read the first SURVEY frames of a log; a fault behind some frames is none here. Raises LogError."""
    notes = Notes()
    parts: list[Columns] = []
    try:
        for columns in iter_chunks(path, chunk=SURVEY, notes=notes, untimed=rate_hz is not None):
            parts.append(columns)
            if sum(len(part.t_ns) for part in parts) >= SURVEY:
                break
    except LogError:
        if not parts:
            raise
    columns = joined(parts)
    if rate_hz is not None:
        columns = columns._replace(t_ns=times_at(rate_hz, 0, len(columns.t_ns)))
    _, m_ns = in_order(Order(), columns.t_ns)
    return Survey(columns, m_ns, notes.channels)


def times_at(rate_hz: float, first: int, count: int) -> IntArray:
    """Return the times (count,) of frames number `first` and on, ns."""
    times: IntArray = np.rint(np.arange(first, first + count) * (1e9 / rate_hz)).astype(np.int64)
    return times


class Run(NamedTuple):
    """A few frames of the file, and their times in order."""

    columns: Columns
    m_ns: IntArray


class Reading:
    """A log read from its first frame on, or from where another reading of it has been.

    What is skipped tells where the order of times stands. `size`: frames read at a time. `count`, `order`,
    `notes`: what was read so far, and what was found in it; `fault`: why it ended before the log did.
    """

    def __init__(
        self, path: Path, channels: dict[str, int], cut: Cut, size: int, marks: Marks, from_ns: int
    ) -> None:
        """Open `path` for frames from `from_ns` on; `channels` gets the channels that turn up."""
        mark = marks.before(from_ns)
        self.size = size
        self.notes = _copied(Notes() if mark is None else mark.notes, channels)
        self.order, self.count = (Order(), 0) if mark is None else (mark.order, mark.frames)
        self.fault: str | None = None
        self._cut, self._marks = cut, marks
        self._smooth = Smooth(latest_ns={}) if mark is None else mark.smooth
        self._held: Run | None = None
        self._chunks = iter_chunks(
            path,
            chunk=lambda: self.size,
            notes=self.notes,
            untimed=cut.rate_hz is not None,
            place=None if mark is None else mark.place,
        )

    def next(self) -> Run | None:
        """Return the next frames, None at the end of the file, or of the part that is played."""
        run, self._held = self._held, None
        return run or self._read()

    def skip(self, log_ns: int, frames: int = SKIPPED) -> bool:
        """Read on a little towards `log_ns`; returns whether `next` has it, or the end."""
        size, self.size = self.size, frames
        self._held = self._read()
        self.size = size
        return self._held is None or int(self._held.m_ns[-1]) >= log_ns

    def lines(self) -> list[str]:
        """Return what was found in what was read, as sentences."""
        notes = self.notes
        found = self.order.lines(self.count)
        if notes.garbage_lines:
            number, text = notes.first_garbage[0]
            found.append(f"{notes.garbage_lines} lines are no CAN frames, first line {number}: {text!r}")
        if notes.impossible_frames:
            found.append(f"{notes.impossible_frames} frames left out: {notes.first_impossible}")
        return found

    def _read(self) -> Run | None:
        stop_ns = self._cut.stop_ns
        if self.count and stop_ns is not None and self.order.last_ns >= stop_ns:
            return None
        try:
            columns = next(self._chunks, None)
        except LogError as fault:
            self.fault = str(fault)
            return None
        return None if columns is None else self._timed(columns)

    def _timed(self, columns: Columns) -> Run:
        count = len(columns.t_ns)
        if self._cut.rate_hz is not None:
            columns = columns._replace(t_ns=times_at(self._cut.rate_hz, self.count, count))
        self.count += count
        self.order, m_ns = in_order(self.order, columns.t_ns)
        if self._cut.cycles is not None:
            self._smooth, m_ns = smoothed(self._smooth, self._cut.cycles, keys_of(columns), m_ns)
        place = self.notes.place
        if place is not None and self._marks.wants(self.count):
            notes = _copied(self.notes, {})
            mark = Mark(int(m_ns[-1]), self.count, place, self.order, self._smooth, notes)
            self._marks.add(mark)
        return Run(columns, m_ns)


def _copied(notes: Notes, channels: dict[str, int]) -> Notes:
    return replace(notes, channels=channels, first_garbage=[*notes.first_garbage])
