"""Measured lines seen through a camera that stands elsewhere than was thought (P2 2.6.1.2).

    line on the road ──true camera──► its rays ──changed camera──► another line on the road ──► offset

A straight line on the road is a straight line in an undistorted image and one on the road again, so that two
of its points are all of it. What this neglects: the detection itself. A method that looks for paint of a
width in metres, or where it expects the line, sees other things under another camera.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vsensor.camera import CameraConfig
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
_AT_ONCE = 200_000  # lines under changes: 10 MB an array


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
    rays = (points - np.array(camera.position_m)) @ _rotations(camera, np.zeros((1, 5)))[0]
    found = np.empty((len(changes), len(lines)))
    at_once = max(1, _AT_ONCE // max(len(lines), 1))
    for first in range(0, len(changes), at_once):
        part = changes[first : first + at_once]
        turned = rays[None] @ _rotations(camera, part).transpose(0, 2, 1)[:, None]  # (P, 2, L, 3)
        x, left, height = camera.position_m
        down = np.where(turned[..., 2] < -1e-9, -turned[..., 2], np.nan)
        reach = (height + part[:, 0])[:, None, None] / down
        x1, x2 = (x + reach * turned[..., 0]).transpose(1, 0, 2)
        y1, y2 = (left + part[:, 1, None, None] + reach * turned[..., 1]).transpose(1, 0, 2)
        found[first : first + at_once] = y1 + (axle_x_m - x1) * (y2 - y1) / (x2 - x1)
    return found


def _rotations(camera: CameraConfig, changes: Array) -> Array:
    """Return (P, 3, 3): the mount's forward-left-up frame in the ego frame, Rz(yaw) Ry(pitch) Rx(roll)."""
    mounted = np.array([camera.yaw_deg, camera.pitch_deg, camera.roll_deg])
    turned = Rotation.from_euler("ZYX", mounted + changes[:, 2:], degrees=True)
    return np.asarray(turned.as_matrix(), np.float64)
