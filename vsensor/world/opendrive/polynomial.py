"""Piecewise cubics along a road: elevation, superelevation, lane offset, lane width."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, sqrt

import numpy as np

from vsensor.types import Array, frozen

START_TOLERANCE_M = 1e-3
"""A first record that starts this little after 0 was meant to start at 0 (rounding of the writer)."""

CubicRecord = tuple[float, float, float, float, float]
"""start, a, b, c, d."""


@dataclass(frozen=True, slots=True)
class Cubics:
    """`a + b ds + c ds^2 + d ds^3` with ds from each record's start; zero before the first record.

    `starts_m` (K,) ascending; `coefficients` (K, 4).
    """

    starts_m: Array
    coefficients: Array

    @classmethod
    def of(cls, records: Sequence[CubicRecord]) -> "Cubics":
        """Build from (start, a, b, c, d); a later record at the same start replaces the earlier."""
        by_start = {record[0]: record[1:] for record in sorted(records, key=lambda record: record[0])}
        starts = np.array(list(by_start), dtype=np.float64)
        if starts.size and 0.0 < starts[0] <= START_TOLERANCE_M:
            starts[0] = 0.0
        return cls(frozen(starts), frozen(np.array(list(by_start.values()), dtype=np.float64).reshape(-1, 4)))

    @property
    def is_zero(self) -> bool:
        """Whether the value is 0 everywhere."""
        return not self.coefficients.any()

    def least(self, end_m: float) -> tuple[float, float]:
        """Return the least value from the first record to `end_m` and where it is; 0 without records."""
        found = [(0.0, end_m)]
        ends = [*self.starts_m.tolist()[1:], end_m]
        for start, end, row in zip(self.starts_m.tolist(), ends, self.coefficients.tolist(), strict=True):
            a, b, c, d = row
            span = min(end, end_m) - start
            for ds in (0.0, span, *_turns(b, 2 * c, 3 * d)):
                if 0.0 <= ds <= span:
                    found.append((a + ds * (b + ds * (c + ds * d)), start + ds))
        return min(found)

    def at(self, s_m: Array) -> tuple[Array, Array, Array]:
        """Return value, first and second derivative, each (N,)."""
        if self.is_zero:
            zero = np.zeros_like(s_m)
            return zero, zero, zero
        if len(self.starts_m) == 1 and self.starts_m[0] <= 0.0:
            a, b, c, d = self.coefficients[0]
            ds = s_m - self.starts_m[0]
            return a + ds * (b + ds * (c + ds * d)), b + ds * (2 * c + ds * 3 * d), 2 * c + ds * 6 * d
        place = np.searchsorted(self.starts_m, s_m, side="right") - 1
        a, b, c, d = np.where(place < 0, 0.0, self.coefficients[np.maximum(place, 0)].T)
        ds = s_m - self.starts_m[np.maximum(place, 0)]
        return a + ds * (b + ds * (c + ds * d)), b + ds * (2 * c + ds * 3 * d), 2 * c + ds * 6 * d


def _turns(a: float, b: float, c: float) -> tuple[float, ...]:
    """Return where a + b x + c x^2 is 0."""
    if c == 0.0:
        return (-a / b,) if b != 0.0 else ()
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return ()
    larger = -(b + copysign(sqrt(square), b)) / 2.0
    return (larger / c, a / larger) if larger != 0.0 else (0.0,)
