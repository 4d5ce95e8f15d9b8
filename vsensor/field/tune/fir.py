"""The low-pass along speed (P1 3.3), and each cell's scale by a local line.

P1 filters the quantiles of thin bins, whose noise a filter smooths but whose bias it keeps. Here the taps
weigh the *distributions* of the neighbouring speeds, each in units of its own scale, and the quantile is
taken of the sum, so that neither the trend of the errors nor that of the driving within the filter's width
shifts it. Only the scale's course over a width counts, its height cancels: it is a local line of the mean
size over three widths, which has little noise of its own.
"""

from dataclasses import dataclass

import numpy as np

from vsensor.errors import TableError
from vsensor.field.tune.grid import SMALLEST_SCALE_M
from vsensor.types import Array

WEIGHT_ONE = 64
"""Sum of the taps as whole numbers, for exact sums over blocks."""
SMALLEST_TAP = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Fir:
    """Taps (K,) over speed cells, symmetric, none negative, sum 1."""

    taps: Array
    order: int
    cutoff_s_per_m: float

    @property
    def reach(self) -> int:
        """Cells on each side that a tap reaches."""
        return self.order // 2

    @property
    def whole(self) -> np.ndarray:
        """The taps in whole numbers of about 1 / `WEIGHT_ONE`."""
        return np.rint(self.taps * WEIGHT_ONE).astype(np.int64)


def low_pass(order: int, cutoff_s_per_m: float, step_mps: float) -> Fir:
    """Return a Hamming-windowed FIR low-pass; raises TableError where a tap would be negative.

    A distribution with a negative weight is none: order * step * cut-off of at most 1 keeps them positive.
    """
    from scipy.signal import firwin

    if order % 2 or order < 0:
        raise TableError(f"--order {order}: an even number of speed steps was expected, 0 for no filter")
    if order == 0:
        return Fir(taps=np.ones(1), order=0, cutoff_s_per_m=cutoff_s_per_m)
    if not 0.0 < cutoff_s_per_m * step_mps < 0.5:
        raise TableError(f"--cutoff {cutoff_s_per_m:g}: below {0.5 / step_mps:g} s/m was expected (Nyquist)")
    taps = np.asarray(firwin(order + 1, cutoff_s_per_m, fs=1.0 / step_mps))
    if taps.min() < -SMALLEST_TAP:
        longest = 1.0 / (order * step_mps)
        raise TableError(
            f"--cutoff {cutoff_s_per_m:g}: with order {order} and steps of {step_mps:g} m/s some taps are "
            f"negative; at most about {longest:g} s/m was expected"
        )
    taps[taps < SMALLEST_TAP] = 0.0  # a zero of the sinc, to rounding
    return Fir(taps=taps, order=order, cutoff_s_per_m=cutoff_s_per_m)


def wider(fir: Fir, step_mps: float, times: int = 3) -> Fir:
    """Return the filter stretched along speed."""
    return low_pass(times * fir.order, fir.cutoff_s_per_m / times, step_mps) if fir.order else fir


def along_speed(taps: np.ndarray, values: np.ndarray, axis: int) -> np.ndarray:
    """Return sum over k of taps[k] * values[v + k - K // 2] along an axis; beyond its ends stand zeros."""
    moved = np.moveaxis(values, axis, 0)
    found = np.zeros(moved.shape, np.result_type(taps, values))
    reach = len(taps) // 2
    for k, tap in enumerate(taps):
        shift = k - reach
        count = len(moved) - abs(shift)
        if count > 0:
            found[max(-shift, 0) :][:count] += tap * moved[max(shift, 0) :][:count]
    return np.moveaxis(found, 0, axis)


def local_scale(fir: Fir, rows: np.ndarray, mean_m: np.ndarray) -> np.ndarray:
    """Return each cell's scale (G, V, R): the local line of the mean size, filled where nothing is."""
    offset = np.arange(-fir.reach, fir.reach + 1)
    total = rows * mean_m
    moments = [along_speed(fir.taps * offset**power, rows.astype(float), 1) for power in range(3)]
    sums = [along_speed(fir.taps * offset**power, total, 1) for power in range(2)]
    with np.errstate(invalid="ignore", divide="ignore"):
        flat = sums[0] / moments[0]
        spread = moments[0] * moments[2] - moments[1] ** 2
        line = (moments[2] * sums[0] - moments[1] * sums[1]) / spread
        steady = spread > 0.05 * moments[0] ** 2  # several speeds, not one
        scale = np.where(steady, np.clip(line, 0.7 * flat, 1.4 * flat), flat)
    return np.asarray(np.maximum(_filled(scale), SMALLEST_SCALE_M))


def _filled(scale: np.ndarray) -> np.ndarray:
    """Fill NaN along speed, then along range, from the nearest known cell."""
    for axis in (1, 2):
        moved = np.moveaxis(scale.copy(), axis, -1)
        shape = moved.shape
        lines = moved.reshape(-1, shape[-1])
        for line in lines:
            known = np.flatnonzero(np.isfinite(line))
            if len(known):
                middle = (known[1:] + known[:-1] + 1) // 2
                line[:] = line[known[np.searchsorted(middle, np.arange(len(line)), side="right")]]
        scale = np.moveaxis(lines.reshape(shape), -1, axis)
    return np.asarray(np.nan_to_num(scale, nan=1.0))


def fill_from_nearest(values: np.ndarray) -> np.ndarray:
    """Return values (R, V) with NaN replaced by the nearest known one along speed, then along range."""
    return np.asarray(_filled(values.T[None])[0].T)
