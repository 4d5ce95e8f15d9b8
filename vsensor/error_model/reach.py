"""Where a model reports: its operating range over speed, and the cells of which too little is known."""

from dataclasses import dataclass
from itertools import groupby
from math import inf, isnan

import numpy as np

from vsensor.error_model.model import ErrorModel
from vsensor.types import Array, Reach, frozen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """The operating range `range_m` (G,) at `speed_mps` (G,), and per column of the grid its blind intervals.

    `columns_mps` (V,) are the columns' speeds; the nearest one counts, at either end for all beyond.
    `most` is the largest share of the operating range at which a line ended, at least 1.
    """

    speed_mps: Array
    range_m: Array
    columns_mps: Array
    blind_m: tuple[Array, ...]
    most: float

    @classmethod
    def of(cls, model: ErrorModel) -> "Region | None":
        """Return the region of a model; None where it has none and no cell is blind."""
        if not (len(model.region_range_m) or model.blind.any()):
            return None
        return cls(
            speed_mps=model.region_speed_mps,
            range_m=model.region_range_m,
            columns_mps=model.speed_mps,
            blind_m=tuple(_intervals(model.range_m, column) for column in model.blind.T),
            most=max([1.0, *model.range_share.tolist()]),
        )

    def at(self, speed_mps: float) -> Reach:
        """Return how far it reports at a speed; one that is not known has the shortest range."""
        is_known = not isnan(speed_mps)
        column = self._column(speed_mps) if is_known else -1
        range_m = inf
        if len(self.range_m):
            range_m = float(np.interp(speed_mps, self.speed_mps, self.range_m))
            range_m = range_m if is_known else float(self.range_m.min())
        return Reach(range_m=range_m, points_m=range_m * self.most, blind_m=self.blind_m[column])

    def _column(self, speed_mps: float) -> int:
        """Return the place of the nearest column; of two as near the slower."""
        columns = self.columns_mps
        above = int(columns.searchsorted(speed_mps))
        if above == len(columns) or (above and speed_mps - columns[above - 1] <= columns[above] - speed_mps):
            return above - 1
        return above


def _intervals(range_m: Array, blind: Array) -> Array:
    """Return the intervals (B, 2) in which the nearest cell is blind; the outer cells go on for ever."""
    edges = [-inf, *(0.5 * (range_m[1:] + range_m[:-1])).tolist(), inf]
    found, place = [], 0
    for is_blind, cells in groupby(blind.tolist()):
        count = len(list(cells))
        if is_blind:
            found.append((edges[place], edges[place + count]))
        place += count
    return frozen(np.array(found).reshape(-1, 2))
