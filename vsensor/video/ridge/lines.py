"""Which of the fitted lines are lines of a lane, and how each of them was seen."""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from vsensor.types import Array, BoolArray, Colour, Fit, MarkingKind, Sighting, frozen
from vsensor.video.ridge.confidence import confidence
from vsensor.video.ridge.config import RidgeConfig
from vsensor.video.ridge.ground import Ground
from vsensor.video.ridge.known import Known
from vsensor.video.ridge.paint import Points
from vsensor.video.ridge.road import Road, inliers, polynomial
from vsensor.video.ridge.search import votes

CLUTTER = 3.0
"""A line has so many more rows of paint than would lie along it by chance, in deviations of that number..."""
SURE_ROWS = 14
"""... and so many at least, unless a line is known to be there."""
SHARE = 0.3
"""The inner stripe of a double marking has this part of the outer one's paint, or it is no stripe."""
DASHED = 0.75
"""A line with less paint than this along its length is dashed."""
SHARP_M = 0.04
"""Where a pixel covers less than this across, a stripe's width is measured."""
MISFIT = 3.5
"""Points that lie about a line by more of their deviations are none of one: the edges of a car, a shrub."""
REACH_M = 0.15
"""So near to a curve points count as along it."""
NARROWEST_M, WIDEST_M, USUAL_M = 0.06, 0.5, 0.12


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line of the picture: its points (N,) bool, place at the front axle, paint in rows and in metres.

    `misfit` is the points' root mean square distance from it, in their standard deviations.
    """

    k: int
    points: BoolArray
    at_axle_m: float
    votes: float
    rows: int
    length_m: float
    misfit: float


def choose(config: RidgeConfig, ground: Ground, points: Points, road: Road, known: Known) -> list[Line]:
    """Return the lines of lanes, from left to right."""
    candidates = [_line(config, ground, points, road, k) for k in range(len(road.offset_m))]
    chance = _by_chance(config, road)
    seen = [line for line in candidates if _is_line(config, line, chance, known.near(road.offset_m[line.k]))]
    kept: list[Line] = []
    for line in sorted(seen, key=lambda line: -line.votes):
        near = [other for other in kept if abs(other.at_axle_m - line.at_axle_m) < config.least_lane_m]
        if not near:
            kept.append(line)
        elif len(near) == 1 and _is_inner_stripe(config, line, near[0]):
            kept[kept.index(near[0])] = line
    return sorted(kept, key=lambda line: -line.at_axle_m)


def sighting(config: RidgeConfig, ground: Ground, points: Points, road: Road, line: Line) -> Sighting:
    """Return a line as this picture shows it."""
    coefficients, covariance = polynomial(road, line.k, ground.foot_m)
    ahead, residual = road.ahead_m[line.points], road.residual_m[line.points]
    begin, end = ground.foot_m[0] + float(ahead.min()), ground.foot_m[0] + float(ahead.max())
    fit = Fit(
        coefficients=frozen(coefficients),
        covariance=frozen(covariance),
        x_min_m=begin,
        x_max_m=end,
        residual_std_m=float(np.sqrt(np.mean(residual * residual))),
        points=line.rows,
    )
    is_dashed = line.length_m < DASHED * (end - begin)
    return Sighting(
        fit=fit,
        quality=confidence(fit, ground.front_axle_m, line.rows),
        kind=MarkingKind.DASHED if is_dashed else MarkingKind.SOLID,
        colour=Colour.UNKNOWN,
        width_m=_width_m(ground, points, line),
        marking=-1,
    )


def _line(config: RidgeConfig, ground: Ground, points: Points, road: Road, k: int) -> Line:
    on_line = inliers(road, k)
    coefficients, _ = polynomial(road, k, ground.foot_m)
    rows = np.unique(points.row[on_line])
    return Line(
        k=k,
        points=on_line,
        at_axle_m=float(np.polynomial.polynomial.polyval(ground.front_axle_m, coefficients)),
        votes=float(votes(points)[on_line].sum()),
        rows=len(rows),
        misfit=_misfit(road, k),
        length_m=float((ground.growth - 1.0) * ground.ahead_m[rows].sum()),
    )


def _misfit(road: Road, k: int) -> float:
    near = road.line == k
    off = road.residual_m[near] / road.sigma_m[near]
    return float(np.sqrt(np.mean(off * off))) if near.any() else 0.0


def _by_chance(config: RidgeConfig, road: Road) -> float:
    """Return how many points would lie within reach of any curve if those of no line lay anywhere."""
    return float(np.count_nonzero(road.line < 0)) * 2.0 * REACH_M / (2.0 * config.aside_m)


def _is_line(config: RidgeConfig, line: Line, chance: float, known_m: float | None) -> bool:
    if line.rows < config.least_rows or line.length_m < config.least_length_m or line.misfit > MISFIT:
        return False
    least = chance + CLUTTER * sqrt(chance)
    return line.rows > (least if known_m is not None else least + SURE_ROWS)


def _is_inner_stripe(config: RidgeConfig, line: Line, other: Line) -> bool:
    """Return whether a line is the inner stripe of a double marking whose other stripe was taken."""
    is_double = abs(line.at_axle_m - other.at_axle_m) < config.double_m
    return is_double and abs(line.at_axle_m) < abs(other.at_axle_m) and line.votes > SHARE * other.votes


def _width_m(ground: Ground, points: Points, line: Line) -> float:
    """Return the marking's width where it is seen sharply."""
    sharp = line.points & (ground.across_m[points.row] < SHARP_M)
    widths: Array = points.width_m[sharp]
    if len(widths) < 3:
        return USUAL_M
    return float(np.clip(np.median(widths), NARROWEST_M, WIDEST_M))
