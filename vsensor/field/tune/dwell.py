"""How long a line stays seen or lost: runs of images, and their law by Kaplan and Meier.

A run that the log's end, a gap or a masked image cuts off lasted at least so long: it counts as such, for
leaving it out would favour short runs.
"""

from dataclasses import dataclass, field

import numpy as np

from vsensor.field.tune.reading import Images
from vsensor.types import Array

_Runs = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _empty() -> _Runs:
    return np.zeros(0), np.zeros(0, bool), np.zeros(0, bool), np.zeros(0, np.int64)


@dataclass(frozen=True, slots=True)
class Dwells:
    """Runs (N,): seconds, whether seen, whether cut off, condition; in order, whatever was merged first."""

    runs: _Runs = field(default_factory=_empty)

    def merge(self, other: "Dwells") -> "Dwells":
        """Return the runs of both."""
        joined = [np.concatenate(pair) for pair in zip(self.runs, other.runs, strict=True)]
        order = np.lexsort(joined[::-1])
        return Dwells((joined[0][order], joined[1][order], joined[2][order], joined[3][order]))

    def of(self, condition: int | None, *, seen: bool) -> tuple[Array, np.ndarray]:
        """Return seconds (N,) and whether cut off (N,) of the seen or lost runs; None: any condition."""
        seconds, is_seen, is_cut, at = self.runs
        chosen = is_seen == seen
        if condition is not None:
            chosen &= at == condition
        return seconds[chosen], is_cut[chosen]


def dwells_of(images: Images, period: int) -> Dwells:
    """Return the runs of one log's images, which are in order of side and time; `period` in ns."""
    if not len(images.t_ns) or period <= 0:
        return Dwells()
    step = np.diff(images.t_ns)
    breaks = (np.diff(images.side) != 0) | (step <= 0) | (step > 3 * period) | ~images.known[1:]
    breaks |= ~images.known[:-1]
    change = images.reported[1:] != images.reported[:-1]
    starts = np.concatenate([[0], np.flatnonzero(breaks | change) + 1])
    stops = np.append(starts[1:], len(images.t_ns))
    begun_cut = np.concatenate([[True], breaks])[starts]
    ended_cut = np.append(breaks, True)[stops - 1]
    seconds = (images.t_ns[stops - 1] - images.t_ns[starts] + period) / 1e9
    good = images.known[starts]
    # of a run that had begun before, only that it lasted so long is known
    cut = begun_cut | ended_cut
    runs = (
        seconds[good],
        images.reported[starts][good],
        cut[good],
        images.group[starts][good].astype(np.int64),
    )
    return Dwells().merge(Dwells(runs))


def dwell_quantiles(seconds: Array, cut: np.ndarray, levels: Array) -> Array:
    """Return the quantiles (Q,) of durations of which some are cut off; empty input gives an empty table.

    Where the longest were all cut off, the curve's end is continued exponentially at its mean rate.
    """
    if not len(seconds):
        return np.zeros(0)
    ends = int(np.count_nonzero(~cut))
    rate = max(ends, 0.5) / float(seconds.sum())  # none ended: half an end, so that no table is infinite
    times, at = np.unique(seconds, return_inverse=True)
    ended = np.bincount(at, ~cut, len(times))
    at_risk = len(seconds) - np.concatenate([[0], np.cumsum(np.bincount(at, minlength=len(times)))[:-1]])
    surviving = np.cumprod(1.0 - ended / at_risk)
    keep = ended > 0
    curve_s, curve_p = times[keep], 1.0 - surviving[keep]
    reached = curve_p[-1] if len(curve_p) else 0.0
    last_s = curve_s[-1] if len(curve_s) else 0.0
    found = np.empty(len(levels))
    inside = (levels <= reached) & (reached > 0.0)  # of runs that never ended no quantile is known
    found[inside] = curve_s[np.searchsorted(curve_p, levels[inside] - 1e-12)] if inside.any() else 0.0
    beyond = np.log((1.0 - reached) / (1.0 - levels[~inside])) / rate if (~inside).any() else np.zeros(0)
    found[~inside] = last_s + beyond
    return np.maximum.accumulate(found)
