import numpy as np
import pytest

from vsensor.experiment.conditions import (
    AXES,
    ConditionSink,
    binned,
    condition_rows,
    gaps_m,
    pooled,
    radii_m,
    shares,
)
from vsensor.score import ERROR_RANGES_M, ErrorStats
from vsensor.session import Session
from vsensor.signals import VehicleConfig
from vsensor.sinks.trace_file import COLUMNS
from vsensor.study.scenario_cells import TraceInMemory
from vsensor.types import Side

X = np.arange(0.0, 110.0, 0.1)
NAMES = {axis.name: axis for axis in AXES}


def trace(rows, **columns):
    """A trace of so many rows, NaN but for the columns given."""
    empty = {name: np.full(rows, np.nan) for name in COLUMNS}
    told = {name: np.asarray(column) for name, column in columns.items()}
    return {**empty, "tick": np.arange(rows), "side": np.zeros(rows, np.uint8), **told}


def test_the_gap_before_a_range_is_the_longest_that_begins_before_it():
    painted = np.ones(X.size, bool)
    painted[(X > 14.95) & (X < 19.95)] = False  # 15.0 to 19.9: 5 m without paint
    painted[(X > 29.95) & (X < 49.95)] = False  # 20 m
    np.testing.assert_allclose(gaps_m(X, painted), [0.0, 5.0, 20.0, 20.0, 20.0], atol=1e-9)


def test_a_gap_behind_the_vehicle_does_not_count_and_a_line_without_paint_has_none():
    x = np.arange(-20.0, 100.0, 0.1)
    painted = x > -0.05
    np.testing.assert_allclose(gaps_m(x, painted)[0], 0.0, atol=0.11)
    assert np.isnan(gaps_m(x, np.zeros(x.size, bool))).all()


def test_what_is_hidden_is_a_share_of_the_paint_not_of_the_line():
    painted = (X % 10) < 4.95
    hidden = (X > 20) & (X < 30)
    found = shares(X, painted, hidden)
    np.testing.assert_allclose(found[:2], 0.0)
    np.testing.assert_allclose(found[2], 1 / 5, atol=0.01)
    assert np.isnan(shares(X, np.zeros(X.size, bool), hidden)).all()


@pytest.mark.parametrize("radius", [250.0, -400.0, 1500.0])
def test_the_radius_of_a_circle_is_its_own_near_the_vehicle(radius):
    c2, c4 = 1 / (2 * radius), 1 / (8 * radius**3)
    found = radii_m(trace(1, truth_c1=[0.0], truth_c2=[c2], truth_c3=[0.0]))
    # at x the cubic lacks 12 c4 x^2 of the curvature
    np.testing.assert_allclose(found[0, 0], abs(radius), rtol=abs(12 * c4 * 100 * radius) + 1e-3)


def test_a_straight_line_has_a_radius_in_the_last_bin_and_no_line_has_none():
    found = radii_m(trace(2, truth_c1=[0.0, np.nan], truth_c2=[0.0, np.nan], truth_c3=[0.0, np.nan]))
    places = NAMES["radius"].bins(found)
    assert (places[0] == len(NAMES["radius"].labels) - 1).all()
    assert (places[1] == -1).all()


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_bins_follow_each_other_without_a_gap(axis):
    assert len(axis.edges) == len(axis.labels) + 1
    inside = np.array([(a + b) / 2 for a, b in zip(axis.edges[:-1], axis.edges[1:], strict=True)])
    np.testing.assert_array_equal(axis.bins(inside), np.arange(len(axis.labels)))
    np.testing.assert_array_equal(axis.bins(np.array([-1.0, np.nan])), -1)


def test_p3s_radii_are_one_to_a_bin():
    places = NAMES["radius"].bins(np.array([250.0, 400.0, 600.0, 800.0, 1000.0, 1500.0]))
    np.testing.assert_array_equal(places, range(6))


def errors_trace(rng, rows):
    columns = {}
    for x in ERROR_RANGES_M:
        columns[f"truth_y_{x}m"] = rng.normal(size=rows)
        columns[f"y_{x}m"] = columns[f"truth_y_{x}m"] + rng.normal(size=rows)
    columns["y_80m"][::3] = np.nan
    return trace(rows, **columns)


def test_pooled_errors_are_those_of_all_runs_together():
    rng = np.random.default_rng(3)
    runs, errors = [], []
    for rows in (50, 80):
        one = errors_trace(rng, rows)
        conditions = {axis.name: np.full((rows, len(ERROR_RANGES_M)), axis.edges[1]) for axis in AXES}
        runs.append(binned(one, conditions))
        errors.append(one["y_80m"] - one["truth_y_80m"])
    stats = ErrorStats.of(np.concatenate(errors))
    (row,) = (row for row in condition_rows(pooled(runs)) if (row["axis"], row["range_m"]) == ("speed", 80))
    assert row["bin"] == NAMES["speed"].labels[1]
    assert row["n"] == stats.n
    found = [row["mean_m"], row["rms_m"], row["abs_max_m"]]
    np.testing.assert_allclose(found, [stats.mean_m, stats.rms_m, stats.abs_max_m], rtol=1e-12)


@pytest.fixture(scope="module")
def drive():
    """A second at night behind a truck, and its trace."""
    told = {
        "environment": {"light": "night", "rain": 0.5},
        "traffic": [{"kind": "truck", "ahead_m": 25, "lanes_left": -1}],
        "ego": {"road": "1", "lane": -3, "speed_kmh": 90},
    }
    memory, sink = TraceInMemory(VehicleConfig()), ConditionSink()
    with Session("highway", overrides=told) as session:
        for _ in range(15):
            output = session.step()
            memory.write(output)
            sink.write(output)
    return memory.trace(), sink


def test_every_row_with_a_true_line_knows_its_conditions(drive):
    trace_, sink = drive
    found = sink.joined(trace_)
    true = np.isfinite(trace_["truth_c0"])
    assert true.sum() > 30
    for name, value in (("light", 2.0), ("rain", 0.5), ("speed", 90.0)):
        np.testing.assert_allclose(found[name][true], value, rtol=1e-3)
    assert np.isfinite(found["gap"][true]).all()


def test_a_truck_beside_hides_the_right_line_and_not_the_left(drive):
    trace_, sink = drive
    hidden = sink.joined(trace_)["hidden"][:, -1]
    assert hidden[trace_["side"] == Side.NEXT_RIGHT].mean() > 20.0
    assert (hidden[trace_["side"] == Side.LEFT] == 0.0).all()
