"""Intervals between the frames of a message: which mean that frames are missing, which that one is late.

    lateness against the cycle          missing                    late
                                            ,-o-o-o-o                o
                                        o-o-'                    o-o' '-o-o-o

The lateness is the sum of (interval - cycle). Frames can only be delayed, so its lower envelope is the
sender's time: if it is higher after a long interval than before, frames are missing, a cycle each; if the
frames after it catch up, it was late. Likewise a short interval after which it stays lower is one frame too
many. This holds for recorders that stamp frames in batches, too.
"""

from dataclasses import dataclass

import numpy as np

from vsensor.types import Array, BoolArray, IntArray

_LEAST_AFTER = 4  # frames after a silence that say whether the stream catches up: fewer at the very end


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """The cycle of a message, and the intervals that pass, in ns."""

    cycle_ns: int
    longest_ns: float
    shortest_ns: float

    @property
    def slack(self) -> float:
        """What passes beyond the cycle, in cycles; less than half of one."""
        return min(self.longest_ns / self.cycle_ns - 1, 0.5)

    @classmethod
    def of(cls, cycle_ns: int, tolerance: float, jitter_ns: int) -> "Pace":
        """Return what passes; one half of a quarter of the cycle apart from its neighbour is one too many."""
        shortest = max(cycle_ns * (1 - tolerance) - jitter_ns, cycle_ns / 4)
        return cls(cycle_ns=cycle_ns, longest_ns=cycle_ns * (1 + tolerance) + jitter_ns, shortest_ns=shortest)


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """Of each frame (N,): how many are missing before it, whether it is one too many, late or early."""

    missing: IntArray
    extra: BoolArray
    late: BoolArray
    early: BoolArray


def judge(pace: Pace, intervals_ns: IntArray, first: int, last: int, since: int, window: int) -> Judged:
    """Judge the frames `first` to `last` - 1 by the intervals (M,) before the frames of a longer stretch.

    `since` is the place of the last frame before `first` at which the envelope moved (0: none);
    `window` is the number of frames in which a stream that is late catches up.
    """
    level = np.cumsum(intervals_ns - pace.cycle_ns)
    d = intervals_ns[first:last]
    long, short = d > pace.longest_ns, d < pace.shortest_ns
    missing, extra = np.zeros(len(d), dtype=np.int64), np.zeros(len(d), dtype=bool)
    for place in np.flatnonzero(long | short).tolist():
        at = first + place
        before = int(level[max(since, at - window, 0) : at].min(initial=level[at - 1] if at else 0))
        shift = (int(level[at : at + window + 1].min()) - before) / pace.cycle_ns
        if long[place]:
            most = round(int(d[place]) / pace.cycle_ns) - 1 if len(level) - at > _LEAST_AFTER else 0
            missing[place] = max(0, min(int(shift + pace.slack), most))
        else:
            extra[place] = shift <= pace.slack - 1
        if missing[place] or extra[place]:
            since = at
    return Judged(
        missing=missing,
        extra=extra,
        late=long & (missing == 0),
        early=short & ~extra,
    )


class Histogram:
    """Quantiles of intervals to half a percent in constant memory: bins of 1 % from 1 us to 12 days."""

    _STEP = np.log(1.01)

    def __init__(self) -> None:
        self.counts = np.zeros(2800, dtype=np.int64)
        self.longest_ns = 0

    def add(self, intervals_ns: IntArray) -> None:
        """Take in intervals (N,)."""
        if len(intervals_ns):
            place = (np.log(np.maximum(intervals_ns, 1000) / 1000) / self._STEP).astype(np.int64)
            self.counts += np.bincount(np.minimum(place, 2799), minlength=2800)
            self.longest_ns = max(self.longest_ns, int(intervals_ns.max()))

    def quantile_ms(self, share: float) -> float:
        """Return the interval below which this share of them is; NaN of none."""
        total = int(self.counts.sum())
        if not total:
            return float("nan")
        place = int(np.searchsorted(np.cumsum(self.counts), share * total))
        return min(float(np.exp((place + 0.5) * self._STEP)) * 1e-3, self.longest_ns / 1e6)

    def quantiles_ms(self) -> Array:
        """Return the median, the 99 % quantile and the longest, (3,)."""
        return np.array([self.quantile_ms(0.5), self.quantile_ms(0.99), self.longest_ns / 1e6])
