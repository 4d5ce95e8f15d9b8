"""From a log's timestamps to the times its frames are due; integer nanoseconds, nothing accumulates.

log's times   in order            paced
t_ns        ->  m_ns (never     ->  due_ns: since the beginning of the replay, gaps cut,
                backwards)          speed applied; goes on over loops and seeks
"""

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from vsensor.types import IntArray

CLOCK_SET_NS = 1_000_000_000
"""Frames of several receivers are written out of order by milliseconds. A larger step back is a clock that
was set, or a second recording: time goes on from there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """Where the ordering of a log stands: time of the latest frame as it is and in order, what was found."""

    last_t_ns: int | None = None
    last_ns: int = 0
    shift_ns: int = 0  # added since a clock was set back
    repeated: int = 0
    backward: int = 0
    clock_set: int = 0

    def lines(self, frames: int) -> list[str]:
        """Return what was found in `frames` frames, as sentences."""
        intervals = max(1, frames - 1)
        found = {
            f"{self.repeated} of {intervals} intervals are 0 ({self.repeated / intervals:.1%}): frames "
            "with equal times leave one after the other": self.repeated,
            f"{self.backward} timestamps run backwards: played in the file's order": self.backward,
            f"{self.clock_set} times the log's clock was set back: played on without a gap": self.clock_set,
        }
        return [line for line, count in found.items() if count]


def in_order(state: Order, t_ns: IntArray) -> tuple[Order, IntArray]:
    """Return the times (N,) as played, in the file's order: none before the one before it."""
    if not len(t_ns):
        return state, t_ns
    before = int(t_ns[0]) if state.last_t_ns is None else state.last_t_ns
    steps = _steps(before, t_ns)
    if int(steps.min()) > 0 and int(t_ns[0]) + state.shift_ns >= state.last_ns:  # nothing to do, mostly
        ordered = t_ns + state.shift_ns
        return replace(state, last_t_ns=int(t_ns[-1]), last_ns=int(ordered[-1])), ordered
    set_back = steps < -CLOCK_SET_NS
    shifts = state.shift_ns + np.cumsum(np.where(set_back, -steps, 0))
    first = int(t_ns[0]) if state.last_t_ns is None else state.last_ns
    ordered = np.maximum(np.maximum.accumulate(t_ns + shifts), first)
    fresh = state.last_t_ns is None
    return Order(
        last_t_ns=int(t_ns[-1]),
        last_ns=int(ordered[-1]),
        shift_ns=int(shifts[-1]),
        repeated=state.repeated + int(np.count_nonzero(steps[fresh:] == 0)),
        backward=state.backward + int(np.count_nonzero((steps < 0) & ~set_back)),
        clock_set=state.clock_set + int(np.count_nonzero(set_back)),
    ), ordered


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """How log time becomes replay time: divided by `speed`, gaps longer than `max_gap_ns` cut to it."""

    speed: Fraction = Fraction(1)
    max_gap_ns: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a replay stands: log time of the latest frame in order, log time gone since the beginning."""

    at_ns: int
    elapsed_ns: int = 0

    def due_ns(self, pace: Pace) -> int:
        """Return the replay's time of this place, ns since its beginning."""
        return self.elapsed_ns * pace.speed.denominator // pace.speed.numerator


def paced(pace: Pace, place: Place, m_ns: IntArray) -> tuple[Place, IntArray]:
    """Return when the frames of log times `m_ns` (N,), in order, are due; ns since the beginning."""
    if not len(m_ns):
        return place, m_ns
    steps = _steps(place.at_ns, m_ns)
    if pace.max_gap_ns is not None:
        steps = np.minimum(steps, pace.max_gap_ns)
    elapsed = place.elapsed_ns + np.cumsum(np.maximum(steps, 0))
    due = elapsed if pace.speed == 1 else _divided(elapsed, pace.speed)
    return Place(at_ns=int(m_ns[-1]), elapsed_ns=int(elapsed[-1])), due


def _divided(elapsed_ns: IntArray, speed: Fraction) -> IntArray:
    """Return times (N,) divided by a speed and rounded down; times 1000 it would not fit after 106 days."""
    whole, rest = np.divmod(elapsed_ns, speed.numerator)
    due: IntArray = whole * speed.denominator + rest * speed.denominator // speed.numerator
    return due


def _steps(before: int, times: IntArray) -> IntArray:
    """Return the intervals (N,) of times, of which `before` is the one before; `np.diff` takes 8 us more."""
    steps = np.empty_like(times)
    steps[0] = times[0] - before
    np.subtract(times[1:], times[:-1], out=steps[1:])
    return steps


def moved(pace: Pace, at_ns: int, due_ns: int) -> Place:
    """Return the place where log time `at_ns` is due at `due_ns`, not before: after a seek."""
    return Place(at_ns=at_ns, elapsed_ns=-(-due_ns * pace.speed.numerator // pace.speed.denominator))


def looped(pace: Pace, place: Place, *, start_ns: int, end_ns: int, seam_ns: int) -> Place:
    """Return the place where a log begins again: `seam_ns` after its end, time goes on."""
    end, _ = paced(pace, place, np.array([max(end_ns, place.at_ns)]))
    return replace(end, at_ns=start_ns, elapsed_ns=end.elapsed_ns + seam_ns)


def seam_of(m_ns: IntArray) -> int:
    """Return the median interval above 0 between log times (N,) in order, 0 if there is none."""
    steps = np.diff(m_ns)
    steps = steps[steps > 0]
    return int(np.median(steps)) if len(steps) else 0
