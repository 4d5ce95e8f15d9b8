"""Rigid transforms, named `a_from_b`: neighbours must match.

Frames: world (x east, y north, z up), ego (ISO 8855: x forward, y left, z up), camera (optical:
x right, y down, z forward). All rotations are active; `R_world_from_ego = Rz(yaw) Ry(pitch) Rx(roll)`
with ISO 8855 signs, so positive pitch is nose down (ERRATA, P1 eq. 2.4).
"""

from dataclasses import dataclass
from math import atan2, cos, hypot, sin

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CAMERA_FROM_FORWARD_LEFT_UP: Array = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Rotation from a forward-left-up frame fixed to the camera to its optical frame."""


@dataclass(frozen=True, slots=True)
class Rigid:
    """`x_a = rotation @ x_b + translation`: rotation (3, 3), translation (3,) in metres of frame a."""

    rotation: Array
    translation: Array


def rotation_from_rpy(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Array:
    """Return `Rz(yaw) Ry(pitch) Rx(roll)`, active, shape (3, 3)."""
    cr, sr = cos(roll_rad), sin(roll_rad)
    cp, sp = cos(pitch_rad), sin(pitch_rad)
    cy, sy = cos(yaw_rad), sin(yaw_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(rotation: Array) -> tuple[float, float, float]:
    """Return (roll, pitch, yaw) in rad of a rotation (3, 3); at pitch +-90 degrees roll is 0."""
    cos_pitch = hypot(rotation[0, 0], rotation[1, 0])
    pitch = atan2(-rotation[2, 0], cos_pitch)
    if cos_pitch < 1e-12:  # gimbal lock: only yaw -+ roll is defined
        return 0.0, pitch, atan2(-rotation[0, 1], rotation[1, 1])
    yaw = atan2(rotation[1, 0], rotation[0, 0])
    if cos_pitch > 1e-3:
        return atan2(rotation[2, 1], rotation[2, 2]), pitch, yaw
    # Near the lock rounding leaves roll and yaw each uncertain by 1e-16 / cos_pitch, but not what they
    # make together: roll is what this yaw leaves of the rotation.
    c, s = cos(yaw), sin(yaw)
    roll = atan2(s * rotation[0, 2] - c * rotation[1, 2], c * rotation[1, 1] - s * rotation[0, 1])
    return roll, pitch, yaw


def compose(a_from_b: Rigid, b_from_c: Rigid) -> Rigid:
    """Return `a_from_c`."""
    return Rigid(
        a_from_b.rotation @ b_from_c.rotation,
        a_from_b.rotation @ b_from_c.translation + a_from_b.translation,
    )


def invert(a_from_b: Rigid) -> Rigid:
    """Return `b_from_a`."""
    transposed = a_from_b.rotation.T
    return Rigid(transposed, -(transposed @ a_from_b.translation))


def transform(a_from_b: Rigid, points_b_m: Array) -> Array:
    """Return points (N, 3) of frame b in frame a.

    For a large translation subtract first (`relative_to`): world coordinates of 5e6 m leave
    1e-9 m in float64, which is enough here but not in float32.
    """
    return points_b_m @ a_from_b.rotation.T + a_from_b.translation


def relative_to(world_from_a: Rigid, points_world_m: Array) -> Array:
    """Return world points (N, 3) in frame a, the origin subtracted before the rotation."""
    return (points_world_m - world_from_a.translation) @ world_from_a.rotation
