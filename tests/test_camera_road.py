"""The inverse on the flat road that the camera takes to be there: closed forms of what that costs."""

import numpy as np
import pytest

from tests.looks import CALIBRATED, LENS, X0, H, camera, lanes, look, scattered, seen_and_real
from tests.roads import ego, marking, moved, straight
from vsensor.camera import HORIZON_M, on_road
from vsensor.distortion import DistortionConfig
from vsensor.transforms import invert
from vsensor.types import Unseen


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
        {"pitch_deg": 12.0, "roll_deg": 35.0},
        {
            "hfov_deg": 80.0,
            "pitch_deg": 15.0,
            "roll_deg": 35.0,
            "distortion": DistortionConfig(k1=-0.3, k2=0.05),
        },
    ],
    ids=["pitched", "turned", "rolled", "rolled, through a lens"],
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
