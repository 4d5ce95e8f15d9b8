"""One tick after another: compute, wait, send, hear, hand on."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from vsensor.clock import Clock
from vsensor.line import Line
from vsensor.runner.outbox import FrameBus, Outbox
from vsensor.runner.summary import Summary
from vsensor.sinks import Sink
from vsensor.types import Frame, Tick


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
) -> Summary:
    """Run `line` for `ticks` slots (None: until the source ends or `stop()` says so).

    `start_ns` is the clock's time of slot 0, None = one period from now. A frame is due at start_ns +
    its due_ns, most of them at their slot's time k * period_ns. If the program gets to a slot's first
    frame later than half a period after that, the slot is dropped: world and error state have advanced,
    nothing is sent, the alive counters stand still, and nothing is sent in a burst afterwards.
    """
    summary = Summary(period_ns=period_ns, real_time=real_time)
    watch = summary.stopwatch
    state = line.initial_state()
    began = time.perf_counter()
    heard: Sequence[Frame] = ()
    start_ns = clock.now_ns() + period_ns if start_ns is None else start_ns
    timing = summary.timing if real_time else None
    outbox = Outbox(clock, bus, start_ns, period_ns, timing)
    index = 0
    while (ticks is None or index < ticks) and not stop():
        tick = Tick(index=index, t_ns=index * period_ns, period_ns=period_ns)
        watch.start()
        computed = line.compute(state, tick, heard, watch.lap)
        if computed is None:
            summary.ended = True
            break
        output = computed.output
        lateness_ns = outbox.pass_on(tick, output.frames)
        if lateness_ns is None:
            state = computed.state_if_dropped
            summary.dropped_slots += 1
        else:
            state = computed.state_if_sent
            sent = outbox.taken_away()
            if timing is not None and output.frames:
                exposed_at_ns = output.estimate.exposed_at_ns - line.latency_ns
                timing.age.add(outbox.last_sent_ns - start_ns - exposed_at_ns)
            summary.frames_sent += len(sent)
            summary.saturated = sum(state.transmit.saturated.values())
            watch.skip()
            output = replace(output, frames=sent, lateness_ns=lateness_ns)
            for sink in sinks:
                sink.write(output)
        if bus is not None:
            arrived = bus.drain()
            heard = tuple(_since(start_ns, frame) for frame in arrived if line.accepts(frame))
            summary.frames_heard += len(arrived)
            summary.frames_decoded += len(heard)
            for due_ns, stamp_ns in bus.confirmed():
                summary.timing.on_bus(start_ns + due_ns, stamp_ns)
        watch.lap("sinks")
        index += 1
        on_tick(index)
    summary.frames_refused, summary.groups_dropped = outbox.frames_refused, outbox.groups_dropped
    summary.notes += line.remarks(state)
    summary.ticks = index
    summary.interrupted = stop()
    summary.wall_s = time.perf_counter() - began
    return summary


def _since(start_ns: int, frame: Frame) -> Frame:
    """Return a frame with its receive time counted from slot 0, as the source takes it."""
    return replace(frame, due_ns=frame.due_ns - start_ns)
