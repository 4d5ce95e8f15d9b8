"""Our method on real pictures; what it finds was looked at, drawn over each of them."""

import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.camera import Camera, CameraConfig
from vsensor.distortion import DistortionConfig
from vsensor.signals import VehicleConfig
from vsensor.video.frames import open_pictures
from vsensor.video.ridge import Ridge, RidgeConfig
from vsensor.video.rows import rows_of
from vsensor.video.types import Motion

CAMERAS = SHARED_DATA / "camera"
LANELINES = CameraConfig(
    width_px=960,
    height_px=540,
    fx_px=868.0,
    fy_px=868.0,
    cx_px=479.5,
    cy_px=315.0,
    position_m=(1.8, 0.0, 1.2),
)
"""Not calibrated: three quarters of the other camera's focal length; horizon and 3.6 m of lane as seen."""
ADVANCED = CameraConfig(
    width_px=1280,
    height_px=720,
    fx_px=1159.1,
    fy_px=1154.5,
    cx_px=669.6,
    cy_px=388.1,
    distortion=DistortionConfig(k1=-0.2578, k2=0.0455, p1=-0.00073, p2=0.00017, k3=-0.1149),
    position_m=(1.8, 0.0, 1.27),
    pitch_deg=-1.4,
)
"""From the chessboards beside the pictures; pitch and height from its two straight roads."""
VEHICLE = VehicleConfig()


def rows(camera, path, one_by_one=False):
    """Return what is seen of the pictures of a path, each for itself if asked."""
    method = Ridge(RidgeConfig(), Camera.from_config(camera), VEHICLE)
    state, estimates = method.begin(), []
    with open_pictures(path) as pictures:
        for picture in pictures:
            state, estimate = method.look(method.begin() if one_by_one else state, picture, Motion())
            estimates.append(estimate)
    return rows_of(VEHICLE, estimates)


@needs_shared
def test_on_the_real_drive_both_lines_are_there_and_the_lane_is_equally_wide():
    seen = rows(LANELINES, CAMERAS / "carnd_lanelines" / "solidWhiteRight.mp4")
    assert len(seen) == 221
    both = (seen.left_confidence > 0) & (seen.right_confidence > 0)
    assert both.mean() >= 0.95
    assert np.nanstd(seen.lane_width_m) <= 0.1
    assert (seen.right_confidence >= 3).mean() > 0.95


@needs_shared
@pytest.mark.parametrize(
    ("camera", "pictures", "count"),
    [
        (LANELINES, CAMERAS / "carnd_lanelines" / "*.jpg", 6),
        (ADVANCED, CAMERAS / "carnd_advanced" / "test_images" / "*.jpg", 8),
    ],
    ids=["lanelines", "advanced"],
)
def test_single_pictures_with_shadows_concrete_and_yellow_paint_give_both_lines(camera, pictures, count):
    seen = rows(camera, pictures, one_by_one=True)
    assert len(seen) == count
    assert (seen.left_confidence > 0).all()
    assert (seen.right_confidence > 0).all()
    assert np.ptp(seen.lane_width_m) < 0.8
    np.testing.assert_allclose(seen.lane_width_m, 3.6, atol=0.4)
