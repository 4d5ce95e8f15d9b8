"""Obstacles as boxes: in a frame near them, their corners and faces."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsensor.transforms import Rigid
from vsensor.types import Array, BoolArray, IntArray, Obstacle

_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
FACES = np.array([[0, 1, 3, 2], [0, 4, 5, 1], [0, 2, 6, 4], [4, 6, 7, 5], [2, 3, 7, 6], [1, 5, 7, 3]])
"""Corners of the faces -x, -y, -z, +x, +y, +z, counterclockwise as seen from outside."""
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
"""Corners of the two triangles of a face."""


@dataclass(frozen=True, slots=True)
class Boxes:
    """M boxes in one frame: `centre_m` (M, 3), `half_m` (M, 3), `rotation` frame_from_box (M, 3, 3)."""

    centre_m: Array
    half_m: Array
    rotation: Array


@dataclass(frozen=True, slots=True)
class Solids:
    """M boxes relative to the camera, and which faces are turned to it.

    `corners_m` (M, 8, 3); `is_front` (M, 6); outward `normals` (M, 6, 3); the camera's height above
    each face's plane, `heights_m` (M, 6).
    """

    corners_m: Array
    is_front: BoolArray
    normals: Array
    heights_m: Array

    def pick(self, which: IntArray) -> "Solids":
        """Return these boxes."""
        return Solids(self.corners_m[which], self.is_front[which], self.normals[which], self.heights_m[which])


def boxes_in(world_from_frame: Rigid, obstacles: Sequence[Obstacle]) -> Boxes:
    """Return the obstacles as boxes in a frame near them, the frame's origin subtracted first."""
    centres = np.array([box.centre_world_m for box in obstacles]).reshape(-1, 3)
    sizes = np.array([box.size_m for box in obstacles]).reshape(-1, 3)
    angles = np.array([(box.roll_rad, box.pitch_rad, box.yaw_rad) for box in obstacles]).reshape(-1, 3).T
    rotation = world_from_frame.rotation
    return Boxes(
        (centres - world_from_frame.translation) @ rotation,
        0.5 * np.abs(sizes),
        rotation.T @ _rotations(np.cos(angles), np.sin(angles)),
    )


def solids_of(origin_m: Array, boxes: Boxes, local: Array) -> Solids:
    """Return the boxes relative to the camera, which is at `local` (M, 3) in their own frames."""
    outward = boxes.rotation.transpose(0, 2, 1)  # row k is the normal of face +k
    corners = (boxes.half_m[:, None] * _CORNERS) @ outward + (boxes.centre_m - origin_m)[:, None]
    heights = np.concatenate([-local - boxes.half_m, local - boxes.half_m], axis=1)
    return Solids(corners, heights > 0.0, np.concatenate([-outward, outward], axis=1), heights)


def box_triangles(boxes: Boxes) -> Array:
    """Return the boxes' faces as triangles (12 M, 3, 3) in their common frame."""
    corners = (boxes.half_m[:, None] * _CORNERS) @ boxes.rotation.transpose(0, 2, 1) + boxes.centre_m[:, None]
    triangles: Array = corners[:, FACES][:, :, HALVES].reshape(-1, 3, 3)
    return triangles


def _rotations(cosines: Array, sines: Array) -> Array:
    """Return Rz(yaw) Ry(pitch) Rx(roll) for rows (roll, pitch, yaw) of (3, M), as (M, 3, 3)."""
    (cr, cp, cy), (sr, sp, sy) = cosines, sines
    rotation = np.empty((cosines.shape[1], 3, 3))
    rotation[:, 0, 0], rotation[:, 1, 0], rotation[:, 2, 0] = cy * cp, sy * cp, -sp
    rotation[:, 0, 1], rotation[:, 1, 1] = cy * sp * sr - sy * cr, sy * sp * sr + cy * cr
    rotation[:, 0, 2], rotation[:, 1, 2] = cy * sp * cr + sy * sr, sy * sp * cr - cy * sr
    rotation[:, 2, 1], rotation[:, 2, 2] = cp * sr, cp * cr
    return rotation
