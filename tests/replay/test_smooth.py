"""Batches spread: cycles restored, order kept, what has no cycle left alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.replay.smooth import GAIN, Smooth, measured_cycles, smoothed

MS = 1_000_000


def run(cycles, keys, times):
    return smoothed(Smooth(latest_ns={}), cycles, np.array(keys), np.array(times, dtype=np.int64))[1]


def batched(count, cycle_ns, batch_ns):
    """Times of a message every cycle, stamped at the end of its batch."""
    true = np.arange(count) * cycle_ns
    return true, -(-true // batch_ns) * batch_ns


def test_the_jitter_of_batches_shrinks_to_less_than_a_third():
    _, stamps = batched(2000, 10 * MS, 7 * MS)
    steps = np.diff(run({1: 10 * MS}, [1] * 2000, stamps))[200:]
    assert np.std(steps) < np.std(np.diff(stamps)) / 3
    assert np.mean(steps) == pytest.approx(10 * MS, rel=0.01)


def test_a_clock_that_runs_fast_is_followed():
    stamps = (np.arange(3000) * 10 * MS * 1.0001).astype(np.int64)
    off = run({1: 10 * MS}, [1] * 3000, stamps) - stamps
    assert abs(off[-1]) < 1000 / GAIN + 10  # 100 ppm of 10 ms


def test_a_missed_frame_starts_the_cycle_anew():
    stamps = [0, 100 * MS, 300 * MS, 400 * MS]
    assert run({1: 100 * MS}, [1] * 4, stamps).tolist() == stamps


def test_a_missed_frame_of_a_cycle_shorter_than_a_batch_is_made_up_for_in_some_cycles():
    stamps = np.array([*range(10), *range(11, 100)]) * 10 * MS
    off = run({1: 10 * MS}, [1] * 99, stamps) - stamps
    assert off.min() == pytest.approx(-10 * MS * (1 - GAIN), rel=0.01)
    assert abs(off[50:]).max() < 0.1 * MS


def test_a_frame_without_a_cycle_keeps_its_time():
    assert run({}, [1, 2, 1], [0, 5, 9]).tolist() == [0, 5, 9]


@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 30 * MS)), max_size=80),
    st.integers(0, 80),
)
def test_the_files_order_is_kept_in_runs_of_any_size(frames, cut):
    keys = np.array([key for key, _ in frames], dtype=np.int64)
    times = np.cumsum(np.array([step for _, step in frames], dtype=np.int64))
    state, first = smoothed(Smooth(latest_ns={}), {0: 10 * MS, 1: 25 * MS}, keys[:cut], times[:cut])
    _, second = smoothed(state, {0: 10 * MS, 1: 25 * MS}, keys[cut:], times[cut:])
    assert (np.diff(np.concatenate([first, second])) >= 0).all()


def test_the_measured_cycle_is_the_median_of_what_comes_three_times():
    keys = np.array([1, 2, 1, 1, 2, -1, -1, -1, 3, 3, 3])
    times = np.array([0, 0, 10, 21, 5, 0, 1, 2, 4, 4, 4])
    assert measured_cycles(keys, times) == {1: 10}
