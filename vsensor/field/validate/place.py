"""Where recorded errors lie in a model's law: between which of its quantiles, at which normal score."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from vsensor.error_model import ErrorModel
from vsensor.types import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """Rows (N,) that the model knows: how many quantiles of size, and signed, each is above; scores.

    `known` (M,) says which of the rows that were asked for these are.
    """

    known: np.ndarray
    size: np.ndarray
    signed: np.ndarray
    score: Array


class LawTable:
    """A model's surfaces, linear between its grid points; nothing outside, nor where it is blind."""

    def __init__(self, model: ErrorModel) -> None:
        self.model = model
        self._scores = ndtri(model.signed_levels)
        self._step = 1e-4 * max(float(np.ptp(model.speed_mps)), 1.0)

    def place(self, range_m: np.ndarray, speed_mps: np.ndarray, error_m: np.ndarray) -> Placed:
        """Return where errors (M,) at ranges and speeds (M,) lie."""
        row, row_part, row_in = _between(self.model.range_m, range_m.astype(np.float64))
        column, part, column_in = _between(self.model.speed_mps, speed_mps.astype(np.float64))
        nearest = self.model.blind[row + (row_part > 0.5), column + (part > 0.5)]
        known = row_in & column_in & ~nearest
        at = (row[known], row_part[known], column[known], part[known])
        error = error_m[known].astype(np.float64)
        size = (np.abs(error) > _surfaces(self.model.absolute_m, *at)).sum(axis=0)
        quantiles = _surfaces(self.model.signed_m, *at)
        signed = (error > quantiles).sum(axis=0)
        return Placed(known=known, size=size, signed=signed, score=self._score(error, quantiles, signed))

    def _score(self, error: Array, quantiles: Array, signed: np.ndarray) -> Array:
        """Return normal scores, linear between the quantiles and beyond them."""
        high = np.clip(signed, 1, len(quantiles) - 1)
        place = np.arange(len(error))
        below, above = quantiles[high - 1, place], quantiles[high, place]
        width = np.maximum(above - below, 1e-12)
        step = self._scores[high] - self._scores[high - 1]
        return np.asarray(np.clip(self._scores[high - 1] + (error - below) / width * step, -6.0, 6.0))


def _between(grid: Array, values: Array) -> tuple[np.ndarray, Array, np.ndarray]:
    """Return the grid point below (N,), the part of the way to the next, and whether it is in the grid.

    Half a step beyond either end counts as the end.
    """
    place = np.clip(np.searchsorted(grid, values, side="right") - 1, 0, len(grid) - 2)
    part = (values - grid[place]) / (grid[place + 1] - grid[place])
    inside = (part >= -0.501) & (part <= 1.501)
    return place, np.clip(part, 0.0, 1.0), inside


def _surfaces(surfaces: Array, row: np.ndarray, row_part: Array, column: np.ndarray, part: Array) -> Array:
    """Return surfaces (K, R, V) at places (N,) as (K, N); a blind cell's NaN does not spread."""
    filled = np.nan_to_num(surfaces)
    found = (1.0 - part) * filled[:, row, column] + part * filled[:, row, column + 1]
    if np.any(row_part > 1e-6):
        above = (1.0 - part) * filled[:, row + 1, column] + part * filled[:, row + 1, column + 1]
        found = (1.0 - row_part) * found + row_part * above
    return np.asarray(found)
