"""Points behind, beside and at the optical centre, cameras and vehicles in every attitude, whole chain."""

from math import nextafter, pi

import numpy as np
import pytest

from tests.hard_cases import chain
from tests.hard_cases.attitudes import ATTITUDES, HALF_TURNS, LINES, turned_road
from tests.hard_cases.far_out import EXACT
from tests.roads import ego, marking, snapshot, straight
from vsensor.camera import Camera, CameraConfig, project
from vsensor.types import Side, Unseen

CENTRE = np.array([1.9, 0.0, 1.35])
OFFSETS_M = (0.0, 1e-300, 1e-15, 1e-9, 1e-6, 1e-3)
GRIDS = pytest.mark.parametrize("pixel_grid", [False, True])


def through(points, **camera):
    """Return the output for one line along points of the ego frame."""
    lines = [marking(np.asarray(points, dtype=float))]
    return chain.shown(snapshot(lines), 2, camera=CameraConfig(**camera))[0]


@GRIDS
@pytest.mark.parametrize("off_m", OFFSETS_M)
@pytest.mark.parametrize("axis", [1, 2])
def test_a_line_through_the_optical_centre_or_past_it_by_a_hair_is_sound(off_m, axis, pixel_grid):
    x = np.sort(
        np.concatenate([np.linspace(0.0, 60.0, 500), CENTRE[0] + np.array([0.0, 1e-12, -1e-12, 1e-6])])
    )
    points = np.column_stack([x, np.full(len(x), CENTRE[1]), np.full(len(x), CENTRE[2])])
    points[:, axis] += off_m
    output = through(points, pixel_grid=pixel_grid, min_range_m=0.01)
    at_centre = np.abs(output.observation.candidates.points_ego_m[:, 0] - CENTRE[0]) < 0.01
    assert (output.observation.reason[at_centre] == Unseen.BEHIND_CAMERA).all()
    assert np.isfinite(output.observation.lines.points_ego_m).all()
    assert (output.observation.reason[~at_centre & (points[:, 0] > CENTRE[0])] == Unseen.SEEN).all()


@GRIDS
def test_lines_beside_and_behind_the_camera_alone_are_of_quality_0_with_that_reason(pixel_grid):
    lines = [straight(y, number, start=0.0, stop=1.8) for number, y in enumerate((1.8, -1.7))]
    output, values = chain.shown(snapshot(lines), 2, camera=CameraConfig(pixel_grid=pixel_grid))
    assert chain.reasons(output) == {side: Unseen.BEHIND_CAMERA for side in chain.OWN}
    assert values["left.quality"] == values["right.quality"] == 0.0


@pytest.mark.parametrize("depth_m", [0.0, -0.0, 1e-9, 1e-12, 1e-300, -1e-300, -1.0, -np.inf, np.nan])
def test_nothing_at_or_behind_the_optical_centre_has_a_pixel(depth_m):
    points = np.array([[x, y, depth_m] for x in (0.0, 1.0, -1e300) for y in (0.0, -3.0)])
    assert np.isnan(project(Camera.from_config(CameraConfig()), points)).all()


@GRIDS
@pytest.mark.parametrize("yaw_deg", [0.0, 90.0, -90.0, 180.0, -180.0])
@pytest.mark.parametrize("pitch_deg", [0.0, 90.0, -90.0])
@pytest.mark.parametrize("roll_deg", [0.0, 90.0, 180.0])
def test_a_camera_may_be_mounted_any_way_round(roll_deg, pitch_deg, yaw_deg, pixel_grid):
    lines = [straight(y, number) for number, y in enumerate(LINES.values())]
    camera = CameraConfig(roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg, pixel_grid=pixel_grid)
    output, _ = chain.shown(snapshot(lines), 2, camera=camera)
    if pitch_deg == 0.0:  # ahead all that the image is wide enough for; beside only that side; behind none
        beside = {90.0: {Side.NEXT_LEFT}, -90.0: {Side.NEXT_RIGHT}, 180.0: set(), -180.0: set()}
        assert chain.reported(output) == beside.get(yaw_deg, chain.reported(output))
        assert bool(chain.reported(output)) == (abs(yaw_deg) < 180.0)


@pytest.mark.parametrize("attitude", ATTITUDES)
def test_a_road_on_its_side_or_upside_down_gives_the_frames_of_a_level_one(attitude):
    level, turned = (chain.shown(turned_road(*rpy), 3)[1] for rpy in ((0.0, 0.0, 0.0), attitude))
    for name, value in level.items():
        # pixels at the border between two may go the other way: one in some thousand, 0.02 m apart
        assert turned[name] == pytest.approx(value, rel=1e-3, abs=1e-3, nan_ok=True), name


@pytest.mark.parametrize("yaw", HALF_TURNS)
def test_a_heading_of_half_a_turn_however_often_reports_the_road_behind(yaw):
    lines = [straight(y, number, start=-120.0, stop=20.0) for number, y in enumerate((1.8, -1.7))]
    output, _ = chain.shown(snapshot(lines, (), ego(yaw_rad=yaw)), **EXACT)
    assert output.estimate.on(Side.LEFT).coefficients[0] == pytest.approx(1.7, abs=1e-8)
    assert output.estimate.on(Side.RIGHT).coefficients[0] == pytest.approx(-1.8, abs=1e-8)


def test_a_heading_that_goes_through_half_a_turn_between_two_images_changes_no_side():
    lines = [straight(y, number, start=-150.0, stop=20.0) for number, y in enumerate((1.8, -1.7))]
    headings = [nextafter(pi, 0.0), pi, -pi, nextafter(-pi, 0.0), pi, 3 * pi, -pi]
    shots = [snapshot(lines, (), ego((-float(n), 0.0, 0.0), yaw_rad=yaw)) for n, yaw in enumerate(headings)]
    line = chain.line_of(lambda tick: shots[tick.index])
    values = [decoded for _, decoded in chain.drive(line, len(shots))]
    assert all(decoded["lane.change"] == 0.0 for decoded in values)
    assert all(decoded["left.available"] == decoded["right.available"] == 1.0 for decoded in values)


@pytest.mark.parametrize("pitch", [pi / 2, -pi / 2, nextafter(pi / 2, 0.0), 0.5, -0.5])
def test_a_body_that_pitches_by_a_quarter_turn_is_sound(pitch):
    lines = [straight(y, number) for number, y in enumerate(LINES.values())]
    for roll in (0.0, pi, -pi / 2):
        vehicle = ego(body_pitch_rad=pitch, body_roll_rad=roll, body_heave_m=0.5)
        for camera in (CameraConfig(), CameraConfig(pixel_grid=False)):
            chain.shown(snapshot(lines, (), vehicle), 2, camera=camera)
