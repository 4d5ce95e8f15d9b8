r"""All lines of a picture fitted at once: what is common to the lines of a road is measured by all of them.

    y_k(x) = offset_k + (slope + turn_k) x + bend_k x^2 / 2 + change x^3 / 6      x, y from the camera's foot

A body that pitches moves every place of the picture: seen too far ahead, parallel lines part, seen too near
they meet. So two lines say how far it pitches, which is where they would meet in the picture. What one line
alone cannot tell from its own slope is held by how far roads converge and bodies pitch (`RidgeConfig`).
"""

from dataclasses import dataclass
from math import radians

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vsensor.types import Array, BoolArray, IntArray
from vsensor.video.ridge.config import RidgeConfig
from vsensor.video.ridge.ground import Ground
from vsensor.video.ridge.known import Known
from vsensor.video.ridge.paint import Points
from vsensor.video.ridge.search import Shape, pitched, stripes

COMMON = 4
"""Unknowns that lines share: slope, bend, change of the bend, pitch."""
WIDE_M = (0.5, 0.4, 0.3, 0.25)
NARROW_M = (0.2, 0.15, 0.15)
"""How far from a line its points are looked for, pass by pass: first for the shape of the road, then for all
lines."""
GATE_PER_M = 0.01
"""The same grows by so much with the distance."""
POINT_PX = 0.3
"""Standard deviation of a stripe's middle in a row of the picture."""
AGAIN, FAR_M = 1.5, 3.0
"""A line that was seen before counts so many times for the own lane, one farther off than this less."""
OBLIQUE = 0.7
"""A line far aside runs flat in the picture: what a row is off by moves it by more."""
WAVE_M, WAVE_AT_M = 0.02, 25.0
"""What no polynomial follows: crests, unevenness, painters' hands; it grows with the distance squared."""
TAIL = 3.0
LOOSE, ASIDE = 0.3, 3.0
"""Beyond so many deviations, or this part of the gate, a point counts less and less (Cauchy). Other lines
than those of the own lane count as if their deviations were so many times as large, and less and less if they
turn away: a wall or a kerb is no line of this road, nor does it lie in its plane."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Road:
    """Lines (L,) of a picture and what they share, as fitted.

    `offset_m`, `turn` (L,); `slope`, `bend_per_m`, `change_per_m2`, `pitch_rad`; `covariance` of
    [offsets, turns, slope, bend, change, pitch]; `line` (N,) is each point's line, -1 for none; `ahead_m`,
    `aside_m`, `residual_m`, `sigma_m` (N,) of the points with the pitch taken out.
    """

    offset_m: Array
    turn: Array
    slope: float
    bend_per_m: float
    change_per_m2: float
    pitch_rad: float
    covariance: Array
    line: IntArray
    ahead_m: Array
    aside_m: Array
    residual_m: Array
    sigma_m: Array

    @property
    def shape(self) -> Shape:
        """Return what the lines share, for the next picture."""
        return Shape(slope=self.slope, bend_per_m=self.bend_per_m, pitch_rad=self.pitch_rad)


def fit_road(
    config: RidgeConfig, ground: Ground, points: Points, shape: Shape, found: Array, known: Known
) -> Road:
    """Fit lines `found` (L, 2: offset, votes) that run as `shape`, with what is `known` before.

    Those of the own lane first; with the road's shape known by them all lines there are.
    """
    lane = own_lane(config, found, known)
    road = _fitted(config, ground, points, shape, lane, known, WIDE_M)
    run = road.ahead_m * (
        road.slope + road.ahead_m * (road.bend_per_m / 2.0 + road.ahead_m * road.change_per_m2 / 6.0)
    )
    offsets = stripes(config, points, road.aside_m - run)
    if not len(offsets):
        return road
    own = [int(np.abs(offsets - offset).argmin()) for offset in road.offset_m]
    first = dict.fromkeys(own)
    order = [*first, *(k for k in range(len(offsets)) if k not in first)]
    return _fitted(config, ground, points, road.shape, offsets[order], known, NARROW_M, len(first))


def own_lane(config: RidgeConfig, found: Array, known: Known) -> Array:
    """Return the offsets (1 or 2,) of the own lane's of lines (L, 2): near, strong, a lane apart."""
    offset = found[:, 0]
    votes = found[:, 1] * [AGAIN if known.near(at) is not None else 1.0 for at in offset.tolist()]
    votes /= 1.0 + (offset / FAR_M) ** 4
    apart = np.abs(offset[:, None] - offset)
    pair = votes[:, None] + votes
    pair[(apart < config.least_lane_m) | (apart > config.tracker.max_own_m + 0.5)] = 0.0
    one, other = np.unravel_index(int(pair.argmax()), pair.shape)
    return offset[[one, other]] if pair[one, other] > votes.max() else offset[[int(votes.argmax())]]


def _fitted(
    config: RidgeConfig,
    ground: Ground,
    points: Points,
    shape: Shape,
    offsets: Array,
    known: Known,
    gates_m: tuple[float, ...],
    leading: int = 2,
) -> Road:
    """Fit these lines to the points near them; the first `leading` say how the road runs."""
    lines = len(offsets)
    prior, std = _prior(config, offsets, known)
    theta = prior.copy()
    theta[:lines] = offsets
    theta[-COMMON:] = shape.slope, shape.bend_per_m, 0.0, shape.pitch_rad
    covariance = np.diag(std * std)
    sigma = _sigma_m(ground, points)
    ahead, aside, line, residual = (
        points.ahead_m,
        points.aside_m,
        np.full(len(sigma), -1),
        np.zeros(len(sigma)),
    )
    for gate_m in gates_m:
        ahead, aside = pitched(ground, points.ahead_m, points.aside_m, theta[-1])
        every = aside - _curves(theta, ahead)
        line = np.abs(every).argmin(axis=0)
        residual = every[line, np.arange(len(line))]
        inside = np.abs(residual) < gate_m + GATE_PER_M * ahead
        spread = np.where(line < leading, sigma, ASIDE * sigma)
        line = np.where(inside, line, -1)
        theta, covariance = _step(
            ground, theta, prior, std, (ahead, aside, line, residual, spread), gate_m, leading
        )
    ahead, aside = pitched(ground, points.ahead_m, points.aside_m, theta[-1])
    residual = aside - _curves(theta, ahead)[np.maximum(line, 0), np.arange(len(line))]
    slope, bend, change, pitch = theta[-COMMON:].tolist()
    return Road(
        offset_m=theta[:lines],
        turn=theta[lines : 2 * lines],
        slope=slope,
        bend_per_m=bend,
        change_per_m2=change,
        pitch_rad=pitch,
        covariance=covariance,
        line=line,
        ahead_m=ahead,
        aside_m=aside,
        residual_m=residual,
        sigma_m=sigma,
    )


def _prior(config: RidgeConfig, offsets: Array, known: Known) -> tuple[Array, Array]:
    """Return what is expected of all unknowns before the picture, and how sure that is."""
    mean, std = known.offsets(offsets)
    run, run_std = known.slope_and_bend(config.bend_std_per_m)
    turns = np.zeros(len(offsets))
    free = [config.clothoid_std_per_m2, radians(config.pitch_std_deg)]
    return (
        np.concatenate([mean, turns, run, [0.0, known.rest_rad]]),
        np.concatenate([std, turns + config.converge_std, run_std, free]),
    )


def _sigma_m(ground: Ground, points: Points) -> Array:
    """Return each point's standard deviation (N,); rows that share rows of pixels share their noise."""
    shared = np.sqrt(np.maximum(ground.along_m / (ground.ahead_m * (ground.growth - 1.0)), 1.0))
    oblique = np.hypot(1.0, OBLIQUE * points.aside_m / ground.height_m)
    pixel = POINT_PX * (ground.across_m * shared)[points.row] * oblique
    return np.hypot(pixel, WAVE_M * (1.0 + (points.ahead_m / WAVE_AT_M) ** 2))


def _bent(offset: Array, bend: float) -> Array:
    """Return each line's own curvature (L,): the inner one of a bend is the more curved."""
    return bend / np.maximum(1.0 - bend * offset, 0.2)


def _curves(theta: Array, ahead: Array) -> Array:
    """Return y of every line at every point (L, N)."""
    lines = (len(theta) - COMMON) // 2
    offset, turn = theta[:lines, None], theta[lines : 2 * lines, None]
    slope, bend, change, _ = theta[-COMMON:]
    bends = _bent(offset, bend)
    return np.asarray(offset + ahead * (slope + turn + ahead * (bends / 2.0 + ahead * (change / 6.0))))


def _step(
    ground: Ground,
    theta: Array,
    prior: Array,
    std: Array,
    observed: tuple[Array, Array, IntArray, Array, Array],
    gate_m: float,
    leading: int,
) -> tuple[Array, Array]:
    """Return better unknowns and their covariance: Gauss-Newton, points far off count less."""
    ahead, aside, line, residual, sigma = observed
    chosen = line >= 0
    lines = (len(theta) - COMMON) // 2
    x, y, k, r = ahead[chosen], aside[chosen], line[chosen], residual[chosen]
    spread = np.maximum(TAIL * sigma[chosen], LOOSE * gate_m)
    weight = 1.0 / (sigma[chosen] ** 2 * (1.0 + (r / spread) ** 2))
    slope, bend, change, _ = theta[-COMMON:]
    along = slope + theta[lines + k] + x * (_bent(theta[k], bend) + x * (change / 2.0))
    rows = np.zeros((len(x), len(theta)))
    at = np.arange(len(x))
    rows[at, k], rows[at, lines + k] = 1.0, x
    rows[:, -4], rows[:, -3], rows[:, -2] = x, x * x / 2.0, x**3 / 6.0
    h = ground.height_m
    rows[:, -1] = x * y / h - along * (x * x + h * h) / h  # -d(residual)/d(pitch)
    scaled = rows * std
    apart = (theta - prior) / std
    held = np.ones(len(theta))
    weak = slice(lines + min(leading, lines), 2 * lines)
    held[weak] = 1.0 / (1.0 + apart[weak] ** 2)
    normal = scaled.T @ (weight[:, None] * scaled) + np.diag(held)
    factor = cho_factor(normal)
    right = scaled.T @ (weight * r) - held * apart
    step = cho_solve(factor, right)
    covariance = cho_solve(factor, np.eye(len(theta))) * np.outer(std, std)
    return theta + std * step, covariance


def polynomial(road: Road, k: int, foot_m: tuple[float, float]) -> tuple[Array, Array]:
    """Return line k's coefficients (4,) in the ego frame and their covariance (4, 4)."""
    lines = len(road.offset_m)
    bend = float(_bent(road.offset_m[k : k + 1], road.bend_per_m)[0])
    local = np.array([road.offset_m[k], road.slope + road.turn[k], bend / 2.0, road.change_per_m2 / 6.0])
    rows = np.zeros((4, len(road.covariance)))
    rows[0, k] = rows[1, lines + k] = rows[1, -4] = 1.0
    rows[2, -3], rows[3, -2] = 0.5, 1.0 / 6.0
    x, y = foot_m
    shift = np.array([[1.0, -x, x * x, -(x**3)], [0, 1, -2 * x, 3 * x * x], [0, 0, 1, -3 * x], [0, 0, 0, 1]])
    to_ego = shift @ rows
    return shift @ local + np.array([y, 0.0, 0.0, 0.0]), to_ego @ road.covariance @ to_ego.T


def inliers(road: Road, k: int) -> BoolArray:
    """Return which points (N,) carry line k."""
    near = np.abs(road.residual_m) < np.maximum(TAIL * road.sigma_m, 0.08)
    return np.asarray((road.line == k) & near)
