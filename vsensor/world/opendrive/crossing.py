"""Whether a road crosses itself on one level: a slip in a map, where it is no bridge."""

from math import pi

import numpy as np

from vsensor.types import Array, BoolArray, IntArray
from vsensor.world.opendrive.planview import Arc, PlanView, Spiral
from vsensor.world.opendrive.polynomial import Cubics

PIECES = 400
BRIDGE_M = 2.5
"""So much higher or lower it is a bridge."""


def self_crossing(plan: PlanView, elevation: Cubics, length_m: float) -> tuple[float, float] | None:
    """Return two s at which the reference line meets itself on one level, None if it does not.

    A line of less than half a turn never does; others are looked at in chords of 1/400 of the length.
    """
    if _most_turn_rad(plan) < pi:
        return None
    s = np.linspace(0.0, length_m, PIECES + 1)
    x, y, _, _ = plan.at(s)
    first, second = np.triu_indices(PIECES, k=2)
    hits = _cross(x, y, first, second).nonzero()[0]
    height = elevation.at(s)[0]
    for hit in hits.tolist():
        a, b = int(first[hit]), int(second[hit])
        closes = a == 0 and b == PIECES - 1  # a circuit ends where it begins
        if not closes and abs(height[a] - height[b]) < BRIDGE_M:
            return float(s[a]), float(s[b])
    return None


def _most_turn_rad(plan: PlanView) -> float:
    """Return what the line turns at most, left and right taken together."""
    turn = 0.0
    for record in plan.records:
        curve = record.curve
        if isinstance(curve, Arc):
            turn += abs(curve.curvature_per_m) * record.length_m
        elif isinstance(curve, Spiral):
            turn += max(abs(curve.start_per_m), abs(curve.end_per_m)) * record.length_m
        else:
            heading = curve.local(np.linspace(0.0, record.length_m, 17))[2]
            turn += 2.0 * float(np.abs(np.diff(np.unwrap(heading))).sum())
    return turn


def _cross(x: Array, y: Array, first: IntArray, second: IntArray) -> BoolArray:
    """Return which pairs of chords cross: each has the other's ends on its two sides."""

    def side(chord: IntArray, point: IntArray) -> Array:
        dx, dy = x[chord + 1] - x[chord], y[chord + 1] - y[chord]
        return np.asarray(np.sign(dx * (y[point] - y[chord]) - dy * (x[point] - x[chord])))

    apart = side(first, second) * side(first, second + 1) < 0
    return np.asarray(apart & (side(second, first) * side(second, first + 1) < 0))
