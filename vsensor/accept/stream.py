"""A stream judged chunk by chunk: the same findings, however it is cut.

frames ──► length, CRC ──► each message: intervals, counter, receiver     (waits for some frames)
                └────────► images: bursts, contradictions, steps          (waits for the next image)
"""

import numpy as np

from vsensor.accept.book import Book
from vsensor.accept.config import LimitsConfig
from vsensor.accept.contradictions import Contradictions
from vsensor.accept.frames import checked, has_pages, page_numbers
from vsensor.accept.images import Bursts, Mixed, image_numbers, tie_column, ties_of
from vsensor.accept.message import Watch
from vsensor.accept.ranges import Ranges
from vsensor.accept.rows import rows_of
from vsensor.accept.seals import Seals
from vsensor.accept.steps import Steps
from vsensor.logs import Columns, Flag
from vsensor.profile import Profile

_HEAD_BITS = {False: 47, True: 67}  # of a classic frame without its data, a pause of 3 bits included
_STUFFED = 1.2  # bits on the wire for each bit of data, a fifth stuffed


class Stream:
    """Judges the frames of one bus by one profile; `take` any number of chunks, then `end`."""

    def __init__(self, profile: Profile, limits: LimitsConfig) -> None:
        self.profile, self.limits, self.book = profile, limits, Book()
        self.watches = [Watch(plan, limits, self.book) for plan in profile.messages]
        self.pages = {
            place: Watch(plan, limits, self.book, of_page=True)
            for place, plan in enumerate(profile.messages)
            if has_pages(plan)
        }
        self.ranges = [Ranges(plan, self.book, by_range=limits.ranges) for plan in profile.messages]
        self.bursts = Bursts(profile, self.book)
        self.steps = Steps(profile, limits, self.book)
        self.contradictions = Contradictions(profile, limits, self.book)
        self._seals = Seals(profile, self.book)
        self._ties = ties_of(profile)
        self._open: Mixed | None = None
        self._images = 0
        self.frames = self.error_frames = self.fd_frames = self.same_time = 0
        self._head_bits = self._data_bits = 0
        self.foreign: set[int] = set()
        self.first_ns: int | None = None
        self.last_ns = 0
        self._bus_ns: tuple[int, int] | None = None

    @property
    def bus_ns(self) -> tuple[int, int]:
        """Time of the first and the last frame of the whole bus."""
        return self._bus_ns or (0, 0)

    @property
    def bits(self) -> float:
        """Bits of all frames on the wire, about, as those of classic frames."""
        return self._head_bits + _STUFFED * self._data_bits

    @property
    def waiting(self) -> int:
        """How many frames wait for the end of their image."""
        return 0 if self._open is None else len(self._open)

    def take(self, columns: Columns) -> None:
        """Take in the next frames of the bus, in the order in which they were heard."""
        if not len(columns.t_ns):
            return
        self._take_bus(columns)
        data = columns.taken((columns.flags & (Flag.ERROR | Flag.REMOTE)) == 0)
        mine = self._checked(data)
        if mine is None:
            return
        self.first_ns = int(mine.t_ns[0]) if self.first_ns is None else self.first_ns
        self.last_ns = int(mine.t_ns[-1])
        mine = mine if self._open is None else self._open.then(mine)
        self._judge_images(mine, is_end=False)

    def end(self) -> None:
        """Judge what waits for more frames."""
        if self._open is not None:
            self._judge_images(self._open, is_end=True)
            self._open = None
        for watch in (*self.watches, *self.pages.values()):
            watch.end(self.first_ns or 0, self.last_ns)

    def _take_bus(self, columns: Columns) -> None:
        """Count what is on the bus, whosever it is."""
        t_ns, flags = columns.t_ns, columns.flags
        first, last = self._bus_ns or (int(t_ns[0]), None)
        steps = np.diff(t_ns, prepend=t_ns[:1] - 1 if last is None else last)
        self.same_time += int(np.count_nonzero(steps == 0))
        self._bus_ns = first, int(t_ns[-1])
        self.frames += len(t_ns)
        self.error_frames += int(np.count_nonzero(flags & Flag.ERROR))
        self.fd_frames += int(np.count_nonzero(flags & Flag.FD))
        extended = int(np.count_nonzero(flags & Flag.EXTENDED))
        self._head_bits += extended * _HEAD_BITS[True] + (len(t_ns) - extended) * _HEAD_BITS[False]
        self._data_bits += 8 * int(columns.length.astype(np.int64).sum())

    def _checked(self, columns: Columns) -> Mixed | None:
        """Judge the messages one by one; return the frames of all of them with what was found."""
        count = len(columns.t_ns)
        plan, kind = np.full(count, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
        tie, right = np.full(count, -1, dtype=np.int64), np.zeros(count, dtype=bool)
        extended = (columns.flags & Flag.EXTENDED) != 0
        for place, watch in enumerate(self.watches):
            layout = watch.plan.layout
            rows = np.flatnonzero(
                (columns.arbitration_id == layout.arbitration_id) & (extended == layout.is_extended)
            )
            if not len(rows):
                continue
            frames = checked(
                watch.plan, columns.t_ns[rows], columns.data[rows], columns.length[rows], self.book
            )
            plan[rows], right[rows] = place, frames.right
            kind[rows] = place + len(self.watches) * page_numbers(frames, watch.plan)
            tie[rows] = np.where(frames.right, tie_column(watch.plan, self._ties[place], frames.data), -1)
            watch.take(frames)
            self.ranges[place].judge(frames)
            if place in self.pages:
                self.pages[place].take(frames.where(page_numbers(frames, watch.plan) == 0))
        self.foreign.update(np.unique(columns.arbitration_id[plan < 0]).tolist())
        mine = np.flatnonzero(plan >= 0)
        if not len(mine):
            return None
        return Mixed(
            t_ns=columns.t_ns[mine],
            plan=plan[mine],
            kind=kind[mine],
            tie=tie[mine],
            ids=columns.arbitration_id[mine].astype(np.int64),
            extended=extended[mine],
            data=columns.data[mine],
            lengths=columns.length[mine],
            right=right[mine],
        )

    def _judge_images(self, frames: Mixed, *, is_end: bool) -> None:
        """Judge the images that are complete; the last one waits unless the stream ends."""
        numbers, twice = image_numbers(frames, self.limits.ns("burst_ms"))
        count = int(numbers[-1]) + (1 if is_end else 0)
        waiting = np.flatnonzero(numbers >= count)
        self._open = frames.taken(waiting)
        done = np.flatnonzero((numbers < count) & ~twice)
        if not count:
            return
        frames, numbers = frames.taken(done), numbers[done]
        inner = slice(0 if self._images else 1, count - 1 if is_end else count)
        mixed = self.bursts.judge(frames, numbers, inner)
        self._seals.take(frames)
        rows = rows_of(self.profile, frames, numbers, mixed)
        self.contradictions.judge(rows)
        self.steps.judge(rows)
        self._images += count
