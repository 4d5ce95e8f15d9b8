"""A log as a player reads it: piece by piece, over loops and seeks, each frame with the time it is due."""

from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from vsensor.errors import LogError
from vsensor.logs import Columns, frames_of
from vsensor.replay.beat import InStep, rest_of_image
from vsensor.replay.choice import EXTENDED_KEY, Choice
from vsensor.replay.marks import Marks
from vsensor.replay.reading import SURVEY, Cut, Reading, Run, Survey
from vsensor.replay.timeline import Pace, Place, looped, moved, paced, seam_of
from vsensor.types import BoolArray, Frame, IntArray

AHEAD = 4096
"""Frames read ahead: half a second of a full bus, in case there is no pause to read in."""
PIECE = 128
"""Frames decoded at a time: some 0.3 ms, which fits between two frames of most buses."""
LOOPS_FOR_EVER = 0
NOTHING = "none of its frames is chosen, within --start and --stop, and of a kind that its bus carries"
IMAGE_FRAMES = 256  # that are looked at for the end of an image


Sendable = Callable[[Columns], BoolArray]
"""Says which of some frames (N,) some bus can take."""


class Piece(NamedTuple):
    """A run of frames to be played: `due_ns` of a frame counts from the beginning of the replay.

    `log_ns`: the log's time of each; `loop` counts from 0.
    """

    frames: list[Frame]
    log_ns: list[int]
    loop: int


class Reel:
    """A log that is played. `pull` gives the next frames; `seek` goes elsewhere, replay time goes on."""

    most_ahead = AHEAD
    opens_ns = lead_ns = 0

    def __init__(
        self,
        path: Path,
        head: Survey,
        *,
        choice: Choice | None = None,
        pace: Pace | None = None,
        cut: Cut | None = None,
        sendable: Sendable | None = None,
        piece: int = PIECE,
    ) -> None:
        """Prepare to read `path`, whose beginning is `head`; without a word all of it, once, as it is.

        `sendable` says which of the chosen frames (N,) some bus can take; the others are left out.
        """
        self.channels = head.channels
        self.ended = False
        self.chosen = 0
        self._path, self._choice, self._size = path, choice or Choice(), piece
        self._pace, self._cut = pace or Pace(), cut or Cut()
        self._sendable = sendable
        self._first_ns = head.start_ns
        self.start_ns = head.start_ns if self._cut.start_ns is None else self._cut.start_ns
        rate_hz = self._cut.rate_hz
        self.seam_ns = seam_of(head.m_ns) if rate_hz is None else round(1e9 / rate_hz)
        if not self.seam_ns and self._cut.loops != 1:
            raise LogError(f"{path}: no time passes in it, so it has no pace to loop at; --rate HZ gives one")
        self.fault: str | None = None  # why reading ended before the log did
        self._loop = self._judged = 0
        self._is_before = False  # what is played begins behind what was read
        self._marks = Marks()
        self._found: list[str] = []
        self._end_ns = self.start_ns
        self._place = Place(at_ns=self.start_ns)
        self._step = None if self._cut.beat is None else InStep(self._cut.beat, self._pace)
        self._begin(self.start_ns)
        while self._is_before:
            self._is_before = not self._reading.skip(self.start_ns, SURVEY)

    @property
    def grain(self) -> int:
        """About how many frames are pulled at a time."""
        return self._size

    @grain.setter
    def grain(self, frames: int) -> None:
        self._size = self._reading.size = frames

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
        if self._is_before:
            self._is_before = not self._reading.skip(self._from_ns)
            return None
        run = self._reading.next()
        self.fault = self._reading.fault or self.fault
        return self._turn_over() if run is None else self._played(*run)

    def reading(self, log_ns: int) -> Reading:
        """Return what can be read up to `log_ns`, little by little, while this plays on: for `seek`."""
        return Reading(self._path, self.channels, self._cut, self._size, self._marks, log_ns)

    def seek(
        self,
        log_ns: int,
        due_ns: int,
        loop: int = 0,
        unsent: Sequence[Frame] = (),
        reading: Reading | None = None,
    ) -> None:
        """Go on, in pass `loop`, with the first frame not before `log_ns`; that time is due at `due_ns`.

        `reading` may have been read up to there. Frames pulled before that are due then or later count as
        not sent.
        """
        log_ns = max(log_ns, self.start_ns)
        self._place = moved(self._pace, log_ns, due_ns)
        self._loop, self.ended = loop, False
        if self._step is not None:
            self._step.seek(due_ns)
        self._begin(log_ns, reading)

    def whole(self, frames: Iterable[Frame]) -> int:
        """Return how many of the coming frames, at the least, are sent before a seek that tears no image.

        Up to the next image, so that nothing is missing; up to the end of this one where none follows.
        """
        beat = self._cut.beat
        if beat is None:
            return 0
        origins = {new: old for old, new in self._choice.rename.items()}
        keys = [f.arbitration_id | EXTENDED_KEY * f.is_extended for f in islice(frames, IMAGE_FRAMES)]
        keys = [origins.get(key, key) for key in keys]
        return keys.index(beat.key) if beat.key in keys else rest_of_image(beat, keys)

    def findings(self) -> list[str]:
        """Return what was found in what was read of the log, as sentences."""
        reading = self._reading
        if reading.count > self._judged:
            self._judged, self._found = reading.count, reading.lines()
        if self._step is None:
            return self._found
        return [*self._found, *self._step.lines()]

    def _begin(self, log_ns: int, reading: Reading | None = None) -> None:
        self._reading = reading or self.reading(log_ns)
        self._from_ns = log_ns
        self._is_before = reading is None and log_ns > self._first_ns
        self._chosen_before = self.chosen  # of this pass

    def _played(self, columns: Columns, m_ns: IntArray) -> Piece | None:
        within = m_ns >= self._from_ns
        if self._cut.stop_ns is not None:
            within &= m_ns < self._cut.stop_ns
        if not within.any():
            return None
        self._end_ns = int(m_ns[-1]) if within[-1] else int(m_ns[within][-1])
        return self._piece(columns, m_ns, within)

    def _piece(self, columns: Columns, m_ns: IntArray, within: BoolArray) -> Piece | None:
        rows = within & self._choice.mask(columns, self.channels)
        chosen, m_ns = _taken(columns, m_ns, rows)
        if self._sendable is not None and len(m_ns):
            chosen, m_ns = _taken(chosen, m_ns, self._sendable(chosen))
        if not len(m_ns):
            return None
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
        last_s = (self._reading.order.last_ns - self._first_ns) / 1e9
        return f"; its frames were looked at from 0 to {last_s:.3f} s"


def _taken(columns: Columns, m_ns: IntArray, rows: BoolArray) -> Run:
    """Return the chosen frames; they are seldom copied, as mostly all are."""
    return Run(columns, m_ns) if rows.all() else Run(columns.taken(rows), m_ns[rows])
