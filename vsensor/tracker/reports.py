"""A line with a side as it is reported: measured as seen in this image, or predicted.

The quality of a predicted line falls step by step: q of the last sight times the share of its prediction
that is left, rounded up. The share is the least of what is left of `coast_s`, of `coast_m`, and of the
length that was seen ahead: q = 4 gives 4, 3, 2, 1 for a quarter each. At 0 nothing is reported.
"""

from math import ceil

from vsensor.tracker.config import TrackerConfig
from vsensor.tracker.moved import fit_now
from vsensor.tracker.state import Track
from vsensor.types import Boundary, Fit, Side, Sighting


def measured(side: Side, k: int, sighting: Sighting) -> Boundary:
    """Return line `k` of this image; the polynomial is the measurement, nothing is smoothed."""
    return _boundary(side, sighting, sighting.fit, sighting.quality, sighting.marking, k)


def predicted(config: TrackerConfig, side: Side, track: Track, t_ns: int) -> Boundary | None:
    """Return a line that is not seen, moved to now; None when its prediction is used up.

    Its `marking` is -1: its place in this scene is not known here.
    """
    used = track.used_up(config, t_ns)
    fit = fit_now(track.last.fit, track.moved, track.age_s(t_ns)) if used < 1.0 else None
    if fit is None:
        return None
    return _boundary(side, track.last, fit, ceil(track.last.quality * (1.0 - used)), -1, -1)


def _boundary(side: Side, line: Sighting, fit: Fit, quality: int, marking: int, k: int) -> Boundary:
    return Boundary(
        side=side,
        coefficients=fit.coefficients,
        covariance=fit.covariance,
        x_min_m=fit.x_min_m,
        x_max_m=fit.x_max_m,
        quality=quality,
        kind=line.kind,
        colour=line.colour,
        width_m=line.width_m,
        measured=k >= 0,
        marking=marking,
        points=k,
    )
