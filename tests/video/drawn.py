"""Pictures of a straight road, drawn: light bands on grey, each where the camera has it."""

import cv2
import numpy as np

from vsensor.camera import Camera, CameraConfig, project
from vsensor.signals import VehicleConfig
from vsensor.transforms import transform
from vsensor.video import Picture

EOR = CameraConfig(
    width_px=355,
    height_px=288,
    fx_px=255.82,
    fy_px=280.99,
    cx_px=179.39,
    cy_px=143.19,
    position_m=(1.8, 0.19, 1.36),
)
"""P2's tables 2.2 and 2.3; 1 m behind the front axle of the default vehicle."""
VEHICLE = VehicleConfig()
WIDTH_M = 0.15
ROAD, PAINT = 90, 200


def road_picture(config=EOR, left_m=1.7, right_m=-1.6, slope=0.0, index=0, noise=2.0, period_ns=100_000_000):
    """Return a picture with the centres of two lines at y(0) = `left_m`, `right_m`; None: no such line."""
    camera = Camera.from_config(config)
    grey = np.full((config.height_px, config.width_px), ROAD, np.uint8)
    for y_m in (left_m, right_m):
        if y_m is not None:
            paint(grey, camera, y_m, slope)
    spoiled = grey + np.random.default_rng(index).normal(0.0, noise, grey.shape)
    return Picture(index=index, t_ns=index * period_ns, grey=np.clip(spoiled, 0, 255).astype(np.uint8))


def paint(grey, camera, y_m, slope, width_m=WIDTH_M, level=PAINT):
    """Paint a band y = `y_m` + `slope` x."""
    x_m = np.geomspace(camera.config.position_m[0] + 1.0, 120.0, 200)
    sides = [
        np.column_stack([x_m, y_m + slope * x_m + half_m, np.zeros_like(x_m)])
        for half_m in (width_m / 2, -width_m / 2)
    ]
    pixels = [project(camera, transform(camera.camera_from_body, points)) for points in sides]
    outline = np.concatenate([pixels[0], pixels[1][::-1]])
    cv2.fillPoly(grey, [np.rint(outline * 16).astype(np.int32)], level, cv2.LINE_AA, 4)
