"""A camera that hangs upside down, as its file says by roll_deg: its pictures are turned before use."""

import msgspec
import numpy as np

from vsensor.camera import Camera, CameraConfig
from vsensor.distortion import DistortionConfig
from vsensor.video.line_points import Grey


def is_turned(config: CameraConfig) -> bool:
    """Return whether the camera hangs upside down, as its file says."""
    return abs(config.roll_deg) > 90.0


def upright_camera(config: CameraConfig) -> CameraConfig:
    """Return the camera that takes a hanging camera's pictures turned by half a turn; others as they are."""
    if not is_turned(config):
        return config
    camera = Camera.from_config(config)
    lens = config.distortion
    return msgspec.structs.replace(
        config,
        hfov_deg=None,
        fx_px=camera.fx_px,
        fy_px=camera.fy_px,
        cx_px=config.width_px - 1 - camera.cx_px,
        cy_px=config.height_px - 1 - camera.cy_px,
        distortion=DistortionConfig(k1=lens.k1, k2=lens.k2, k3=lens.k3, p1=-lens.p1, p2=-lens.p2),
        roll_deg=config.roll_deg - 180.0 if config.roll_deg > 0.0 else config.roll_deg + 180.0,
    )


def upright_grey(grey: Grey, config: CameraConfig) -> Grey:
    """Return a picture the right way up."""
    return np.ascontiguousarray(grey[::-1, ::-1]) if is_turned(config) else grey
