"""Error statistics of events and of many of them (P2 2.27 to 2.37 with the errata)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.video.series import can
from vsensor.video.evaluate.categories import CATEGORIES, by_category, compared, errors_in, table_of
from vsensor.video.evaluate.pairing import reference_of
from vsensor.video.evaluate.rules import Rules
from vsensor.video.evaluate.statistics import Moments, pooled

ERRORS = arrays(np.float64, st.integers(1, 20), elements=st.floats(-4.0, 4.0))


def test_moments_are_mean_and_standard_deviation_of_what_is_known():
    errors = np.array([[0.1, np.nan], [0.3, -0.2]])
    one = Moments.of(errors)
    assert one.count == 3
    assert one.mean_m == pytest.approx(np.mean([0.1, 0.3, -0.2]))
    assert one.std_m == pytest.approx(np.std([0.1, 0.3, -0.2], ddof=1))


def test_two_events_pooled_by_hand():
    # means 0.1 and 0.5, weights 2 and 4; within: (0.02 + 0.04) / (1 + 3)
    first, second = np.array([0.0, 0.2]), np.array([0.4, 0.6, 0.4, 0.6])
    found = pooled([Moments.of(first), Moments.of(second)])
    mean = (2 * 0.1 + 4 * 0.5) / 6
    assert (found.cases, found.count) == (2, 6)
    assert found.mean_m == pytest.approx(mean)
    assert found.within_m == pytest.approx(np.sqrt(0.06 / 4))
    assert found.between_m == pytest.approx(np.sqrt((2 * (0.1 - mean) ** 2 + 4 * (0.5 - mean) ** 2) / 6))


@given(st.lists(ERRORS, min_size=1, max_size=6))
def test_mean_and_rms_are_those_of_all_values_and_the_parts_add_up(events):
    found = pooled([Moments.of(one) for one in events], events)
    together = np.concatenate(events)
    assert found.mean_m == pytest.approx(together.mean(), abs=1e-12)
    assert found.rms_m == pytest.approx(np.sqrt(np.mean(together**2)), abs=1e-12)
    assert found.abs_95_m == pytest.approx(np.quantile(np.abs(together), 0.95))
    freedom = found.count - found.cases
    within = freedom * found.within_m**2 if freedom else 0.0
    parts = found.count * (found.mean_m**2 + found.between_m**2) + within
    assert parts == pytest.approx(found.count * found.rms_m**2, abs=1e-9)


def test_the_published_deviation_does_not_see_what_events_differ_by():
    events = [Moments.of(np.array([-0.01, 0.01]) + bias) for bias in (-1.0, 1.0)]
    found = pooled(events)
    assert found.mean_m == pytest.approx(0.0)
    assert found.within_m == pytest.approx(np.sqrt(2e-4))
    assert found.between_m == pytest.approx(1.0)
    assert found.rms_m > 1.0


def test_an_event_without_a_value_is_no_case():
    found = pooled([Moments.of(np.full(3, np.nan)), Moments.of(np.array([0.2, 0.4]))])
    assert (found.cases, found.count) == (1, 2)
    assert found.mean_m == pytest.approx(0.3)


T_S = np.arange(100) * 0.1


def one_event(name="a", video=(1.85, -1.65), **columns):
    reference = reference_of(can(12.0, **columns), T_S, 0.0, Rules())
    return compared(name, reference, np.tile(video, (100, 1)))


def test_an_error_is_positive_where_the_video_says_too_far_out_on_either_side():
    error = one_event(video=(1.80, -1.70)).error_m  # the vehicle's lane is 1.75 m on both sides
    np.testing.assert_allclose(error, [[0.05, -0.05]] * 100, atol=1e-12)


def test_a_yaw_error_cancels_in_general_and_shows_on_each_side():
    figures = by_category([one_event(video=(1.85, -1.65))])
    assert figures["general"].mean_m == pytest.approx(0.0, abs=1e-12)
    assert figures["left"].mean_m == pytest.approx(0.1)
    assert figures["right"].mean_m == pytest.approx(-0.1)
    assert figures["general"].rms_m == pytest.approx(0.1)


def test_events_are_day_or_night_and_one_that_changes_is_neither():
    change = np.where(np.arange(121) < 60, 0.0, 2.0)
    events = [one_event("day"), one_event("night", sensor__light=2.0), one_event("b", sensor__light=change)]
    figures = by_category(events)
    assert (figures["general"].cases, figures["daytime"].cases, figures["nighttime"].cases) == (3, 1, 1)


def test_values_are_curvy_and_changing_by_themselves_either_way():
    early = np.arange(121) < 30
    yaw_rate = np.where(early, np.radians(-5.2), np.radians(4.8))
    event = one_event(ego__yaw_rate_radps=yaw_rate, ego__acceleration_mps2=np.where(early, -0.2, 0.05))
    counts = {name: len(errors_in(name, [event])[0]) for name in CATEGORIES}
    assert (counts["curvy"], counts["straight"]) == (60, 140)
    assert (counts["non-constant speed"], counts["constant speed"]) == (60, 140)


def test_the_table_has_the_published_rows_and_no_number_where_there_is_nothing():
    rows = table_of(by_category([one_event()]))
    assert [row[0] for row in rows[:8]] == [
        "type of case",
        *("general", "daytime", "nighttime", "straight", "curvy", "constant speed", "non-constant speed"),
    ]
    assert rows[0][1:5] == ["cases", "measurements", "mean", "standard deviation"]
    assert rows[3][1:] == ["0", "0", "-", "-", "-", "-", "-"]  # no event by night
