"""What only a truth can tell: lines that are there and not reported, and those reported though absent."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from vsensor.types import Array, BoolArray
from vsensor.video.evaluate.statistics import OUTWARD


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """The true lines of an event at its frames.

    `offset_m` (N, 2) is positive to the left, NaN where there is no line; `is_near` (N, 2) where a marking is
    painted within the first 20 m.
    """

    offset_m: Array
    is_near: BoolArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Presence:
    """Of values (a line's side in a frame): how many, and how many of them were reported.

    `near`: a marking is in the first 20 m; `absent`: there is no line; `gross`: reported farther from the
    truth than an error of the same line would be.
    """

    near: int
    near_reported: int
    absent: int
    absent_reported: int
    reported: int
    gross: int

    @property
    def availability(self) -> float:
        """The share of markings nearby that were reported."""
        return self.near_reported / self.near if self.near else nan

    @property
    def false_share(self) -> float:
        """The share of absent lines that were reported."""
        return self.absent_reported / self.absent if self.absent else nan

    @property
    def gross_share(self) -> float:
        """The share of reports that are another line's, or none's."""
        return self.gross / self.reported if self.reported else nan


def presence(events: Sequence[tuple[Truth, Array]], gross_m: float) -> Presence:
    """Count over events of truth and the video's offsets (N, 2)."""
    sums = np.zeros(6, dtype=np.int64)
    for truth, video_m in events:
        reported = np.isfinite(video_m)
        absent = ~np.isfinite(truth.offset_m)
        error = np.abs(OUTWARD * (video_m - truth.offset_m))
        masks = (
            truth.is_near,
            truth.is_near & reported,
            absent,
            absent & reported,
            reported,
            reported & (absent | (error > gross_m)),
        )
        sums += [int(np.count_nonzero(mask)) for mask in masks]
    near, near_reported, absent_n, absent_reported, reported_n, gross = sums.tolist()
    return Presence(
        near=near,
        near_reported=near_reported,
        absent=absent_n,
        absent_reported=absent_reported,
        reported=reported_n,
        gross=gross,
    )


def presence_table(present: Mapping[str, Presence]) -> list[list[str]]:
    """Return the shares of each method as words, a row of headings first."""
    heads = ("method", "markings in the first 20 m", "reported", "no line in view", "reported though absent")
    rows = [[*heads, "off by more than another line would"]]
    for method, one in present.items():
        shares = [_percent(share) for share in (one.availability, one.false_share, one.gross_share)]
        absent = [str(one.absent), f"{one.absent_reported} = {shares[1]}"]
        rows.append([method, str(one.near), shares[0], *absent, shares[2]])
    return rows


def _percent(share: float) -> str:
    return "-" if share != share else f"{100.0 * share:.2f} %"
