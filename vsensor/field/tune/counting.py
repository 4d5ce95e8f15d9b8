"""Second pass: how many errors fall into each bin of each cell. Exact counts; merging is adding."""

from dataclasses import dataclass

import numpy as np

from vsensor.field.table import LogFile
from vsensor.field.tune.conditions import Conditions
from vsensor.field.tune.grid import SIZES, Grid, bin_of, range_mm
from vsensor.field.tune.reading import Progress, Rows, read_log, rows_of

PIECE = 1 << 16
"""Rows at a time inside a chunk: what is computed for them stays in the processor's cache."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Binning:
    """Where rows are counted: `scale_m` (G, V, R) is each cell's size of 1."""

    conditions: Conditions
    grid: Grid
    scale_m: np.ndarray

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """The shape of the counts: conditions, speeds, ranges, bins."""
        return (*self.scale_m.shape, 2 * SIZES)

    def cells(self, rows: Rows, places: np.ndarray) -> np.ndarray:
        """Return the cell (N,) int32 of each row, of G V R; `places` is the grid's."""
        speeds, ranges = self.grid.shape
        cell = self.grid.speed_cell(rows.speed_mps)
        if self.scale_m.shape[0] > 1:
            cell += rows.group * np.int32(speeds)
        cell *= ranges
        cell += places.take(range_mm(rows.range_m))  # half the time of places[...]
        return cell


@dataclass(frozen=True, slots=True, kw_only=True)
class CountPass:
    """Counts logs one at a time into (G, V, R, bins) uint32."""

    binning: Binning

    def start(self) -> np.ndarray:
        """Return counts of nothing."""
        return np.zeros(self.binning.shape, np.uint32)

    def add(self, counts: np.ndarray, file: LogFile, progress: Progress | None = None) -> None:
        """Add one log."""
        flat = counts.reshape(-1)
        places = self.binning.grid.places()
        per_metre = (1.0 / self.binning.scale_m).astype(np.float32).reshape(-1)
        for rows in read_log(file, self.binning.conditions.rule, progress, timed=False):
            assert isinstance(rows, Rows)
            for piece in pieces(rows):
                cell = self.binning.cells(piece, places)
                place = bin_of(piece.error_m * per_metre.take(cell))
                place += cell * np.int32(2 * SIZES)
                np.add.at(flat, place, np.uint32(1))


def pieces(rows: Rows) -> list[Rows]:
    """Return the rows in pieces of at most `PIECE`."""
    if rows.count <= PIECE:
        return [rows]
    starts = range(0, rows.count, PIECE)
    return [rows_of([values[at : at + PIECE] for values in rows.columns()]) for at in starts]
