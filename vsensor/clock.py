"""Time in integer nanoseconds: a real clock that meets absolute deadlines, and one that jumps."""

import ctypes
import sys
import time
from collections.abc import Callable
from typing import Protocol

SPIN_NS = 500_000
"""How long before a deadline sleeping ends and spinning begins: the kernel wakes a process some 60 to
160 us late, so that 0.5 ms leave room; measured lateness 1 us at the median, 3 us at 99 %."""

TIMER_ABSTIME = 1  # time.h
PR_SET_TIMERSLACK = 29  # prctl(2): the kernel may delay a wake-up by this much, 50 us unless told


class Clock(Protocol):
    """What the loop needs of time."""

    def now_ns(self) -> int:
        """Return the time in ns; never runs backwards, starts anywhere."""
        ...

    def sleep_until_ns(self, deadline_ns: int) -> int:
        """Return at the deadline, at once if it has passed; returns the time."""
        ...


class MonotonicClock:
    """The machine's monotonic clock.

    `spin_ns` of every wait are spent spinning (0 sleeps only: kinder to the machine, about 0.1 ms
    late). `slack_ns` asks Linux for a finer timer in this thread; None leaves it as it is.
    """

    def __init__(self, spin_ns: int = SPIN_NS, slack_ns: int | None = 1) -> None:
        self._spin_ns = spin_ns
        self._sleep_until = _absolute_sleep()
        if slack_ns is not None:
            _set_timer_slack(slack_ns)

    def now_ns(self) -> int:
        """Return CLOCK_MONOTONIC in ns."""
        return time.monotonic_ns()

    def sleep_until_ns(self, deadline_ns: int) -> int:
        """Sleep, then spin, until `deadline_ns`; a signal handler that raises ends the wait."""
        wake_ns, now_ns = deadline_ns - self._spin_ns, 0
        while now_ns < wake_ns:  # again, if a signal ended the sleep
            self._sleep_until(wake_ns)
            now_ns = time.monotonic_ns()
        while now_ns < deadline_ns:
            now_ns = time.monotonic_ns()
        return now_ns


class SimulatedClock:
    """A clock that stands still while the program computes and jumps to each deadline."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Return the time of the latest deadline."""
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> int:
        """Jump to `deadline_ns`; stay if it has passed."""
        self._now_ns = max(self._now_ns, deadline_ns)
        return self._now_ns


def epoch_offset_ns(attempts: int = 5) -> int:
    """Return Unix time minus monotonic time in ns, for the time stamps of logs.

    Measure it once at the start: a log then never runs backwards when the wall clock is set. Of
    several readings the one with the least time between its two clocks counts (below 1 us).
    """
    readings: list[tuple[int, int]] = []
    for _ in range(attempts):
        before_ns = time.monotonic_ns()
        epoch_ns = time.time_ns()
        after_ns = time.monotonic_ns()
        readings.append((after_ns - before_ns, epoch_ns - (before_ns + after_ns) // 2))
    return min(readings)[1]


def _absolute_sleep() -> Callable[[int], None]:
    """Return what sleeps until a time of CLOCK_MONOTONIC in ns, shorter if a signal comes.

    clock_nanosleep(2) with TIMER_ABSTIME: one system call. `time.sleep` takes an interval, and so two more
    looks at the clock; inside user-mode Linux each takes 50 us, as long as sending a frame.
    """
    library = ctypes.CDLL(None)
    if not sys.platform.startswith("linux") or not hasattr(library, "clock_nanosleep"):
        return lambda until_ns: time.sleep(max(0, until_ns - time.monotonic_ns()) / 1e9)
    nanosleep, until = library.clock_nanosleep, (ctypes.c_long * 2)()  # struct timespec

    def sleep(until_ns: int) -> None:
        until[0], until[1] = divmod(max(0, until_ns), 1_000_000_000)
        nanosleep(time.CLOCK_MONOTONIC, TIMER_ABSTIME, until, None)

    return sleep


def _set_timer_slack(slack_ns: int) -> None:
    """Ask Linux for finer timers in the calling thread; elsewhere there is nothing to ask."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, ctypes.c_ulong(slack_ns), 0, 0, 0)
