"""A log as a player reads it: piece by piece, over loops and seeks, each frame with the time it is due."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vsensor.errors import LogError
from vsensor.logs import Columns, Notes, frames_of, iter_chunks
from vsensor.logs.table import joined
from vsensor.replay.beat import Beat, InStep, rest_of_image
from vsensor.replay.choice import EXTENDED_KEY, Choice, keys_of
from vsensor.replay.smooth import Smooth, smoothed
from vsensor.replay.timeline import Order, Pace, Place, in_order, looped, moved, paced, seam_of
from vsensor.types import BoolArray, Frame, IntArray

AHEAD = 4096
"""Frames read ahead: half a second of a full bus, in case there is no pause to read in."""
PIECE = 128
"""Frames decoded at a time: some 0.3 ms, which fits between two frames of most buses."""
SURVEY = 65536
"""Frames at the beginning of a log that are looked at before anything is sent: a quarter of a second."""
LOOPS_FOR_EVER = 0
NOTHING = "none of its frames is chosen, within --start and --stop, and of a kind that its bus carries"


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


class Piece(NamedTuple):
    """A run of frames to be played: `due_ns` of a frame counts from the beginning of the replay.

    `log_ns`: the log's time of each; `loop` counts from 0.
    """

    frames: list[Frame]
    log_ns: list[int]
    loop: int


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


class Reel:
    """A log that is played. `pull` gives the next frames; `seek` goes elsewhere, replay time goes on."""

    most_ahead = AHEAD
    opens_ns = 0

    def __init__(
        self,
        path: Path,
        head: Survey,
        *,
        choice: Choice,
        pace: Pace | None = None,
        cut: Cut | None = None,
        sendable: Callable[[Columns], BoolArray] | None = None,
        piece: int = PIECE,
    ) -> None:
        """Prepare to read `path`, whose beginning is `head`.

        `sendable` says which of the chosen frames (N,) some bus can take; the others are left out.
        """
        self.channels = head.channels
        self.ended = False
        self.chosen = 0
        self._path, self._choice, self._size = path, choice, piece
        self._pace, self._cut = pace or Pace(), cut or Cut()
        self._sendable = sendable
        self._first_ns = head.start_ns
        self.start_ns = head.start_ns if self._cut.start_ns is None else self._cut.start_ns
        rate_hz = self._cut.rate_hz
        self.seam_ns = seam_of(head.m_ns) if rate_hz is None else round(1e9 / rate_hz)
        if not self.seam_ns and self._cut.loops != 1:
            raise LogError(f"{path}: no time passes in it, so it has no pace to loop at; --rate HZ gives one")
        self.fault: str | None = None  # why reading ended before the log did
        self._loop = self._read = self._judged = 0
        self._found: list[str] = []
        self._end_ns = self.start_ns
        self._place = Place(at_ns=self.start_ns)
        self._step = None if self._cut.beat is None else InStep(self._cut.beat, self._pace)
        self._begin(self.start_ns)

    @property
    def is_in_step(self) -> bool:
        """Whether seams and seeks keep a rhythm."""
        return self._step is not None

    def pull(self) -> Piece | None:
        """Decode the next few frames; None if none of them is played, or (`ended`) there are no more.

        Raises LogError if the whole log holds no frame that is played.
        """
        if self.ended:
            return None
        columns = self._next()
        if columns is None:
            return self._turn_over()
        return self._played(columns)

    def seek(self, log_ns: int, due_ns: int, loop: int = 0, unsent: Sequence[Frame] = ()) -> None:
        """Go on, in pass `loop`, with the first frame not before `log_ns`; that time is due at `due_ns`."""
        log_ns = max(log_ns, self.start_ns)
        self._place = moved(self._pace, log_ns, due_ns)
        self._loop, self.ended = loop, False
        if self._step is not None:
            self._step.seek(due_ns)
        self._begin(log_ns)

    def unfinished(self, frames: Iterable[Frame]) -> int:
        """Return how many of the coming frames belong to an image that has begun, with what is between."""
        if self._cut.beat is None:
            return 0
        origins = {new: old for old, new in self._choice.rename.items()}
        keys = (f.arbitration_id | EXTENDED_KEY * f.is_extended for f in frames)
        return rest_of_image(self._cut.beat, (origins.get(key, key) for key in keys))

    def findings(self) -> list[str]:
        """Return what was found in what was read of the log, as sentences."""
        if self._read > self._judged:
            self._judged, self._found = self._read, [*self._order.lines(self._read), *self._garbage()]
        if self._step is None:
            return self._found
        return [*self._found, *self._step.lines()]

    def _begin(self, log_ns: int) -> None:
        """Read from the first frame of the file: what is skipped tells where the order of times stands."""
        self._notes = Notes(channels=self.channels)
        is_rated = self._cut.rate_hz is not None
        self._chunks = iter_chunks(self._path, chunk=self._size, notes=self._notes, untimed=is_rated)
        self._order, self._smooth = Order(), Smooth(latest_ns={})
        self._read = 0
        self._from_ns = log_ns
        self._chosen_before = self.chosen  # of this pass

    def _next(self) -> Columns | None:
        """Return the next frames of the file, None at the end of the part that is played."""
        stop_ns = self._cut.stop_ns
        if self._read and stop_ns is not None and self._order.last_ns >= stop_ns:
            return None
        try:
            return next(self._chunks, None)
        except LogError as fault:
            self.fault = str(fault)
            return None

    def _played(self, columns: Columns) -> Piece | None:
        if self._cut.rate_hz is not None:
            times = times_at(self._cut.rate_hz, self._read, len(columns.t_ns))
            columns = columns._replace(t_ns=times)
        self._read += len(columns.t_ns)
        self._order, m_ns = in_order(self._order, columns.t_ns)
        if self._cut.cycles is not None:
            self._smooth, m_ns = smoothed(self._smooth, self._cut.cycles, keys_of(columns), m_ns)
        within = m_ns >= self._from_ns
        if self._cut.stop_ns is not None:
            within &= m_ns < self._cut.stop_ns
        if not within.any():
            return None
        self._end_ns = int(m_ns[within][-1])
        return self._piece(columns, m_ns, within)

    def _piece(self, columns: Columns, m_ns: IntArray, within: BoolArray) -> Piece | None:
        rows = within & self._choice.mask(columns, self.channels)
        if self._sendable is not None and rows.any():
            rows[rows] = self._sendable(columns.taken(rows))
        if not rows.any():
            return None
        chosen, m_ns = columns.taken(rows), m_ns[rows]
        if self._step is not None:
            chosen, m_ns, self._place = self._step.take(chosen, m_ns, self._place)
        return self._timed(chosen, m_ns)

    def _timed(self, columns: Columns, m_ns: IntArray) -> Piece | None:
        """Return the frames that are played, each with the time it is due."""
        if not len(m_ns):
            return None
        self._place, due_ns = paced(self._pace, self._place, m_ns)
        self.chosen += len(due_ns)
        renamed = self._choice.renamed(columns)._replace(t_ns=due_ns)
        return Piece(list(frames_of(renamed)), m_ns.tolist(), self._loop)

    def _turn_over(self) -> Piece | None:
        """End a pass: begin the next one, or end; returns what was kept back of the last one."""
        self.findings()
        is_last = self._cut.loops != LOOPS_FOR_EVER and self._loop + 1 >= self._cut.loops
        rest = (
            self._step.rest()
            if self._step is not None and (is_last or self.chosen == self._chosen_before)
            else None
        )
        last = None if rest is None else self._timed(*rest)
        if not self.chosen:
            raise LogError(self.fault or f"{self._path}: {NOTHING}{self._span()}")
        self._loop += 1
        if is_last:
            self.ended = True
            return last
        if self._step is not None:
            self._step.turn_over(self._place)
        self._place = looped(
            self._pace, self._place, start_ns=self.start_ns, end_ns=self._end_ns, seam_ns=self.seam_ns
        )
        self._begin(self.start_ns)
        return last

    def _span(self) -> str:
        """Return where the log's frames are, for who asked for others."""
        if self._cut.start_ns is None and self._cut.stop_ns is None:
            return ""
        return f"; its frames were looked at from 0 to {(self._order.last_ns - self._first_ns) / 1e9:.3f} s"

    def _garbage(self) -> list[str]:
        notes = self._notes
        found = []
        if notes.garbage_lines:
            number, text = notes.first_garbage[0]
            found.append(f"{notes.garbage_lines} lines are no CAN frames, first line {number}: {text!r}")
        if notes.impossible_frames:
            found.append(f"{notes.impossible_frames} frames left out: {notes.first_impossible}")
        return found
