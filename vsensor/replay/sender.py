"""A frame's last steps: through the stages, onto the buses, into the recording."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from vsensor.replay.report import Report
from vsensor.replay.stages import Chain, Stage
from vsensor.types import Frame

UNHEARD = 1000  # frames sent without listening, where there is no time at all
RECORDED_AT_ONCE, UNRECORDED = 64, 4096


class Sending(Protocol):
    """What the player needs of the buses."""

    def send(self, frame: Frame) -> bool:
        """Send now; False if the bus refused the frame (counted, never raised)."""
        ...

    def drain(self) -> Sequence[Frame]:
        """Return what was heard since the last call."""
        ...


class Sender:
    """Sends what is told; `states` are those of the stages, `due_ns` when the latest frame was due."""

    def __init__(
        self,
        sending: Sending,
        stages: Sequence[Stage],
        record: Callable[[Frame, int], None] | None,
        report: Report,
    ) -> None:
        """`record(frame, origin_ns)` gets every frame that was taken, when there is time for it."""
        self.states = [stage.state for stage in stages]
        self.due_ns = -1
        self._sending, self._record, self._report = sending, record, report
        self._chain = Chain(stages)
        self._ready: tuple[list[Any], tuple[Frame, ...]] | None = None  # the next frame behind the stages
        self._to_record: deque[tuple[Frame, int]] = deque()
        self._unheard = 0

    @property
    def has_unrecorded(self) -> bool:
        """Whether something is to be recorded."""
        return bool(self._to_record)

    def prepare(self, frame: Frame) -> None:
        """Do what can be done before `frame`, which is the next one, is due."""
        if self._ready is None:
            self._ready = self._chain.through(self.states, (frame,))

    def forget(self) -> None:
        """Undo `prepare`: another frame is the next one."""
        self._ready = None

    def send(self, frame: Frame, origin_ns: int) -> None:
        """Send a frame of the log."""
        result = self._ready or self._chain.through(self.states, (frame,))
        self._ready = None
        self._report.order(self.due_ns, frame.due_ns)
        self.due_ns = frame.due_ns
        self._give(result, origin_ns)

    def next_wake_ns(self) -> int | None:
        """Return when the next frame of a stage is due; None without one."""
        woken = self._chain.next_wake(self.states)
        return None if woken is None else woken[0]

    def wake_until(self, last_ns: int, origin_ns: int, now_ns: int | None) -> None:
        """Send the stages' own frames that are due before, or at, `last_ns`; what a bus refuses is lost.

        `now_ns` tells how late they are; None: nobody wants to know.
        """
        while self._chain.is_timed and (woken := self._chain.next_wake(self.states)) is not None:
            due_ns, number = woken
            if due_ns > last_ns:
                return
            self.states, frames = self._chain.wake(self.states, number, due_ns)
            self._ready = None  # it was made with the states before
            self._report.order(self.due_ns, due_ns)
            self.due_ns = max(self.due_ns, due_ns)
            if now_ns is not None:
                self._report.late(now_ns - origin_ns - due_ns)
            self._give((self.states, frames), origin_ns)

    def listen(self) -> None:
        """Hear what has arrived."""
        self._unheard = 0
        self._sending.drain()

    def write(self) -> None:
        """Record a few of the frames that were sent."""
        record = self._record
        if record is not None:
            for _ in range(min(RECORDED_AT_ONCE, len(self._to_record))):
                record(*self._to_record.popleft())

    def finish(self) -> None:
        """Record and hear what is left."""
        while self._to_record:
            self.write()
        self.listen()

    def _give(self, result: tuple[list[Any], tuple[Frame, ...]], origin_ns: int) -> None:
        """Hand frames to the buses; the states that belong to them count if one of the frames was taken."""
        states, frames = result
        is_gone = not frames
        for one in frames:
            taken = self._sending.send(one)
            self._report.sent(one.channel, taken)
            is_gone |= taken
            if taken and self._record is not None:
                self._to_record.append((one, origin_ns))
        if is_gone:  # counters follow what was sent
            self.states = states
        self._unheard += len(frames)
        if self._unheard >= UNHEARD:
            self.listen()
        if len(self._to_record) >= UNRECORDED:
            self.write()
