"""The loop: compute ahead of the slot, let the frames go when they are due, hand the output to the sinks."""

import time
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from vsensor.clock import Clock
from vsensor.line import Line
from vsensor.sinks import Sink
from vsensor.types import Frame, Tick

STAGES = ("world", "camera", "region+error", "fit+track", "signals+codec", "sinks")
"""What the time of a tick is divided into."""

RECENT_TICKS = 4096  # stage times are kept for that many ticks, so that memory stays flat


class FrameBus(Protocol):
    """What the loop needs of a bus."""

    def send(self, frame: Frame) -> bool:
        """Send now; False if the bus refused the frame (counted, never raised)."""
        ...

    def drain(self) -> Sequence[Frame]:
        """Return what has arrived since the last call."""
        ...


class Stopwatch:
    """Time per stage: `lap(stage)` charges the time since the last lap to `stage`."""

    def __init__(self) -> None:
        self._recent_ns = np.zeros((RECENT_TICKS, len(STAGES)), dtype=np.int64)
        self._place = {stage: number for number, stage in enumerate(STAGES)}
        self._tick = -1
        self._last_ns = 0

    def start(self) -> None:
        """Begin a tick."""
        self._tick += 1
        self._recent_ns[self._tick % RECENT_TICKS] = 0
        self._last_ns = time.perf_counter_ns()

    def lap(self, stage: str) -> None:
        """Charge the time since the last lap to `stage`."""
        now_ns = time.perf_counter_ns()
        self._recent_ns[self._tick % RECENT_TICKS, self._place[stage]] += now_ns - self._last_ns
        self._last_ns = now_ns

    def skip(self) -> None:
        """Charge the time since the last lap to nobody (waiting, sending)."""
        self._last_ns = time.perf_counter_ns()

    def recent_ms(self) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        """Return (ticks, stages) in ms of the latest ticks."""
        return self._recent_ns[: min(self._tick + 1, RECENT_TICKS)] / 1e6

    def p50_ms(self) -> dict[str, float]:
        """Return the median of each stage over the latest ticks, ms."""
        recent_ms = self.recent_ms()
        medians = np.median(recent_ms, axis=0) if len(recent_ms) else np.zeros(len(STAGES))
        return dict(zip(STAGES, medians.tolist(), strict=True))


@dataclass(slots=True)
class Summary:
    """What a run did; `text()` is what a person sees at its end."""

    period_ns: int
    ticks: int = 0
    frames_sent: int = 0
    frames_refused: int = 0
    dropped_slots: int = 0
    frames_heard: int = 0
    frames_decoded: int = 0
    saturated: int = 0
    interrupted: bool = False
    ended: bool = False  # the road or the recording ended before the time did
    real_time: bool = True
    wall_s: float = 0.0
    lateness_ns: "array[int]" = field(default_factory=lambda: array("q"))
    stopwatch: Stopwatch = field(default_factory=Stopwatch)
    notes: list[str] = field(default_factory=list)

    def text(self) -> str:
        """Return the summary as lines: frames, lateness, dropped slots, time per stage."""
        simulated_s = self.ticks * self.period_ns / 1e9
        lines = [
            f"{self.ticks} ticks of {self.period_ns / 1e6:g} ms = {simulated_s:.2f} s in {self.wall_s:.2f} s"
            + ("" if self.real_time else f" ({simulated_s / max(self.wall_s, 1e-9):.1f} x real time)"),
            f"frames sent {self.frames_sent}, refused by the bus {self.frames_refused}, "
            f"slots dropped {self.dropped_slots}, values saturated {self.saturated}",
        ]
        if self.ended:
            lines.append(f"the road or the recording ended after {simulated_s:.2f} s")
        if self.frames_heard:
            lines.append(f"frames heard {self.frames_heard}, decoded and checked {self.frames_decoded}")
        if self.real_time and self.lateness_ns:
            p50, p99 = np.percentile(np.asarray(self.lateness_ns), [50, 99]) / 1e6
            lines.append(
                f"lateness of the first frame: p50 {p50:.3f}, p99 {p99:.3f}, "
                f"max {max(self.lateness_ns) / 1e6:.3f} ms"
            )
        return "\n".join([*lines, *self._stage_lines(), *self.notes])

    def _stage_lines(self) -> list[str]:
        recent_ms = self.stopwatch.recent_ms()
        if not len(recent_ms):
            return []
        with_total = np.column_stack([recent_ms, recent_ms.sum(axis=1)])
        p50, p99 = np.percentile(with_total, [50, 99], axis=0)
        names = (*STAGES, "total")
        rows = [f"  {name:<14} {a:8.3f} {b:8.3f}" for name, a, b in zip(names, p50, p99, strict=True)]
        return ["time per tick, ms   p50      p99", *rows]


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

    `start_ns` is the clock's time of slot 0, None = one period from now. Slot k is due at start_ns +
    k * period_ns. If the program gets to it later than half a period after that, the slot is dropped:
    world and error state have advanced, nothing is sent, the alive counters stand still, and nothing
    is sent in a burst afterwards.
    """
    summary = Summary(period_ns=period_ns, real_time=real_time)
    watch = summary.stopwatch
    state = line.initial_state()
    began = time.perf_counter()
    heard: Sequence[Frame] = ()
    start_ns = clock.now_ns() + period_ns if start_ns is None else start_ns
    index = 0
    while (ticks is None or index < ticks) and not stop():
        tick = Tick(index=index, t_ns=index * period_ns, period_ns=period_ns)
        watch.start()
        computed = line.compute(state, tick, heard, watch.lap)
        if computed is None:
            summary.ended = True
            break
        due_ns = start_ns + tick.t_ns
        clock.sleep_until_ns(due_ns)
        lateness_ns = clock.now_ns() - due_ns
        if lateness_ns > period_ns // 2:
            state = computed.state_if_dropped
            summary.dropped_slots += 1
        else:
            state, output = computed.state_if_sent, computed.output
            summary.lateness_ns.append(lateness_ns)
            if bus is not None:
                sent = tuple(frame for frame in output.frames if bus.send(frame))
                summary.frames_refused += len(output.frames) - len(sent)
                if len(sent) < len(output.frames):
                    output = replace(output, frames=sent)
            summary.frames_sent += len(output.frames)
            summary.saturated = sum(state.transmit.saturated.values())
            watch.skip()
            output = replace(output, lateness_ns=lateness_ns)
            for sink in sinks:
                sink.write(output)
        if bus is not None:
            heard = bus.drain()
            summary.frames_heard += len(heard)
            summary.frames_decoded += sum(line.accepts(frame) for frame in heard)
        watch.lap("sinks")
        index += 1
        on_tick(index)
    summary.ticks = index
    summary.interrupted = stop()
    summary.wall_s = time.perf_counter() - began
    return summary
