"""Frames that wait for their time: each group leaves at its own, what is too late is not sent at all."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from operator import attrgetter, itemgetter
from typing import NamedTuple, Protocol

from vsensor.clock import Clock
from vsensor.timing import Timing
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
    """Frames of one tick that are due together, `due_ns` after slot 0, and no more than `limit_ns` late."""

    due_ns: int
    tick: int
    frames: tuple[Frame, ...]
    limit_ns: int


class Outbox:
    """Lets the frames of one tick after another go, each group at its time.

        slot k             k + 1
        |  A     B    ...  |  A     B         A, B: groups of a slot, such as messages with a phase
        |<- half a period: a group that is not gone by then is dropped

    The period is that of the slots, or the time to the same message's next frame in this slot if that is
    shorter. A tick whose first group is more than half a slot late is dropped as a whole. A group that
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
            self._waiting.append(Group(tick.t_ns + latency_ns, tick.index, (), self._period_ns // 2))
            self._waiting.sort(key=itemgetter(0))
        lateness_ns: int | None = 0
        is_first = True
        while self._waiting and self._waiting[0].due_ns < horizon_ns:
            group = self._waiting.pop(0)
            late_ns = self._wait(group)
            if group.tick == tick.index and is_first:
                is_first = False
                lateness_ns = late_ns
                if late_ns > self._period_ns // 2:
                    self._waiting = [other for other in self._waiting if other.tick != tick.index]
                    lateness_ns = None
                    continue
            if late_ns > group.limit_ns:
                self.groups_dropped += 1
            elif group.frames:
                self._send(group, late_ns)
        return lateness_ns

    def starts_at(self, start_ns: int) -> None:
        """Take `start_ns` as the clock's time of slot 0 from now on."""
        self._start_ns = start_ns

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
        if ordered[0].due_ns == ordered[-1].due_ns:
            self._waiting.append(Group(ordered[0].due_ns, tick.index, tuple(ordered), self._period_ns // 2))
        else:
            self._waiting += self._groups(tick, ordered)
        self._waiting.sort(key=itemgetter(0))

    def _groups(self, tick: Tick, ordered: Sequence[Frame]) -> Iterator[Group]:
        """Yield the groups, the last one first: how late one may be depends on those after it."""
        next_due_ns: dict[int, int] = {}
        for due_ns, some in reversed([(due_ns, tuple(some)) for due_ns, some in groupby(ordered, _due_ns)]):
            ids = [frame.arbitration_id for frame in some]
            gaps_ns = [next_due_ns[number] - due_ns for number in ids if number in next_due_ns]
            next_due_ns |= dict.fromkeys(ids, due_ns)
            yield Group(due_ns, tick.index, some, min([self._period_ns, *gaps_ns]) // 2)

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
