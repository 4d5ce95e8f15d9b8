"""Missing, late or one too many: from the times alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.accept.intervals import Histogram, Pace, judge

CYCLE_NS = 40_000_000
PACE = Pace.of(CYCLE_NS, 0.1, 5_000_000)
WINDOW = 16


def judged(times_ms, pace=PACE):
    intervals = np.diff(np.round(np.array(times_ms) * 1e6).astype(np.int64), prepend=0)
    intervals[0] = pace.cycle_ns
    return judge(pace, intervals, 0, len(intervals), 0, WINDOW)


def places(mask):
    return np.flatnonzero(mask).tolist()


def test_what_passes_is_the_cycle_its_tolerance_and_the_jitter():
    assert (PACE.longest_ns, PACE.shortest_ns) == (49e6, 31e6)


def test_of_a_cycle_as_short_as_the_jitter_only_a_quarter_of_it_is_too_short():
    assert Pace.of(5_000_000, 0.1, 5_000_000).shortest_ns == 1_250_000


def test_times_on_the_cycle_are_fine():
    found = judged(np.arange(50) * 40.0)
    assert not found.missing.any()
    assert not (found.extra | found.late | found.early).any()


@given(
    st.lists(st.integers(0, 5), min_size=40, max_size=80),
    st.lists(st.floats(0, 4), min_size=84, max_size=84),
)
def test_the_number_of_missing_frames_is_what_was_left_out(gaps, jitter):
    gaps = [*gaps, 0, 0, 0, 0]  # at the very end nobody can tell
    kept = np.cumsum(1 + np.array(gaps))
    found = judged(kept * 40.0 + np.array(jitter[: len(kept)]))
    assert found.missing[1:].tolist() == gaps[1:]
    assert not found.extra.any()


@given(st.integers(1, 60), st.floats(10, 300))
def test_a_frame_that_alone_is_late_is_never_missing(place, delay_ms):
    times = np.arange(80) * 40.0
    times[place:] = np.maximum(times[place:], times[place] + delay_ms)
    found = judged(times)
    assert not found.missing.any()
    assert not found.extra.any()
    assert places(found.late) == [place]


@given(st.lists(st.integers(1, 58), min_size=1, max_size=5, unique=True), st.floats(0.01, 9))
def test_frames_that_come_twice_are_too_many(doubled, after_ms):
    times = np.arange(60) * 40.0
    found = judged(np.sort(np.concatenate([times, times[doubled] + after_ms])))
    assert int(found.extra.sum()) == len(doubled)
    assert not found.missing.any()
    assert not found.late.any()


@given(st.lists(st.floats(0, 38), min_size=100, max_size=100))
def test_a_recorder_that_delays_each_frame_by_less_than_a_cycle_loses_none(delays):
    delays = np.array(delays)
    delays[::4] = delays[-WINDOW:] = 0  # some are on time
    times = np.arange(100) * 40.0 + delays
    found = judged(np.maximum.accumulate(times))
    assert not found.missing.any()
    assert not found.extra.any()


def test_a_frame_lost_in_a_stream_that_is_stamped_in_batches_is_missing():
    sent = np.delete(np.arange(100), 50)
    batches = np.ceil(sent * 40.0 / 100.0) * 100.0  # read every 100 ms
    found = judged(batches)
    assert int(found.missing.sum()) == 1
    assert abs(places(found.missing)[0] - 50) <= 3


def test_a_stream_slower_than_its_cycle_has_late_frames_and_none_missing():
    found = judged(np.arange(50) * 55.0)
    assert not found.missing.any()
    assert places(found.late) == list(range(1, 50))


@given(st.lists(st.floats(0.01, 100_000), min_size=1, max_size=300), st.floats(0.01, 0.99))
def test_a_quantile_of_the_histogram_is_within_one_percent(values_ms, share):
    histogram = Histogram()
    histogram.add((np.array(values_ms) * 1e6).astype(np.int64))
    exact = np.quantile(values_ms, share, method="inverted_cdf")
    assert histogram.quantile_ms(share) == pytest.approx(exact, rel=0.01)


def test_no_interval_has_no_quantile():
    assert np.isnan(Histogram().quantile_ms(0.5))
