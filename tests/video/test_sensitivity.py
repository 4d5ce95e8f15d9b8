"""What a camera that stands elsewhere than thought does to measured offsets: closed forms (P2 2.6.1.2)."""

import numpy as np
import pytest

from vsensor.camera import Camera, CameraConfig, normalised, project
from vsensor.transforms import transform
from vsensor.video.sensitivity.one_by_one import one_by_one, slopes_at_zero
from vsensor.video.sensitivity.reproject import PARAMETERS, Lines, changed_offsets
from vsensor.video.sensitivity.together import shares

AXLE_M, H = 2.8, 1.36
LEVEL = CameraConfig(position_m=(1.8, 0.19, H))
TILTED = CameraConfig(position_m=(1.8, 0.19, H), pitch_deg=4.0, yaw_deg=-2.0, roll_deg=1.5)
LINES = Lines(offset_m=np.array([1.7, -1.6, 1.2]), slope=np.array([0.0, 0.02, -0.03]))
PARALLEL = Lines(offset_m=np.array([1.7, -1.6]), slope=np.zeros(2))


def moved(camera, lines=LINES, **change):
    row = np.array([[change.get(name, 0.0) for name in PARAMETERS]])
    return changed_offsets(camera, AXLE_M, lines, row)[0]


@pytest.mark.parametrize("camera", [LEVEL, TILTED])
def test_an_unchanged_camera_gives_the_offsets_back(camera):
    np.testing.assert_allclose(moved(camera), LINES.offset_m, atol=1e-12)


@pytest.mark.parametrize("camera", [LEVEL, TILTED])
def test_a_lateral_shift_shifts_every_offset(camera):
    np.testing.assert_allclose(moved(camera, lateral=0.1), LINES.offset_m + 0.1, atol=1e-12)


@pytest.mark.parametrize("camera", [LEVEL, TILTED])
def test_height_scales_the_road_about_the_point_below_the_camera(camera):
    scale, (x, y, _) = (H + 0.2) / H, camera.position_m
    at_camera = LINES.offset_m + LINES.slope * (x - AXLE_M) - y
    expected = y + scale * at_camera + LINES.slope * (AXLE_M - x)
    np.testing.assert_allclose(moved(camera, height=0.2), expected, atol=1e-12)


@pytest.mark.parametrize("camera", [LEVEL, TILTED])
def test_yaw_turns_the_road_about_the_point_below_the_camera(camera):
    turn, (x, y, _) = np.radians(2.0), camera.position_m
    heading = np.arctan(LINES.slope) + turn
    foot = (LINES.offset_m + LINES.slope * (x - AXLE_M) - y) * np.cos(np.arctan(LINES.slope))  # distance
    expected = y + foot / np.cos(heading) + np.tan(heading) * (AXLE_M - x)
    np.testing.assert_allclose(moved(camera, yaw=2.0), expected, atol=1e-12)


def test_pitch_turns_a_parallel_line_inward_and_the_offset_beside_the_camera_by_its_cosine():
    # the ray to (x, y, -h), turned nose down by p, meets the road where y(x) = y (cos p - x / h sin p)
    pitch = np.radians(3.0)
    ahead = AXLE_M - LEVEL.position_m[0]
    beside = PARALLEL.offset_m - LEVEL.position_m[1]
    expected = LEVEL.position_m[1] + beside * (np.cos(pitch) - ahead / H * np.sin(pitch))
    np.testing.assert_allclose(moved(LEVEL, PARALLEL, pitch=3.0), expected, atol=1e-12)


def test_a_road_mirrored_with_its_camera_gives_mirrored_offsets():
    mirrored = CameraConfig(position_m=(1.8, -0.19, H), pitch_deg=4.0, yaw_deg=2.0, roll_deg=-1.5)
    other = Lines(offset_m=-LINES.offset_m, slope=-LINES.slope)
    here = moved(TILTED, roll=1.0, yaw=0.5, pitch=-2.0, height=0.1, lateral=0.05)
    there = moved(mirrored, other, roll=-1.0, yaw=-0.5, pitch=-2.0, height=0.1, lateral=-0.05)
    np.testing.assert_allclose(here, -there, atol=1e-12)


def test_it_is_what_the_sensors_own_camera_sees():
    """Project by one camera, back to the road by another: pixels, lens and all."""
    lens = {
        "fx_px": 255.82,
        "fy_px": 280.99,
        "cx_px": 179.39,
        "cy_px": 143.19,
        "width_px": 355,
        "height_px": 288,
    }
    true = CameraConfig(position_m=(1.8, 0.19, H), pitch_deg=1.0, roll_deg=-0.5, **lens)
    thought = CameraConfig(position_m=(1.8, 0.24, H + 0.1), pitch_deg=2.0, yaw_deg=0.7, roll_deg=0.5, **lens)
    x = AXLE_M + np.array([8.0, 15.0])
    line = Lines(offset_m=np.array([1.6]), slope=np.array([0.02]))
    points = np.column_stack([x, 1.6 + 0.02 * (x - AXLE_M), np.zeros(2)])
    seen, assumed = Camera.from_config(true), Camera.from_config(thought)
    right, down = normalised(seen, project(seen, transform(seen.camera_from_body, points)))
    rays = np.column_stack([right, down, np.ones(2)]) @ assumed.camera_from_body.rotation
    ground = np.array(thought.position_m) - rays * (thought.position_m[2] / rays[:, 2:])
    slope = np.diff(ground[:, 1]) / np.diff(ground[:, 0])
    expected = ground[0, 1] + (AXLE_M - ground[0, 0]) * slope
    found = moved(true, line, height=0.1, lateral=0.05, yaw=0.7, pitch=1.0, roll=1.0)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_line_above_the_horizon_gives_no_offset():
    assert np.isnan(moved(LEVEL, pitch=-30.0)).all()


def test_one_by_one_follows_the_closed_forms():
    left, right = (Lines(offset_m=np.array([y]), slope=np.zeros(1)) for y in (1.69, -1.31))
    courses = one_by_one(LEVEL, AXLE_M, [left, right])
    assert list(courses) == list(PARAMETERS)
    slopes = slopes_at_zero(courses)
    assert slopes["lateral"] == pytest.approx((-1.0, 1.0))  # original less changed: the left distance grows
    assert slopes["height"] == pytest.approx((-1.5 / H, -1.5 / H))  # both are 1.5 m from the camera
    percent = courses["height"].mean_percent[0]
    np.testing.assert_allclose(percent, 100.0 * courses["height"].mean_m[0] / 1.69)
    for course in courses.values():
        middle = len(course.change) // 2
        np.testing.assert_allclose(course.mean_m[:, middle], 0.0, atol=1e-12)


def test_shares_of_a_sum_are_those_of_its_variances_and_nothing_is_joint():
    found = shares(lambda x: x @ np.array([[1.0], [2.0]]), {"a": 1.0, "b": 1.0})
    assert found.first["a"][0] == pytest.approx(0.2, abs=0.01)
    assert found.total["b"][0] == pytest.approx(0.8, abs=0.01)
    assert found.joint["a", "b"][0] == pytest.approx(0.0, abs=0.02)
    assert found.std == pytest.approx(np.sqrt(5.0 / 3.0), rel=0.01)


def test_shares_of_a_product_are_all_joint():
    found = shares(lambda x: x[:, :1] * x[:, 1:], {"a": 1.0, "b": 2.0})
    assert found.first["a"][0] == pytest.approx(0.0, abs=0.02)
    assert found.total["a"][0] == pytest.approx(1.0, abs=0.03)
    assert found.joint["a", "b"][0] == pytest.approx(1.0, abs=0.04)


def test_shares_of_ishigamis_function_are_its_closed_ones():
    def ishigami(x):
        a, b, c = x.T
        return (np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a))[:, None]

    found = shares(ishigami, dict.fromkeys("abc", np.pi), draws=2048)
    np.testing.assert_allclose([found.first[k][0] for k in "abc"], [0.3139, 0.4424, 0.0], atol=0.02)
    np.testing.assert_allclose([found.total[k][0] for k in "abc"], [0.5576, 0.4424, 0.2437], atol=0.02)
    assert found.joint["a", "c"][0] == pytest.approx(0.2437, abs=0.03)
    assert found.joint["a", "b"][0] == pytest.approx(0.0, abs=0.03)


def test_outputs_are_put_together_by_their_variance():
    found = shares(lambda x: x * np.array([3.0, 1.0]), {"a": 1.0, "b": 1.0})  # one output each: 9 to 1
    assert found.first["a"][0] == pytest.approx(0.9, abs=0.01)
