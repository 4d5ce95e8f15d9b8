"""The RAV4 drive's GNSS pose in local coordinates, and how far a path drifts from it."""

from dataclasses import dataclass
from math import atan2, cos, hypot, sin, sqrt

import numpy as np

from tests.shared import SHARED_DATA

POSE = SHARED_DATA / "ego/rav4_pose/global_pose"
LOG_MINUS_POSE_NS = 1_533_177_678_415_000_000  # SOURCES.md


def east_north_m(ecef_m):
    """Return (N, 2) east and north of the first point, WGS 84."""
    x, y, z = ecef_m[0]
    e2 = (2 - 1 / 298.257223563) / 298.257223563
    latitude = atan2(z, hypot(x, y) * (1 - e2))
    for _ in range(6):
        normal = 6_378_137.0 / sqrt(1 - e2 * sin(latitude) ** 2)
        latitude = atan2(z + e2 * normal * sin(latitude), hypot(x, y))
    longitude = atan2(y, x)
    east = (-sin(longitude), cos(longitude), 0.0)
    north = (-sin(latitude) * cos(longitude), -sin(latitude) * sin(longitude), cos(latitude))
    return (ecef_m - ecef_m[0]) @ np.array([east, north]).T


@dataclass(frozen=True)
class Drift:
    """Position error at the end of the measured kilometre, along and across the drive, and the largest."""

    length_m: float
    along_m: float
    across_m: float
    largest_m: float

    @property
    def end_m(self):
        return hypot(self.along_m, self.across_m)


def drift(t_ns, x_m, y_m, align_m=100.0, length_m=1000.0):
    """Compare a path with the GNSS pose after turning and shifting it to agree over the first `align_m`."""
    pose_ns = LOG_MINUS_POSE_NS + np.round(np.load(POSE / "frame_times") * 1e9).astype(np.int64)
    truth = east_north_m(np.load(POSE / "frame_positions"))
    known = (pose_ns >= t_ns[0]) & (pose_ns <= t_ns[-1])
    truth, at = truth[known], (pose_ns[known] - t_ns[0]) / 1e9
    path = np.column_stack([np.interp(at, (t_ns - t_ns[0]) / 1e9, line) for line in (x_m, y_m)])
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth, axis=0).T))])
    first = driven <= align_m
    a, b = path[first] - path[first].mean(0), truth[first] - truth[first].mean(0)
    turn = atan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    rotation = np.array([[cos(turn), -sin(turn)], [sin(turn), cos(turn)]])
    error = (path - path[first].mean(0)) @ rotation.T + truth[first].mean(0) - truth
    end = min(int(np.searchsorted(driven, length_m)), len(driven) - 1)
    ahead = truth[end] - truth[max(0, end - 20)]
    ahead = ahead / hypot(*ahead)
    return Drift(
        length_m=float(driven[end]),
        along_m=float(error[end] @ ahead),
        across_m=float(error[end] @ np.array([-ahead[1], ahead[0]])),
        largest_m=float(np.hypot(*error[: end + 1].T).max()),
    )
