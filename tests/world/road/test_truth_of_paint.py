"""Which line is the true one where others lie beside it: no ghost, no white under yellow."""

from dataclasses import replace

import numpy as np
import pytest

from tests.outputs import Drawn, output_of, straight
from tests.world.road.made import STRAIGHT, written
from vsensor.cli import main
from vsensor.sinks.trace import read_trace
from vsensor.types import Side
from vsensor.world.truth import line_truths

AXLE_M = 2.8


def with_void(output, place):
    """Return the output with one marking that does not count."""
    markings = list(output.snapshot.scene.markings)
    void = np.zeros(len(markings[place].points_world_m), dtype=bool)
    markings[place] = replace(markings[place], valid=void)
    scene = replace(output.snapshot.scene, markings=tuple(markings))
    return replace(output, snapshot=replace(output.snapshot, scene=scene))


def test_a_line_that_does_not_count_bounds_no_lane():
    output = with_void(output_of([Drawn(y=straight(1.5)), Drawn(y=straight(1.8))]), 0)
    assert line_truths(output, AXLE_M)[Side.LEFT].marking == 1


def test_a_report_of_a_line_that_does_not_count_is_judged_by_the_true_one():
    lines = [Drawn(y=straight(1.5), reported=Side.LEFT), Drawn(y=straight(1.8))]
    truth = line_truths(with_void(output_of(lines), 0), AXLE_M)[Side.LEFT]
    assert truth.marking == 1
    np.testing.assert_allclose(truth.y_m, 1.8, atol=1e-12)
    assert truth.coefficients[0] == pytest.approx(1.8, abs=1e-9)


def overridden(output, place, where):
    """Return the output with one marking that does not count where `where(x)` holds."""
    markings = list(output.snapshot.scene.markings)
    x_m = markings[place].points_world_m[:, 0]  # the vehicle stands at the origin
    markings[place] = replace(markings[place], valid=~where(x_m))
    scene = replace(output.snapshot.scene, markings=tuple(markings))
    return replace(output, snapshot=replace(output.snapshot, scene=scene))


def test_where_another_line_overrides_it_ahead_the_truth_of_a_line_ends():
    output = output_of([Drawn(y=straight(1.8), reported=Side.LEFT)])
    truth = line_truths(overridden(output, 0, lambda x: x >= 40.0), AXLE_M)[Side.LEFT]
    assert truth.marking == 0
    np.testing.assert_allclose(truth.y_m[:2], 1.8, atol=1e-12)
    assert np.isnan(truth.y_m[2:]).all()


def test_beside_the_vehicle_an_overridden_line_bounds_no_lane_though_it_counts_again_ahead():
    lines = [Drawn(y=straight(1.5), reported=Side.LEFT), Drawn(y=straight(1.8))]
    truths = line_truths(overridden(output_of(lines), 0, lambda x: x < 40.0), AXLE_M)
    assert truths[Side.LEFT].marking == 1
    assert Side.NEXT_LEFT not in truths


def test_a_report_of_a_ghost_with_no_line_beside_it_has_no_truth():
    output = with_void(output_of([Drawn(y=straight(1.5), reported=Side.LEFT)]), 0)
    assert line_truths(output, AXLE_M)[Side.LEFT].marking == -1


def test_a_line_that_counts_is_judged_as_before():
    lines = [Drawn(y=straight(1.5), reported=Side.LEFT), Drawn(y=straight(1.8))]
    assert line_truths(output_of(lines), AXLE_M)[Side.LEFT].marking == 0


MOVED = """[[road.construction]]
border = -1
from_m = 60
to_m = 290
offset_m = 0.8
"""
FAINT = "ghost = [{ border = -1, from_m = 0, to_m = 300, offset_m = 0.7, contrast = 0.05, wear = 0 }]\n"


def traced(folder, more, seconds=3.5):
    """Return the rows of the right line of a run over the straight road."""
    out = folder / "out.csv"
    path = written(folder, STRAIGHT + more)
    assert main(["run", str(path), "--fast", "--quiet", "--duration", str(seconds), "--trace", str(out)]) == 0
    rows = read_trace(out)
    right = rows["side"] == Side.RIGHT
    return {name: rows[name][right] for name in ("t_ns", "y_10m", "truth_y_10m", "lane_offset_m")}


def test_in_a_construction_site_the_yellow_line_is_true_and_reported(tmp_path):
    rows = traced(tmp_path, MOVED)
    inside = rows["t_ns"] > 2.5e9  # 69 m of way: the whole view is yellow
    np.testing.assert_allclose(rows["truth_y_10m"][inside], -1.75 + 0.8, atol=1e-9)
    assert np.nanmedian(np.abs(rows["y_10m"][inside] - rows["truth_y_10m"][inside])) < 0.1


def test_before_a_construction_site_no_line_beside_the_vehicle_is_yellow(tmp_path):
    y = traced(tmp_path, MOVED, seconds=1.0)["truth_y_10m"]
    np.testing.assert_allclose(y[np.isfinite(y)], -1.75, atol=1e-9)
    assert np.isfinite(y[0])


def test_a_ghost_is_no_true_line_however_near_it_is(tmp_path):
    rows = traced(tmp_path, FAINT, seconds=2.0)
    np.testing.assert_allclose(rows["truth_y_10m"], -1.75, atol=1e-9)
