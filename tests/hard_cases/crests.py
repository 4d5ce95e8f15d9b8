"""The road as what hides: at the tangent of a crest, from on and below the road, on slopes of 45 degrees.

The road is z = rise x + bend x^2 + bank y, cut by cross-sections as far apart as the map's would be. In
120 digits a sight line's greatest depth under it is known in closed form: where a point is free though
its line passes below the road, the error is that depth; where it is hidden though the line stays above,
it is by how much the camera would have to be lower.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from tests.hard_cases import exact
from tests.hard_cases.exact import Row, mp
from vsensor.raycast import hidden_by_surface
from vsensor.world.sections import RISE_M, STEPS_M

FREE_M = 1e-3 + RISE_M + 1e-3
"""Bound: the road must stand a millimetre higher before it hides, it rises by so much between two sections,
and between two of the 120 points of a line at which the clearance is found another may be lost."""

HIDDEN_M = 1e-12
"""Bound: nothing is hidden falsely, but for rounding."""

BANDS_M = 10.0 ** np.arange(-12.0, 1.0, 0.25)
HALF_M = 6.0


class Road(NamedTuple):
    """A road by its coefficients, and the camera's height above it at x = 0, y = `aside_m`."""

    rise: float
    bend_per_m: float
    bank: float
    eye_m: float
    aside_m: float = 0.0

    def height(self, x, y):
        return self.rise * x + self.bend_per_m * x * x + self.bank * y

    @property
    def eye(self):
        return np.array([0.0, self.aside_m, self.height(0.0, self.aside_m) + self.eye_m])


def sections(road, end_m=140.0, columns=2):
    """Return cross-sections (M, columns, 3), as far apart as the map's rule has it."""
    low, high = STEPS_M
    curvature = max(2.0 * abs(road.bend_per_m), 8.0 * RISE_M / high**2)
    step = max(np.sqrt(8.0 * RISE_M / curvature), low)
    x = np.arange(-20.0, end_m, int(step))
    y = np.linspace(HALF_M, -HALF_M, columns)
    return np.array([[(a, b, road.height(a, b)) for b in y] for a in x])


def lines(road, start_m=2.0, end_m=100.0, step_m=0.1):
    x = np.arange(start_m, end_m, step_m)
    return np.concatenate(
        [np.column_stack([x, np.full(len(x), y), road.height(x, y)]) for y in (1.75, -1.75, 5.9)]
    )


def depth(road, point, lowered_m=0.0):
    """Return how far below the road the sight line to a point passes at the most, exactly; 0 = nowhere."""
    start, end = exact.matrix(road.eye), exact.matrix(point)
    start[2] -= mp.mpf(lowered_m)
    rise, bend, bank = (mp.mpf(value) for value in road[:3])
    dx, dy, dz = end - start
    # road(u) - line(u) = c + b u + a u^2 for the fraction u of the sight line
    a = bend * dx * dx
    b = rise * dx + 2 * bend * start[0] * dx + bank * dy - dz
    c = rise * start[0] + bend * start[0] ** 2 + bank * start[1] - start[2]
    places = [mp.mpf(0)]
    if a < 0:
        places.append(min(max(-b / (2 * a), mp.mpf(0)), mp.mpf(1)))
    return max(mp.mpf(0), *(c + b * u + a * u * u for u in places))


def errors_m(road, points, columns=2):
    """Return the worst depth of a point that is free, and the worst height of one that is hidden."""
    found = hidden_by_surface(road.eye, points, sections(road, columns=columns))
    free = max((depth(road, point) for point in points[~found][::7]), default=mp.mpf(0))
    above = [_too_high_m(road, point) for point in points[found][::7]]
    return float(free), max(above, default=0.0)


def _too_high_m(road, point):
    if depth(road, point) > 0:
        return 0.0
    return next((float(band) for band in BANDS_M if depth(road, point, band) > 0), np.inf)


def about_the_tangent(road):
    """Points at the tangent from the camera, up to 1 m before and behind, in steps of a line's points."""
    x = np.sqrt(road.eye_m / -road.bend_per_m)
    near = np.concatenate([x + sign * 10.0 ** np.arange(-12.0, 0.1) for sign in (-1, 1)])
    near.sort()
    return np.column_stack([near, np.full(len(near), 1.75), road.height(near, 1.75)])


CRESTS = [Road(0.0, -1 / (2 * radius), 0.0, 1.35) for radius in (500.0, 1000.0, 2000.0, 8000.0)]
CASES = {
    "over crests of 500 to 8000 m": (CRESTS, lines),
    "points 1e-12 to 1 m about the tangent to a crest": (CRESTS, about_the_tangent),
    "towards a crest, up 10 %": (
        [Road(0.1, -1 / 1000.0, 0.0, 1.35), Road(0.1, -1 / 4000.0, 0.0, 1.35)],
        lines,
    ),
    "a crest of a banked road": (
        [Road(0.0, -1 / 2000.0, 0.1, 1.35), Road(0.0, -1 / 2000.0, -0.6, 1.35)],
        lines,
    ),
    "slopes of 45 degrees up and down": (
        [Road(s, b, 0.0, 1.35) for s in (1, -1) for b in (0, -1e-3, 1e-3)],
        lines,
    ),
    "camera on the road, plane and crest": (
        [Road(0.02, 0.0, 0.0, 0.0), Road(0.0, -1 / 2000.0, 0.0, 0.0)],
        lines,
    ),
    "camera below the road, beyond the next section": (
        [Road(0.0, 0.0, 0.0, -0.2), Road(0.03, -1 / 2000.0, 0.0, -0.2)],
        partial(lines, start_m=10.1),
    ),
    "camera far beside the road": (
        [Road(0.0, -1 / 2000.0, 0.0, 1.35, 5.9), Road(0.0, 0.0, 0.1, 1.35, -8.0)],
        lines,
    ),
    "lines of a few metres": ([CRESTS[0]], partial(lines, start_m=34.0, end_m=41.0)),
}


QUANTITIES = ("point wrongly free: depth of its line", "point wrongly hidden: camera higher by")


def rows():
    found = []
    for case, (roads, points_of) in CASES.items():
        pairs = [errors_m(road, points_of(road), columns) for road in roads for columns in (2, 5)]
        for quantity, bound, worst in zip(QUANTITIES, (FREE_M, HIDDEN_M), np.max(pairs, axis=0), strict=True):
            found.append(Row(case, quantity, float(worst), "m", bound, "120 digits"))
    return found
