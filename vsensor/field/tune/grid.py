"""Where an error falls: in a cell of range and speed, and there in a bin of its size.

    range, speed ──► cell (v, r): speeds in steps around k * step, ranges as the table has them
    error / scale of the cell ──► sign, exponent, 6 bits of the mantissa: bins 0 .. 2 SIZES - 1, rising

A bin is at most 1/64 of the size wide, from 1/16 of the cell's mean size up to 64 times it; what is smaller
or larger is in the innermost or outermost bin. Counts are whole numbers, so that sums do not depend on the
order of logs, and within a bin a quantile is interpolated.
"""

from dataclasses import dataclass

import numpy as np

from vsensor.types import Array

MANTISSA_BITS = 6
_SHIFT = 23 - MANTISSA_BITS
_OCTAVES = (-4, 6)
_BASE = int(np.float32(2.0 ** _OCTAVES[0]).view(np.int32)) >> _SHIFT
SIZES = ((_OCTAVES[1] - _OCTAVES[0]) << MANTISSA_BITS) + 1
"""Bins of each sign; the first holds everything below 2^-4."""
BIN_WIDTH = 2.0**-MANTISSA_BITS
"""Widest bin relative to the value: the bound of what the bins add to a quantile's error."""
SMALLEST_SCALE_M = 1e-6

MAX_SPEED_MPS = 90.0
MAX_RANGE_MM = 400_000


def size_edges() -> Array:
    """Return the edges (SIZES + 1,) of the sizes' bins in units of the scale."""
    octaves = 2.0 ** np.arange(*_OCTAVES)
    inner = (octaves[:, None] * (1.0 + np.arange(1 << MANTISSA_BITS) * BIN_WIDTH)).ravel()
    last = 2.0 ** _OCTAVES[1]
    return np.concatenate([[0.0], inner, [last]])[: SIZES + 1]


def signed_edges() -> Array:
    """Return the edges (2 SIZES + 1,) of all bins, from the most negative."""
    edges = size_edges()
    return np.concatenate([-edges[:0:-1], edges])


def bin_of(scaled: np.ndarray) -> np.ndarray:
    """Return the bin (N,) int32 of errors over their scale (N,) float32."""
    bits = scaled.view(np.int32)
    size = bits & 0x7FFFFFFF
    size >>= _SHIFT
    size -= _BASE - 1
    np.clip(size, 0, SIZES - 1, out=size)
    size ^= bits >> 31  # of a negative error -1 - size
    size += SIZES
    return size


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Ranges in mm (R,) rising, and `speeds` cells around multiples of `step_mps`."""

    range_mm: tuple[int, ...]
    step_mps: float
    speeds: int

    @property
    def range_m(self) -> Array:
        """The ranges (R,) in m."""
        return np.array(self.range_mm) / 1000.0

    @property
    def speed_mps(self) -> Array:
        """The speeds (V,) in the middle of the cells."""
        return np.asarray(np.arange(self.speeds) * self.step_mps, np.float64)

    @property
    def shape(self) -> tuple[int, int]:
        """Speeds and ranges: (V, R), the order of all counts."""
        return self.speeds, len(self.range_mm)

    def places(self) -> np.ndarray:
        """Return the place of every range in mm, -1 where there is none."""
        places = np.full(MAX_RANGE_MM + 1, -1, np.int32)
        places[list(self.range_mm)] = np.arange(len(self.range_mm))
        return places

    def speed_cell(self, speed_mps: np.ndarray) -> np.ndarray:
        """Return the cell (N,) of speeds; faster than the grid is the last."""
        return speed_cell(speed_mps, self.step_mps, self.speeds)


def speed_cell(speed_mps: np.ndarray, step_mps: float, speeds: int) -> np.ndarray:
    """Return the cell (N,) int32 around a multiple of the step; slower than 0 is the first."""
    cell = np.rint(speed_mps * np.float32(1.0 / step_mps)).astype(np.int32)
    return np.clip(cell, 0, speeds - 1, out=cell)


def range_mm(range_m: np.ndarray) -> np.ndarray:
    """Return ranges (N,) as whole mm, within what `Grid.places` knows."""
    whole = np.rint(range_m * np.float32(1000.0)).astype(np.int32)
    return np.clip(whole, 0, MAX_RANGE_MM, out=whole)
