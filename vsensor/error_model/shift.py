"""Points of lines moved along the normal of their line."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from vsensor.types import Array, LinePoints

CHORD_M = 5.0
"""Length over which a line's direction is taken, and the widest step of the range grid."""


def shift(lines: LinePoints, grid_m: Array, errors_m: Sequence[Array] | Array) -> LinePoints:
    """Move line k by `errors_m[k]` (G,) given on `grid_m`, along its normal there, left positive.

    Between two nodes of the grid the movement is linear, beyond it that of the nearest node.
    """
    points = lines.points_ego_m.copy(order="K")  # along x, y and z each, as they come
    spans = list(pairwise(lines.starts.tolist()))
    slope = np.zeros((len(spans), len(grid_m)))
    for row, (start, stop) in enumerate(spans):
        if stop > start:
            slope[row] = _slope(points[start:stop, 0], points[start:stop, 1], grid_m)
    moved = np.empty(slope.shape, complex)  # back along x + i left along y: one search gives both
    moved.imag = errors_m / np.sqrt(1.0 + slope * slope)
    moved.real = moved.imag * slope
    for row, (start, stop) in enumerate(spans):
        x = points[start:stop, 0]
        by = np.interp(x, grid_m, moved[row])
        x -= by.real
        points[start:stop, 1] += by.imag
    points.flags.writeable = False
    return LinePoints(marking=lines.marking, starts=lines.starts, index=lines.index, points_ego_m=points)


def _slope(x: Array, y: Array, grid_m: Array) -> Array:
    """Return dy/dx (G,) of one line on the grid, from chords of about `CHORD_M`.

    Between neighbours of 0.1 m the pixel grid would turn the normal by tens of degrees.
    """
    stride = max(int((len(x) - 1) * CHORD_M / max(x[-1] - x[0], CHORD_M)), 1)
    x_node, y_node = x[::stride], y[::stride]
    if len(x_node) < 2:
        return np.zeros(len(grid_m))
    run = x_node[1:] - x_node[:-1]
    return np.asarray(np.interp(grid_m, x_node[:-1] + 0.5 * run, (y_node[1:] - y_node[:-1]) / run))
