"""By how much a video's signal is late against the CAN log's: a wrong start of the video looks like an error.

The lateness is where the two differ least, whatever each event's bias on either side is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from vsensor.types import Array
from vsensor.video.can_signals import CanSignals
from vsensor.video.evaluate.pairing import SIDES

MOST_S, STEP_S = 0.8, 0.02
PLAIN = 0.8
"""The difference must fall below this share of its greatest, or the signals are too flat to say anything."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Timed:
    """A method's offsets (N, 2) of an event at times `at_s` (N,) of its log, and which count (N, 2)."""

    can: CanSignals
    at_s: Array
    offset_m: Array
    counts: Array


def lateness_s(events: Sequence[Timed]) -> float:
    """Return by how much the video's signal is late, in s; NaN where the signals do not say it."""
    shifts = np.arange(-MOST_S, MOST_S + STEP_S / 2, STEP_S)
    left = np.array([sum(_differ(one, shift) for one in events) for shift in shifts])
    k = int(left.argmin())
    if not 0 < k < len(shifts) - 1 or not left[k] < PLAIN * left.max():
        return nan
    before, here, after = left[k - 1 : k + 2]
    return float(shifts[k] + 0.5 * STEP_S * (before - after) / (before - 2.0 * here + after))


def _differ(one: Timed, late_s: float) -> float:
    """Return the summed squares of what differs beside a bias, if the video is so late: it tells the past."""
    total = 0.0
    for column, side in enumerate(SIDES):
        told = one.can.linear(f"{side}.lane_offset_m", one.at_s - late_s)
        known = one.counts[:, column] & np.isfinite(one.offset_m[:, column] + told)
        if known.sum() > 1:
            differences = one.offset_m[known, column] - told[known]
            total += float(np.var(differences)) * int(one.counts[:, column].sum())
    return total
