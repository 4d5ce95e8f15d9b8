"""Frames that wait for their time: each group leaves at its own, what is too late is not sent at all."""

from collections.abc import Sequence
from itertools import groupby
from operator import attrgetter, itemgetter
from typing import NamedTuple, Protocol

from vsensor.clock import Clock
from vsensor.runner.timing import Timing
from vsensor.types import Frame, Tick

_due_ns = attrgetter("due_ns")


class FrameBus(Protocol):
    """What the loop needs of a bus."""

    def send(self, frame: Frame) -> bool:
        """Send now; False if the bus refused the frame (counted, never raised)."""
        ...

    def drain(self) -> Sequence[Frame]:
        """Return what has arrived since the last call."""
        ...

    def confirmed(self) -> Sequence[tuple[int, int]]:
        """Return `due_ns` and time on the bus of own frames since the last call, where the bus says so."""
        ...


class Group(NamedTuple):
    """Frames of one tick that are due together, `due_ns` after slot 0."""

    due_ns: int
    tick: int
    frames: tuple[Frame, ...]


class Outbox:
    """Lets the frames of one tick after another go, each group at its time.

        slot k             k + 1
        |  A     B    ...  |  A     B         A, B: groups of a slot, such as messages with a phase
        |<- half a period: a group that is not gone by then is dropped

    A tick whose first group is too late is dropped as a whole; of a later group only itself. A group that
    is due in a later tick's time (a delayed frame) waits, and leaves between that tick's groups.
    """

    def __init__(
        self, clock: Clock, bus: FrameBus | None, start_ns: int, period_ns: int, timing: Timing | None
    ) -> None:
        self.frames_refused = self.groups_dropped = 0
        self.last_sent_ns = start_ns  # the clock's time after the latest frame
        self._clock, self._bus, self._start_ns = clock, bus, start_ns
        self._period_ns, self._timing = period_ns, timing
        self._waiting: list[Group] = []
        self._gone: list[Frame] = []
        self._latency_ns: int | None = None  # least time from a slot to its first frame so far

    def pass_on(self, tick: Tick, frames: Sequence[Frame]) -> int | None:
        """Wait for, and send, what is due until the next slot's frames; returns the first group's lateness.

        None: the tick was too late and is dropped. A tick without frames only waits for its slot.
        """
        self._add(tick, frames)
        latency_ns = self._latency_ns or 0
        horizon_ns = tick.t_ns + self._period_ns + latency_ns
        if not frames:
            self._waiting.append(Group(tick.t_ns + latency_ns, tick.index, ()))
            self._waiting.sort(key=itemgetter(0))
        lateness_ns: int | None = 0
        is_first = True
        while self._waiting and self._waiting[0].due_ns < horizon_ns:
            group = self._waiting.pop(0)
            late_ns = self._wait(group)
            is_late = late_ns > self._period_ns // 2
            if group.tick == tick.index and is_first:
                is_first = False
                lateness_ns = None if is_late else late_ns
                if is_late:
                    self._waiting = [other for other in self._waiting if other.tick != tick.index]
                    continue
            if is_late:
                self.groups_dropped += 1
            elif group.frames:
                self._send(group, late_ns)
        return lateness_ns

    def taken_away(self) -> tuple[Frame, ...]:
        """Return the frames that the bus took since the last call, in their order."""
        gone, self._gone = tuple(self._gone), []
        return gone

    def _add(self, tick: Tick, frames: Sequence[Frame]) -> None:
        ordered = sorted(frames, key=_due_ns)
        if not ordered:
            return
        latency_ns = ordered[0].due_ns - tick.t_ns
        self._latency_ns = latency_ns if self._latency_ns is None else min(self._latency_ns, latency_ns)
        self._waiting += [
            Group(due_ns, tick.index, tuple(some)) for due_ns, some in groupby(ordered, _due_ns)
        ]
        self._waiting.sort(key=itemgetter(0))

    def _wait(self, group: Group) -> int:
        due_ns = self._start_ns + group.due_ns
        self._clock.sleep_until_ns(due_ns)
        return self._clock.now_ns() - due_ns

    def _send(self, group: Group, late_ns: int) -> None:
        bus, gone = self._bus, self._gone
        if bus is None:
            gone += group.frames
        else:
            taken = [frame for frame in group.frames if bus.send(frame)]
            self.frames_refused += len(group.frames) - len(taken)
            gone += taken
        if self._timing is not None:
            self.last_sent_ns = self._clock.now_ns()
            self._timing.lateness.add(late_ns)
            self._timing.burst.add(self.last_sent_ns - self._start_ns - group.due_ns - late_ns)
