"""Which line is the true one where others lie beside it: no ghost, no white under yellow."""

from dataclasses import replace

import numpy as np
import pytest

from tests.outputs import Drawn, output_of, straight
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


def test_a_report_of_a_ghost_with_no_line_beside_it_has_no_truth():
    output = with_void(output_of([Drawn(y=straight(1.5), reported=Side.LEFT)]), 0)
    assert line_truths(output, AXLE_M)[Side.LEFT].marking == -1


def test_a_line_that_counts_is_judged_as_before():
    lines = [Drawn(y=straight(1.5), reported=Side.LEFT), Drawn(y=straight(1.8))]
    assert line_truths(output_of(lines), AXLE_M)[Side.LEFT].marking == 0
