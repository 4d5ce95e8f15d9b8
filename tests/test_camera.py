"""The camera: exact both ways, the grid's bound, and a reason for every point that is not seen."""

import subprocess
import sys

import numpy as np
import pytest

from tests import p1
from tests.roads import box, ego, marking, snapshot, straight
from vsensor.camera import (
    SIGMA_FLOOR_M,
    Camera,
    CameraConfig,
    camera_from_ego,
    in_image,
    observe,
    project,
    unproject,
)
from vsensor.camera import look as camera_module
from vsensor.errors import ConfigError
from vsensor.scene import SceneConfig
from vsensor.schema import convert
from vsensor.transforms import transform
from vsensor.types import MarkingKind, Unseen

NEAR = SceneConfig()


def camera(**settings):
    return Camera.from_config(CameraConfig(**settings))


def optical_points(count=2000, seed=1):
    """Return points (N, 3) in front of the camera, out to three times its field of view."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(0.6, 150, count)
    return np.column_stack([z * rng.uniform(-1.5, 1.5, count), z * rng.uniform(-1, 1, count), z])


# The projection


def test_the_focal_length_puts_half_the_angle_of_view_at_the_images_edge():
    seen = camera(width_px=1000, hfov_deg=60.0)
    edge = np.array([[np.tan(np.radians(30.0)), 0.0, 1.0]])
    assert project(seen, edge)[0, 0] == pytest.approx(999.5)  # the edge of the last pixel, not its centre


def test_a_point_straight_ahead_is_in_the_middle_of_the_image():
    np.testing.assert_array_equal(project(camera(), np.array([[0.0, 0.0, 7.0]])), [[639.5, 399.5]])


def test_right_is_u_and_down_is_v():
    middle, aside = project(camera(), np.array([[0.0, 0.0, 10.0], [1.0, 2.0, 10.0]]))
    assert (aside > middle).all()
    assert aside[1] - middle[1] == pytest.approx(2.0 * (aside[0] - middle[0]))  # square pixels


def test_points_at_and_behind_the_optical_centre_have_no_pixel():
    points = np.array([[0.0, 0, 0], [1, 1, 0], [1, 1, -5], [0, 0, -1e-300], [1e3, 0, 1e-320], [np.nan, 0, 1]])
    assert np.isnan(project(camera(), points)).any(axis=1).all()


def test_the_inverse_with_true_depth_gives_the_point_back_to_rounding():
    points = optical_points()
    back = unproject(camera(), project(camera(), points), points[:, 2])
    scale = np.linalg.norm(points, axis=1)[:, None]
    assert (np.abs(back - points) <= 1e-14 * scale).all()


def test_the_projection_gives_the_pixel_back_to_rounding():
    rng = np.random.default_rng(2)
    pixels = rng.uniform(0, 1280, (1000, 2))
    again = project(camera(), unproject(camera(), pixels, rng.uniform(1, 100, 1000)))
    np.testing.assert_allclose(again, pixels, atol=1e-11)


def test_the_image_is_p1s_field_of_view_except_on_its_boundary():
    seen = camera()
    points = np.concatenate([optical_points(20_000), -optical_points(2000, seed=3)])
    p1_frame = points * [1, -1, -1]  # y up, looking along -z
    expected = p1.is_in_field_of_view(p1_frame, np.radians(26.0), columns=1280, rows=800, sight=1e4)
    pixels = project(seen, points)
    from_edge = np.minimum(np.abs(pixels + 0.5), np.abs(pixels - [1279.5, 799.5])).min(axis=1)
    off_boundary = ~(from_edge < 1e-6)
    assert 0.05 < expected.mean() < 0.95
    np.testing.assert_array_equal(in_image(seen, pixels)[off_boundary], expected[off_boundary])


@pytest.mark.parametrize(
    ("pixel", "expected"),
    [
        ((-0.5, 0), True),
        ((-0.5001, 0), False),
        ((1279.4999, 0), True),
        ((1279.5, 0), False),
        ((0, -0.5), True),
        ((0, -0.5001), False),
        ((0, 799.4999), True),
        ((0, 799.5), False),
    ],
)
def test_the_image_holds_its_left_and_upper_edge_only(pixel, expected):
    assert in_image(camera(), np.array([pixel])) == expected


# The pose


def ahead(seen, vehicle, point):
    """Return a point of the road-level ego frame in the optical frame."""
    return transform(camera_from_ego(seen, vehicle), np.array([point], dtype=float))[0]


def test_the_camera_stands_where_it_is_mounted():
    seen = camera(position_m=(1.5, 0.1, 1.2))
    np.testing.assert_allclose(ahead(seen, ego(), (11.5, -0.9, 0.2)), [1.0, 1.0, 10.0], atol=1e-15)


def test_a_camera_pitched_down_sees_the_road_higher_in_the_image():
    level, down = (
        project(camera(pitch_deg=angle), np.array([ahead(camera(pitch_deg=angle), ego(), (30, 0, 0))]))
        for angle in (0, 5)
    )
    assert down[0, 1] < level[0, 1]


def test_a_camera_turned_to_the_left_sees_the_road_further_right():
    assert ahead(camera(yaw_deg=5.0), ego(), (30, 0, 0))[0] > 0


def test_a_camera_rolled_by_a_quarter_has_left_at_the_bottom():
    point = ahead(camera(roll_deg=90.0), ego(), (11.9, 1.0, 1.35))
    np.testing.assert_allclose(point, [0.0, 1.0, 10.0], atol=1e-14)


def test_braking_tilts_the_camera_with_the_body_and_not_the_road():
    # nose down by t: Ry(t)^T (x, 0, z) = (x cos t - z sin t, 0, x sin t + z cos t) on the body
    cos, sin = np.cos(0.02), np.sin(0.02)
    expected = [0.0, -(51.9 * sin + 1.35 * cos - 1.35), 51.9 * cos - 1.35 * sin - 1.9]
    found = ahead(camera(), ego(body_pitch_rad=0.02), (51.9, 0, 1.35))
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_a_heaving_body_lifts_the_camera():
    np.testing.assert_allclose(
        ahead(camera(), ego(body_heave_m=0.1), (51.9, 0, 0)), [0, 1.45, 50], atol=1e-14
    )


def test_the_body_turns_about_the_origin_of_the_ego_frame():
    vehicle = ego(body_roll_rad=0.1, body_pitch_rad=-0.2, body_heave_m=0.3)
    at_origin, level = (ahead(camera(), who, (0, 0, height)) for who, height in ((vehicle, 0.3), (ego(), 0)))
    np.testing.assert_allclose(at_origin, level, atol=1e-15)


def test_a_camera_pitched_straight_down_sees_what_is_below_it():
    down = camera(pitch_deg=90.0, position_m=(2.0, 0.0, 4.0))
    below, ahead_of_it = (ahead(down, ego(), point) for point in ((2, 0, 0), (3, 0, 0)))
    np.testing.assert_allclose(below, [0, 0, 4], atol=1e-15)
    np.testing.assert_allclose(ahead_of_it, [0, -1, 4], atol=1e-15)  # forward is up in the image


# The whole look


def look(markings, obstacles=(), vehicle=None, config=NEAR, **settings):
    return observe(camera(**settings), config, snapshot(markings, obstacles, vehicle))


def seen_points(observation):
    """Return the points as seen and where they really are."""
    real = {}
    for line, candidate in ((observation.lines, False), (observation.candidates, True)):
        keys = np.repeat(line.marking, np.diff(line.starts)) * 1_000_000 + line.index
        real[candidate] = dict(zip(keys.tolist(), line.points_ego_m, strict=True))
    return np.array([(point, real[True][key]) for key, point in real[False].items()]).transpose(1, 0, 2)


@pytest.mark.parametrize(
    "settings",
    [{}, {"pitch_deg": 4.0, "yaw_deg": -7.0, "roll_deg": 3.0}, {"width_px": 320, "height_px": 200}],
)
def test_the_grid_moves_no_point_along_a_camera_axis_by_more_than_half_a_pixel(settings):
    vehicle = ego(body_pitch_rad=0.01, body_roll_rad=-0.02)
    found = look([straight(1.75, 0), straight(-1.75, 1)], vehicle=vehicle, **settings)
    seen = camera(**settings)
    as_seen, real = (transform(camera_from_ego(seen, vehicle), points) for points in seen_points(found))
    assert len(real) > 500
    bound_m = real[:, 2] / (2.0 * seen.fx_px)
    moved_m = np.abs(as_seen - real)
    assert (moved_m[:, :2] <= bound_m[:, None] * (1 + 1e-9) + 1e-12).all()
    assert (moved_m[:, :2].max(axis=0) > 0.9 * bound_m.min()).all()  # the bound is tight
    np.testing.assert_allclose(as_seen[:, 2], real[:, 2], atol=1e-12)


def test_seen_points_lie_on_pixel_centres():
    found = look([straight(1.75, 0), straight(-1.75, 1)])
    pixels = project(camera(), transform(camera_from_ego(camera(), ego()), found.lines.points_ego_m))
    np.testing.assert_allclose(pixels, np.rint(pixels), atol=1e-9)


def test_without_the_grid_every_seen_point_is_exact():
    as_seen, real = seen_points(look([straight(1.75, 0), straight(-1.75, 1)], pixel_grid=False))
    np.testing.assert_array_equal(as_seen, real)


def test_the_lateral_deviation_is_that_of_a_uniform_error_of_one_pixel():
    found = look([straight(1.75)])
    depth_m = found.lines.points_ego_m[:, 0] - 1.9
    expected = np.maximum(depth_m / camera().fx_px / np.sqrt(12.0), SIGMA_FLOOR_M)
    np.testing.assert_allclose(found.sigma_y_m, expected, rtol=1e-12)


def test_errors_of_the_grid_have_the_deviation_that_is_said():
    lateral_m = np.random.default_rng(4).uniform(-4, 4, 60)
    found = look([straight(y, number) for number, y in enumerate(lateral_m)])
    as_seen, real = seen_points(found)
    far = real[:, 0] > 20.0  # above the floor
    ratio = (as_seen - real)[far, 1] / found.sigma_y_m[far]
    assert abs(ratio.std() - 1.0) < 0.02  # uniform on [-sqrt(3), sqrt(3)], 48,000 points, neighbours alike
    assert np.abs(ratio).max() <= np.sqrt(3.0) * (1 + 1e-9)


@pytest.mark.parametrize("settings", [{"pixel_grid": False}, {"model": "none"}])
def test_without_a_grid_the_lateral_deviation_is_zero(settings):
    assert not look([straight(1.75)], **settings).sigma_y_m.any()


def test_x_increases_along_a_line_even_where_a_coarse_grid_swaps_points():
    found = look(
        [straight(1.75, step=0.05), straight(-1.75, 1)], width_px=32, height_px=20, pitch_deg=20.0, yaw_deg=15
    )
    assert len(found.lines.index) > 100
    for start, stop in zip(found.lines.starts, found.lines.starts[1:], strict=False):
        assert (np.diff(found.lines.points_ego_m[start:stop, 0]) > 0).all()
    assert len(found.sigma_y_m) == len(found.lines.index) == found.lines.starts[-1]


def test_every_candidate_has_its_reason():
    painted = np.ones(1401, dtype=bool)
    painted[400:450] = False  # x from 20 to 25 m
    found = look(
        [straight(0.5, painted=painted)], [box(41, 0.5, size=(2, 1.5, 3))], config=SceneConfig(behind_m=10)
    )
    x = found.candidates.points_ego_m[:, 0]
    assert set(found.reason[x < 1.9]) == {Unseen.BEHIND_CAMERA}
    assert set(found.reason[(x > 3) & (x < 6)]) == {Unseen.OUTSIDE_IMAGE}
    assert set(found.reason[(x > 7) & (x < 19.9)]) == {Unseen.SEEN}
    assert set(found.reason[(x > 20.05) & (x < 24.9)]) == {Unseen.NO_PAINT}
    assert set(found.reason[(x > 40.1)]) == {Unseen.OCCLUDED}


def test_the_lines_hold_what_the_reasons_call_seen():
    chains = [straight(1.75, 0), straight(-1.75, 1), straight(15.0, 2, stop=10.0)]
    found = look(chains, [box(30, 1.75)])
    seen = np.add.reduceat(found.reason == Unseen.SEEN, found.candidates.starts[:-1])
    np.testing.assert_array_equal(np.diff(found.lines.starts), seen)
    assert seen[2] == 0  # the line is there, with no point


def test_a_point_nearer_than_the_least_range_is_not_seen():
    found = look([straight(0.0)], min_range_m=20.0)
    assert found.lines.points_ego_m[0, 0] == pytest.approx(21.9, abs=0.1)


def test_a_mirrored_scene_is_seen_mirrored():
    left = look([straight(1.75, 0), straight(-5.25, 1)], [box(30, 2, yaw_rad=0.3)])
    right = look([straight(-1.75, 0), straight(5.25, 1)], [box(30, -2, yaw_rad=-0.3)])
    np.testing.assert_array_equal(left.reason, right.reason)
    np.testing.assert_allclose(left.lines.points_ego_m * [1, -1, 1], right.lines.points_ego_m, atol=1e-12)


def test_the_same_is_seen_wherever_the_road_lies_and_whichever_way_it_runs():
    yaw, origin = 2.0, np.array([5.0e5, 5.4e6, 30.0])
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    chain, obstacle = straight(1.75).points_world_m, np.array([30.0, 2.0, 0.75])
    here = look([marking(chain)], [box(*obstacle)], pixel_grid=False)
    there = look(
        [marking(chain @ turn.T + origin)],
        [box(*(turn @ obstacle + origin), yaw_rad=yaw)],
        vehicle=ego(origin, yaw_rad=yaw),
        pixel_grid=False,
    )
    assert abs(len(here.lines.index) - len(there.lines.index)) <= 2  # ends of the window, to rounding
    both, at, also = np.intersect1d(here.lines.index, there.lines.index, return_indices=True)
    assert len(both) > 300
    np.testing.assert_allclose(here.lines.points_ego_m[at], there.lines.points_ego_m[also], atol=2e-9)


def test_kind_colour_and_width_are_those_of_the_nearest_paint_that_is_seen():
    x = np.arange(1401)
    far = x >= 400  # from x = 20 m
    chain = straight(
        0.0,
        kind=np.where(far, MarkingKind.DASHED, MarkingKind.SOLID),
        colour=np.where(far, 2, 1),
        width_m=np.where(far, 0.3, 0.15),
        painted=(x < 220) | far,  # none in the image before 20 m
    )
    found = look([chain])
    assert (found.kind[0], found.colour[0], found.width_m[0]) == (MarkingKind.DASHED, 2, 0.3)


def test_a_line_of_which_nothing_is_seen_has_the_kind_of_its_nearest_point():
    found = look([straight(0.0, kind=MarkingKind.CURB, painted=np.zeros(1401))])
    assert found.kind[0] == MarkingKind.CURB
    assert len(found.lines.index) == 0


def test_the_bypassed_camera_takes_the_painted_points_as_they_are():
    painted = np.arange(1401) % 3 == 0
    found = look([straight(1.75, painted=painted)], [box(10, 1.75)], model="none")
    np.testing.assert_array_equal(
        found.lines.points_ego_m, found.candidates.points_ego_m[found.reason == Unseen.SEEN]
    )
    assert set(found.reason) == {Unseen.SEEN, Unseen.NO_PAINT}


@pytest.mark.parametrize("broken", ["project", "back_to_road", "_hidden"])
def test_the_bypassed_camera_never_projects(monkeypatch, broken):
    def refuse(*_):
        raise AssertionError("projected")

    monkeypatch.setattr(camera_module, broken, refuse)
    scene = [straight(1.75)], [box(30, 0)]
    look(*scene, model="none")
    with pytest.raises(AssertionError, match="projected"):
        look(*scene)


@pytest.mark.parametrize("model", ["none", "pinhole"])
def test_an_empty_road_gives_an_empty_observation(model):
    found = look([], [box(30, 0)], model=model)
    assert (len(found.lines.index), len(found.kind), len(found.reason)) == (0, 0, 0)


def test_a_camera_that_looks_backwards_sees_nothing_ahead():
    found = look([straight(1.75)], [box(30, 0)], yaw_deg=180.0)
    assert set(found.reason) <= {Unseen.BEHIND_CAMERA, Unseen.OUTSIDE_IMAGE}


@pytest.mark.parametrize("method", ["boxes", "embree"])
def test_each_way_to_find_hidden_points_gives_the_same_observation(method):
    scene = [straight(1.75), straight(-1.75, 1)], [box(30, 1, yaw_rad=0.2), box(50, -2)]
    np.testing.assert_array_equal(look(*scene, occlusion=method).reason, look(*scene).reason)


@pytest.mark.parametrize(("pitch_deg", "is_seen"), [(90.0, True), (-90.0, False)])
def test_a_camera_that_looks_straight_down_sees_the_road_and_one_that_looks_up_does_not(pitch_deg, is_seen):
    found = look([straight(0.5, start=-20)], [box(30, 0)], pitch_deg=pitch_deg)
    assert (len(found.lines.index) > 0) == is_seen


def test_a_line_through_the_camera_itself_gives_no_warning_and_no_answer_that_is_not_a_number():
    through = marking(np.column_stack([np.arange(0, 90, 0.1), np.zeros(900), np.full(900, 1.35)]))
    found = look([through], [box(30, 0)], position_m=(2.0, 0.0, 1.35))
    assert np.isfinite(found.lines.points_ego_m).all()
    assert found.reason[20] == Unseen.BEHIND_CAMERA  # x = 2.0: the optical centre


def test_a_body_attitude_that_is_not_known_shows_nothing_and_breaks_nothing():
    found = look([straight(1.75)], [box(30, 0)], vehicle=ego(body_pitch_rad=np.nan))
    assert set(found.reason) == {Unseen.OUTSIDE_IMAGE}


def test_occlusion_can_be_switched_off():
    assert Unseen.OCCLUDED not in look([straight(0.0)], [box(30, 0)], occlusion="none").reason


def test_all_arrays_are_read_only():
    found = look([straight(1.75), straight(-1.75, 1)], [box(30, 0)])
    arrays = [found.sigma_y_m, found.kind, found.colour, found.width_m, found.reason]
    arrays += [found.lines.points_ego_m, found.lines.index, found.lines.starts, found.lines.marking]
    assert not any(array.flags.writeable for array in arrays)


LOOK_AND_TELL = """
import sys
from tests.roads import box, snapshot, straight
from vsensor.camera import Camera, CameraConfig, observe
from vsensor.scene import SceneConfig
road = snapshot([straight(0.0)], [box({x}, 0)])
observe(Camera.from_config(CameraConfig(occlusion="embree")), SceneConfig(), road)
print(any(name.startswith("embreex") for name in sys.modules))
"""


@pytest.mark.parametrize(("x", "imported"), [(30, "True"), (-60, "False"), (300, "False"), (-5, "False")])
def test_embree_is_imported_only_where_an_obstacle_is_in_view(x, imported, pytestconfig):
    told = subprocess.run(
        [sys.executable, "-c", LOOK_AND_TELL.format(x=x)],
        cwd=pytestconfig.rootpath,
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout.strip() == imported


# The configuration


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({"hfov_deg": 190}, "hfov_deg = 190"),
        ({"position_m": [1.9, 0.0, 135.0]}, r"position_m\[2\] = 135.0"),
        ({"width_px": 0}, "width_px = 0"),
        ({"width": 1280}, "did you mean width_px"),
        ({"occlusion": "rays"}, "occlusion = 'rays'"),
        ({"pitch_deg": float("nan")}, "pitch_deg = nan"),
    ],
)
def test_a_wrong_setting_is_refused_by_name(table, expected):
    with pytest.raises(ConfigError, match=expected):
        convert(table, CameraConfig, "camera.toml")
