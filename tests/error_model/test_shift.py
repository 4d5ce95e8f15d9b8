"""Points moved along the normal of their line: as the plain formula has it, point by point."""

import itertools
import math

import numpy as np
import pytest

from tests.lines import line_points, points_of
from vsensor.error_model.shift import CHORD_M, shift

GRID_M = np.array([0.0, 5.0, 10.0, 15.0, 25.0, 40.0, 60.0, 90.0])


def between(x, xs, ys):
    """Linear interpolation of one value; the nearest beyond the ends."""
    if x <= xs[0]:
        return ys[0]
    for a, b, low, high in zip(xs, xs[1:], ys, ys[1:], strict=False):
        if x <= b:
            return low + (high - low) * ((x - a) / (b - a))
    return ys[-1]


def plainly(points, errors_m):
    """One line (N, 3), moved point by point."""
    stride = max(int((len(points) - 1) * CHORD_M / max(points[-1, 0] - points[0, 0], CHORD_M)), 1)
    nodes = points[::stride]
    middles = [0.5 * (a[0] + b[0]) for a, b in itertools.pairwise(nodes)]
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in itertools.pairwise(nodes)]
    on_grid = [between(x, middles, slopes) if middles else 0.0 for x in GRID_M]
    left = [error / math.hypot(1.0, slope) for error, slope in zip(errors_m, on_grid, strict=True)]
    back = [along * slope for along, slope in zip(left, on_grid, strict=True)]
    moved = [(x - between(x, GRID_M, back), y + between(x, GRID_M, left), z) for x, y, z in points.tolist()]
    return np.array(moved)


def some_lines(counts, seed=1):
    random = np.random.default_rng(seed)
    found = []
    for count in counts:
        x = np.sort(random.uniform(-3.0, 110.0, count))
        found.append((x, random.normal() + random.normal(scale=0.1) * x + random.normal() * x**2 / 400.0))
    return line_points(*found)


@pytest.mark.parametrize("counts", [(40, 300, 80, 7), (1, 2, 0, 150), (250,), ()], ids=str)
def test_every_point_goes_along_the_normal_by_the_error_at_its_range(counts):
    lines = some_lines(counts)
    errors_m = np.random.default_rng(2).normal(scale=0.3, size=(len(counts), len(GRID_M)))
    moved = shift(lines, GRID_M, errors_m)
    for row, count in enumerate(counts):
        if count:
            expected = plainly(points_of(lines, row), errors_m[row].tolist())
            np.testing.assert_allclose(points_of(moved, row), expected, rtol=0.0, atol=1e-12)


def test_the_points_that_were_given_stay_and_those_that_are_given_back_are_read_only():
    lines = some_lines((50, 60))
    before = lines.points_ego_m.copy()
    moved = shift(lines, GRID_M, np.ones((2, len(GRID_M))))
    np.testing.assert_array_equal(lines.points_ego_m, before)
    assert not moved.points_ego_m.flags.writeable
    assert (moved.starts is lines.starts, moved.index is lines.index) == (True, True)
