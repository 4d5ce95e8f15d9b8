"""Pitch and yaw to a fraction of a degree, from nothing: seen with the right ones, lines run straight ahead.

Line points of many pictures are laid on the road for each pair of angles. Where the vanishing point is right,
the points of a line share one distance to the side, and the histogram of these is at its sharpest.
"""

from collections.abc import Sequence
from math import radians

import numpy as np

from vsensor.types import Array, IntArray
from vsensor.video.parallel import Mount

REACH_RAD = radians(5.0)
"""Angles are looked for so far from those given."""
PRIOR_RAD = radians(4.0)
"""A single clear line is sharp along a whole valley of angles: the nearest to those given are taken."""
FIRST_STEP_RAD, LAST_STEP_RAD = radians(1.0), radians(0.25)
BIN, WIDEST = 0.006, 0.6
"""Of distances to the side, in terms of the median distance ahead."""
NEAREST_M, FARTHEST_M = 2.0, 60.0


def straightest(rays: Sequence[Array], mount: Mount) -> Mount:
    """Return the mount with the angles that show the points (3, N) of each picture most straight ahead."""
    points = np.concatenate(list(rays), axis=1)
    picture = np.repeat(np.arange(len(rays)), [one.shape[1] for one in rays])
    step, reach = FIRST_STEP_RAD, REACH_RAD
    best = mount
    while True:
        turns = np.arange(-round(reach / step), round(reach / step) + 1) * step
        around = best
        candidates = [
            around._replace(pitch_rad=around.pitch_rad + dp, yaw_rad=around.yaw_rad + dy)
            for dp in turns
            for dy in turns
        ]
        best = max(candidates, key=lambda one: _score(points, picture, len(rays), one, mount))
        if step <= LAST_STEP_RAD:
            return best
        step, reach = step / 2.0, step


def _score(points: Array, picture: IntArray, pictures: int, mount: Mount, given: Mount) -> float:
    """Return the sharpness, less where the angles are far from those given."""
    away = np.hypot(mount.pitch_rad - given.pitch_rad, mount.yaw_rad - given.yaw_rad) / PRIOR_RAD
    return _sharpness(points, picture, pictures, mount) * float(np.exp(-0.5 * away * away))


def _sharpness(points: Array, picture: IntArray, pictures: int, mount: Mount) -> float:
    """Return how much the points of each picture share few distances to the side."""
    x, y, meets = mount.on_road(points)
    x = x - mount.position_m[0]
    ahead = meets & (x > NEAREST_M) & (x < FARTHEST_M)
    if not ahead.any():
        return 0.0
    y = y / float(np.median(x[ahead]))  # what is nearer by a steeper pitch is narrower, not sharper
    inside = ahead & (np.abs(y) < WIDEST)
    bins = round(2.0 * WIDEST / BIN)
    place = ((y[inside] + WIDEST) / BIN).astype(int).clip(0, bins - 1)
    counts = np.bincount(picture[inside] * bins + place, minlength=pictures * bins).reshape(pictures, bins)
    smooth = counts[:, :-1] + counts[:, 1:]
    return float((smooth * smooth).sum())
