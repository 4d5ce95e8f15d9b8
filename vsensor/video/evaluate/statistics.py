"""Error statistics of events, and of many of them together (P2 eq. 2.27 to 2.37, with the errata).

The error of a value is its distance from the vehicle less the reference's: positive is too far out, on either
side. An event's mean is its bias; what its values do around that is within; the biases' spread is between.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import nan, sqrt

import numpy as np

from vsensor.types import Array

OUTWARD: Array = np.array([1.0, -1.0])
"""Left and right: from positions, which are positive to the left, to distances from the vehicle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Moments:
    """Number, mean and sum of squared deviations of errors in m: what can be put together exactly."""

    count: int
    mean_m: float
    squares_m2: float

    @classmethod
    def of(cls, errors_m: Array) -> "Moments":
        """Return the moments of what is known among errors of any shape."""
        known = errors_m[np.isfinite(errors_m)]
        mean = float(known.mean()) if len(known) else nan
        return cls(count=len(known), mean_m=mean, squares_m2=float(np.sum((known - mean) ** 2)))

    @property
    def std_m(self) -> float:
        """The standard deviation as estimated (2.33, 2.34); NaN of fewer than two values."""
        return sqrt(self.squares_m2 / (self.count - 1)) if self.count > 1 else nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Pooled:
    """The errors of many events: their number, that of their values, and figures in m.

    `within_m` is the published standard deviation (2.36, 2.37), which drops what events differ by;
    `between_m` is that of the events' means, weighted by their values; `rms_m` is over all values:

        count rms^2 = count (mean^2 + between^2) + (count - cases) within^2
    """

    cases: int
    count: int
    mean_m: float
    within_m: float
    between_m: float
    rms_m: float
    abs_95_m: float = nan


def pooled(events: Iterable[Moments], errors_m: Sequence[Array] = ()) -> Pooled:
    """Return the figures of events; those without a value are no cases. `errors_m` give the 95 % of |e|."""
    known = [event for event in events if event.count]
    count = np.array([event.count for event in known], dtype=np.float64)
    if not known:
        return Pooled(cases=0, count=0, mean_m=nan, within_m=nan, between_m=nan, rms_m=nan)
    means = np.array([event.mean_m for event in known])
    squares = float(sum(event.squares_m2 for event in known))
    total, freedom = float(count.sum()), float((count - 1.0).sum())
    mean = float(count @ means / total)
    between = float(count @ (means - mean) ** 2 / total)
    sizes = np.abs(np.concatenate([one.ravel() for one in errors_m])) if len(errors_m) else np.empty(0)
    sizes = sizes[np.isfinite(sizes)]
    return Pooled(
        cases=len(known),
        count=int(total),
        mean_m=mean,
        within_m=sqrt(squares / freedom) if freedom else nan,
        between_m=sqrt(between),
        rms_m=sqrt(mean * mean + between + squares / total),
        abs_95_m=float(np.quantile(sizes, 0.95)) if len(sizes) else nan,
    )
