"""The camera's further models: calibrated intrinsics, a lens, an end of sight."""

import numpy as np
import pytest

from tests import p1
from tests.looks import CALIBRATED, LENS, X0, H, camera, lanes, look, optical_points, scattered
from tests.roads import ego, marking, snapshot, straight
from vsensor.camera import (
    CameraConfig,
    camera_from_ego,
    in_image,
    observe,
    project,
    unproject,
)
from vsensor.camera.sight import apparent_width_px
from vsensor.distortion import DistortionConfig
from vsensor.errors import ConfigError
from vsensor.scene import SceneConfig
from vsensor.schema import convert
from vsensor.transforms import transform
from vsensor.types import Unseen

FOLDING = DistortionConfig(k1=-0.9)  # folds at a radius of 0.61, shown at 0.41: 22 degrees, inside the image


# Intrinsics


def test_calibrated_intrinsics_place_a_point_as_the_matrix_does():
    point = np.array([[1.0, -2.0, 10.0]])
    expected = [[1200.0 * 0.1 + 655.0, 1150.0 * -0.2 + 380.5]]
    np.testing.assert_allclose(project(camera(**CALIBRATED), point), expected, rtol=1e-15)


def test_the_angle_of_view_and_the_focal_length_that_belongs_to_it_are_the_same_camera():
    focal = 640.0 / np.tan(np.radians(26.0))
    same = camera(fx_px=focal, fy_px=focal, cx_px=639.5, cy_px=399.5)
    np.testing.assert_allclose(
        project(same, optical_points()), project(camera(), optical_points()), rtol=1e-14, atol=1e-11
    )


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({"hfov_deg": 52, "fx_px": 1300}, "hfov_deg and fx_px are both given"),
        ({"hfov_deg": 52, **CALIBRATED}, "hfov_deg and fx_px, fy_px, cx_px, cy_px are both given"),
        ({"fx_px": 1300, "fy_px": 1300}, "fx_px, fy_px without cx_px, cy_px"),
        ({"fx_px": 0}, "fx_px = 0"),
        ({"distortion": {"k1": 9}}, "distortion.k1 = 9"),
        ({"distortion": {"k6": 0.1}}, "distortion.k6: unknown key"),
        ({"inverse": "flat"}, "inverse = 'flat'"),
        ({"assumed_height_m": 0.0}, "assumed_height_m = 0.0"),
        ({"max_range_m": -1}, "max_range_m = -1"),
    ],
)
def test_a_wrong_setting_is_refused_by_name(table, expected):
    with pytest.raises(ConfigError, match=expected):
        convert(table, CameraConfig, "camera.toml")


# The lens


@pytest.mark.parametrize("lens", [LENS, FOLDING], ids=["calibrated", "folding"])
@pytest.mark.parametrize("intrinsics", [{}, CALIBRATED])
def test_with_a_lens_the_inverse_gives_back_the_point_and_the_projection_the_pixel(lens, intrinsics):
    seen = camera(distortion=lens, **intrinsics)
    points = optical_points()
    pixels = project(seen, points)
    shown = np.isfinite(pixels[:, 0])
    assert shown.mean() > 0.2
    back = unproject(seen, pixels[shown], points[shown, 2])
    np.testing.assert_allclose(project(seen, back), pixels[shown], rtol=0, atol=1e-9)
    inside = np.hypot(points[shown, 0], points[shown, 1]) < 0.6 * points[shown, 2]  # 0.61 is the fold
    np.testing.assert_allclose(back[inside], points[shown][inside], rtol=0, atol=1e-11)


def test_opencv_projects_to_the_same_pixels():
    cv2 = pytest.importorskip("cv2")
    matrix = np.array([[1200.0, 0, 655.0], [0, 1150.0, 380.5], [0, 0, 1]])
    five = np.array([LENS.k1, LENS.k2, LENS.p1, LENS.p2, LENS.k3])
    expected, _ = cv2.projectPoints(optical_points(), np.zeros(3), np.zeros(3), matrix, five)
    found = project(camera(distortion=LENS, **CALIBRATED), optical_points())
    np.testing.assert_allclose(found, expected[:, 0], rtol=1e-13, atol=1e-10)


def test_a_point_beyond_the_fold_is_no_ghost_in_the_image():
    seen = camera(distortion=FOLDING)
    aside = np.array([[0.5, 0.0, 1.0], [0.7, 0.0, 1.0], [1.0, 0.1, 1.0], [-1.05, 0.0, 1.0]])
    plain = aside[:, 0] * (1.0 - 0.9 * (aside[:, :2] ** 2).sum(axis=1))
    assert (np.abs(1312 * plain) < 640).all()  # the formula alone would show each of them
    np.testing.assert_array_equal(in_image(seen, project(seen, aside)), [True, False, False, False])


def test_what_lies_beyond_the_fold_is_outside_the_image_and_breaks_nothing():
    found = look(lanes(), distortion=FOLDING, hfov_deg=90.0)
    assert set(found.reason) <= {Unseen.SEEN, Unseen.OUTSIDE_IMAGE, Unseen.BEHIND_CAMERA, Unseen.BEYOND_SIGHT}
    assert np.isfinite(found.lines.points_ego_m).all()
    assert np.isfinite(found.sigma_y_m).all()
    near = found.reason[found.candidates.points_ego_m[:, 0] < 5.0]
    assert not (near == Unseen.SEEN).any()


def test_a_point_in_a_pixel_whose_centre_the_lens_does_not_show_has_no_place():
    found = look(scattered(), distortion=FOLDING, hfov_deg=90.0, width_px=64, height_px=40)
    assert (found.reason == Unseen.BEYOND_SIGHT).any()
    assert np.isfinite(found.lines.points_ego_m).all()


def test_barrel_shows_more_of_the_road():
    assert (look(lanes(), distortion=DistortionConfig(k1=-0.3)).reason == Unseen.SEEN).sum() > (
        look(lanes()).reason == Unseen.SEEN
    ).sum()


def test_points_seen_through_a_lens_lie_on_pixel_centres():
    seen = camera(distortion=LENS)
    found = look(lanes(), distortion=LENS)
    pixels = project(seen, transform(camera_from_ego(seen, ego()), found.lines.points_ego_m))
    assert len(pixels) > 1000
    np.testing.assert_allclose(pixels, np.rint(pixels), atol=1e-8)


def test_a_lens_of_zeros_is_no_lens():
    assert camera(distortion=DistortionConfig(k1=0.0)).distortion is None


# The end of sight


@pytest.mark.parametrize("sight_m", [20.0, 80.0])
def test_with_an_end_of_sight_a_point_is_seen_where_p1_sees_it(sight_m):
    rng = np.random.default_rng(7)
    cloud = [np.sort(rng.uniform(2, 100, 4000)), rng.uniform(-15, 15, 4000), rng.uniform(-5, 6, 4000)]
    seen = camera(max_range_m=sight_m, pixel_grid=False, pitch_deg=3.0)
    found = observe(seen, SceneConfig(lateral_m=200.0), snapshot([marking(np.column_stack(cloud))]))
    points = transform(seen.camera_from_body, found.candidates.points_ego_m)
    expected = p1.is_in_field_of_view(points * [1, -1, -1], np.radians(26.0), 1280, 800, sight_m)
    expected &= points[:, 2] >= 0.5
    assert 0.03 < expected.mean() < 0.9
    np.testing.assert_array_equal(found.reason == Unseen.SEEN, expected)


def test_a_point_in_the_image_beyond_the_end_of_sight_has_that_reason_and_one_outside_its_own():
    bridge = marking(np.column_stack([np.arange(45.0, 80.0), np.zeros(35), np.full(35, 30.0)]), 1)
    found = look([straight(0.0, 0), bridge], max_range_m=40.0)
    x, _, z = found.candidates.points_ego_m.T
    assert set(found.reason[(x > 42.0) & (z == 0.0)]) == {Unseen.BEYOND_SIGHT}
    assert set(found.reason[(x > 10.0) & (x < 41.8) & (z == 0.0)]) == {Unseen.SEEN}
    assert set(found.reason[z == 30.0]) == {Unseen.OUTSIDE_IMAGE}


def test_paint_is_as_wide_as_the_closed_form_says():
    # along x at y aside: f w / z across the row, times h / hypot(h, y) across its own direction
    seen, depth, aside = camera(), np.array([10.0, 30.0, 90.0]), np.array([0.0, 3.5, -7.0])
    points = np.array([aside, np.full(3, H), depth])
    along = np.array([[0.0] * 3, [0.0] * 3, [1.0] * 3])
    found = apparent_width_px(seen, points, along, np.array([0.0, -1.0, 0.0]), np.full(3, 0.15))
    expected = seen.fx_px * 0.15 / depth * H / np.hypot(H, aside)
    np.testing.assert_allclose(found, expected, rtol=1e-14)


@pytest.mark.parametrize("lens", [DistortionConfig(), LENS])
def test_the_width_is_the_distance_between_the_images_of_the_two_sides(lens):
    seen, rng, width = camera(distortion=lens, **CALIBRATED), np.random.default_rng(8), 1e-5
    points = optical_points(200) * 0.7 + [0.0, 0.0, 5.0]
    along = rng.normal(size=(200, 3))
    up = np.array([0.1, -0.9, 0.2])
    across = np.cross(up, along)
    across *= 0.5 * width / np.linalg.norm(across, axis=1)[:, None]
    left, right, ahead = (project(seen, points + step) for step in (across, -across, 1e-4 * along))
    way = ahead - project(seen, points)
    gap = left - right
    expected = np.abs(gap[:, 0] * way[:, 1] - gap[:, 1] * way[:, 0]) / np.hypot(*way.T)
    found = apparent_width_px(seen, points.T, along.T, up, np.full(200, width))
    np.testing.assert_allclose(found, expected, rtol=3e-3, atol=1e-9)


def test_narrow_paint_ends_where_it_is_too_few_pixels_wide():
    found = look([straight(0.0, width_m=0.15)], min_width_px=4.0)
    x = found.candidates.points_ego_m[:, 0]
    end = X0 + camera().fx_px * 0.15 / 4.0  # f w / z = 4 px
    assert set(found.reason[(x > 7.0) & (x < end - 0.01)]) == {Unseen.SEEN}
    assert set(found.reason[x > end + 0.01]) == {Unseen.TOO_NARROW}


def test_a_cross_line_ends_earlier_than_one_along_the_road():
    cross = marking(np.column_stack([np.linspace(30.0, 30.01, 60), np.linspace(-3.0, 3.0, 60)]), 1)
    found = look([straight(0.0), cross], min_width_px=3.0)
    edge = found.candidates.starts[1]
    along = found.candidates.points_ego_m[:edge, 0]
    assert found.reason[:edge][np.searchsorted(along, 30.0)] == Unseen.SEEN
    assert set(found.reason[edge:]) == {Unseen.TOO_NARROW}  # its 0.15 m are foreshortened


def test_each_points_own_width_counts():
    x = np.arange(1401) * 0.1 - 20.0
    width_m = np.where((x > 40) & (x < 50), 0.3, 0.1)
    found = look([straight(0.0, width_m=width_m, painted=x > 12.0)], min_width_px=5.0)
    at = found.candidates.points_ego_m[:, 0]
    assert set(found.reason[(at > 40.1) & (at < 49.9)]) == {Unseen.SEEN}
    assert set(found.reason[(at > 30) & (at < 39.9)]) == {Unseen.TOO_NARROW}


def test_each_points_own_direction_counts():
    x = np.arange(5.0, 90.0, 0.1)
    kinked = np.column_stack([x, np.maximum(x - 40.0, 0.0) * 0.5])  # ahead, then half to the left
    found = look([marking(kinked, painted=x > 12.0)], min_width_px=3.5)
    at = found.candidates.points_ego_m
    slope = np.where(at[:, 0] > 40.0, 0.5, 0.0)
    along, up = np.array([-slope, 0 * slope, 1 + 0 * slope]), np.array([0.0, -1.0, 0.0])
    points = np.array([-at[:, 1], H - at[:, 2], at[:, 0] - X0])
    width_px = apparent_width_px(camera(), points, along, up, np.full(len(at), 0.15))
    seen_where_painted = (at[:, 0] > 12.0) & (np.abs(at[:, 0] - 40.0) > 0.15)
    assert (width_px[at[:, 0] < 39.8] > 4.0).all()  # so both reasons are there for the direction alone
    np.testing.assert_array_equal(
        found.reason[seen_where_painted] == Unseen.TOO_NARROW, width_px[seen_where_painted] < 3.5
    )


def test_a_line_of_one_point_and_one_seen_end_on_have_a_width_too():
    single = marking(np.array([[20.0, 1.0, 0.0]]), 0)
    end_on = marking(np.column_stack([np.arange(5.0, 60.0), np.zeros(55), np.full(55, 1.35)]), 1)
    found = look([single, end_on], min_width_px=1.0, position_m=(1.9, 0.0, 1.35))
    assert set(found.reason) == {Unseen.SEEN}
