"""Which of the fitted lines are lines of a lane, and how each of them was seen."""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from vsensor.types import Array, BoolArray, Colour, Fit, MarkingKind, Sighting, frozen
from vsensor.video.ridge.confidence import confidence
from vsensor.video.ridge.config import RidgeConfig
from vsensor.video.ridge.ground import Ground
from vsensor.video.ridge.known import Double, Known
from vsensor.video.ridge.paint import Points
from vsensor.video.ridge.road import Road, inliers, polynomial
from vsensor.video.ridge.search import votes

CLUTTER = 3.0
"""A line has so many more rows of paint than would lie along it by chance, in deviations of that number..."""
SURE_ROWS = 14
"""... and so many at least, unless a line is known to be there."""
AS_LIGHT = 0.25
"""Stripes of a double marking are about as light: by this part of the other one's contrast at least. Of paint
they may show any share: dashes of 3 m every 9 m, far ahead one with the other stripe, have a tenth of it."""
SHARE, SURE_PICTURES = 0.3, 5
"""With this part of the other one's paint it counts at once, else once seen in so many pictures: specks
pass."""
STRIPES_APART_M = 0.15
"""Two fits nearer to each other than this at the front axle are of one stripe."""
SAME_GAP_M = 0.08
GAP_STD_M = 0.02
"""How surely the one stripe of a double marking is known from where the other one is."""
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

    `strength` is the median of its points', `misfit` their root mean square distance from it, in standard
    deviations. Of a `double` marking it is the inner stripe; where that shows no paint, between its dashes,
    the points are the outer one's, and it is `beside_m` from them.
    """

    k: int
    points: BoolArray
    at_axle_m: float
    votes: float
    strength: float
    rows: int
    length_m: float
    misfit: float
    double: Double | None = None
    beside_m: float = 0.0


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
        elif len(near) == 1 and _is_double(config, line, near[0]):
            kept[kept.index(near[0])] = _inner(road, known, line, near[0])
    return sorted((_beside(road, known, line) for line in kept), key=lambda line: -line.at_axle_m)


def sighting(config: RidgeConfig, ground: Ground, points: Points, road: Road, line: Line) -> Sighting:
    """Return a line as this picture shows it."""
    coefficients, covariance = polynomial(road, line.k, ground.foot_m)
    if line.beside_m:
        coefficients[0] += line.beside_m
        covariance[0, 0] += GAP_STD_M**2
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
        strength=float(np.median(points.strength[on_line])) if len(rows) else 0.0,
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


def _is_double(config: RidgeConfig, line: Line, other: Line) -> bool:
    """Return whether a line and a stronger one are the stripes of a double marking."""
    apart_m = abs(line.at_axle_m - other.at_axle_m)
    return STRIPES_APART_M < apart_m < config.double_m and line.strength > AS_LIGHT * other.strength


def _inner(road: Road, known: Known, line: Line, other: Line) -> Line:
    """Return the inner one of two stripes of a double marking; of more the strongest two count."""
    if other.double is not None:
        return other
    inner, outer = sorted((line, other), key=lambda stripe: abs(stripe.at_axle_m))
    inner_m, outer_m = (float(road.offset_m[stripe.k]) for stripe in (inner, outer))
    before = known.double(outer_m)
    is_again = before is not None and abs(before.gap_m - (inner_m - outer_m)) < SAME_GAP_M
    pictures = 1 + (before.pictures if before is not None and is_again else 0)
    is_sure = pictures >= SURE_PICTURES or inner.votes > SHARE * outer.votes
    double = Double(outer_m=outer_m, gap_m=inner_m - outer_m, pictures=pictures)
    return replace(inner if is_sure else outer, double=double)


def _beside(road: Road, known: Known, line: Line) -> Line:
    """Return the inner stripe of a known double marking where the outer one alone is seen."""
    double = known.double(float(road.offset_m[line.k])) if line.double is None else None
    if double is None or double.pictures < SURE_PICTURES:
        return line
    if abs(line.at_axle_m + double.gap_m) > abs(line.at_axle_m):
        return line
    at_axle_m = line.at_axle_m + double.gap_m
    return replace(line, at_axle_m=at_axle_m, beside_m=double.gap_m, double=double)


def _width_m(ground: Ground, points: Points, line: Line) -> float:
    """Return the marking's width where it is seen sharply."""
    sharp = line.points & (ground.across_m[points.row] < SHARP_M)
    widths: Array = points.width_m[sharp]
    if len(widths) < 3:
        return USUAL_M
    return float(np.clip(np.median(widths), NARROWEST_M, WIDEST_M))
