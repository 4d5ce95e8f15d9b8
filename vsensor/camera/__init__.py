"""What the optics let the sensor see: lens, pixel grid, occlusion, and back to the road (P1 2.1)."""

from vsensor.camera.config import CameraConfig
from vsensor.camera.look import observe
from vsensor.camera.optics import (
    OPTICAL_CENTRE_M,
    Camera,
    camera_from_ego,
    in_image,
    normalised,
    project,
    unproject,
)
from vsensor.camera.road import HORIZON_M, SIGMA_FLOOR_M, on_road

__all__ = [
    "HORIZON_M",
    "OPTICAL_CENTRE_M",
    "SIGMA_FLOOR_M",
    "Camera",
    "CameraConfig",
    "camera_from_ego",
    "in_image",
    "normalised",
    "observe",
    "on_road",
    "project",
    "unproject",
]
