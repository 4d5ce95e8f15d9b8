"""One message of the stream: intervals, counter, and what a protected receiver makes of it."""

import numpy as np

from vsensor.accept.book import Book
from vsensor.accept.config import LimitsConfig
from vsensor.accept.frames import Frames, has_pages
from vsensor.accept.intervals import Histogram, Judged, Pace, judge
from vsensor.accept.reception import Listener
from vsensor.profile import MessagePlan
from vsensor.types import Array, BoolArray, IntArray

_PATIENCE_CYCLES = 3  # a recording may begin and end anywhere; a consumer waits that long


class Watch:
    """Watches one message; frames are judged once the `settle_frames` after them have come.

    Of a message whose pages leave together, one watch takes all frames for their counters, and another, with
    `of_page`, those of one page for their times.
    """

    def __init__(self, plan: MessagePlan, limits: LimitsConfig, book: Book, *, of_page: bool = False) -> None:
        self.plan, self._book, self._window = plan, book, limits.settle_frames
        self.name = plan.layout.name
        cycle_ns = plan.sending.cycle_ns if of_page or not has_pages(plan) else 0
        self._pace = Pace.of(cycle_ns, limits.cycle_tolerance, limits.ns("jitter_ms")) if cycle_ns else None
        self._is_cyclic = plan.sending.is_cyclic
        self._gap_ns = plan.sending.min_delay_ns - limits.ns("jitter_ms")
        self._tolerance = limits.cycle_tolerance
        guard = None if of_page else plan.guard
        self._listener = Listener(self.name, guard, limits.receiver, book) if guard is not None else None
        self.kept: Frames | None = None
        self._done = 0  # of the kept frames are judged already
        self._begun = False
        self._since = 0  # place among them where the envelope last moved
        self._counter: int | None = None
        self._lost = 0  # frames missing or wrong since the counter was read
        self._doubled = 0
        self.intervals = Histogram()
        self.count = self.late = self.backwards = self.missing = self.extra = 0
        self.first_ns: int | None = None
        self.last_ns = 0

    @property
    def is_paced(self) -> bool:
        """Whether its cycle is known, so that silence says something."""
        return self._pace is not None

    def take(self, frames: Frames) -> None:
        """Take in the next frames of the message."""
        if not len(frames):
            return
        if self.first_ns is None:
            self.first_ns = int(frames.t_ns[0])
        self.last_ns = int(frames.t_ns[-1])
        self.count += len(frames)
        self.kept = frames if self.kept is None else self.kept.then(frames)
        self._settle(len(self.kept) - self._window)

    def end(self, first_ns: int, last_ns: int) -> None:
        """Judge what is left; the stream of all messages lasted from `first_ns` to `last_ns`."""
        if self.kept is None or self.first_ns is None:
            return
        self._settle(len(self.kept))
        silent = 0
        if self._pace is not None:
            self._cut(first_ns + self.plan.sending.offset_ns, self.first_ns)
            silent = self._cut(self.last_ns, last_ns)
            self._judge_cycle(self._pace)
        if self._listener is not None:
            self._listener.silence(silent, last_ns)
            self._listener.end(last_ns)

    def _cut(self, begin_ns: int, end_ns: int) -> int:
        """Return, and note, how many frames are missing at an end of the stream."""
        pace = self._pace
        if pace is None or end_ns - begin_ns <= pace.longest_ns + (_PATIENCE_CYCLES - 1) * pace.cycle_ns:
            return 0
        cycles = (end_ns - begin_ns) // pace.cycle_ns
        self._note_missing([begin_ns], cycles, [(end_ns - begin_ns) / 1e6])
        return cycles

    def _note_missing(self, t_ns: IntArray | list[int], count: int, worst_ms: list[float]) -> None:
        limit = self._pace.longest_ns / 1e6 if self._pace is not None else None
        self._book.note(
            "missing", self.name, t_ns, worst=worst_ms, count=count, limit=limit, unit="ms of silence"
        )

    def _judge_cycle(self, pace: Pace) -> None:
        """Note a mean interval that is off: it says once what each late frame says again."""
        steps = self.count - 1 + self.missing - self.extra
        if not self._is_cyclic or self.count < 3 or self.first_ns is None or steps < 1 or self.backwards:
            return
        mean_ns = (self.last_ns - self.first_ns) / steps
        if abs(mean_ns / pace.cycle_ns - 1) > self._tolerance:
            self._book.drop("late", self.name)
            self._book.note(
                "wrong_cycle",
                self.name,
                [self.first_ns],
                worst=[mean_ns / 1e6],
                count=self.count,
                limit=pace.cycle_ns / 1e6,
                unit="ms",
            )

    def _settle(self, last: int) -> None:
        """Judge the kept frames up to `last` - 1, and keep what the next ones are compared with."""
        first, kept = self._done, self.kept
        if last <= first or kept is None:
            return
        missing, extra = self._judge_intervals(kept.t_ns, first, last)
        self._judge_counters(kept.part(first, last), missing, extra)
        drop = max(0, last - self._window - 1)
        self.kept = kept.part(drop, len(kept))
        self._done, self._since = last - drop, max(0, self._since - drop)

    def _judge_intervals(self, t_ns: IntArray, first: int, last: int) -> tuple[IntArray, BoolArray]:
        """Return how many frames are missing before each, and whether it is one too many; note them."""
        nothing = np.zeros(last - first, dtype=np.int64)
        intervals = np.diff(t_ns, prepend=t_ns[:1])
        starts = int(not self._begun)  # before the first frame of all there is no interval
        self._begun = True
        times = t_ns[first:last]
        self._note_any(intervals[first + starts : last], times[starts:])
        if self._pace is None:
            return nothing, nothing.astype(bool)
        if starts:
            intervals[0] = self._pace.cycle_ns
        intervals = np.where(intervals < 0, self._pace.cycle_ns, intervals)
        judged = self._judged(self._pace, intervals, first, last)
        moved = np.flatnonzero((judged.missing > 0) | judged.extra)
        self._since = first + int(moved[-1]) if len(moved) else self._since
        self._note_intervals(self._pace, judged, intervals[first:last] / 1e6, times)
        return judged.missing, judged.extra

    def _note_any(self, intervals: IntArray, times: IntArray) -> None:
        """Take in intervals whatever the message's cycle is; note those below its minimum delay."""
        self.intervals.add(np.maximum(intervals, 0))
        self.backwards += int(np.count_nonzero(intervals < 0))
        if self._gap_ns > 0:
            close = intervals < self._gap_ns
            early_ms = (self.plan.sending.min_delay_ns - intervals[close]) / 1e6
            self._book.note(
                "too_close", self.name, times[close], worst=early_ms, limit=0.0, unit="ms too early"
            )

    def _judged(self, pace: Pace, intervals: IntArray, first: int, last: int) -> Judged:
        if self._is_cyclic:
            return judge(pace, intervals, first, last, self._since, self._window)
        mine = intervals[first:last]  # sent by events, too: only a long silence says something
        long = mine > pace.longest_ns
        missing = np.where(long, np.maximum(np.rint(mine / pace.cycle_ns).astype(np.int64) - 1, 0), 0)
        none = np.zeros(len(mine), dtype=bool)
        return Judged(missing=missing, extra=none, late=long & (missing == 0), early=none)

    def _note_intervals(self, pace: Pace, judged: Judged, lasted_ms: Array, times: IntArray) -> None:
        lost = judged.missing > 0
        if lost.any():
            self.missing += int(judged.missing.sum())
            self._note_missing(times[lost], int(judged.missing.sum()), lasted_ms[lost].tolist())
        self.extra += int(np.count_nonzero(judged.extra))
        self.late += int(np.count_nonzero(judged.late))
        self._book.note("extra", self.name, times[judged.extra])
        self._book.note(
            "late",
            self.name,
            times[judged.late],
            worst=lasted_ms[judged.late],
            limit=pace.longest_ns / 1e6,
            unit="ms",
        )

    def _judge_counters(self, frames: Frames, missing: IntArray, extra: BoolArray) -> None:
        """Compare each counter with the one before, and with how many frames time says are lost between."""
        guard, right = self.plan.guard, frames.right
        if guard is None or self._listener is None:
            return
        rows = np.flatnonzero(right)
        fine = np.zeros(len(frames), dtype=bool)
        if guard.counter_states > 1:
            fine[rows] = self._steps(guard.counters_bulk(frames.data[rows]), rows, frames, missing, extra)
        else:
            fine[rows] = True
        fine &= missing == 0
        self._listener.take(frames.t_ns, frames.data, missing, fine)

    def _steps(
        self, counters: IntArray, rows: IntArray, frames: Frames, missing: IntArray, extra: BoolArray
    ) -> BoolArray:
        """Return which right frames have the next counter; note the steps that time does not explain."""
        states = self.plan.guard.counter_states if self.plan.guard is not None else 1
        losses = self._lost + np.cumsum(missing + ~frames.right)
        doubles = self._doubled + np.cumsum(extra)
        between = np.diff(losses[rows], prepend=0)
        doubled = np.diff(doubles[rows], prepend=0) > 0
        self._lost = int(losses[-1] - (losses[rows[-1]] if len(rows) else 0))
        self._doubled = int(doubles[-1] - (doubles[rows[-1]] if len(rows) else 0))
        if not len(rows):
            return np.zeros(0, dtype=bool)
        steps = np.diff(counters, prepend=counters[:1]) % states
        steps[0] = 1 if self._counter is None else (int(counters[0]) - self._counter) % states
        self._counter = int(counters[-1])
        explained = between >= states - 1
        times = frames.t_ns[rows]
        self._book.note("counter_repeated", self.name, times[(steps == 0) & ~doubled & ~explained])
        jumped = (steps - 1 > between) & ~explained
        size = steps[jumped].astype(np.float64)
        self._book.note("counter_jumped", self.name, times[jumped], worst=size, limit=1.0, unit="steps")
        return np.asarray(steps == 1)
