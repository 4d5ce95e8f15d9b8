"""One tick after another: compute, wait, send, hear, hand on."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

from msgspec import structs

from vsensor.clock import Clock
from vsensor.errors import ConfigError
from vsensor.faults import Clear, Command, Fault, Inject
from vsensor.line import Line
from vsensor.runner.outbox import FrameBus, Outbox
from vsensor.runner.summary import Summary
from vsensor.sinks import Sink
from vsensor.types import Frame, Output, Tick


class Loop:
    """A run, one tick at a time. `output` is the latest that was sent, `index` the number of the next tick.

    `start_ns` is the clock's time of slot 0, None = one period from now. A frame is due at start_ns +
    its due_ns, most of them at their slot's time k * period_ns. If the program gets to a slot's first
    frame later than half a period after that, the slot is dropped: world and error state have advanced,
    nothing is sent, the alive counters stand still, and nothing is sent in a burst afterwards.
    """

    def __init__(
        self,
        line: Line,
        clock: Clock,
        *,
        period_ns: int,
        start_ns: int | None = None,
        bus: FrameBus | None = None,
        sinks: Sequence[Sink] = (),
        real_time: bool = True,
    ) -> None:
        self.line, self.clock, self.period_ns = line, clock, period_ns
        self.state, self.index = line.initial_state(), 0
        self.output: Output | None = None
        self.summary = Summary(period_ns=period_ns, real_time=real_time)
        self.is_stopped = False
        self._bus, self._sinks = bus, sinks
        self._start_ns = clock.now_ns() + period_ns if start_ns is None else start_ns
        self._timing = self.summary.timing if real_time else None
        self._outbox = Outbox(clock, bus, self._start_ns, period_ns, self._timing)
        self._heard: Sequence[Frame] = ()
        self._commands: list[Command] = []
        self._began = time.perf_counter()

    def inject(self, fault: Fault) -> int:
        """Let a fault happen from the next tick on; returns its number."""
        number = self._next_fault()
        self._commands.append(Inject(fault))
        return number

    def _next_fault(self) -> int:
        waiting = sum(isinstance(command, Inject) for command in self._commands)
        return self.state.faults.next_number + waiting

    def clear(self, number: int | None = None) -> None:
        """End a fault, or all that have begun, with the next tick; one that has ended may be named, too.

        Raises ConfigError for a number that no fault has had.
        """
        known = range(self._next_fault())
        if number is not None and number not in known:
            said = f"0 to {known[-1]} were given" if known else "none was given yet"
            raise ConfigError(f"clear: number = {number!r}: no fault has it; {said}")
        self._commands.append(Clear(number))

    def stop(self) -> None:
        """Ask for the end of the run."""
        self.is_stopped = True

    def catch_up(self) -> None:
        """Let the next slot be due a period from now if its time has passed: the run was left alone."""
        if self._start_ns + self.index * self.period_ns < self.clock.now_ns():
            self._start_ns = self.clock.now_ns() - (self.index - 1) * self.period_ns
            self._outbox.starts_at(self._start_ns)

    def step(self) -> bool:
        """Do one tick; False once the road or the recording has ended."""
        summary, watch, index = self.summary, self.summary.stopwatch, self.index
        tick = Tick(index=index, t_ns=index * self.period_ns, period_ns=self.period_ns)
        watch.start()
        computed = self.line.compute(self.state, tick, self._heard, watch.lap, self._commands)
        if computed is None:
            summary.ended = True
            return False
        self._commands = []
        lateness_ns = self._outbox.pass_on(tick, computed.output.frames)
        if lateness_ns is None:
            self.state = computed.state_if_dropped
            summary.dropped_slots += 1
        else:
            self.state = computed.state_if_sent
            self._hand_on(computed.output, lateness_ns)
        if self._bus is not None:
            self._hear(self._bus)
        watch.lap("sinks")
        self.index = index + 1
        return True

    def so_far(self) -> Summary:
        """Return what the run did so far."""
        summary = self.summary
        summary.frames_refused = self._outbox.frames_refused
        summary.groups_dropped = self._outbox.groups_dropped
        summary.ticks = self.index
        summary.wall_s = time.perf_counter() - self._began
        return summary

    def finish(self) -> Summary:
        """Return what the run did, with what is to be said at its end."""
        summary = self.so_far()
        summary.notes += self.line.remarks(self.state)
        return summary

    def _hand_on(self, output: Output, lateness_ns: int) -> None:
        summary, sent = self.summary, self._outbox.taken_away()
        if self._timing is not None and output.frames:
            exposed_at_ns = output.estimate.exposed_at_ns - self.line.latency_ns
            self._timing.age.add(self._outbox.last_sent_ns - self._start_ns - exposed_at_ns)
        summary.frames_sent += len(sent)
        summary.saturated = sum(self.state.transmit.saturated.values())
        summary.stopwatch.skip()
        self.output = replace(output, frames=sent, lateness_ns=lateness_ns)
        for sink in self._sinks:
            sink.write(self.output)

    def _hear(self, bus: FrameBus) -> None:
        summary, start_ns = self.summary, self._start_ns
        arrived = bus.drain()
        self._heard = tuple(_since(start_ns, frame) for frame in arrived if self.line.accepts(frame))
        summary.frames_heard += len(arrived)
        summary.frames_decoded += len(self._heard)
        for due_ns, stamp_ns in bus.confirmed():
            summary.timing.on_bus(start_ns + due_ns, stamp_ns)


class Control(Protocol):
    """Somebody who may want something of a run, asked between two ticks."""

    def poll(self, loop: Loop) -> None:
        """Do what was asked for since the last call; returns at once."""
        ...


def run_loop(
    line: Line,
    clock: Clock,
    *,
    period_ns: int,
    ticks: int | None,
    start_ns: int | None = None,
    bus: FrameBus | None = None,
    sinks: Sequence[Sink] = (),
    stop: Callable[[], bool] = lambda: False,
    on_tick: Callable[[int], None] = lambda index: None,
    real_time: bool = True,
    control: Control | None = None,
) -> Summary:
    """Run `line` for `ticks` slots (None: until the source ends, or `stop()` or `control` says so).

    The other arguments: see Loop.
    """
    loop = Loop(
        line, clock, period_ns=period_ns, start_ns=start_ns, bus=bus, sinks=sinks, real_time=real_time
    )
    while (ticks is None or loop.index < ticks) and not loop.is_stopped and not stop():
        if not loop.step():
            break
        on_tick(loop.index)
        if control is not None:
            control.poll(loop)
    loop.summary.interrupted = stop()
    return loop.finish()


def _since(start_ns: int, frame: Frame) -> Frame:
    """Return a frame with its receive time counted from slot 0, as the source takes it."""
    return structs.replace(frame, due_ns=frame.due_ns - start_ns)
