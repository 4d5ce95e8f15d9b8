"""Views of a video with its signals drawn (P2 2.6.2)."""

import numpy as np
import pytest

from vsensor.camera import Camera, CameraConfig, project
from vsensor.distortion import DistortionConfig
from vsensor.transforms import transform
from vsensor.video.types import Picture
from vsensor.video.views import GREEN, MAGENTA, TOP_AHEAD_M, TOP_LATERAL_M, Signal, Views

AXLE_M = 2.8
CAMERA = Camera.from_config(
    CameraConfig(
        width_px=640,
        height_px=540,
        hfov_deg=60.0,
        pitch_deg=6.0,
        position_m=(1.8, 0.2, 1.4),
        distortion=DistortionConfig(k1=-0.15, k2=0.03),
    )
)


@pytest.fixture(scope="module")
def views():
    return Views(CAMERA, AXLE_M)


def seen_at(point):
    """Return the pixel of a point on the road."""
    return project(CAMERA, transform(CAMERA.camera_from_body, np.array([[*point, 0.0]])))[0]


def picture(grey=None):
    return Picture(index=3, t_ns=300_000_000, grey=np.zeros((540, 640), np.uint8) if grey is None else grey)


@pytest.mark.parametrize("point", [(7.0, 0.0), (9.0, 2.5), (16.0, -3.0)])
def test_the_top_view_has_what_lies_on_the_road_at_its_place_in_metres(views, point):
    grey = np.zeros((540, 640), np.uint8)
    u, v = np.rint(seen_at(point)).astype(int)
    grey[v - 5 : v + 6, u - 5 : u + 6] = 255
    top = views.top(picture(grey), [])
    rows, columns = np.nonzero(top[:-16, 60:, 0] > 128)  # beside the ticks
    per_m = top.shape[0] / TOP_AHEAD_M
    ahead = CAMERA.config.position_m[0] + (top.shape[0] - 0.5 - rows.mean()) / per_m
    left = TOP_LATERAL_M - (columns.mean() + 60.5) / per_m
    row_m = abs(seen_slope(point))  # a pixel of the picture is that long on the road
    assert left == pytest.approx(point[1], abs=0.05)
    assert ahead == pytest.approx(point[0], abs=2.0 * row_m)


def seen_slope(point):
    """Return how many m along the road a row of the picture is."""
    x, y = point
    return 0.1 / (seen_at((x + 0.1, y))[1] - seen_at((x, y))[1])


def test_a_signal_is_drawn_where_its_line_is_in_the_picture(views):
    image = views.front(picture(), [Signal(name="video", colour=MAGENTA, left_m=1.7, right_m=np.nan)])
    u, v = np.rint(seen_at((9.0, 1.7))).astype(int)
    assert image[v, u].tolist() == list(MAGENTA)
    right = seen_at((9.0, -1.7)).astype(int)
    assert not image[:, right[0] - 60 :].any()


def test_a_signal_follows_the_direction_of_the_lane(views):
    heading = 0.1
    signal = Signal(name="CAN", colour=GREEN, left_m=np.nan, right_m=-1.6, heading_rad=heading)
    image = views.front(picture(), [signal])
    u, v = np.rint(seen_at((10.0, -1.6 + np.tan(heading) * (10.0 - AXLE_M)))).astype(int)
    assert image[v, u].tolist() == list(GREEN)


def test_what_is_not_known_is_not_drawn(views):
    nothing = Signal(name="video", colour=MAGENTA, left_m=np.nan, right_m=np.nan)
    for view in (views.front, views.top):
        np.testing.assert_array_equal(view(picture(), [nothing]), view(picture(), []))


def test_both_views_stand_side_by_side_at_one_height(views):
    front, top, both = (view(picture(), []) for view in (views.front, views.top, views.both))
    assert both.shape == (front.shape[0], front.shape[1] + top.shape[1], 3)
    np.testing.assert_array_equal(both[200:, :640], front[200:])


def test_a_small_picture_is_enlarged_before_anything_is_drawn():
    small = Camera.from_config(CameraConfig(width_px=355, height_px=288, hfov_deg=70.0))
    image = Views(small, AXLE_M).front(Picture(index=0, t_ns=0, grey=np.zeros((288, 355), np.uint8)), [])
    assert image.shape == (576, 710, 3)
