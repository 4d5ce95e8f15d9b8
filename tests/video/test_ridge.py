"""Our own method: how far off, how often, and on what it does not fall for. Made drives with exact truth."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.video.drives import AXLE_M, EOR, TWO_LANES, Drive, Line, night
from vsensor.camera import Camera, CameraConfig
from vsensor.errors import ConfigError
from vsensor.image import ImageConfig
from vsensor.signals import VehicleConfig
from vsensor.signals.lane import lane_offset_m
from vsensor.types import Environment, Light, MarkingKind, Side
from vsensor.video.ridge import BOUNDS_M, Ridge, RidgeConfig
from vsensor.video.types import Motion, Picture

CONFIG, VEHICLE = RidgeConfig(), VehicleConfig(wheelbase_m=AXLE_M)


def weaving(t):
    return 0.35 * np.sin(0.6 * t)


def shaken(t):
    return np.radians(0.5 * np.sin(2.0 * np.pi * 1.3 * t))


def winding(s):
    return 0.004 * np.sin(s / 60.0)


@cache
def looked(drive, count):
    """Return a drive's estimates and what they were found from, beside the frames."""
    method = Ridge(CONFIG, Camera.from_config(drive.camera), VEHICLE)
    state, found = method.begin(), []
    for frame in drive.frames(count):
        state, estimate, look = method.examine(state, frame.picture, frame.motion)
        found.append((frame, estimate, look))
    return found


def offsets(found, axle_m=AXLE_M):
    """Return offsets of left and right as reported and as they are, each (N, 2)."""
    said = [
        [_offset(estimate.on(side), axle_m) for side in (Side.LEFT, Side.RIGHT)] for _, estimate, _ in found
    ]
    return np.array(said), np.array([frame.truth(axle_m) for frame, _, _ in found])


def _offset(line, axle_m):
    return np.nan if line is None else lane_offset_m(line, axle_m)


def rms(values):
    return float(np.sqrt(np.nanmean(values**2)))


@pytest.mark.parametrize("light", [{}, night()], ids=["day", "night"])
def test_on_a_winding_road_with_a_pitching_body_bias_and_rms_keep_the_issues_limits(light):
    drive = Drive(offset=weaving, pitch_rad=shaken, curvature=winding, **light)
    said, true = offsets(looked(drive, 30))
    assert np.isfinite(said).mean() >= 0.95
    assert abs(np.nanmean(said - true)) <= 0.05
    assert rms(said - true) <= 0.10


def test_a_road_without_markings_gives_no_line():
    for light in ({}, night()):
        assert not any(estimate.boundaries for _, estimate, _ in looked(Drive(lines=(), **light), 5))


def test_a_black_picture_gives_no_line():
    method = Ridge(CONFIG, Camera.from_config(EOR), VEHICLE)
    picture = Picture(index=0, t_ns=0, grey=np.zeros((288, 355), np.uint8))
    _, estimate = method.look(method.begin(), picture, Motion())
    assert estimate.boundaries == ()


def test_the_mirrored_picture_gives_the_mirrored_lines():
    drive = Drive(offset=lambda _: 0.3, lines=(Line(1.75), Line(-1.75)))
    camera = CameraConfig(
        **{**{key: getattr(EOR, key) for key in ("width_px", "height_px", "fx_px", "fy_px", "cy_px")}},
        cx_px=177.0,
        position_m=(AXLE_M - 1.0, 0.0, 1.36),
    )
    frame = next(replace(drive, camera=camera).frames(1))
    method = Ridge(CONFIG, Camera.from_config(camera), VEHICLE)
    _, plain = method.look(method.begin(), frame.picture, Motion())
    turned = replace(frame.picture, grey=np.ascontiguousarray(frame.picture.grey[:, ::-1]))
    _, mirrored = method.look(method.begin(), turned, Motion())
    for side, other in ((Side.LEFT, Side.RIGHT), (Side.RIGHT, Side.LEFT)):
        np.testing.assert_allclose(mirrored.on(side).coefficients, -plain.on(other).coefficients, atol=1e-3)


def test_the_bodys_pitch_is_told_from_where_the_lines_meet():
    found = looked(Drive(pitch_rad=shaken), 12)
    said = np.array([look.road.pitch_rad for _, _, look in found])
    true = np.array([frame.snapshot.ego.body_pitch_rad for frame, _, _ in found])
    assert np.ptp(true) > np.radians(0.9)
    np.testing.assert_allclose(said, true, atol=np.radians(0.15))


def test_a_solid_and_a_dashed_line_are_told_apart_and_their_widths_measured():
    _, estimate, _ = looked(Drive(), 6)[-1]
    left, right = estimate.on(Side.LEFT), estimate.on(Side.RIGHT)
    assert (left.kind, right.kind) == (MarkingKind.DASHED, MarkingKind.SOLID)
    assert left.width_m == pytest.approx(0.15, abs=0.02)
    assert right.width_m == pytest.approx(0.20, abs=0.02)


def test_one_line_alone_is_reported_on_its_side():
    drive = Drive(lines=TWO_LANES[2:], offset=weaving)
    said, true = offsets(looked(drive, 10))
    assert np.isnan(said[:, 0]).all()
    assert rms(said[:, 1] - true[:, 1]) < 0.05


def test_a_camera_that_looks_up_is_refused_in_one_line():
    camera = CameraConfig(pitch_deg=-60.0)
    with pytest.raises(ConfigError, match="sees no road"):
        Ridge(CONFIG, Camera.from_config(camera), VEHICLE)


def test_crosswalks_stop_lines_and_a_roundabouts_bend_do_not_lead_astray():
    drive = Drive(
        crossings=(46.0, 62.0), stop_lines=(44.0, 60.0), speed_mps=10.0, curvature=lambda s: 0.02 * (s > 75.0)
    )
    said, true = offsets(looked(drive, 30))
    assert np.isfinite(said).mean() >= 0.95
    assert rms(said - true) <= 0.10


def test_cars_that_hide_the_lines_leave_an_offset_that_is_right():
    drive = Drive(offset=weaving, pitch_rad=shaken, traffic=((15.0, 0.0), (12.0, 3.5), (25.0, 3.5)))
    said, true = offsets(looked(drive, 20))
    assert np.isfinite(said).mean() >= 0.95
    assert rms(said - true) <= 0.10


def test_a_line_that_ends_is_not_reported_behind_its_end_nor_is_the_next_lanes_in_its_place():
    ended = Line(-1.75, gaps=((45.0, 500.0),))
    found = looked(Drive(lines=(Line(1.75), ended, Line(-5.25))), 20)
    said, true = offsets(found)
    assert np.isfinite(said[:4]).all()
    behind = np.array([frame.snapshot.ego.position_world_m[0] > 47.0 for frame, _, _ in found])
    assert behind.sum() > 8
    assert np.isnan(said[behind, 1]).all()
    assert rms(said[:, 0] - true[:, 0]) < 0.05


def test_a_lane_change_hands_the_crossed_line_to_the_other_side_as_the_rear_axle_crosses_it():
    drive = Drive(offset=lambda t: 3.5 / (1.0 + np.exp(-2.5 * (t - 1.2))), lines=(*TWO_LANES, Line(5.25)))
    found = looked(drive, 25)
    said, true = offsets(found)
    sides_differ = np.abs(said - true) > 1.0
    assert np.count_nonzero(sides_differ.any(axis=1)) <= 2
    assert rms(np.where(sides_differ, np.nan, said - true)) <= 0.10
    assert [estimate.lane_change for _, estimate, _ in found].count(1) == 1


def test_without_motion_from_can_the_offsets_are_as_good():
    drive = Drive(offset=weaving, pitch_rad=shaken, curvature=winding)
    method = Ridge(CONFIG, Camera.from_config(EOR), VEHICLE)
    state, found = method.begin(), []
    for frame in drive.frames(15):
        state, estimate = method.look(state, frame.picture, Motion())
        found.append((frame, estimate, None))
    said, true = offsets(found)
    assert rms(said - true) <= 0.05


def test_of_a_double_marking_the_dashed_stripe_beside_the_lane_counts_between_its_dashes_too():
    dashed = Line(1.75, dash_m=3.0, every_m=9.0, width_m=0.12, gaps=((50.0, 100.0),))
    found = looked(Drive(lines=(Line(2.03, width_m=0.12), dashed, Line(-1.75))), 16)
    said, _ = offsets(found)
    np.testing.assert_allclose(said[5:, 0], 1.75 - 0.06, atol=0.08)
    assert sum(bool(line.beside_m) for _, _, look in found for line in look.lines) >= 1


HARD = (
    Drive(offset=weaving, pitch_rad=shaken, curvature=winding),
    Drive(offset=weaving, pitch_rad=shaken, curvature=winding, **night()),
    Drive(offset=weaving, pitch_rad=shaken, traffic=((15.0, 0.0), (12.0, 3.5), (25.0, 3.5))),
    Drive(
        lines=(
            Line(1.75, dash_m=3.0, every_m=12.0, wear=0.4),
            Line(-1.75, dash_m=3.0, every_m=12.0, wear=0.4),
        ),
        offset=weaving,
        pitch_rad=shaken,
        air=Environment(light=Light.NIGHT, rain=0.5),
        image=ImageConfig(noise_std=3.0),
    ),
)


def test_of_each_confidence_95_percent_of_the_offsets_are_within_its_bound():
    errors, sure = [], []
    for drive, count in zip(HARD, (30, 30, 20, 40), strict=True):
        found = looked(drive, count)
        said, true = offsets(found)
        errors.append(np.abs(said - true).ravel())
        for _, estimate, _ in found:
            lines = [estimate.on(side) for side in (Side.LEFT, Side.RIGHT)]
            sure += [0 if line is None else line.quality for line in lines]
    error, confidence = np.concatenate(errors), np.array(sure)
    quantiles = []
    for number, bound_m in enumerate(BOUNDS_M, start=1):
        of_this = error[(confidence == number) & np.isfinite(error)]
        if len(of_this) >= 20:
            quantiles.append(float(np.quantile(of_this, 0.95)))
            assert quantiles[-1] <= bound_m
    assert len(quantiles) >= 3
    assert quantiles == sorted(quantiles, reverse=True)
