"""How well frames kept the times of a log, against a queue that loses no time.

due       |A   BCD        |        B, C and D have one timestamp: only one of them can leave at a time
ideal     |A   B  C  D    |        each leaves when it is due and the one before it has gone (cost_ns later)
arrived   |A    B  C   D  |        error = arrived - due, beyond the queue = arrived - ideal
"""

from typing import NamedTuple

import numpy as np

from vsensor.types import IntArray


class Arrived(NamedTuple):
    """What somebody else saw: times (N,) in ns of any clock, the frames as bytes, how many it missed."""

    t_ns: IntArray
    frames: list[bytes]
    missed: int = 0


def ideal_ns(due_ns: IntArray, cost_ns: int) -> IntArray:
    """Return when frames due at (N,), in order, leave a queue in which each takes `cost_ns`."""
    queue = np.arange(len(due_ns)) * cost_ns
    ideal: IntArray = np.maximum.accumulate(due_ns - queue) + queue
    return ideal


def judged(arrived: Arrived, due_ns: IntArray, sent: list[bytes], cost_ns: int) -> dict[str, object]:
    """Return the figures of one player.

    Nobody knows when a player meant to begin: errors count from its own best frame.
    """
    found: dict[str, object] = {"frames": len(sent), **order(arrived.frames, sent), "missed": arrived.missed}
    if len(arrived.t_ns) != len(due_ns):
        return found
    raw_ns = arrived.t_ns - due_ns
    raw_ns = raw_ns - raw_ns.min()
    waited_ns = ideal_ns(due_ns, cost_ns) - due_ns
    span_ns = (arrived.t_ns[-1] - arrived.t_ns[0]) - (due_ns[-1] - due_ns[0])
    return found | {
        "raw": figures_ms(raw_ns),
        "beyond_queue": figures_ms(raw_ns - waited_ns),
        "queue": figures_ms(waited_ns),
        "duration_error_ms": float(span_ns) / 1e6,
    }


def order(arrived: list[bytes], sent: list[bytes]) -> dict[str, int]:
    """Return how many frames were lost, and how many are not what stands at their place in the log."""
    lost = len(sent) - len(arrived)
    unlike = sum(map(_differ, arrived, sent)) if not lost else 0
    return {"lost": lost, "unlike": unlike}


def _differ(one: bytes, other: bytes) -> bool:
    """Tell whether two classic frames differ in id, length or data; what is between is for CAN FD."""
    return one[:5] + one[8:] != other[:5] + other[8:]


def figures_ms(values_ns: IntArray) -> dict[str, float]:
    """Return quantiles in ms."""
    p50, p99, p999 = np.percentile(values_ns, [50, 99, 99.9]) / 1e6
    return {"p50": float(p50), "p99": float(p99), "p99.9": float(p999), "max": float(values_ns.max()) / 1e6}
