"""What of a CAN log stands for the truth at a video's frames (P2 2.3, 2.4)."""

import numpy as np
import pytest

from tests.video.series import can
from vsensor.errors import LogError
from vsensor.video.evaluate.pairing import driven_m, filled, reference_of
from vsensor.video.evaluate.rules import Rules


def test_an_offset_between_two_messages_is_on_the_straight_line_between_them():
    t = np.arange(121) * 0.1
    log = can(12.0, left__lane_offset_m=1.0 + 0.5 * t)
    at = np.array([0.03, 1.77, 4.0])
    np.testing.assert_allclose(reference_of(log, at, 0.0, Rules()).offset_m[:, 0], 1.0 + 0.5 * at, atol=1e-12)


def test_a_video_that_began_later_is_read_later_in_the_log():
    t = np.arange(121) * 0.1
    log = can(12.0, left__lane_offset_m=1.0 + 0.1 * t)
    at = np.arange(5) * 0.25
    np.testing.assert_allclose(reference_of(log, at, 3.0, Rules()).offset_m[:, 0], 1.3 + 0.1 * at, atol=1e-12)


@pytest.mark.parametrize("begins_s", [12.5, -4.0])
def test_a_log_that_does_not_overlap_the_video_is_refused_in_one_line(begins_s):
    with pytest.raises(LogError, match=r"made\.blf: does not overlap the video: the log has 0 to 12\.0 s"):
        reference_of(can(12.0), np.arange(30) * 0.1, begins_s, Rules())


def test_offsets_of_low_confidence_are_masked_each_side_for_itself():
    quality = np.where(np.arange(121) < 60, 2.0, 3.0)
    reference = reference_of(can(12.0, left__quality=quality), np.arange(121) * 0.1, 0.0, Rules())
    np.testing.assert_array_equal(np.isfinite(reference.offset_m[:, 0]), np.arange(121) >= 60)
    assert np.isfinite(reference.offset_m[:, 1]).all()
    assert reference.reliable_share == pytest.approx((61 + 121) / 242)


def test_between_two_values_the_lesser_confidence_counts():
    quality = np.where(np.arange(121) < 60, 4.0, 1.0)
    reference = reference_of(can(12.0, left__quality=quality), np.array([5.88, 5.92]), 0.0, Rules())
    assert reference.confidence[:, 0].tolist() == [4.0, 1.0]


def test_filling_changes_no_share():
    quality = np.where(np.arange(121) % 20 < 10, 1.0, 4.0)
    log, at = can(12.0, left__quality=quality, right__quality=quality), np.arange(121) * 0.1
    plain, full = (reference_of(log, at, 0.0, Rules(fill=fill)) for fill in (False, True))
    assert plain.reliable_share == full.reliable_share < 0.6
    assert np.isnan(plain.offset_m).any()
    assert np.isfinite(full.offset_m).all()


def test_a_gap_shorter_than_50_m_is_filled_straight_and_a_longer_one_is_left():
    way = np.arange(12) * 10.0
    values = np.array([0.0, np.nan, np.nan, 3.0, 4.0, np.nan, np.nan, np.nan, np.nan, 9.0, 10.0, 11.0])
    full = filled(way, values, 50.0)
    np.testing.assert_allclose(full[:5], [0.0, 1.0, 2.0, 3.0, 4.0])
    assert np.isnan(full[5:9]).all()  # 50 m from 4 to 9
    np.testing.assert_allclose(filled(way, values, 50.1), np.arange(12.0))


def test_ends_are_filled_level():
    way = np.arange(6) * 10.0
    values = np.array([np.nan, np.nan, 2.0, 3.0, np.nan, np.nan])
    np.testing.assert_allclose(filled(way, values, 50.0), [2.0, 2.0, 2.0, 3.0, 3.0, 3.0])
    np.testing.assert_array_equal(filled(way, values, 20.0), values)


def test_where_the_way_is_not_known_nothing_is_filled():
    way = driven_m(np.arange(4) * 1.0, np.array([10.0, np.nan, 10.0, 10.0]))
    values = np.array([1.0, np.nan, 1.0, 1.0])
    np.testing.assert_array_equal(filled(way, values, 50.0), values)
    np.testing.assert_array_equal(filled(way, np.full(4, np.nan), 50.0), np.full(4, np.nan))


def test_the_way_at_a_rising_speed_is_exact():
    t = np.arange(0.0, 10.1, 0.5)
    np.testing.assert_allclose(driven_m(t, 2.0 + 3.0 * t), 2.0 * t + 1.5 * t * t)


def test_what_the_log_does_not_tell_belongs_to_no_condition():
    log = can(12.0, ego__yaw_rate_radps=np.nan, sensor__light=np.nan)
    reference = reference_of(log, np.arange(20) * 0.1, 0.0, Rules())
    assert reference.light == ""
    assert np.isnan(reference.is_curvy).all()


def test_where_messages_pause_for_long_nothing_is_known():
    log = can(12.0)
    t, values = log.series["left.lane_offset_m"]
    kept = (t < 5.0) | (t > 8.0)
    log.series["left.lane_offset_m"] = t[kept], values[kept]
    offset = reference_of(log, np.array([4.9, 6.0, 8.1]), 0.0, Rules()).offset_m[:, 0]
    np.testing.assert_array_equal(np.isfinite(offset), [True, False, True])
