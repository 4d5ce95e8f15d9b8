"""What a run did, as figures and as the lines that a person reads at its end."""

from dataclasses import dataclass, field

import numpy as np

from vsensor.runner.stopwatch import STAGES, Stopwatch
from vsensor.timing import Samples, Timing


@dataclass(slots=True)
class Summary:
    """What a run did; `text()` is what a person sees at its end."""

    period_ns: int
    ticks: int = 0
    frames_sent: int = 0
    frames_refused: int = 0
    dropped_slots: int = 0
    groups_dropped: int = 0  # later groups of slots whose first one was sent
    frames_heard: int = 0
    frames_decoded: int = 0
    saturated: int = 0
    interrupted: bool = False
    ended: bool = False  # the road or the recording ended before the time did
    real_time: bool = True
    wall_s: float = 0.0
    timing: Timing = field(default_factory=Timing)
    stopwatch: Stopwatch = field(default_factory=Stopwatch)
    notes: list[str] = field(default_factory=list)

    @property
    def lateness_ns(self) -> Samples:
        """Lateness of the first frame of each burst at the send call, ns."""
        return self.timing.lateness

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
        if self.groups_dropped:
            lines.append(f"later groups of a slot dropped {self.groups_dropped}")
        if self.real_time:
            lines += [f"{name}: {samples.text()}" for name, samples in self.timing.named().items()]
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
