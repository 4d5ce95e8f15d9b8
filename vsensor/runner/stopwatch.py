"""What the time of a tick is spent on."""

import time

import numpy as np

STAGES = ("world", "camera", "region+error", "fit+track", "signals+codec", "sinks")
"""What the time of a tick is divided into."""

RECENT_TICKS = 4096  # stage times are kept for that many ticks, so that memory stays flat


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
