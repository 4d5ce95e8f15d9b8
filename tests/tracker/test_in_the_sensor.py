"""Predicted lines of a whole sensor that is blind for a while, against the truth."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import polynomial

from tests.roads import ego, marking, snapshot
from tests.shared import SHARED_DATA, needs_shared
from vsensor.config import load_scenario
from vsensor.line import build_line
from vsensor.sensor import Sensor, SensorConfig, initial_state, sense
from vsensor.sinks.trace import TraceSink, read_trace
from vsensor.types import Side, Tick, Unseen
from vsensor.world.truth import line_truths

HIGHWAY = Path(__file__).parents[2] / "vsensor" / "scenarios" / "highway.xodr"
EXACT = {
    "camera": {"pixel_grid": False},
    "error_model": {"mode": "none"},
    "region": {"enabled": False},
    "scene": {"range_m": 120.0},
    "state": {"init_s": 0.0},
    "ego": {"speed_kmh": 72},
}
BLIND = {"fit": {"min_points": 10_000}}
PERIOD_NS = 40_000_000
SEEING, UNSEEING = 15, 45


def outputs(map_file, ticks):
    """Yield the outputs of a drive that sees the road for 0.6 s and then nothing for 1.8 s, in turn."""
    seeing, blind = (build_line(load_scenario(str(map_file), EXACT | more)) for more in ({}, BLIND))
    state = seeing.initial_state()
    for index in range(ticks):
        line = seeing if index % (SEEING + UNSEEING) < SEEING else blind
        computed = line.compute(state, Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS))
        if computed is None:
            return
        state = computed.state_if_sent
        yield computed.output


def errors(map_file, ticks=240):
    """Return {x: largest error of predicted lines at x}, and how many were compared."""
    worst, compared = {10.0: 0.0, 20.0: 0.0, 50.0: 0.0, 80.0: 0.0}, 0
    for output in outputs(map_file, ticks):
        truths = line_truths(output, 2.8)
        for line in output.estimate.boundaries:
            if line.measured or line.side not in truths:
                continue
            for x, true_y in zip((10.0, 20.0, 50.0, 80.0), truths[line.side].y_m.tolist(), strict=False):
                if line.x_min_m <= x <= line.x_max_m and not math.isnan(true_y):
                    worst[x] = max(worst[x], abs(polynomial.polyval(x, line.coefficients) - true_y))
                    compared += 1
    return worst, compared


@needs_shared
@pytest.mark.parametrize("name", ["e6mini", "straight_3000m"])
def test_on_a_gentle_road_a_blind_drive_of_36_m_moves_a_line_by_no_more_than_5_mm(name):
    worst, compared = errors(SHARED_DATA / "xodr" / f"{name}.xodr")
    assert compared > 500
    assert max(worst.values()) < 0.005


@needs_shared
@pytest.mark.parametrize(
    "name",
    ["soderleden", "curves_elevation", "highway_example_with_merge_and_split", "velodrome", "curve_r100"],
)
def test_on_winding_roads_a_blind_drive_of_36_m_moves_a_line_by_no_more_than_half_a_metre(name):
    worst, compared = errors(SHARED_DATA / "xodr" / f"{name}.xodr")
    assert compared > 500
    assert max(worst[10.0], worst[20.0]) < 0.3
    assert max(worst[50.0], worst[80.0]) < 0.5


@pytest.fixture(scope="module")
def blind_drive():
    return list(outputs(HIGHWAY, 45))


def test_a_predicted_line_says_which_marking_of_the_present_scene_it_is(blind_drive):
    groups = {}
    for output in blind_drive:
        for line in output.estimate.boundaries:
            marking = output.snapshot.scene.markings[line.marking]
            assert groups.setdefault(line.side, marking.id) == marking.id
    assert set(groups) == {Side.LEFT, Side.RIGHT, Side.NEXT_LEFT}  # the outermost lane


def test_the_bus_carries_predicted_lines_with_their_flag_and_a_falling_quality(blind_drive):
    for output in blind_drive[SEEING:]:
        assert output.values["left.available"] == 1.0
        assert output.values["left.measured"] == 0.0
        assert math.isfinite(output.values["left.lane_offset_m"])
    qualities = [output.values["left.quality"] for output in blind_drive[SEEING:]]
    assert qualities == sorted(qualities, reverse=True)
    assert qualities[0] > qualities[-1]


def test_in_a_trace_a_predicted_line_is_no_measured_one_and_says_why_it_was_not_seen(blind_drive, tmp_path):
    sink = TraceSink(tmp_path / "trace.npz", front_axle_x_m=2.8)
    for output in blind_drive:
        sink.write(output)
    sink.close()
    trace = read_trace(tmp_path / "trace.npz")
    rows = trace["side"] == Side.LEFT
    reported = rows & np.isfinite(trace["c0"])
    assert reported.sum() == len(blind_drive) - 2
    assert trace["measured"][reported].tolist() == [1] * (SEEING - 2) + [0] * (45 - SEEING)
    assert set(trace["reason_unseen"][reported & (trace["measured"] == 0)]) == {Unseen.TOO_FEW_POINTS}
    assert set(trace["reason_unseen"][reported & (trace["measured"] == 1)]) == {Unseen.SEEN}


def test_a_drive_restarted_while_lines_are_predicted_goes_on_bit_for_bit():
    seeing, blind = (build_line(load_scenario("highway", more)) for more in ({}, BLIND))

    def run(state, first, last):
        frames = []
        for index in range(first, last):
            line = seeing if index < 15 else blind
            computed = line.compute(state, Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS))
            state = computed.state_if_sent
            frames += computed.output.frames
        return state, frames

    state, _ = run(seeing.initial_state(), 0, 20)
    assert run(state, 20, 30)[1] == run(state, 20, 30)[1]
    _, whole = run(seeing.initial_state(), 0, 30)
    assert whole[-len(run(state, 20, 30)[1]) :] == run(state, 20, 30)[1]


# --- gaps in the paint ------------------------------------------------------------------------------


def across_a_gap(gap_m, speed_mps=80.0 / 3.6):
    """Yield the reports of a straight road's left line, which has no paint for `gap_m` from 120 m on."""
    x = np.arange(0.0, 400.0, 0.1)
    left = marking(np.column_stack([x, np.full(len(x), 1.8)]), 0, painted=(x < 120.0) | (x > 120.0 + gap_m))
    right = marking(np.column_stack([x, np.full(len(x), -1.7)]), 1)
    sensor, state = Sensor.of(SensorConfig(), 1), initial_state()
    for index in range(int((120.0 + gap_m) / speed_mps * 25)):
        vehicle = ego((speed_mps * 0.04 * index, 0.0, 0.0), speed_mps=speed_mps)
        tick = Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)
        state, sensed = sense(sensor, state, snapshot([left, right], vehicle=vehicle), tick)
        yield sensed.estimate.on(Side.LEFT)


@pytest.mark.parametrize("gap_m", [5.0, 12.0, 30.0, 50.0])
def test_a_gap_in_the_paint_of_5_to_50_m_is_bridged_at_80_kmh(gap_m):
    reports = list(across_a_gap(gap_m))[2:]
    assert all(reports)
    assert max(abs(line.coefficients[0] - 1.8) for line in reports) < 0.5  # with the error model's errors
    assert all(line.quality >= 1 for line in reports)


def test_a_gap_longer_than_the_view_ends_the_line():
    assert None in list(across_a_gap(110.0))[2:]
