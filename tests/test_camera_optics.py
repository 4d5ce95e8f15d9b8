"""The camera's further models: calibrated intrinsics, a lens, an end of sight, the inverse on a flat road."""

import numpy as np
import pytest

from tests import p1
from tests.roads import ego, marking, moved, snapshot, straight
from vsensor.camera import (
    HORIZON_M,
    Camera,
    CameraConfig,
    camera_from_ego,
    in_image,
    observe,
    on_road,
    project,
    unproject,
)
from vsensor.camera.sight import apparent_width_px
from vsensor.distortion import DistortionConfig
from vsensor.errors import ConfigError
from vsensor.scene import SceneConfig
from vsensor.schema import convert
from vsensor.transforms import invert, transform
from vsensor.types import Unseen

CALIBRATED = {"fx_px": 1200.0, "fy_px": 1150.0, "cx_px": 655.0, "cy_px": 380.5}
LENS = DistortionConfig(k1=-0.3, k2=0.12, k3=-0.02, p1=1e-3, p2=-5e-4)
FOLDING = DistortionConfig(k1=-0.9)  # folds at a radius of 0.61, shown at 0.41: 22 degrees, inside the image
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
    found = look([straight(0.0, 0), straight(30.0, 1, stop=70.0)], max_range_m=40.0)
    x, y = found.candidates.points_ego_m[:, 0], found.candidates.points_ego_m[:, 1]
    assert set(found.reason[(x > 42.0) & (y == 0.0)]) == {Unseen.BEYOND_SIGHT}
    assert set(found.reason[(x > 10.0) & (x < 41.8) & (y == 0.0)]) == {Unseen.SEEN}
    assert set(found.reason[(x > 42.0) & (x < 50.0) & (y == 30.0)]) <= {Unseen.OUTSIDE_IMAGE}


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
    found = look([straight(0.0, width_m=np.where((x > 40) & (x < 50), 0.3, 0.1))], min_width_px=5.0)
    at = found.candidates.points_ego_m[:, 0]
    assert set(found.reason[(at > 40.1) & (at < 49.9)]) == {Unseen.SEEN}
    assert set(found.reason[(at > 30) & (at < 39.9)]) == {Unseen.TOO_NARROW}


def test_a_line_of_one_point_and_one_seen_end_on_have_a_width_too():
    single = marking(np.array([[20.0, 1.0, 0.0]]), 0)
    end_on = marking(np.column_stack([np.arange(5.0, 60.0), np.zeros(55), np.full(55, 1.35)]), 1)
    found = look([single, end_on], min_width_px=1.0, position_m=(1.9, 0.0, 1.35))
    assert set(found.reason) == {Unseen.SEEN}


# The flat road that the camera takes to be there


def test_at_rest_on_a_flat_road_the_ground_plane_gives_the_true_points():
    pose = {"pitch_deg": 3.0, "yaw_deg": -4.0, "roll_deg": 2.0, "distortion": LENS, **CALIBRATED}
    for settings in ({}, pose):
        found = look(lanes(), pixel_grid=False, inverse="ground_plane", **settings)
        exact = look(lanes(), pixel_grid=False, **settings)
        assert len(found.lines.index) > 1500
        np.testing.assert_array_equal(found.reason, exact.reason)
        np.testing.assert_allclose(found.lines.points_ego_m, exact.lines.points_ego_m, rtol=0, atol=1e-9)
        assert not found.sigma_y_m.any()


def flat_error(vehicle=None, markings=None, **settings):
    """Return the points as seen without the grid, and as they are."""
    found = look(
        markings or lanes(), vehicle, pixel_grid=False, inverse="ground_plane", pitch_deg=0.0, **settings
    )
    return seen_and_real(found)


@pytest.mark.parametrize("pitch_deg", [0.3, -0.3])
def test_a_known_error_of_pitch_gives_the_known_error_of_range_and_offset(pitch_deg):
    # The camera looks pitch_deg further up than it believes: what it sees at the depression a of a road
    # straight ahead it takes to be at a + pitch. Aside, the ray's bearing in the pitched frame keeps
    # y / depth along the axis.
    seen, real = flat_error(assumed_pitch_deg=pitch_deg)
    delta, depth = np.radians(pitch_deg), real[:, 0] - X0
    x = X0 + H / np.tan(np.arctan2(H, depth) + delta)
    expected_y = real[:, 1] * (x - X0) / (depth * np.cos(delta) - H * np.sin(delta))
    assert np.abs(x - real[:, 0]).max() > 1.0
    np.testing.assert_allclose(seen[:, 0], x, rtol=1e-10)
    np.testing.assert_allclose(seen[:, 1], expected_y, rtol=1e-10)
    assert not seen[:, 2].any()


def test_braking_moves_the_road_as_the_body_pitches_and_true_depth_does_not_notice():
    # The body dips by d about the road below the rear axle: the camera goes to (x0 c + h s, h c - x0 s).
    delta = 0.01
    vehicle = ego(body_pitch_rad=delta)
    seen, real = flat_error(vehicle)
    x0, h = X0 * np.cos(delta) + H * np.sin(delta), H * np.cos(delta) - X0 * np.sin(delta)
    expected = X0 + H / np.tan(np.arctan2(h, real[:, 0] - x0) - delta)
    far = expected < 400.0
    assert (seen[far, 0] > real[far, 0]).all()  # nose down: the road seems higher in the image, further
    np.testing.assert_allclose(seen[far, 0], expected[far], rtol=1e-9)
    exact, true = seen_and_real(look(lanes(), vehicle, pixel_grid=False))
    np.testing.assert_array_equal(exact, true)


def test_a_wrong_height_scales_the_road_about_the_foot_of_the_camera():
    seen, real = flat_error(assumed_height_m=1.2 * H)
    foot = np.array([X0, 0.0, 0.0])
    np.testing.assert_allclose(seen, foot + 1.2 * (real - foot), rtol=1e-10, atol=1e-9)


def test_a_heaving_body_scales_the_road_too():
    seen, real = flat_error(ego(body_heave_m=0.1))
    foot = np.array([X0, 0.0, 0.0])
    np.testing.assert_allclose(seen, foot + H / (H + 0.1) * (real - foot), rtol=1e-10, atol=1e-9)


def test_a_wrong_roll_turns_the_ray_about_the_cameras_axis():
    roll = np.radians(1.5)
    seen, real = flat_error(assumed_roll_deg=1.5)
    # the ray (1, y, -h) / depth turned by the roll about x, and carried to the road
    y, z = real[:, 1] * np.cos(roll) + H * np.sin(roll), real[:, 1] * np.sin(roll) - H * np.cos(roll)
    np.testing.assert_allclose(seen[:, 0], X0 + (real[:, 0] - X0) * H / -z, rtol=1e-10)
    np.testing.assert_allclose(seen[:, 1], y * H / -z, rtol=1e-10)


def test_paint_on_a_rise_is_taken_to_be_further_away_on_the_same_ray():
    raised = marking(np.column_stack([np.arange(5, 90, 0.1), np.full(850, 1.75), np.full(850, 0.2)]))
    seen, real = flat_error(markings=[raised])
    np.testing.assert_allclose(seen[:, 0], X0 + (real[:, 0] - X0) * H / (H - 0.2), rtol=1e-10)
    np.testing.assert_allclose(seen[:, 1], 1.75 * H / (H - 0.2), rtol=1e-10)


def test_the_pose_of_the_road_in_the_world_changes_nothing():
    vehicle = ego((5e5, 5.4e6, 30.0), yaw_rad=1.0, pitch_rad=-0.05, roll_rad=0.03)
    there = [marking(moved(line.points_world_m, vehicle), line.id) for line in lanes()]
    here, abroad = look(lanes(), inverse="ground_plane"), look(there, vehicle, inverse="ground_plane")
    assert (
        abs(len(here.lines.index) - len(abroad.lines.index)) < 20
    )  # a rounding moves some to the next pixel
    both, at, also = np.intersect1d(
        *(
            np.repeat(found.lines.marking, np.diff(found.lines.starts)) * 10_000 + found.lines.index
            for found in (here, abroad)
        ),
        return_indices=True,
    )
    assert len(both) > 300
    gap = np.abs(here.lines.points_ego_m[at] - abroad.lines.points_ego_m[also])[:, :2]
    assert np.median(gap) < 1e-6


def test_with_the_grid_the_error_of_range_grows_with_its_square():
    seen, real = seen_and_real(look(scattered(), inverse="ground_plane"))
    depth, error = real[:, 0] - X0, np.abs(seen[:, 0] - real[:, 0])
    per_px = depth**2 / (camera().fy_px * H)  # a row of pixels
    half = 0.5 * per_px / (1 - 0.5 * per_px / depth)  # the far side of a row is longer
    assert (error <= half * (1 + 1e-9)).all()
    for nearest in (10.0, 40.0, 80.0):
        part = (depth > nearest) & (depth < 1.2 * nearest)
        assert error[part].max() > 0.4 * per_px[part].min()


@pytest.mark.parametrize("inverse", ["true_depth", "ground_plane"])
@pytest.mark.parametrize(
    "settings",
    [
        {"pitch_deg": 4.0},
        {"pitch_deg": 4.0, "yaw_deg": 6.0, "roll_deg": 3.0},
        {"pitch_deg": 4.0, "distortion": DistortionConfig(k1=-0.4, k2=0.1, p1=2e-3)},
    ],
    ids=["pitched", "turned", "through a lens"],
)
def test_errors_of_the_grid_have_the_deviation_that_is_said(inverse, settings):
    found = look(scattered(), inverse=inverse, **settings)
    seen, real = seen_and_real(found)
    above = (found.sigma_y_m > 1.5e-3) & (found.sigma_y_m < 0.3)
    ratio = (seen - real)[above, 1] / found.sigma_y_m[above]
    assert len(ratio) > 3000
    assert abs(ratio.std() - 1.0) < 0.03
    assert np.abs(ratio).max() < 2.6  # two uniform errors: sqrt(6), and a little for the curve


@pytest.mark.parametrize(
    "settings", [{}, {"roll_deg": 0.5, "yaw_deg": 2.0}, {"width_px": 320, "height_px": 200}]
)
def test_on_the_flat_road_x_increases_strictly_along_every_line(settings):
    found = look(lanes(), inverse="ground_plane", **settings)
    assert len(found.lines.index) > 80
    for start, stop in zip(found.lines.starts, found.lines.starts[1:], strict=False):
        assert (np.diff(found.lines.points_ego_m[start:stop, 0]) > 0).all()
    assert len(found.sigma_y_m) == len(found.lines.index) == found.lines.starts[-1]


def test_of_a_row_of_pixels_the_middle_of_the_line_in_it_stays():
    bend = marking(np.column_stack([np.arange(20, 100, 0.1), np.arange(20, 100, 0.1) * 0.1]))
    seen, real = seen_and_real(look([bend], inverse="ground_plane"))
    aside = seen[:, 1] - 0.1 * seen[:, 0]
    assert abs(aside.mean()) < 0.01  # the first of each row would be 0.05 to one side
    assert np.abs(real[:, 0] - seen[:, 0]).max() < 0.6  # and up to 2.8 m short


def test_above_the_horizon_there_is_no_road():
    seen = camera()
    pixels = np.array([[600.0, 600.0, 600.0], [0.0, seen.cy_px, 500.0]])
    points, sigma, meets = on_road(seen, camera(inverse="ground_plane").assumed_from_ego, pixels)
    assert meets.tolist() == [False, False, True]
    assert points.shape == (3, 1)
    assert sigma.shape == (1,)


def test_paint_above_the_horizon_that_the_camera_assumes_is_beyond_sight():
    found = look(lanes(), inverse="ground_plane", assumed_pitch_deg=-1.5)  # believes that it looks up
    x = found.candidates.points_ego_m[:, 0]
    horizon = X0 + H / np.tan(np.radians(1.5))
    assert set(found.reason[x > horizon + 4.0]) == {Unseen.BEYOND_SIGHT}
    assert Unseen.BEYOND_SIGHT not in found.reason[x < horizon - 4.0]
    assert found.lines.points_ego_m[:, 0].max() < HORIZON_M + X0
    assert np.isfinite(found.lines.points_ego_m).all()


@pytest.mark.parametrize("pitch_deg", [90.0, -90.0, 89.999])
@pytest.mark.parametrize("inverse", ["true_depth", "ground_plane"])
@pytest.mark.parametrize("lens", [DistortionConfig(), LENS], ids=["pinhole", "lens"])
def test_a_camera_that_looks_straight_down_or_up_breaks_nothing(pitch_deg, inverse, lens):
    found = look(
        [straight(0.5, start=-20)],
        pitch_deg=pitch_deg,
        inverse=inverse,
        distortion=lens,
        min_width_px=0.1,
        max_range_m=50.0,
    )
    assert np.isfinite(found.lines.points_ego_m).all()
    assert (len(found.lines.index) > 0) == (pitch_deg > 0)


def test_the_assumed_pose_is_the_mounts_where_nothing_else_is_said():
    seen = camera(inverse="ground_plane", pitch_deg=3.0, roll_deg=-1.0, yaw_deg=2.0)
    assert seen.assumed_from_ego is not None
    np.testing.assert_array_equal(seen.assumed_from_ego.rotation, seen.camera_from_body.rotation)
    other = camera(inverse="ground_plane", pitch_deg=3.0, assumed_height_m=1.1, assumed_pitch_deg=2.0)
    assert other.assumed_from_ego is not None
    np.testing.assert_allclose(invert(other.assumed_from_ego).translation, [1.9, 0.0, 1.1], atol=1e-15)
    np.testing.assert_array_equal(
        other.assumed_from_ego.rotation, camera(pitch_deg=2.0).camera_from_body.rotation
    )
