"""P2's steps, each against what its equation says."""

import numpy as np
import pytest

from tests.video.drawn import EOR
from vsensor.camera import Camera, CameraConfig, project
from vsensor.distortion import DistortionConfig
from vsensor.transforms import transform
from vsensor.types import Side
from vsensor.video import Picture
from vsensor.video.published import PublishedConfig
from vsensor.video.published.ground import boundary, straight_camera
from vsensor.video.published.hough import ImageLine, accumulate, peaks, side_line
from vsensor.video.published.masks import (
    binary,
    borders,
    cleaned,
    optimal_threshold,
    responses,
    row_median,
    white_zones,
)
from vsensor.video.published.prepare import Straightener, static_area, straight_maps, under_parabola

CONFIG = PublishedConfig()
BENT = CameraConfig(
    width_px=200,
    height_px=120,
    hfov_deg=60.0,
    distortion=DistortionConfig(k1=-0.3, k2=0.1, k3=-0.02, p1=0.002, p2=-0.003),
    pitch_deg=3.0,
    yaw_deg=-1.0,
    position_m=(1.5, 0.1, 1.3),
)


# ---- undistortion, eq. 2.14 and 2.15 ----------------------------------------------------------------------


def test_the_maps_say_where_the_bent_picture_has_the_ray_of_a_straight_pixel():
    bent, straight = Camera.from_config(BENT), straight_camera(Camera.from_config(BENT))
    u, v = straight_maps(bent)
    points = np.array([[0.2, 0.1, 1.0], [-0.3, 0.15, 1.0], [0.0, -0.2, 1.0]])
    places = np.rint(project(straight, points)).astype(int)
    rays = np.column_stack(
        [
            (places[:, 0] - straight.cx_px) / straight.fx_px,
            (places[:, 1] - straight.cy_px) / straight.fy_px,
            np.ones(3),
        ]
    )
    expected = project(bent, rays)
    found = np.column_stack([u[places[:, 1], places[:, 0]], v[places[:, 1], places[:, 0]]])
    np.testing.assert_allclose(found, expected, atol=1e-4)  # maps are float32


def test_a_camera_without_distortion_leaves_its_pictures_alone():
    grey = np.arange(288 * 355, dtype=np.uint8).reshape(288, 355)
    assert Straightener(Camera.from_config(EOR))(grey) is grey


# ---- static pixels -----------------------------------------------------------------------------------------


def moving_pictures(bonnet, count=25, shape=(100, 160)):
    rng = np.random.default_rng(1)
    for index in range(count):
        grey = rng.integers(0, 256, shape, dtype=np.uint8)
        grey[bonnet] = 40
        yield Picture(index=index, t_ns=index, grey=grey)


def bonnet_area(shape=(100, 160)):
    column = np.arange(shape[1])
    return np.arange(shape[0])[:, None] >= 80.0 + 12.0 * ((column - 80.0) / 80.0) ** 2


def static_of(pictures, shape=(100, 160)):
    config = CameraConfig(width_px=shape[1], height_px=shape[0])
    return static_area(CONFIG, Straightener(Camera.from_config(config)), pictures)


def test_the_bonnet_is_what_lies_under_a_parabola_along_its_border():
    bonnet = bonnet_area()
    found = static_of(moving_pictures(bonnet))
    rows = np.abs(found.sum(axis=0).astype(int) - bonnet.sum(axis=0))
    assert rows.max() <= 2  # pixels: a closing of 5, and the regression


def test_a_video_that_changes_everywhere_has_no_bonnet():
    assert static_of(moving_pictures(np.zeros((100, 160), bool))) is None


def test_a_video_that_never_changes_has_no_bonnet():
    assert under_parabola(np.ones((100, 160), bool)) is None


def test_even_asphalt_that_paint_passes_is_no_bonnet():
    static = np.arange(100)[:, None] >= np.full(160, 50)
    static[:, 20:60] = False  # where a dashed line came by
    assert under_parabola(static) is None


def test_too_few_pictures_say_nothing_of_what_is_static():
    assert static_of(moving_pictures(bonnet_area(), count=CONFIG.static_pictures - 1)) is None


# ---- white zones -------------------------------------------------------------------------------------------


def test_the_row_median_is_that_of_every_row_for_itself():
    grey = np.random.default_rng(2).integers(0, 256, (5, 40), dtype=np.uint8)
    padded = np.pad(grey, ((0, 0), (4, 4)), mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 9, axis=1)
    np.testing.assert_array_equal(row_median(grey, 9), np.median(windows, axis=2))


@pytest.mark.parametrize(("lighter", "is_white"), [(20, False), (21, True), (199, True), (200, False)])
def test_white_is_lighter_than_the_median_by_more_than_t1_and_less_than_t2(lighter, is_white):
    grey = np.full((20, 200), 30, np.uint8)
    grey[:, 100:108] += np.uint8(lighter)
    mask = white_zones(CONFIG, grey)
    assert mask[:, 100:108].all() if is_white else not mask.any()
    assert not mask[:, :99].any()


def test_small_patches_go_and_holes_of_a_pixel_are_closed():
    mask = np.zeros((30, 30), bool)
    mask[2:5, 2:5] = True
    mask[10:20, 10:20] = True
    mask[15, 15] = False
    found = cleaned(mask, 20)
    assert found.sum() == 100
    assert not found[:6].any()


# ---- borders -----------------------------------------------------------------------------------------------


def test_a_step_up_answers_in_one_filter_and_a_step_down_in_the_other():
    grey = np.full((3, 40), 50, np.uint8)
    grey[:, 15:25] = 90
    right, left = responses(grey)
    np.testing.assert_array_equal(np.flatnonzero(right[1]), [13, 14, 15, 16])
    np.testing.assert_array_equal(right[1, 13:17], [40, 80, 80, 40])  # eq. 2.19
    np.testing.assert_array_equal(np.flatnonzero(left[1]), [23, 24, 25, 26])


def test_the_optimal_threshold_is_in_the_middle_of_the_two_means_that_it_parts():
    rng = np.random.default_rng(3)
    values = np.clip(np.concatenate([rng.normal(20, 8, 4000), rng.normal(140, 20, 900)]), 0, 255)
    values = values.astype(np.uint8).reshape(70, 70)
    threshold = optimal_threshold(values)
    middle = (values[values <= threshold].mean() + values[values > threshold].mean()) / 2
    assert threshold == pytest.approx(middle)
    assert 60 < threshold < 100


def test_each_half_has_a_threshold_of_its_own():
    response = np.zeros((20, 100), np.uint8)
    response[:, 10:14], response[:, 30:33] = 200, 60
    response[:, 60:64] = 60  # the strongest of its half
    mask = binary(CONFIG, response)
    assert mask[:, 10:14].all()
    assert mask[:, 60:64].all()
    assert not mask[:, 30:33].any()


def test_both_edges_of_a_marking_are_in_the_borders():
    grey = np.full((10, 60), 60, np.uint8)
    grey[:, 20:30] = 180
    found = np.flatnonzero(borders(CONFIG, grey)[5])
    assert {19, 20, 29, 30} <= set(found.tolist())
    assert not {5, 25, 50} & set(found.tolist())


def test_a_black_picture_with_noise_has_no_borders():
    grey = np.random.default_rng(4).integers(0, 3, (60, 80), dtype=np.uint8)
    assert not borders(CONFIG, grey).any()


# ---- lines -------------------------------------------------------------------------------------------------


def mask_of(rho_px, theta_deg, shape=(140, 355), first_row=148):
    """Return the mask of one exact line."""
    v, u = np.indices(shape)
    theta = np.radians(theta_deg)
    return np.abs(u * np.cos(theta) + (v + first_row) * np.sin(theta) - rho_px) <= 0.5


def test_a_line_is_found_where_it_is():
    line = side_line(PublishedConfig(lines=1), mask_of(220.0, 47.0), 148, is_left=True)
    assert np.degrees(line.theta_rad) == pytest.approx(47.0)
    assert line.rho_px == pytest.approx(220.0)
    v = np.array([150.0, 280.0])
    np.testing.assert_allclose(line.u_at(v) * np.cos(line.theta_rad) + v * np.sin(line.theta_rad), 220.0)


def test_a_line_of_the_other_side_is_none_of_this_one():
    assert side_line(CONFIG, mask_of(40.0, -50.0), 148, is_left=True) is None
    assert side_line(CONFIG, mask_of(40.0, -50.0), 148, is_left=False) is not None


@pytest.mark.parametrize("theta_deg", [5.0, 88.0])
def test_posts_and_the_horizon_are_no_lines(theta_deg):
    config = PublishedConfig(least_votes=120)
    assert side_line(config, mask_of(200.0, theta_deg), 148, is_left=True) is None


def test_the_line_of_a_side_is_the_median_of_three():
    mask = mask_of(200.0, 45.0) | mask_of(230.0, 45.0) | mask_of(290.0, 45.0)
    line = side_line(CONFIG, mask, 148, is_left=True)
    assert line.found == 3
    assert line.rho_px == pytest.approx(230.0)


def test_peaks_are_no_neighbours_and_none_is_below_the_least():
    votes = np.zeros((801, 61), np.int64)
    votes[400, 30], votes[405, 30], votes[430, 30], votes[600, 10] = 100, 99, 80, 20
    assert peaks(votes, 3, 50.0) == [(400, 30), (430, 30)]


def test_every_pixel_votes_once_at_every_angle():
    mask = np.random.default_rng(5).random((30, 40)) < 0.1
    votes, _ = accumulate(mask, 30, np.radians(np.arange(20.0, 81.0)))
    np.testing.assert_array_equal(votes.sum(axis=0), mask.sum())


def test_an_empty_mask_has_no_line():
    assert side_line(CONFIG, np.zeros((140, 355), bool), 148, is_left=True) is None


# ---- to the road -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("y_m", "slope"), [(1.7, 0.0), (1.2, 0.03), (-1.9, -0.02)])
def test_a_line_of_the_picture_is_the_line_of_the_road_that_it_is_the_image_of(y_m, slope):
    config = CameraConfig(
        width_px=640, height_px=480, hfov_deg=60.0, pitch_deg=4.0, yaw_deg=1.5, roll_deg=-2.0
    )
    camera = straight_camera(Camera.from_config(config))
    x_m = np.array([6.0, 30.0])
    ground = np.column_stack([x_m, y_m + slope * x_m, np.zeros(2)])
    (u_0, v_0), (u_1, v_1) = project(camera, transform(camera.camera_from_body, ground))
    theta = np.arctan2(u_0 - u_1, v_1 - v_0)
    theta -= np.pi * (theta > np.pi / 2)
    line = ImageLine(rho_px=float(u_0 * np.cos(theta) + v_0 * np.sin(theta)), theta_rad=float(theta), found=3)
    v, u = np.indices((240, 640))
    mask = np.abs(u * np.cos(theta) + (v + 240) * np.sin(theta) - line.rho_px) < 1.0
    found = boundary(camera, line, Side.LEFT, mask, 240)
    np.testing.assert_allclose(found.coefficients, [y_m, slope], atol=1e-9)
    assert found.quality == 3
    assert found.x_min_m < 6.0
    assert found.x_max_m > 20.0


def test_a_line_that_does_not_meet_the_road_ahead_is_none():
    up = CameraConfig(width_px=640, height_px=480, hfov_deg=60.0, pitch_deg=-40.0)
    camera = straight_camera(Camera.from_config(up))
    line = ImageLine(rho_px=400.0, theta_rad=float(np.radians(45.0)), found=3)
    assert boundary(camera, line, Side.LEFT, np.ones((240, 640), bool), 240) is None
