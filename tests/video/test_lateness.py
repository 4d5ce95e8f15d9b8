"""A video that began at another time than it says."""

import numpy as np
import pytest

from tests.video.series import can
from vsensor.video.evaluate.lateness import Timed, lateness_s

AT_S = np.arange(10, 290) * 0.1


def drive(t_s):
    """Return the offset to the left marking of a vehicle that wanders in its lane."""
    return 1.7 + 0.3 * np.sin(0.9 * t_s) + 0.1 * np.sin(2.1 * t_s)


def timed(late_s, bias_m=0.0, noise_m=0.0):
    t = np.arange(601) * 0.05
    log = can(30.0, step_s=0.05, left__lane_offset_m=drive(t), right__lane_offset_m=drive(t) - 3.5)
    left = drive(AT_S - late_s) + bias_m
    noise = np.random.default_rng(3).normal(0.0, noise_m or 1e-9, (len(AT_S), 2))
    offset = np.column_stack([left, left - 3.5 + 2.0 * bias_m]) + noise
    return Timed(can=log, at_s=AT_S, offset_m=offset, counts=np.ones((len(AT_S), 2), bool))


@pytest.mark.parametrize("late_s", [-0.31, 0.0, 0.127])
def test_a_lateness_is_found_whatever_the_bias_and_the_noise(late_s):
    events = [timed(late_s, 0.2, 0.03), timed(late_s, -0.1, 0.03)]
    assert lateness_s(events) == pytest.approx(late_s, abs=0.01)


def test_signals_that_do_not_move_say_nothing_of_time():
    log = can(30.0)
    offset = np.tile([1.75, -1.75], (len(AT_S), 1)) + np.random.default_rng(1).normal(
        0.0, 0.02, (len(AT_S), 2)
    )
    flat = Timed(can=log, at_s=AT_S, offset_m=offset, counts=np.ones(offset.shape, bool))
    assert np.isnan(lateness_s([flat]))


def test_a_drive_of_another_time_is_not_given_one():
    assert np.isnan(lateness_s([timed(2.0)]))
