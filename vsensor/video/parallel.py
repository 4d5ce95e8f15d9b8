"""Camera angles and the two lines of a lane from one picture: lines beside each other are parallel.

    y_left(x)  = a     + k x^2 / 2             + r x^3 / 6     k, r: curvature of the left line, its rate
    y_right(x) = a - w + k x^2 / (2 (1 + k w)) + r x^3 / 6     w: width of the lane; one centre of the bend

A pitch that is wrong makes them part or meet, a yaw that is wrong makes them run aside from x = 0 on, where
the rear axle rolls along them.
"""

from dataclasses import dataclass
from math import radians
from typing import NamedTuple

import numpy as np

from vsensor.transforms import CAMERA_FROM_FORWARD_LEFT_UP, rotation_from_rpy
from vsensor.types import Array, BoolArray

POINT_PX = 0.5
"""Deviation of a point of a line across it, in pixels, beside the road's own: lines are laid to some cm."""
POINT_M = 0.02
TUKEY = 4.685
STEPS = 12
LEAST_POINTS = 6
"""Of each line."""
LEAST_SPAN_M = 3.0
FIRST_M = 18.0
"""The part of the road that is looked at first is so long, a dash and a gap; each step adds a half."""
TRIED_PER_M = tuple(k / 250.0 for k in (0.0, 0.25, -0.25, 0.5, -0.5, 1.0, -1.0, 2.0, -2.0))
"""Curvatures of which one shows the lines' points beside each other, to begin with."""
GATES_M = (0.45, 0.35, 0.30)
"""How far from the line, at first and later, a point may be to be one of its own."""
WIDEST_M, BIN_M, BINS = 6.0, 0.1, 120
"""Distances to the side in which lines are looked for."""
LEAST_LENGTH_M, LEAST_PART = 2.5, 0.2
"""A line shows on so many metres, and on such a part of what the clearest one shows."""
LANE_M = (2.0, 5.5)
BESIDE_M = 0.25
"""A line is at least so far from the vehicle's middle."""
ANGLE_PRIOR_RAD = radians(3.0)
CURVATURE_PRIOR_PER_M = 1.0 / 100.0
RATE_PRIOR_PER_M2 = 4e-5
"""A bend of 300 m radius begins within some 80 m."""
PRIORS = (
    ANGLE_PRIOR_RAD**-2,
    ANGLE_PRIOR_RAD**-2,
    CURVATURE_PRIOR_PER_M**-2,
    0.0,
    0.0,
    RATE_PRIOR_PER_M2**-2,
)
STEPS_OF = (1e-5, 1e-5, 1e-6, 1e-4, 1e-4, 1e-8)
"""Steps of the derivatives by pitch, yaw, k, a, w, r."""


class Mount(NamedTuple):
    """Where the camera is on the body, its roll, and its pitch and yaw as far as they are known."""

    position_m: tuple[float, float, float]
    roll_rad: float
    pitch_rad: float
    yaw_rad: float

    def on_road(self, rays: Array) -> tuple[Array, Array, BoolArray]:
        """Return x, y (N,) in m where rays (3, N) of the optical frame meet the road, and which do."""
        turned = (
            CAMERA_FROM_FORWARD_LEFT_UP @ rotation_from_rpy(self.roll_rad, self.pitch_rad, self.yaw_rad).T
        )
        forward, left, up = turned.T @ rays
        meets = up < -1e-3 * np.hypot(forward, left)
        depth = np.divide(-self.position_m[2], up, out=np.full(len(up), np.nan), where=meets)
        return self.position_m[0] + depth * forward, self.position_m[1] + depth * left, meets


@dataclass(frozen=True, slots=True, kw_only=True)
class Lane:
    """What one picture says: camera angles in rad, curvature, offset of the left line and width of the lane.

    `pitch_std_rad`, `yaw_std_rad` are what the points leave open. `points` counts those of both lines.
    """

    pitch_rad: float
    yaw_rad: float
    curvature_per_m: float
    left_m: float
    width_m: float
    pitch_std_rad: float
    yaw_std_rad: float
    points: int


SUREST_RAD = radians(0.3)
"""A lane that leaves its pitch more open than this, or yaw three times as much, says nothing."""


def fit_lane(rays: Array, mount: Mount, focal_px: float) -> Lane | None:
    """Return the lane that the rays (3, N) of line points show, None where they show no two lines."""
    x, y, meets = mount.on_road(rays)
    keep = meets & (np.abs(y) < 8.0)
    rays, x, y = rays[:, keep], x[keep], y[keep]
    if len(x) < 2 * LEAST_POINTS:
        return None
    near = float(np.quantile(x, 0.02))
    sides = _sides(x, y, near)
    if sides is None:
        return None
    left_m, right_m, curvature = sides
    state = np.array((mount.pitch_rad, mount.yaw_rad, curvature, left_m, left_m - right_m, 0.0))
    fitted: tuple[Array, Array, int] | None = None
    reach = FIRST_M
    for gate_m in (*GATES_M, GATES_M[-1], GATES_M[-1]):
        fitted = _fit(rays, mount, state, near + reach, gate_m, focal_px)
        if fitted is None:
            return None
        state, reach = fitted[0], 1.5 * reach
    assert fitted is not None
    std = np.sqrt(np.diag(fitted[1]))
    if std[0] > SUREST_RAD or std[1] > 3.0 * SUREST_RAD:
        return None
    return Lane(
        pitch_rad=float(state[0]),
        yaw_rad=float(state[1]),
        curvature_per_m=float(state[2]),
        left_m=float(state[3]),
        width_m=float(state[4]),
        pitch_std_rad=float(std[0]),
        yaw_std_rad=float(std[1]),
        points=fitted[2],
    )


def _sides(x: Array, y: Array, near_m: float) -> tuple[float, float, float] | None:
    """Return where the nearest lines on both sides are beside the vehicle, and their curvature, roughly."""
    close = x < near_m + FIRST_M
    x, y = x[close], y[close]
    trials = [_lengths_m(x, y - k * x * x / 2.0) for k in TRIED_PER_M]
    sharp = [float((one[:-1] + one[1:]) @ (one[:-1] + one[1:])) for one in trials]
    best = int(np.argmax(sharp))
    pair = _nearest_pair(np.convolve(trials[best], (0.5, 1.0, 0.5), "same"))
    return None if pair is None else (*pair, TRIED_PER_M[best])


def _lengths_m(x: Array, y: Array) -> Array:
    """Return over how many metres ahead there are points, in each bin across (M,)."""
    inside = np.abs(y) < WIDEST_M
    across = ((y[inside] + WIDEST_M) / BIN_M).astype(int)
    ahead = (x[inside] - x.min()).astype(int)
    taken = np.zeros((BINS, int(np.ptp(x)) + 1))
    taken[across.clip(0, BINS - 1), ahead] = 1.0
    return np.asarray(taken.sum(axis=1))


def _nearest_pair(counts: Array) -> tuple[float, float] | None:
    """Return where the lines nearest to the vehicle are that make a lane."""
    middles = (np.arange(BINS) + 0.5) * BIN_M - WIDEST_M
    strong = counts >= max(LEAST_PART * float(counts.max(initial=0.0)), LEAST_LENGTH_M)
    peak = strong & (counts >= np.roll(counts, 1)) & (counts > np.roll(counts, -1))
    left, right = middles[peak & (middles > BESIDE_M)], middles[peak & (middles < -BESIDE_M)]
    pairs = [
        (float(one), float(other)) for one in left for other in right if LANE_M[0] < one - other < LANE_M[1]
    ]
    return min(pairs, key=lambda pair: pair[0] - pair[1], default=None)


def _fit(
    rays: Array, mount: Mount, state: Array, far_m: float, gate_m: float, focal_px: float
) -> tuple[Array, Array, int] | None:
    """Return state, covariance and number of points of the fit to points nearer than `far_m`, or None."""
    x, _, left, right = _near_lines(rays, mount, state, far_m, gate_m)
    for side in (left, right):
        if side.sum() < LEAST_POINTS or np.ptp(x[side]) < LEAST_SPAN_M:
            return None
    chosen = left | right
    rays, left = rays[:, chosen], left[chosen]
    prior = np.array((mount.pitch_rad, mount.yaw_rad, 0.0, 0.0, 0.0, 0.0))
    for _ in range(STEPS):
        residual, jacobian = _linearised(rays, mount, state, left)
        sigma = np.hypot(POINT_M, POINT_PX / focal_px * _ranges(rays, mount, state))
        scaled = residual / sigma
        scale = max(1.4826 * float(np.median(np.abs(scaled))), 0.3)
        weight = np.maximum(1.0 - (scaled / (TUKEY * scale)) ** 2, 0.0) ** 2 / (scale * sigma) ** 2
        normal = (jacobian * weight) @ jacobian.T
        normal += np.diag(PRIORS)
        pull = (jacobian * weight) @ residual + np.array(PRIORS) * (state - prior)
        try:
            covariance = np.linalg.inv(normal)
        except np.linalg.LinAlgError:
            return None
        step = -covariance @ pull
        state = state + step
        if not np.isfinite(state).all() or not LANE_M[0] < state[4] < LANE_M[1]:
            return None
        if np.abs(step[:2]).max() < 1e-6 and abs(step[3]) < 1e-4:
            break
    return state, np.asarray(covariance, np.float64), len(left)


def _near_lines(
    rays: Array, mount: Mount, state: Array, far_m: float, gate_m: float
) -> tuple[Array, Array, BoolArray, BoolArray]:
    """Return x and y of all points, and which belong to the left and to the right line."""
    x, y, meets = mount._replace(pitch_rad=state[0], yaw_rad=state[1]).on_road(rays)
    near = meets & (x < far_m)
    left = near & (np.abs(y - _line(x, state, True)) < gate_m)
    right = near & (np.abs(y - _line(x, state, False)) < gate_m)
    return x, y, left, right & ~left


def _line(x: Array, state: Array, left: BoolArray | bool) -> Array:
    """Return y (N,) of the left or right line."""
    _, _, k, a, w, r = state
    side_k = np.where(left, k, k / (1.0 + k * w))
    return np.asarray(a - np.where(left, 0.0, w) + x * x * (side_k / 2.0 + r * x / 6.0))


def _ranges(rays: Array, mount: Mount, state: Array) -> Array:
    x, _, _ = mount._replace(pitch_rad=state[0], yaw_rad=state[1]).on_road(rays)
    return np.where(np.isfinite(x), np.abs(x - mount.position_m[0]), 1e3)


def _linearised(rays: Array, mount: Mount, state: Array, left: BoolArray) -> tuple[Array, Array]:
    """Return residuals (N,) in m and their derivatives (6, N) by the state."""

    def residual(at: Array) -> Array:
        x, y, meets = mount._replace(pitch_rad=at[0], yaw_rad=at[1]).on_road(rays)
        return np.where(meets, y - _line(x, at, left), 0.0)

    here = residual(state)
    jacobian = np.empty((len(state), len(left)))
    for place, step in enumerate(STEPS_OF):
        moved = state.copy()
        moved[place] += step
        jacobian[place] = (residual(moved) - here) / step
    return here, jacobian
