"""The figures of a lane departure, from courses whose figures are known."""

import numpy as np
import pytest

from vsensor.experiment.course import LOOP_FIGURES, loop_figures
from vsensor.experiment.ecu import REQUEST, WARNING
from vsensor.profile import LaneWarning

T = np.arange(0.0, 10.0, 0.04)
RELEASE_S = 2.0
SILENT = {REQUEST: np.empty((0, 2)), WARNING: np.empty((0, 2))}


def course(dtle=None, acceleration=None):
    """A course: 0.5 m/s towards the edge from 1 m on, no acceleration, the other edge 1 m away."""
    straight = 1.0 - 0.5 * (T - RELEASE_S)
    return np.stack(
        [
            T,
            straight if dtle is None else dtle,
            np.full(T.size, 1.0),
            np.zeros(T.size) if acceleration is None else acceleration,
            np.where(T < RELEASE_S - 0.01, 0.1, -np.gradient(straight if dtle is None else dtle, T)),
        ],
        axis=1,
    )


def figures(course_, ecu=None, is_left=True, marking_m=0.15):
    return loop_figures(course_, {**SILENT, **(ecu or {})}, RELEASE_S, marking_m, is_left)


def test_every_figure_is_a_column():
    assert tuple(figures(course())) == LOOP_FIGURES


def test_a_drift_without_an_ecu_has_its_speed_and_no_warning():
    found = figures(course())
    assert found["departure_mps"] == pytest.approx(0.5)
    assert found["dtle_min_m"] == pytest.approx(1.0 - 0.5 * (T[-1] - RELEASE_S))
    assert np.isnan([found["warning_s"], found["dtle_at_warning_m"], found["intervention_s"]]).all()


def test_a_warning_is_placed_between_two_images():
    warning = np.array([[4.5, float(LaneWarning.NONE)], [4.51, float(LaneWarning.LEFT)]])
    found = figures(course(), {WARNING: warning})
    assert found["warning_s"] == pytest.approx(2.51)
    assert found["dtle_at_warning_m"] == pytest.approx(1.0 - 0.5 * 2.51)
    assert found["beyond_marking_at_warning_m"] == pytest.approx(0.5 * 2.51 - 1.0 - 0.15)
    assert found["time_to_crossing_at_warning_s"] == pytest.approx((1.0 - 0.5 * 2.51) / 0.5)


def test_a_warning_of_the_other_side_is_none():
    warning = {WARNING: np.array([[4.5, float(LaneWarning.LEFT)]])}
    assert np.isnan(figures(course(), warning, is_left=False)["warning_s"])


def test_only_a_request_after_the_release_is_an_intervention():
    requests = np.array([[1.0, 0.01], [3.0, np.nan], [3.02, 0.01]])
    found = figures(course(), {REQUEST: requests})
    assert found["intervention_s"] == pytest.approx(1.02)
    assert found["dtle_at_intervention_m"] == pytest.approx(1.0 - 0.5 * 1.02)


@pytest.mark.parametrize(("ramp_s", "expected"), [(1.0, 2.0), (0.52, 2.0), (0.24, 0.96)])
def test_jerk_is_the_mean_over_half_a_second(ramp_s, expected):
    # 2 m/s^3 for so long: a shorter ramp fills only part of the half second
    acceleration = 2.0 * np.clip(T - 4.0, 0.0, ramp_s)
    found = figures(course(acceleration=acceleration))
    assert found["lateral_jerk_max_mps3"] == pytest.approx(expected, abs=1e-9)
    assert found["lateral_acceleration_max_mps2"] == pytest.approx(2.0 * ramp_s)


def test_what_the_bend_needs_is_not_counted_and_what_was_before_the_release_neither():
    acceleration = np.where(T < RELEASE_S - 0.02, 3.0, 1.2)
    found = figures(course(acceleration=acceleration))
    assert found["lateral_acceleration_max_mps2"] == pytest.approx(0.0)
    assert found["lateral_jerk_max_mps3"] == pytest.approx(0.0)


@pytest.mark.parametrize(("returns_mps", "beyond"), [(0.2, -0.3), (0.6, 0.1)])
def test_the_speed_back_counts_two_seconds_after_the_least_distance(returns_mps, beyond):
    dtle = np.where(T < 4.0, 1.0 - 0.5 * (T - RELEASE_S), returns_mps * (T - 4.0))
    found = figures(course(dtle))
    assert found["dtle_min_m"] == pytest.approx(0.0, abs=0.01)
    assert found["returning_mps"] == pytest.approx(returns_mps)
    assert found["returning_beyond_mps"] == pytest.approx(beyond)


def test_a_slow_departure_allows_a_return_of_30_cm_a_second():
    dtle = np.where(T < 4.0, 0.4 - 0.2 * (T - RELEASE_S), 0.3 * (T - 4.0))
    assert figures(course(dtle))["returning_beyond_mps"] == pytest.approx(0.0)
