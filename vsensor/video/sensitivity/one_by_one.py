"""One parameter at a time, the others as they are (P2 2.6.1.2, fig. 3.17 to 3.20)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsensor.camera import CameraConfig
from vsensor.types import Array
from vsensor.video.sensitivity.reproject import ANGLES, DISTANCES, PARAMETERS, Lines, changed_offsets

STEPS = 41
BAND = (0.05, 0.95)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """How the offsets change with one parameter: `change` (S,) of it in its unit.

    Original less changed distance from the vehicle (2.43, 2.44 as the errata have them), (2, S) of left and
    right: the mean in m, in % of the original, and the quantiles BAND in m.
    """

    change: Array
    mean_m: Array
    mean_percent: Array
    low_m: Array
    high_m: Array


def one_by_one(
    camera: CameraConfig,
    axle_x_m: float,
    lines: Sequence[Lines],
    *,
    angle_deg: float = 3.0,
    distance_m: float = 0.3,
) -> dict[str, Course]:
    """Return the course of every parameter; `lines` are those of the left and of the right side."""
    found = {}
    for place, name in enumerate(PARAMETERS):
        most = angle_deg if name in ANGLES else distance_m
        change = np.linspace(-most, most, STEPS)
        changes = np.zeros((STEPS, len(PARAMETERS)))
        changes[:, place] = change
        sides = [_course(camera, axle_x_m, one, changes) for one in lines]
        mean, percent, low, high = (np.stack(rows) for rows in zip(*sides, strict=True))
        found[name] = Course(change=change, mean_m=mean, mean_percent=percent, low_m=low, high_m=high)
    return found


def _course(
    camera: CameraConfig, axle_x_m: float, lines: Lines, changes: Array
) -> tuple[Array, Array, Array, Array]:
    original = np.abs(lines.offset_m)
    moved = changed_offsets(camera, axle_x_m, lines, changes) * np.sign(lines.offset_m)
    less = original - moved
    whole = original > 0.1  # of next to nothing there are no percents
    percent = 100.0 * (less[:, whole] / original[whole]).mean(axis=1) if whole.any() else less.mean(axis=1)
    low, high = np.quantile(less, BAND, axis=1)
    return less.mean(axis=1), percent, low, high


def slopes_at_zero(courses: Mapping[str, Course]) -> dict[str, tuple[float, float]]:
    """Return by how many m left and right distances fall per unit of each parameter, near its true value."""
    middle = STEPS // 2
    found = {}
    for name, course in courses.items():
        step = course.change[middle + 1] - course.change[middle - 1]
        rise = (course.mean_m[:, middle + 1] - course.mean_m[:, middle - 1]) / step
        found[name] = (float(rise[0]), float(rise[1]))
    return found


__all__ = ["ANGLES", "DISTANCES", "Course", "one_by_one", "slopes_at_zero"]
