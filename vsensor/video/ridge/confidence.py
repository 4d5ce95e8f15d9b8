"""Confidence 1 to 4 of a line: how far off the offset at the front axle may be.

    confidence     4        3        2        1
    95 % within    0.06     0.15     0.30     0.60 m

The bounds hold on made drives (tests/video); the deviation that decides is that of the fit, with what the
fit does not know: the height of the camera and the shape of the road.
"""

from math import hypot

from vsensor.types import Fit

BOUNDS_M = (0.60, 0.30, 0.15, 0.06)
"""95 % of the offsets of confidence 1, 2, 3, 4 are within."""
INFLATION = 1.5
"""Errors of neighbouring points go together; the covariance takes them as independent."""
UNKNOWN_M = 0.015
"""What no fit knows: the camera's height, the paint's own edges."""
WITHIN = 2.5
"""95 % of errors are within so many of these deviations: their tails are longer than the normal law's, 2."""


def confidence(fit: Fit, front_axle_m: float, rows: int) -> int:
    """Return 0 (no line worth a report) to 4."""
    std_m = hypot(INFLATION * fit.std_at(front_axle_m), UNKNOWN_M)
    by_std = sum(WITHIN * std_m <= bound for bound in BOUNDS_M)
    by_paint = 1 + (rows >= 12) + (rows >= 18) + (rows >= 28)
    return min(by_std, by_paint)
