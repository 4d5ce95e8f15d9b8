"""How well a line is seen: 0 no line, 1 poor, 2 fair, 3 good, 4 high.

The quality is the lowest that any of these gives (defaults of the config; 1 below the first limit):

    quality                              2       3       4
    seen up to (x_max)              >=  15      30      50 m
    seen length (x_max - x_min)     >=  10      20      35 m
    seen from (x_min)               <=  30      25      20 m
    points of paint                 >=  20      60     120
    longest stretch without paint   <=  40      25      15 m
    std of y at 20 m (covariance)   <=   0.40    0.20    0.10 m
    std of the points about it      <=   0.60    0.30    0.15 m
    rain                            <=   0.85    0.60    0.30
    light                                                dusk or day (3 at night)

So more range, more points, smaller gaps, a better fit, less rain or more light never lower it.
That of a line which is predicted falls from there to 0; see `vsensor.tracker.reports`.
"""

from collections.abc import Sequence
from typing import Annotated

import msgspec

from vsensor.schema import Config
from vsensor.types import (
    Array,
    Colour,
    Detections,
    Environment,
    Fit,
    Light,
    MarkingKind,
    Sighting,
)

Limits = tuple[float, float, float]
"""Limits of quality 2, 3 and 4."""


class QualityConfig(Config, frozen=True, kw_only=True):
    """The limits of quality 2, 3, 4, in this order; see the table in `vsensor.quality`."""

    range_m: Limits = (15.0, 30.0, 50.0)
    length_m: Limits = (10.0, 20.0, 35.0)
    start_m: Limits = (30.0, 25.0, 20.0)
    points: Limits = (20.0, 60.0, 120.0)
    gap_m: Limits = (40.0, 25.0, 15.0)
    std_m: Limits = (0.40, 0.20, 0.10)
    residual_m: Limits = (0.60, 0.30, 0.15)
    rain: Limits = (0.85, 0.60, 0.30)
    std_at_m: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 20.0
    night: Annotated[int, msgspec.Meta(ge=1, le=4)] = 3


def rate(config: QualityConfig, fit: Fit | None, x_m: Array, environment: Environment) -> int:
    """Return 0..4 of one line; `x_m` (N,) increasing are its points. 0 = no fit."""
    if fit is None:
        return 0
    gap = float((x_m[1:] - x_m[:-1]).max()) if len(x_m) > 1 else 0.0
    return min(
        _at_least(config.range_m, fit.x_max_m),
        _at_least(config.length_m, fit.x_max_m - fit.x_min_m),
        _at_most(config.start_m, fit.x_min_m),
        _at_least(config.points, fit.points),
        _at_most(config.gap_m, gap),
        _at_most(config.std_m, fit.std_at(config.std_at_m)),
        _at_most(config.residual_m, fit.residual_std_m),
        _at_most(config.rain, environment.rain),
        config.night if environment.light is Light.NIGHT else 4,
    )


def _at_least(limits: Limits, value: float) -> int:
    """Return 1 to 4; NaN meets no limit."""
    fair, good, high = limits
    return 1 + (value >= fair) + (value >= good) + (value >= high)


def _at_most(limits: Limits, value: float) -> int:
    """Return 1 to 4; NaN meets no limit."""
    fair, good, high = limits
    return 1 + (value <= fair) + (value <= good) + (value <= high)


def sightings(
    config: QualityConfig,
    fits: tuple[Fit | None, ...],
    detections: Detections,
    environment: Environment,
    marking_ids: Sequence[int],
) -> tuple[Sighting | None, ...]:
    """Join polynomial, quality and paint of every line; None where there is no polynomial.

    `marking_ids` (K,) is the id of each line's marking.
    """
    return tuple(
        None if fit is None else _sighting(config, k, fit, detections, environment, marking_ids[k])
        for k, fit in enumerate(fits)
    )


def _sighting(
    config: QualityConfig,
    k: int,
    fit: Fit,
    detections: Detections,
    environment: Environment,
    marking_id: int,
) -> Sighting:
    lines = detections.lines
    x_m = lines.points_ego_m[int(lines.starts[k]) : int(lines.starts[k + 1]), 0]
    x_m = x_m[: int(x_m.searchsorted(fit.x_max_m, "right"))]
    return Sighting(
        fit=fit,
        quality=rate(config, fit, x_m, environment),
        kind=MarkingKind(int(detections.kind[k])),
        colour=Colour(int(detections.colour[k])),
        width_m=float(detections.width_m[k]),
        marking=int(lines.marking[k]),
        marking_id=marking_id,
    )
