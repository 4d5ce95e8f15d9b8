"""From timestamps to due times: in the file's order, exact, over gaps, speeds, loops."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.replay.timeline import CLOCK_SET_NS, Order, Pace, Place, in_order, looped, moved, paced, seam_of

T0 = 1_533_224_087_000_000_000
TIMES = st.lists(st.integers(-3 * CLOCK_SET_NS, 3 * CLOCK_SET_NS), min_size=1, max_size=60)


def array(*values):
    return np.array(values, dtype=np.int64)


def ordered(values, cut=None):
    """All values in order, given at once or in two runs."""
    runs = [values] if cut is None else [values[:cut], values[cut:]]
    state, out = Order(), []
    for run in runs:
        state, times = in_order(state, array(*run))
        out += times.tolist()
    return state, out


def test_times_that_never_fall_stay_as_they_are():
    values = [T0, T0, T0 + 1, T0 + 7]
    assert ordered(values)[1] == values


def test_a_time_before_the_one_before_it_is_played_at_once():
    assert ordered([10, 20, 15, 18, 30])[1] == [10, 20, 20, 20, 30]


def test_after_a_clock_was_set_back_the_intervals_go_on():
    back = T0 - 3600 * 10**9
    state, times = ordered([T0, T0 + 5, back, back + 4])
    assert times == [T0, T0 + 5, T0 + 5, T0 + 9]
    assert (state.clock_set, state.backward) == (1, 0)


def test_repeated_and_backward_times_are_counted():
    state, _ = ordered([1, 1, 3, 2, 2, 9])
    assert (state.repeated, state.backward, state.clock_set) == (2, 1, 0)


@given(TIMES, st.integers(0, 60))
def test_runs_of_any_size_give_the_same_times_and_findings(values, cut):
    assert ordered(values, min(cut, len(values))) == ordered(values)


@given(TIMES)
def test_no_frame_is_played_before_the_one_before_it(values):
    assert (np.diff(ordered(values)[1]) >= 0).all()


def test_findings_name_how_many():
    state, _ = ordered([1, 1, 3, 2, 2 - 2 * CLOCK_SET_NS])
    assert [line.split(":")[0] for line in state.lines(5)] == [
        "1 of 4 intervals are 0 (25.0%)",
        "1 timestamps run backwards",
        "1 times the log's clock was set back",
    ]


def test_at_speed_one_due_times_are_the_intervals_of_the_log_to_the_nanosecond():
    _, due = paced(Pace(), Place(at_ns=T0), array(T0, T0 + 1, T0 + 10**15 + 7))
    assert due.tolist() == [0, 1, 10**15 + 7]


@pytest.mark.parametrize("speed", ["0.1", "0.333", "2", "100"])
def test_at_a_speed_the_time_is_divided_and_no_error_adds_up(speed):
    pace = Pace(speed=Fraction(speed))
    place = Place(at_ns=T0)
    for k in range(1, 200):
        place, due = paced(pace, place, array(T0 + k * 1_000_003))
    assert due.tolist() == [int(199 * 1_000_003 / Fraction(speed))]


@pytest.mark.parametrize("log_s", [10**8, 2 * 10**9])
def test_at_a_speed_of_three_decimals_years_of_log_time_are_divided_right(log_s):
    pace = Pace(speed=Fraction(33337, 1000))
    _, due = paced(pace, Place(at_ns=T0), array(T0, T0 + log_s * 10**9 + 7))
    assert due.tolist() == [0, (log_s * 10**9 + 7) * 1000 // 33337]


def test_a_longer_gap_is_cut_and_a_shorter_one_is_not():
    pace = Pace(max_gap_ns=100)
    place, due = paced(pace, Place(at_ns=0), array(0, 50, 150, 1000, 1001))
    assert due.tolist() == [0, 50, 150, 250, 251]
    assert paced(pace, place, array(9999))[1].tolist() == [351]


@given(st.lists(st.integers(0, 10**12), min_size=1, max_size=40).map(sorted), st.integers(0, 40))
def test_pacing_in_two_runs_is_pacing_in_one(values, cut):
    pace = Pace(speed=Fraction(7, 3), max_gap_ns=10**9)
    _, whole = paced(pace, Place(at_ns=0), array(*values))
    place, first = paced(pace, Place(at_ns=0), array(*values[:cut]))
    _, second = paced(pace, place, array(*values[cut:]))
    assert [*first.tolist(), *second.tolist()] == whole.tolist()


def test_a_loop_begins_one_seam_after_the_end_of_the_log():
    place, _ = paced(Pace(), Place(at_ns=100), array(100, 160))
    again = looped(Pace(), place, start_ns=100, end_ns=190, seam_ns=5)  # the last 30 ns hold no chosen frame
    assert paced(Pace(), again, array(100, 160))[1].tolist() == [95, 155]


@given(st.integers(0, 10**15), st.fractions(Fraction(1, 10), 100, max_denominator=1000))
def test_after_a_seek_the_time_goes_on_where_it_was(due_ns, speed):
    pace = Pace(speed=speed)
    place = moved(pace, 5000, due_ns)
    assert due_ns <= place.due_ns(pace) <= due_ns + 1 / speed
    assert paced(pace, place, array(5000))[1][0] == place.due_ns(pace)


def test_the_seam_is_the_median_of_the_intervals_that_are_not_0():
    assert seam_of(array(0, 0, 10, 10, 20, 120)) == 10
    assert seam_of(array(7)) == 0
    assert seam_of(array(7, 7)) == 0
