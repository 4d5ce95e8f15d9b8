"""A video as CAN frames: the sensor's own chain, fed with its estimates."""

import math

import numpy as np
import pytest

from tests.video.drawn import EOR, VEHICLE
from tests.video.test_rows import line
from vsensor.logs.decode import decode_log
from vsensor.profile import load_profile
from vsensor.run import RunOptions
from vsensor.types import Environment, LaneEstimate, Side
from vsensor.video import Motion
from vsensor.video.methods import believed
from vsensor.video.rows import rows_from
from vsensor.video.sending import CYCLE_NS, VideoDrive, send_video, tick_ns, video_line

TENTH_NS = 100_000_000


def estimates(count, step_ns=TENTH_NS):
    """Return estimates whose left offset rises by 1 cm a picture; the right line is there in odd ones."""
    return [
        LaneEstimate(
            exposed_at_ns=k * step_ns,
            image_index=k,
            boundaries=(line(Side.LEFT, 1.6 + 0.01 * k), *[line(Side.RIGHT, -1.5)] * (k % 2)),
        )
        for k in range(count)
    ]


def sent(tmp_path, drive, profile_name, picture_ns=TENTH_NS):
    profile, log = load_profile(profile_name), tmp_path / "sent.log"
    summary = send_video(
        video_line(drive, EOR, VEHICLE, profile),
        drive,
        RunOptions(log=log, fast=True),
        lambda text: None,
        lambda: False,
        period_ns=tick_ns(profile, picture_ns),
    )
    return summary, decode_log(log, [profile])


@pytest.fixture(scope="module")
def p2(tmp_path_factory):
    """20 pictures at 10 Hz through p2, whose cycle they go with, and what its log holds."""
    motions = [Motion(speed_mps=20.0 + k, yaw_rate_radps=0.01, acceleration_mps2=0.5) for k in range(20)]
    drive = VideoDrive(estimates(20), motions, TENTH_NS, Environment())
    return sent(tmp_path_factory.mktemp("p2"), drive, "p2")


def test_every_frame_carries_the_offsets_of_its_picture(p2):
    _, table = p2
    expected = 1.5 + 0.01 * np.arange(20)  # to the inner edge of a marking of 0.2 m
    np.testing.assert_allclose(table.columns["left.lane_offset_m"], expected, atol=0.006)
    right = table.columns["right.lane_offset_m"]
    assert np.isnan(right[::2]).all()
    np.testing.assert_allclose(right[1::2], -1.4, atol=0.006)


def test_confidence_is_the_quality_and_none_where_there_is_no_line(p2):
    _, table = p2
    np.testing.assert_array_equal(table.columns["left.quality"], np.full(20, 3.0))
    np.testing.assert_array_equal(table.columns["right.quality"], [0, 3] * 10)


def test_the_motion_of_can_goes_along(p2):
    _, table = p2
    np.testing.assert_allclose(table.columns["ego.speed_mps"], 20.0 + np.arange(20), atol=0.1)


def test_the_cycle_is_the_profile_s_and_its_checks_hold(p2):
    summary, table = p2
    np.testing.assert_array_equal(np.diff(table.t_ns), TENTH_NS)
    assert summary.dropped_slots == 0
    assert summary.frames_sent == 40
    assert not [text for text in table.findings if "CRC" in text]  # those with a wrong one would be left out


def test_native_frames_keep_their_cycle_between_the_pictures(tmp_path):
    drive = VideoDrive(estimates(5), [Motion()] * 5, TENTH_NS, Environment())
    _, table = sent(tmp_path, drive, "native")
    assert set(np.diff(table.t_ns).tolist()) == {40_000_000}
    newest = (table.t_ns - table.t_ns[0]) // TENTH_NS
    np.testing.assert_array_equal(table.columns["image.index"], newest)
    np.testing.assert_allclose(table.columns["left.offset_m"], 1.6 + 0.01 * newest, atol=0.001)


def test_what_can_does_not_say_is_not_available(tmp_path):
    drive = VideoDrive(estimates(3), [Motion()] * 3, TENTH_NS, Environment())
    _, table = sent(tmp_path, drive, "p2")
    assert np.isnan(table.columns["ego.speed_mps"]).all()


def test_pictures_at_odd_times_go_out_in_the_sensor_s_own_cycle(tmp_path):
    picture_ns = round(1e9 / 29.97)
    assert tick_ns(load_profile("native"), picture_ns) == CYCLE_NS
    drive = VideoDrive(estimates(30, picture_ns), [Motion()] * 30, picture_ns, Environment())
    _, table = sent(tmp_path, drive, "native", picture_ns)
    newest = (table.t_ns - table.t_ns[0] + 1000) // picture_ns
    np.testing.assert_array_equal(table.columns["image.index"], newest)


def test_a_line_that_the_rows_do_not_believe_is_not_sent():
    rows = rows_from([(0.0, 1.5, math.nan, math.nan, 0.0, 3, 0), (0.1, math.nan, -1.4, math.nan, 0.0, 0, 3)])
    kept = believed(rows, [estimates(2)[1]] * 2)
    assert [[one.side for one in estimate.boundaries] for estimate in kept] == [[Side.LEFT], [Side.RIGHT]]
