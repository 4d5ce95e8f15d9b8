"""The road laid along a path: where its borders are, that it is smooth, how it is painted."""

import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import ConfigError
from vsensor.schema import convert
from vsensor.sources.drive import DriveConfig, load_drive
from vsensor.types import Colour, MarkingKind, Stripe
from vsensor.world.dead_reckoning import integrated
from vsensor.world.laid_road import LaidRoadConfig, lay_road, smoothed


def path_of(speed, rate, seconds=60.0, step_s=0.01):
    t_ns = (np.arange(0.0, seconds, step_s) * 1e9).astype(np.int64)
    return integrated(t_ns, speed(t_ns / 1e9), rate(t_ns / 1e9))


def straight(speed=20.0, seconds=60.0):
    return path_of(lambda t: np.full_like(t, speed), np.zeros_like, seconds)


def curvature(points):
    step = np.diff(points[:, :2], axis=0)
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    return np.diff(heading) / np.hypot(step[1:, 0], step[1:, 1])


def test_on_a_straight_drive_the_borders_run_half_a_lane_to_either_side():
    road = lay_road(LaidRoadConfig(lane_width_m=3.6), straight())
    left, right, next_left = road.markings
    for marking, y in ((left, 1.8), (right, -1.8), (next_left, 5.4)):
        np.testing.assert_allclose(marking.points_world_m[:, 1], y, atol=1e-9)
        np.testing.assert_allclose(np.diff(marking.points_world_m[:, 0]), 0.1, atol=1e-9)
        assert (marking.points_world_m[:, 2] == 0.0).all()


def test_a_vehicle_left_of_its_lanes_centre_has_its_left_border_nearer():
    left, right, _ = lay_road(LaidRoadConfig(lane_width_m=3.6), straight(), offset_in_lane_m=0.3).markings
    np.testing.assert_allclose(left.points_world_m[:, 1], 1.5, atol=1e-9)
    np.testing.assert_allclose(right.points_world_m[:, 1], -2.1, atol=1e-9)


def test_in_a_bend_the_borders_are_circles_about_its_centre():
    radius, speed = 400.0, 20.0
    path = path_of(lambda t: np.full_like(t, speed), lambda t: np.full_like(t, speed / radius), 40.0)
    road = lay_road(LaidRoadConfig(lane_width_m=3.6), path)
    inner = slice(1600, -4000)  # away from the straight ends
    for marking, shift in zip(road.markings, (-1.8, 1.8, -5.4), strict=True):
        points = marking.points_world_m[inner]
        distance = np.hypot(points[:, 0], points[:, 1] - radius)
        np.testing.assert_allclose(distance, radius + shift, atol=2e-3)  # sigma^4 / (8 R^3): 0.1 mm, chords


def test_smoothing_leaves_a_cubic_as_it_is():
    x = np.arange(0.0, 400.0, 0.1) - 200.0
    line = np.column_stack([x, 0.3 - 0.01 * x + 1e-3 * x**2 + 4e-6 * x**3])
    inner = slice(950, -950)
    np.testing.assert_allclose(smoothed(line, 150.0)[inner], line[inner], atol=1e-6)


def test_smoothing_takes_off_what_is_short():
    x = np.arange(0.0, 400.0, 0.1)
    line = np.column_stack([x, 0.05 * np.sin(2 * np.pi * x / 20.0)])
    assert np.abs(smoothed(line, 150.0)[800:-800, 1]).max() < 1e-4


def across(path, road):
    """How far the path runs to the left of the road's centre line."""
    nearest = np.round((path.s_m - road.s_first_m) / 0.1).astype(int)
    centre = road.centre_world_m[nearest, :2]
    ahead = road.centre_world_m[nearest + 1, :2] - centre
    ahead /= np.hypot(*ahead.T)[:, None]
    return ahead[:, 0] * (path.y_m - centre[:, 1]) - ahead[:, 1] * (path.x_m - centre[:, 0])


@pytest.mark.parametrize(("speed", "radius"), [(4.0, 8.0), (8.0, 25.0), (20.0, 150.0), (35.0, 500.0)])
def test_the_road_follows_a_turn_at_a_crossing_as_well_as_a_bend_of_the_motorway(speed, radius):
    turning_s = np.pi / 2 * radius / speed

    def rate(t):  # a quarter turn, entered and left within a second and a half
        return speed / radius * np.clip(np.minimum(t - 20.0, 20.0 + 1.5 + turning_s - t) / 1.5, 0.0, 1.0)

    path = path_of(lambda t: np.full_like(t, speed), rate, 40.0 + turning_s)
    assert path.yaw_rad[-1] == pytest.approx(np.pi / 2, abs=0.01)
    assert np.abs(across(path, lay_road(LaidRoadConfig(), path))).max() < 0.25  # a tenth of half a lane


def test_steps_of_speed_and_yaw_rate_make_no_kinks():
    generator = np.random.default_rng(5)
    held = generator.choice([-0.244, 0.0, 0.244], 600)  # a step of the signal, changing every 0.1 s
    path = path_of(lambda t: np.where(t < 30, 15.0, 18.0), lambda t: np.radians(held[(t * 10).astype(int)]))
    for marking in lay_road(LaidRoadConfig(), path).markings:
        bend = curvature(marking.points_world_m)
        assert np.abs(np.diff(bend) / 0.1).max() < 1e-4  # 1/m^2; a motorway clothoid of A = 100 m has 1e-4


def test_dashes_have_their_length_and_gap():
    config = LaidRoadConfig(left="dashed", dash_m=3.0, gap_m=9.0)
    painted = lay_road(config, straight()).markings[0].painted
    starts = np.flatnonzero(np.diff(painted.astype(int)) == 1)
    ends = np.flatnonzero(np.diff(painted.astype(int)) == -1)
    assert np.abs(np.diff(starts) - 120).max() <= 1
    assert (
        np.abs(ends[ends > starts[0]][: len(starts)] - starts[: len(ends[ends > starts[0]])] - 30).max() <= 1
    )


@pytest.mark.parametrize(
    ("kind", "stripes"),
    [
        ("solid", [("SINGLE", True)]),
        ("none", [("SINGLE", False)]),
        ("double_solid", [("LEFT", True), ("RIGHT", True)]),
        ("solid_dashed", [("LEFT", True), ("RIGHT", None)]),
        ("dashed_solid", [("LEFT", None), ("RIGHT", True)]),
        ("double_dashed", [("LEFT", None), ("RIGHT", None)]),
        ("botts_dots", [("SINGLE", None)]),
    ],
)
def test_a_border_has_the_stripes_and_paint_of_its_kind(kind, stripes):
    markings = [m for m in lay_road(LaidRoadConfig(left=kind), straight()).markings if m.group == 0]
    assert [m.stripe for m in markings] == [Stripe[name] for name, _ in stripes]
    for marking, (_, always) in zip(markings, stripes, strict=True):
        assert (marking.kind == MarkingKind[kind.upper()]).all()
        assert set(marking.painted.tolist()) == ({False, True} if always is None else {always})


def test_the_stripes_of_a_double_are_a_gap_apart_and_the_left_one_is_left():
    config = LaidRoadConfig(left="double_solid", marking_width_m=0.12, double_gap_m=0.2, lane_width_m=3.5)
    left, right = lay_road(config, straight()).markings[:2]
    assert left.points_world_m[50, 1] - right.points_world_m[50, 1] == pytest.approx(0.32)
    assert left.points_world_m[50, 1] + right.points_world_m[50, 1] == pytest.approx(3.5)


def test_an_absent_border_has_no_marking():
    config = LaidRoadConfig(left="solid", right="absent", next_left="absent", next_right="absent")
    assert [m.group for m in lay_road(config, straight()).markings] == [0]


def test_a_window_is_a_view_with_the_ids_of_the_whole():
    road = lay_road(LaidRoadConfig(), straight())
    window = road.markings_window(100.0, 200.0)
    for part, whole in zip(window, road.markings, strict=True):
        assert (part.id, part.group) == (whole.id, whole.group)
        assert np.shares_memory(part.points_world_m, whole.points_world_m)
        assert part.points_world_m[0, 0] == pytest.approx(100.0, abs=0.11)
        assert part.points_world_m[-1, 0] == pytest.approx(200.0, abs=0.11)
        assert (
            len(part.painted)
            == len(part.kind)
            == len(part.colour)
            == len(part.width_m)
            == len(part.points_world_m)
        )


def test_a_window_beyond_the_road_is_cut():
    road = lay_road(LaidRoadConfig(), straight(seconds=5.0))
    assert all(len(m.points_world_m) == 0 for m in road.markings_window(1e6, 2e6))
    assert len(road.markings_window(-1e6, 1e6)[0].points_world_m) == len(road.centre_world_m)


def test_the_road_goes_on_beyond_the_end_of_the_drive_for_the_view():
    path = straight(seconds=10.0)
    assert lay_road(LaidRoadConfig(), path).centre_world_m[-1, 0] - path.x_m[-1] > 250.0


def test_a_stop_leaves_no_gap_and_no_kink():
    path = path_of(lambda t: np.where((t > 20) & (t < 30), 0.0, 15.0), lambda t: 0.02 + 0.0 * t)
    points = lay_road(LaidRoadConfig(), path).centre_world_m
    steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
    assert steps.max() < 0.101
    assert np.abs(np.diff(curvature(points)) / 0.1).max() < 1e-3


def test_colour_and_width_are_those_of_the_config():
    road = lay_road(LaidRoadConfig(colour="yellow", marking_width_m=0.12), straight())
    assert (road.markings[0].colour == Colour.YELLOW).all()
    assert (road.markings[0].width_m == 0.12).all()


def test_an_unknown_kind_of_marking_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"left = 'dotted'"):
        convert({"left": "dotted"}, LaidRoadConfig, "x.toml")


@needs_shared
def test_the_rav4s_road_is_smooth_and_within_centimetres_of_its_path():
    dbc = str(SHARED_DATA / "dbc/toyota_rav4_2017_pt_generated.dbc")
    path = load_drive(SHARED_DATA / "can/rav4_drive.log", DriveConfig(profile=("toyota_rav4",), dbc=dbc)).path
    road = lay_road(LaidRoadConfig(), path)
    assert np.abs(np.diff(curvature(road.centre_world_m)) / 0.1).max() < 1e-4  # measured 4.2e-5 1/m^2
    assert np.abs(across(path, road)).max() < 0.1  # measured 0.045 m
