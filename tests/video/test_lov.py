"""P2's thresholds and fillings (2.5.3): what goes, what comes, what stays empty."""

import numpy as np
import pytest

from vsensor.video.lov import LovConfig, filled, plausible, processed
from vsensor.video.rows import rows_from

CONFIG = LovConfig()
T_S = 0.1 * np.arange(60)
NAN = np.nan


def test_an_offset_lies_between_nothing_and_four_metres():
    found = plausible(CONFIG, T_S[:4], np.array([-0.1, 1.0, 4.0, NAN]))
    np.testing.assert_array_equal(np.isfinite(found), [False, True, False, False])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_jump_faster_than_a_vehicle_moves_sideways_goes_both_ways(sign):
    offset = 2.0 + sign * np.array([0.0, 0.2, 0.2, 0.5, 0.5])  # 2, 0, 3, 0 m/s
    np.testing.assert_array_equal(np.isnan(plausible(CONFIG, T_S[:5], offset)), [0, 0, 0, 1, 0])


def test_the_same_movement_at_another_rate_has_the_same_fate():
    for rate_hz in (4.0, 10.0, 25.0):
        t_s = np.arange(20) / rate_hz
        assert np.isfinite(plausible(CONFIG, t_s, 0.5 + 0.4 * t_s)).all()  # 0.4 m/s
        assert np.isnan(plausible(LovConfig(max_lateral_mps=0.39), t_s, 0.5 + 0.4 * t_s)[1:]).all()


def test_a_gap_of_two_seconds_is_filled_straight_and_one_more_value_is_not():
    for missing, is_filled in ((20, True), (21, False)):
        offset = 1.0 + 0.01 * np.arange(60)
        expected = offset.copy()
        offset[10 : 10 + missing] = NAN
        found = filled(CONFIG, T_S, offset)
        np.testing.assert_allclose(found, expected if is_filled else offset, rtol=1e-12)


def test_two_seconds_are_two_seconds_at_four_hertz():
    t_s, offset = np.arange(30) / 4.0, np.ones(30)
    offset[5:13] = NAN  # 8 values
    assert np.isfinite(filled(CONFIG, t_s, offset)).all()
    offset[5:14] = NAN
    assert np.isnan(filled(CONFIG, t_s, offset)).sum() == 9


def test_ends_are_held_level_where_that_is_wanted():
    offset = np.concatenate([[NAN] * 5, np.linspace(1.0, 2.0, 50), [NAN] * 5])
    found = filled(CONFIG, T_S, offset)
    assert (found[:5] == 1.0).all()
    assert (found[-5:] == 2.0).all()
    assert np.isnan(filled(LovConfig(extrapolate=False), T_S, offset)).sum() == 10


def test_of_nothing_nothing_is_made():
    assert np.isnan(filled(CONFIG, T_S, np.full(60, NAN))).all()


def test_a_left_offset_that_is_refused_has_no_confidence():
    rows = rows_from([(0.0, 4.5, -1.7, 6.2, 0.0, 3, 3)])
    assert processed(CONFIG, rows).left_confidence[0] == 0
    assert processed(CONFIG, rows).right_confidence[0] == 3


def test_what_is_filled_has_no_confidence_and_what_is_refused_no_width():
    rows = rows_from([(0.1 * k, 1.5, -1.7 if k != 2 else -7.0, 3.2, 0.0, 3, 3) for k in range(5)])
    bare = processed(CONFIG, rows)
    np.testing.assert_array_equal(np.isnan(bare.lane_width_m), [0, 0, 1, 0, 0])
    np.testing.assert_array_equal(bare.right_confidence, [3, 3, 0, 3, 3])
    whole = processed(LovConfig(fill=True), rows)
    np.testing.assert_allclose(whole.right_offset_m, -1.7)
    np.testing.assert_allclose(whole.lane_width_m, 3.2)
    np.testing.assert_array_equal(whole.right_confidence, [3, 3, 0, 3, 3])
