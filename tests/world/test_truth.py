"""The truth beside an output, against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.outputs import Drawn, circle, ego_at, four_lines, output_of, straight
from vsensor.signals import VehicleConfig
from vsensor.types import MarkingKind, Side, Stripe, Unseen
from vsensor.world.truth import RANGES_M, best_cubic, lane_truth, line_truths

AXLE_M = 2.8
POINT_SPACING_M = 0.1


def chord_sag_m(radius_m):
    """Return how far an arc stands from its chords of one point spacing."""
    return POINT_SPACING_M**2 / (8 * radius_m)


def test_a_straight_line_is_itself_at_every_range():
    truth = line_truths(output_of([Drawn(y=straight(1.8, 0.01))]), AXLE_M)[Side.LEFT]
    np.testing.assert_allclose(truth.y_m, 1.8 + 0.01 * np.array(RANGES_M), atol=1e-12)
    np.testing.assert_allclose(truth.coefficients, [1.8, 0.01, 0, 0], atol=1e-12)


@pytest.mark.parametrize("radius", [600.0, -600.0, 2000.0])
def test_the_true_place_on_a_bend_is_that_of_the_circle(radius):
    y = circle(1.8, radius)
    truth = line_truths(output_of([Drawn(y=y)]), AXLE_M)[Side.LEFT]
    np.testing.assert_allclose(truth.y_m, y(np.array(RANGES_M)), atol=1.1 * chord_sag_m(600.0))


def test_truth_does_not_change_when_the_whole_scene_is_moved_and_turned():
    y = circle(1.8, 700.0)
    here = line_truths(output_of([Drawn(y=y)]), AXLE_M)[Side.LEFT]
    there = line_truths(output_of([Drawn(y=y)], ego=ego_at(5.0e5, -5.4e6, 2.1)), AXLE_M)[Side.LEFT]
    np.testing.assert_allclose(there.y_m, here.y_m, atol=1e-8)  # float64 at 5e6 m: 1e-9 m
    assert there.lane_offset_m == pytest.approx(here.lane_offset_m, abs=1e-8)


def test_mirroring_the_scene_flips_every_number_and_swaps_the_sides():
    y = circle(1.8, 700.0)
    left = line_truths(output_of([Drawn(y=y)]), AXLE_M)[Side.LEFT]
    right = line_truths(output_of([Drawn(y=lambda x: -y(x))]), AXLE_M)[Side.RIGHT]
    np.testing.assert_allclose(right.y_m, -left.y_m, atol=1e-12)
    np.testing.assert_allclose(right.coefficients, -left.coefficients, atol=1e-12)
    assert right.lane_offset_m == pytest.approx(-left.lane_offset_m, abs=1e-12)


def test_sides_follow_from_the_true_place_beside_the_vehicle():
    truths = line_truths(output_of(four_lines()[::-1]), AXLE_M)
    assert {side: truth.y_m[0] for side, truth in truths.items()} == pytest.approx(
        {Side.LEFT: 1.8, Side.RIGHT: -1.9, Side.NEXT_LEFT: 5.5, Side.NEXT_RIGHT: -5.6}
    )


def test_a_measured_report_is_compared_with_its_own_marking_wherever_it_is_reported():
    swapped = Drawn(y=straight(-0.3), reported=Side.LEFT)  # truly to the right already
    truth = line_truths(output_of([swapped, Drawn(y=straight(3.4))]), AXLE_M)[Side.LEFT]
    assert truth.y_m[0] == pytest.approx(-0.3, abs=1e-12)


def test_beyond_the_end_of_a_line_there_is_no_truth():
    truth = line_truths(output_of([Drawn(y=straight(1.8), x_range_m=(-5.0, 60.0))]), AXLE_M)[Side.LEFT]
    np.testing.assert_array_equal(np.isfinite(truth.y_m), [True, True, True, False, False])


def test_at_the_end_of_the_window_the_next_point_of_the_marking_is_used():
    y = straight(1.8, 0.123)  # no point lies at x = 100 exactly
    output = output_of([Drawn(y=y)], ego=ego_at(0.033, 0.0, 0.2))
    moved = line_truths(replace(output, snapshot=output.snapshot), AXLE_M)[Side.LEFT]
    assert output.observation.candidates.points_ego_m[-1, 0] <= 100.0
    assert moved.y_m[-1] == pytest.approx(y(100.0), abs=1e-10)


def test_a_line_drawn_against_the_driving_direction_has_the_same_truth():
    y = circle(1.8, 800.0)
    unseen = {"unseen": lambda p: p[:, 0] > 47.0, "reported": Side.LEFT}
    along = line_truths(output_of([Drawn(y=y, **unseen)]), AXLE_M)[Side.LEFT]
    against = line_truths(output_of([Drawn(y=y, against=True, **unseen)]), AXLE_M)[Side.LEFT]
    np.testing.assert_allclose(against.y_m, along.y_m, atol=1e-12)
    np.testing.assert_allclose(against.coefficients, along.coefficients, rtol=1e-9, atol=1e-12)


def test_the_cubic_uses_just_the_points_that_the_fit_used():
    y = circle(1.8, 600.0)
    output = output_of([Drawn(y=y, reported=Side.LEFT, unseen=lambda p: (p[:, 0] < 12.0) | (p[:, 0] > 40.0))])
    truth = line_truths(output, AXLE_M)[Side.LEFT]
    np.testing.assert_allclose(
        truth.coefficients, output.estimate.boundaries[0].coefficients, rtol=1e-6, atol=1e-11
    )


def test_the_cubic_ends_with_a_fit_that_ends_before_its_points_do():
    output = output_of([Drawn(y=circle(1.8, 600.0), reported=Side.LEFT)])
    (line,) = output.estimate.boundaries
    shorter = output_of(
        [Drawn(y=circle(1.8, 600.0), reported=Side.LEFT, unseen=lambda p: p[:, 0] > 40.0)]
    ).estimate.boundaries[0]
    cut = replace(line, x_max_m=shorter.x_max_m, coefficients=shorter.coefficients)
    output = replace(output, estimate=replace(output.estimate, boundaries=(cut,)))
    truth = line_truths(output, AXLE_M)[Side.LEFT]
    np.testing.assert_allclose(truth.coefficients, shorter.coefficients, rtol=1e-6, atol=1e-11)


@pytest.mark.parametrize("against", [False, True])
def test_a_joint_with_a_double_point_does_not_shift_the_points_that_the_cubic_uses(against):
    line = Drawn(y=circle(1.8, 600.0), reported=Side.LEFT, unseen=lambda p: p[:, 0] > 40.0, against=against)
    plain = line_truths(output_of([line]), AXLE_M)[Side.LEFT]
    output = output_of([replace(line, joint=150)])
    assert np.abs(np.diff(output.observation.candidates.index)).max() == 2  # the scene left one out
    jointed = line_truths(output, AXLE_M)[Side.LEFT]
    np.testing.assert_allclose(jointed.coefficients, plain.coefficients, rtol=1e-9, atol=1e-12)


def test_the_cubic_of_a_cubic_is_itself():
    x = np.linspace(3.0, 97.0, 941)
    expected = [1.7, -0.02, 4e-4, -2e-6]
    found = best_cubic(x, np.polynomial.polynomial.polyval(x, expected))
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_the_residual_of_the_best_cubic_is_orthogonal_to_every_power():
    x = np.linspace(0.0, 100.0, 1001)
    y = np.sin(x / 20)
    residual = y - np.polynomial.polynomial.polyval(x, best_cubic(x, y))
    for power in range(4):
        assert abs(residual @ (x / 100) ** power) < 1e-10


def test_three_points_have_no_cubic():
    assert np.isnan(best_cubic(np.arange(3.0), np.ones(3))).all()


def test_the_lane_offset_goes_to_the_inner_edge_at_the_front_axle():
    slope, width = 0.05, 0.3
    lines = [Drawn(y=straight(y, slope), width_m=width) for y in (1.8, -1.9)]
    truths = line_truths(output_of(lines), AXLE_M)
    half = width / 2 * math.sqrt(1 + slope**2)
    assert truths[Side.LEFT].lane_offset_m == pytest.approx(1.8 + slope * AXLE_M - half, abs=1e-12)
    assert truths[Side.RIGHT].lane_offset_m == pytest.approx(-1.9 + slope * AXLE_M + half, abs=1e-12)
    across = (3.7 - 2 * half) * math.cos(math.atan(slope))
    assert lane_truth(VehicleConfig(), truths, ego_at()).width_m == pytest.approx(across, abs=1e-12)


def test_a_line_that_begins_ahead_of_the_front_axle_has_no_lane_offset():
    truth = line_truths(output_of([Drawn(y=straight(1.8), x_range_m=(8.0, 100.0))]), AXLE_M)[Side.LEFT]
    assert math.isnan(truth.lane_offset_m)


def test_a_lane_without_two_lines_has_no_width():
    truths = line_truths(output_of([Drawn(y=straight(1.8))]), AXLE_M)
    assert math.isnan(lane_truth(VehicleConfig(), truths, ego_at()).width_m)


def test_a_double_line_is_its_inner_stripe():
    stripes = [
        Drawn(y=straight(1.95), stripe=Stripe.LEFT, group=7, kind=MarkingKind.DOUBLE_SOLID),
        Drawn(y=straight(1.65), stripe=Stripe.RIGHT, group=7, kind=MarkingKind.DOUBLE_SOLID),
    ]
    truths = line_truths(output_of(stripes), AXLE_M)
    assert truths[Side.LEFT].y_m[0] == pytest.approx(1.65)
    assert truths[Side.LEFT].kind is MarkingKind.DOUBLE_SOLID
    assert Side.NEXT_LEFT not in truths


def test_a_border_without_any_paint_is_no_true_line():
    lines = [Drawn(y=straight(1.8), unpainted=lambda p: p[:, 0] > -99), Drawn(y=straight(3.5))]
    assert line_truths(output_of(lines), AXLE_M)[Side.LEFT].y_m[0] == pytest.approx(3.5)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_line_beyond_the_own_lane_is_the_next_one_where_the_own_is_missing(sign):
    beside = {1: Side.NEXT_LEFT, -1: Side.NEXT_RIGHT}[sign]
    assert set(line_truths(output_of([Drawn(y=straight(sign * 5.6))]), AXLE_M)) == {beside}


def test_a_line_beyond_the_next_lane_is_none_of_the_four():
    assert line_truths(output_of([Drawn(y=straight(8.1)), Drawn(y=straight(-8.1))]), AXLE_M) == {}


def test_paint_behind_the_vehicle_makes_no_true_line():
    line = Drawn(y=straight(1.8), unpainted=lambda p: p[:, 0] > -0.05)
    assert line_truths(output_of([line]), AXLE_M) == {}


def test_no_lines_have_no_truth():
    assert line_truths(output_of([]), AXLE_M) == {}


def test_a_report_without_any_true_line_is_there_without_truth():
    ghost = replace(output_of(four_lines()).estimate.boundaries[0], marking=-1, points=-1, measured=False)
    truth = line_truths(output_of([], ghosts=(ghost,)), AXLE_M)[Side.LEFT]
    assert truth.marking == -1
    assert truth.reason_unseen is Unseen.NO_LINE
    assert np.isnan([*truth.y_m, *truth.coefficients, truth.lane_offset_m]).all()


@pytest.mark.parametrize("reason", [Unseen.OCCLUDED, Unseen.OUTSIDE_IMAGE, Unseen.BEHIND_CAMERA])
def test_the_reason_is_what_befell_most_painted_points(reason):
    line = Drawn(y=straight(1.8), unseen=lambda p: p[:, 0] > -99, reason=reason)
    assert line_truths(output_of([line]), AXLE_M)[Side.LEFT].reason_unseen is reason


def test_the_gaps_of_a_dashed_line_are_no_reason_while_its_paint_is_hidden():
    line = Drawn(y=straight(1.8), unseen=lambda p: p[:, 0] > -99, unpainted=lambda p: p[:, 0] % 18 > 6)
    assert line_truths(output_of([line]), AXLE_M)[Side.LEFT].reason_unseen is Unseen.OCCLUDED


def test_the_reason_of_a_measured_line_is_seen():
    assert line_truths(output_of(four_lines()), AXLE_M)[Side.RIGHT].reason_unseen is Unseen.SEEN


def test_a_predicted_line_is_compared_with_the_marking_that_it_was_seen_as_though_it_has_another_side():
    lines = [Drawn(y=straight(0.1)), Drawn(y=straight(-3.4))]
    boundary = output_of([Drawn(y=straight(1.8), reported=Side.RIGHT)]).estimate.boundaries[0]
    output = output_of(lines)
    predicted = replace(boundary, side=Side.RIGHT, measured=False, points=-1, marking=0)
    output = replace(output, estimate=replace(output.estimate, boundaries=(predicted,)))
    truths = line_truths(output, AXLE_M)
    assert truths[Side.RIGHT].marking == 0
    assert truths[Side.RIGHT].y_m[0] == pytest.approx(0.1)
    elsewhere = replace(predicted, marking=7)  # not in the window any more
    output = replace(output, estimate=replace(output.estimate, boundaries=(elsewhere,)))
    assert line_truths(output, AXLE_M)[Side.RIGHT].marking == 1


def test_a_line_that_was_detected_but_not_fitted_had_too_few_points():
    assert line_truths(output_of([Drawn(y=straight(1.8))]), AXLE_M)[Side.LEFT].reason_unseen is (
        Unseen.TOO_FEW_POINTS
    )


@pytest.mark.parametrize(("reach", "reason"), [(20.0, Unseen.BEYOND_RANGE), (100.0, Unseen.LOST)])
def test_a_line_that_was_seen_but_not_detected_was_beyond_the_range_or_lost(reach, reason):
    output = output_of([Drawn(y=straight(1.8), unseen=lambda p: p[:, 0] < 30.0)])
    lines = output.detections.lines
    empty = replace(
        lines, starts=np.array([0, 0]), index=lines.index[:0], points_ego_m=lines.points_ego_m[:0]
    )
    dropped = replace(output.detections, lines=empty, operating_range_m=reach)
    truth = line_truths(replace(output, detections=dropped), AXLE_M)[Side.LEFT]
    assert truth.reason_unseen is reason


def test_a_line_that_the_error_model_or_a_fault_dropped_was_lost_and_others_were_not():
    output = output_of([Drawn(y=straight(1.8)), Drawn(y=straight(-1.8))])
    dropped = replace(output.estimate, lost=(Side.LEFT, Side.NEXT_LEFT))
    truths = line_truths(replace(output, estimate=dropped), AXLE_M)
    reasons = {side: truth.reason_unseen for side, truth in truths.items()}
    assert reasons == {Side.LEFT: Unseen.LOST, Side.RIGHT: Unseen.TOO_FEW_POINTS}
