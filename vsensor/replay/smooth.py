"""Spreads frames that a recorder stamped in batches: each id keeps its cycle, the file keeps its order.

An adapter that hands over frames in batches gives all of them the time of the batch, so that the intervals
of a 10 ms message read 0, 20, 0, 20. Per id the time is followed by a loop of first order: predicted one
cycle after the frame before, corrected by GAIN of what the stamp says. The estimates of all ids are then
put into the file's order: halfway between the latest estimate so far and the earliest of those to come.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsensor.types import IntArray

GAIN = 1 / 8
"""Of the stamp's deviation: jitter shrinks to a quarter (sqrt(g / (2 - g))), a drift of 100 ppm at 10 ms
leaves 8 us behind."""
BATCH_NS = 20_000_000
"""Adapters hand over what came in 1 to 16 ms: a stamp that is off by less may be that of a batch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Smooth:
    """Where smoothing stands: time of each id's latest frame, and of the latest frame of all."""

    latest_ns: Mapping[int, int]
    last_ns: int | None = None


def measured_cycles(keys: IntArray, m_ns: IntArray) -> dict[int, int]:
    """Return the median interval of each id that came at least 3 times; ids keyed as in `choice.keys_of`."""
    cycles: dict[int, int] = {}
    for key in np.unique(keys).tolist():
        steps = np.diff(m_ns[keys == key])
        if key >= 0 and len(steps) >= 2 and np.median(steps) > 0:
            cycles[key] = int(np.median(steps))
    return cycles


def smoothed(
    state: Smooth, cycles: Mapping[int, int], keys: IntArray, m_ns: IntArray
) -> tuple[Smooth, IntArray]:
    """Return times (N,) in order; the loop of an id starts anew where a stamp is off by more than a batch."""
    if not len(m_ns):
        return state, m_ns
    latest = dict(state.latest_ns)
    estimates = m_ns.tolist()
    for place, key in enumerate(keys.tolist()):
        cycle_ns = cycles.get(key)
        if cycle_ns is None:
            continue
        stamp_ns = estimates[place]
        if key in latest:
            predicted_ns = latest[key] + cycle_ns
            off_ns = stamp_ns - predicted_ns
            if abs(off_ns) <= max(cycle_ns // 2, BATCH_NS):  # else a frame was missed, or came on an event
                estimates[place] = predicted_ns + round(off_ns * GAIN)
        latest[key] = estimates[place]
    times = np.array(estimates, dtype=np.int64)
    upper, lower = np.maximum.accumulate(times), np.minimum.accumulate(times[::-1])[::-1]
    ordered = lower + (upper - lower) // 2
    ordered = ordered if state.last_ns is None else np.maximum(ordered, state.last_ns)
    return Smooth(latest_ns=latest, last_ns=int(ordered[-1])), ordered
