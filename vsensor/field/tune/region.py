"""How far the line is reported: d_max(v) by quantile regression (P1 fig. 3.7), and the share of it."""

from typing import Any

import numpy as np
from scipy import sparse

from vsensor.field.tune.survey import REACH_BINS, REACH_STEP_M
from vsensor.types import Array

KNOT_STEP_MPS = 2.5
SMOOTHNESS = 0.05
"""Weight of the sum of bends (m per knot) beside the mean check loss (m)."""
NEAREST_M = 1.0


def reach_middles() -> Array:
    """Return the middle (REACH_BINS,) of the bins of reported ranges, in m."""
    return np.asarray((np.arange(REACH_BINS) + 0.5) * REACH_STEP_M)


def operating_region(counts: np.ndarray, step_mps: float, level: float) -> tuple[Array, Array]:
    """Return knots (G,) in m/s and d_max (G,) in m: the reported range's quantile, linear between knots.

    `counts` (V, REACH_BINS). Least check loss plus the sum of bends (a quantile smoothing spline), as a
    linear program; constant beyond the speeds that were driven.
    """
    cell, place = np.nonzero(counts)
    if not len(cell):
        return np.array([0.0, KNOT_STEP_MPS]), np.full(2, NEAREST_M)
    speed, reach = np.asarray(cell * step_mps, np.float64), reach_middles()[place]
    weight = counts[cell, place] / counts.sum()
    if np.ptp(speed) == 0.0:  # knots beyond the only speed would hang in the air
        range_m = reach[np.searchsorted(np.cumsum(weight), level * (1.0 - 1e-12))]
        return np.array([speed[0], speed[0] + step_mps]), np.full(2, max(float(range_m), NEAREST_M))
    first, last = speed.min(), max(speed.max(), speed.min() + step_mps)
    knots = np.linspace(first, last, max(int(np.ceil((last - first) / KNOT_STEP_MPS)), 2) + 1)
    values = _check_loss_spline(_hats(knots, speed), reach, weight, level)
    return knots, np.maximum(values, NEAREST_M)


def _hats(knots: Array, speed: Array) -> sparse.csr_array:
    """Return (N, G): the weights of linear interpolation."""
    left = np.clip(np.searchsorted(knots, speed, side="right") - 1, 0, len(knots) - 2)
    part = (speed - knots[left]) / (knots[left + 1] - knots[left])
    rows = np.arange(len(speed))
    entries = np.concatenate([1.0 - part, part])
    where = (np.concatenate([rows, rows]), np.concatenate([left, left + 1]))
    return sparse.csr_array(sparse.coo_array((entries, where), shape=(len(speed), len(knots))))


def _check_loss_spline(hats: sparse.csr_array, reach: Array, weight: Array, level: float) -> Array:
    """Minimise sum w (level u+ + (1 - level) u-) + SMOOTHNESS sum |second difference|."""
    from scipy.optimize import linprog

    solve: Any = linprog  # its stubs do not know sparse constraints
    points, knots = hats.shape
    bends = knots - 2
    second = sparse.diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(bends, knots))
    # unknowns: d at the knots, u+, u-, b+, b-;  hats d + u+ - u- = reach,  second d + b+ - b- = 0
    one, curve = sparse.eye_array(points), sparse.eye_array(bends)
    parts: list[list[Any]] = [[hats, one, -one, None, None], [second, None, None, curve, -curve]]
    cost = np.concatenate(
        [
            np.zeros(knots),
            weight * level,
            weight * (1.0 - level),
            np.full(2 * bends, SMOOTHNESS * (1.0 - level)),
        ]
    )
    found = solve(
        cost,
        A_eq=sparse.csc_array(sparse.block_array(parts)),
        b_eq=np.concatenate([reach, np.zeros(bends)]),
        bounds=[(None, None)] * knots + [(0.0, None)] * (2 * points + 2 * bends),
        method="highs",
    )
    return np.asarray(found.x[:knots])


def range_share(counts: np.ndarray, reach_m: Array, levels: Array) -> Array:
    """Return the quantiles (Q,) of the reported range over d_max, of counts (V, bins); 1 of nothing."""
    cell, place = np.nonzero(counts)
    if not len(cell):
        return np.ones(len(levels))
    share = reach_middles()[place] / reach_m[cell]
    order = np.argsort(share, kind="stable")
    below = np.cumsum(counts[cell, place][order])
    at = np.searchsorted(below, levels * below[-1], side="left")
    return np.asarray(share[order][np.minimum(at, len(order) - 1)])
