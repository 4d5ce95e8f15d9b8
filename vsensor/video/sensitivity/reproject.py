"""Measured lines seen through a camera that stands elsewhere than was thought (P2 2.6.1.2).

    line on the road ──true camera──► its rays ──changed camera──► another line on the road ──► offset

A straight line on the road is a straight line in an undistorted image and one on the road again, so that two
of its points are all of it. What this neglects: the detection itself. A method that looks for paint of a
width in metres, or where it expects the line, sees other things under another camera.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians

import numpy as np

from vsensor.camera import CameraConfig
from vsensor.transforms import rotation_from_rpy
from vsensor.types import Array

PARAMETERS: Mapping[str, str] = {
    "height": "m",
    "lateral": "m",
    "yaw": "deg",
    "pitch": "deg",
    "roll": "deg",
}
"""What P2 changed, with its unit; signs as in the camera's section: to the left, nose down."""
ANGLES = ("yaw", "pitch", "roll")
DISTANCES = ("height", "lateral")

_NEAR_M, _FAR_M = 6.0, 20.0
"""Of the two points, ahead of the front axle; which ones does not matter."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lines:
    """Measured lines as straight ones: `offset_m` (L,) at the front axle, `slope` (L,), left positive."""

    offset_m: Array
    slope: Array

    def __len__(self) -> int:
        return len(self.offset_m)


def changed_offsets(camera: CameraConfig, axle_x_m: float, lines: Lines, changes: Array) -> Array:
    """Return the offsets (P, L) that are measured with the camera changed by each row of `changes` (P, 5).

    The columns are PARAMETERS, m and degrees. NaN where the line would be seen above the horizon.
    """
    ahead = axle_x_m + np.array([_NEAR_M, _FAR_M])
    y = lines.offset_m + lines.slope * np.array([[_NEAR_M], [_FAR_M]])
    points = np.stack(np.broadcast_arrays(ahead[:, None], y, 0.0), axis=-1)
    rays = (points - np.array(camera.position_m)) @ _rotation(
        camera, np.zeros(5)
    )  # in the camera, forward-left-up
    found = np.empty((len(changes), len(lines)))
    for place, change in enumerate(changes):
        x, left, height = camera.position_m
        turned = rays @ _rotation(camera, change).T
        down = np.where(turned[..., 2] < -1e-9, -turned[..., 2], np.nan)
        reach = (height + change[0]) / down
        x1, x2 = x + reach * turned[..., 0]
        y1, y2 = left + change[1] + reach * turned[..., 1]
        found[place] = y1 + (axle_x_m - x1) * (y2 - y1) / (x2 - x1)
    return found


def _rotation(camera: CameraConfig, change: Array) -> Array:
    return rotation_from_rpy(
        radians(camera.roll_deg + change[4]),
        radians(camera.pitch_deg + change[3]),
        radians(camera.yaw_deg + change[2]),
    )
