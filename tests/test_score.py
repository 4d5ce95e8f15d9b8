"""The score, from traces whose statistics are known by construction."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.outputs import Drawn, ego_at, four_lines, output_of, straight
from tests.roads import box
from tests.roads import straight as road_line
from tests.truths import output_at
from vsensor.camera import Camera, CameraConfig
from vsensor.score import ErrorStats, score_trace
from vsensor.sinks.trace import TraceSink, read_trace
from vsensor.types import Side, Unseen


def scored(tmp_path, outputs):
    """Return the score of the outputs' trace."""
    sink = TraceSink(tmp_path / "trace.npz", front_axle_x_m=2.8)
    for output in outputs:
        sink.write(output)
    sink.close()
    return score_trace(read_trace(tmp_path / "trace.npz"))


def left(error=0.0, **changes):
    """Return a straight left line reported with a lateral error."""
    return Drawn(y=straight(1.8), reported=Side.LEFT, error=(error, 0.0, 0.0, 0.0), **changes)


def test_error_free_output_scores_zero(tmp_path):
    score = scored(tmp_path, [output_of(four_lines(), tick=t) for t in range(3)])
    for side in (*score.sides, score.pooled):
        assert side.availability == 1.0
        assert side.false_reports == 0
        for stats in side.error.values():
            assert [stats.mean_m, stats.std_m, stats.abs_95_m] == pytest.approx([0, 0, 0], abs=1e-9)


def test_mean_deviation_and_quantile_are_those_of_the_errors_that_were_made(tmp_path):
    errors = np.linspace(-0.3, 0.5, 21)
    score = scored(tmp_path, [output_of([left(e)], tick=t) for t, e in enumerate(errors)])
    for x in (10, 20, 50, 80):
        stats = score.sides[0].error[x]
        assert stats.n == 21
        assert stats.mean_m == pytest.approx(errors.mean(), abs=1e-9)
        assert stats.std_m == pytest.approx(errors.std(), abs=1e-9)
        assert stats.abs_95_m == pytest.approx(np.quantile(np.abs(errors), 0.95), abs=1e-9)


def test_an_error_is_positive_where_the_report_is_too_far_left(tmp_path):
    assert scored(tmp_path, [output_of([left(0.2)])]).pooled.error[20].mean_m == pytest.approx(0.2)


def test_a_heading_error_grows_with_the_range(tmp_path):
    line = Drawn(y=straight(-1.9), reported=Side.RIGHT, error=(0.0, 0.002, 0.0, 0.0))
    error = scored(tmp_path, [output_of([line])]).pooled.error
    assert [error[x].mean_m for x in (10, 20, 50, 80)] == pytest.approx([0.02, 0.04, 0.1, 0.16])


def test_availability_is_the_share_of_true_lines_that_were_reported(tmp_path):
    unseen = left(unseen=lambda p: p[:, 0] > -99)
    outputs = [output_of([unseen if t % 4 == 0 else left()], tick=t) for t in range(20)]
    side = scored(tmp_path, outputs).sides[0]
    assert side.availability == pytest.approx(0.75)
    assert side.unseen == {Unseen.OCCLUDED: 5}
    assert side.hidden_by == {}


def test_availability_is_that_of_measured_lines_plus_that_of_predicted_ones(tmp_path):
    unseen = left(unseen=lambda p: p[:, 0] > -99)
    outputs = [output_of([unseen if t < 2 else left(measured=t >= 5)], tick=t) for t in range(20)]
    score = scored(tmp_path, outputs)
    side = score.sides[0]
    assert (side.availability, side.measured, side.predicted) == pytest.approx((0.9, 0.75, 0.15))
    (row,) = [
        line.split()
        for line in score.text().splitlines()
        if line.startswith("left") and len(line.split()) == 9
    ]
    assert row[5:8] == ["90.00", "75.00", "15.00"]


def test_a_report_without_a_true_line_is_false_and_does_not_count_as_available(tmp_path):
    boundary = output_of([left()]).estimate.boundaries[0]
    ghost = replace(boundary, marking=-1, points=-1, measured=False)
    side = scored(tmp_path, [output_of([], ghosts=(ghost,))]).sides[0]
    assert side.false_reports == 1
    assert side.true_rows == 0
    assert math.isnan(side.availability)


def test_range_is_that_of_the_reports(tmp_path):
    limits = np.arange(40.0, 61.0)
    outputs = [
        output_of([left(unseen=lambda p, m=m: p[:, 0] > m + 0.05)], tick=t) for t, m in enumerate(limits)
    ]
    side = scored(tmp_path, outputs).sides[0]
    found = [side.range_mean_m, side.range_5_m, side.range_95_m]
    assert found == pytest.approx([50.0, 41.0, 59.0], abs=1e-6)


def test_errors_beyond_the_view_range_do_not_count(tmp_path):
    short = left(0.1, unseen=lambda p: p[:, 0] > 60)
    error = scored(tmp_path, [output_of([short])]).pooled.error
    assert [error[x].n for x in (10, 20, 50, 80)] == [1, 1, 1, 0]


def test_pooled_counts_are_the_sums_over_the_sides(tmp_path):
    score = scored(tmp_path, [output_of(four_lines()), output_of(four_lines()[:3], tick=1)])
    assert score.ticks == 2
    assert score.pooled.true_rows == sum(side.true_rows for side in score.sides) == 7
    assert score.pooled.error[20].n == 7


def test_lane_offset_error_is_reported_minus_true(tmp_path):
    values = {"left.lane_offset_m": 1.8 - 0.075 + 0.03}
    score = scored(tmp_path, [output_of([left()], values=values)])
    assert score.pooled.lane_offset.mean_m == pytest.approx(0.03)


def test_an_empty_trace_has_an_empty_score(tmp_path):
    score = scored(tmp_path, [])
    assert score.ticks == 0
    assert score.sides == ()
    assert "nan" not in score.text()


def test_no_errors_have_no_statistics():
    stats = ErrorStats.of(np.array([math.nan, math.inf]))
    assert stats.n == 0
    assert math.isnan(stats.mean_m)


def test_the_text_is_a_table_with_every_side_and_range(tmp_path):
    lines = scored(tmp_path, [output_of(four_lines())]).text().splitlines()
    errors = lines[1 : lines.index("")]
    assert len({len(line) for line in errors}) == 1  # aligned
    assert [line.split()[0] for line in errors[1:5]] == ["left"] * 4
    assert errors[0].split() == ["side", "at", "n", "mean", "std", "95", "%", "of", "|e|"]
    assert any(line.startswith("all") for line in errors)


def test_the_object_that_hid_a_line_is_named(tmp_path):
    camera = Camera.from_config(CameraConfig(pixel_grid=False))
    wall = box(6.0, 0.0, 1.5, (2.0, 9.0, 3.0), number=7)
    sink = TraceSink(tmp_path / "trace.npz", front_axle_x_m=2.8, camera=camera)
    sink.write(output_at(ego_at(), [road_line(1.8)], camera=camera, obstacles=(wall,)))
    sink.close()
    score = score_trace(read_trace(tmp_path / "trace.npz"))
    assert score.sides[0].hidden_by == {7: 1}
    assert "occluded by object 7" in score.text()
