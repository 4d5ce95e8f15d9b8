"""What tests of the camera look at, through which camera, and what of it they compare."""

import numpy as np

from tests.roads import marking, snapshot, straight
from vsensor.camera import Camera, CameraConfig, observe
from vsensor.distortion import DistortionConfig
from vsensor.scene import SceneConfig

CALIBRATED = {"fx_px": 1200.0, "fy_px": 1150.0, "cx_px": 655.0, "cy_px": 380.5}
LENS = DistortionConfig(k1=-0.3, k2=0.12, k3=-0.02, p1=1e-3, p2=-5e-4)
X0, H = 1.9, 1.35  # where the default camera stands


def camera(**settings):
    return Camera.from_config(CameraConfig(**settings))


def look(markings, vehicle=None, **settings):
    return observe(camera(**settings), SceneConfig(), snapshot(markings, (), vehicle))


def optical_points(count=3000, seed=1):
    rng = np.random.default_rng(seed)
    z = rng.uniform(0.6, 150, count)
    return np.column_stack([z * rng.uniform(-0.7, 0.7, count), z * rng.uniform(-0.5, 0.5, count), z])


def lanes():
    return [straight(y, number) for number, y in enumerate((-5.25, -1.75, 1.75, 5.25))]


def scattered(lines=300, count=30):
    """Return lines of points so far apart along the road that few share a row of pixels."""
    rng = np.random.default_rng(4)
    return [
        marking(np.column_stack([np.sort(rng.uniform(5, 100, count)), rng.uniform(-6, 6, count)]), number)
        for number in range(lines)
    ]


def seen_and_real(found):
    """Return the points (N, 3) as seen, and where they really are."""
    real = {}
    for line, place in ((found.candidates, "real"), (found.lines, "seen")):
        keys = np.repeat(line.marking, np.diff(line.starts)) * 1_000_000 + line.index
        real[place] = dict(zip(keys.tolist(), line.points_ego_m, strict=True))
    keys = list(real["seen"])
    return np.array([real["seen"][key] for key in keys]), np.array([real["real"][key] for key in keys])
