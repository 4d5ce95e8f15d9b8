"""Losses, range and quality of reported lines: how long, how far, how good; and what of it is on the bus."""

import dataclasses
import math
import pickle
from itertools import pairwise

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import kstest

from tests.error_model.models import flat_model
from tests.lines import tick
from vsensor.draws import Draws
from vsensor.error_model.report import SIDES, ReportLaw, advance, reported
from vsensor.types import Boundary, Colour, LaneEstimate, MarkingKind, Side, frozen

LEVELS = np.linspace(0.0, 1.0, 401)
PERIOD_S = 0.04


def exponential_s(mean_s):
    """Quantiles of an exponential law, cut at the level 0.9995."""
    return -mean_s * np.log1p(-np.minimum(LEVELS, 0.9995))


def law_of(**fitted):
    return ReportLaw.of(flat_model(**fitted))


def lossy(seen_s, lost_s, **fitted):
    return law_of(dwell_levels=LEVELS, seen_dwell_s=seen_s, lost_dwell_s=lost_s, **fitted)


def drive(law, indices, seed=1, state=None, draws=None):
    """Return the states at the given ticks."""
    draws, found = draws or Draws(seed), []
    for index in indices:
        state = advance({"a": law}, "a", state, draws, tick(index))
        found.append(state)
    return found


def dwells_s(lost):
    """Return how long each side was seen and lost, whole dwells only: two lists of seconds."""
    found = ([], [])
    for column in lost.T:
        ends = np.flatnonzero(np.diff(column)) + 1
        for start, end in pairwise(ends.tolist()):
            found[int(column[start])].append((end - start) * PERIOD_S)
    return found


def test_lines_stay_seen_and_lost_for_as_long_as_the_tables_say():
    law = lossy(exponential_s(2.0), exponential_s(0.5))
    lost = np.array([state.lost for state in drive(law, range(10_000))])
    for dwell, mean_s in zip(dwells_s(lost), (2.0, 0.5), strict=True):
        assert len(dwell) > 500
        smooth = np.array(dwell) + np.random.default_rng(1).uniform(-PERIOD_S / 2, PERIOD_S / 2, len(dwell))
        # rounded to images, one at least: that moves the law by up to half an image
        distance = kstest(smooth, lambda x, mean_s=mean_s: -np.expm1(-np.maximum(x, 0.0) / mean_s)).statistic
        assert distance < PERIOD_S / 2 / mean_s + 1.63 / np.sqrt(len(dwell))


def test_dwells_are_semi_markov_not_exponential_where_the_table_is_not():
    lost = np.array([state.lost for state in drive(lossy(1.0 + 0.2 * LEVELS, 0.2 + 0 * LEVELS), range(3000))])
    seen, gone = dwells_s(lost)
    assert min(seen) >= 1.0 - 1e-9
    assert max(seen) <= 1.2 + 1e-9
    assert set(np.round(gone, 6)) == {0.2}


def test_a_dwell_lasts_one_image_at_least():
    lost = np.array([state.lost for state in drive(lossy(0.0 * LEVELS, 0.0 * LEVELS), range(20))])
    assert (lost[1:] != lost[:-1]).all()


def test_a_run_begins_with_the_share_of_lost_lines_of_the_long_run_and_midway_in_a_dwell():
    law = lossy(2.0 + 0.0 * LEVELS, 0.5 + 0.0 * LEVELS)
    first = [drive(law, [0], seed=seed)[0] for seed in range(400)]
    share = np.mean([state.lost for state in first])
    assert abs(share - 0.2) < 4.0 * np.sqrt(0.2 * 0.8 / (400 * SIDES))
    left = np.concatenate([(state.until[~state.lost] - 0) * PERIOD_S for state in first])
    assert kstest(left, "uniform", args=(0.0, 2.0)).statistic < PERIOD_S / 2.0 + 1.63 / np.sqrt(len(left))


def test_at_the_start_a_long_dwell_is_likelier_under_way_than_a_short_one():
    """What is left of a dwell from 0 to 2 s, all alike: density (1 - F) / mean, so t - t^2 / 4 is below t."""
    law = lossy(2.0 * LEVELS, 0.5 + 0.0 * LEVELS)
    first = [drive(law, [0], seed=seed)[0] for seed in range(400)]
    left = np.concatenate([state.until[~state.lost] * PERIOD_S for state in first])
    distance = kstest(left, lambda t: np.clip(t, 0.0, 2.0) - np.clip(t, 0.0, 2.0) ** 2 / 4.0).statistic
    assert distance < PERIOD_S + 1.63 / np.sqrt(len(left))  # whole images, rounded up


def test_dropped_slots_change_nothing_of_what_is_lost():
    law = lossy(exponential_s(0.4), exponential_s(0.2))
    whole, some = drive(law, range(301)), drive(law, range(0, 301, 3))
    np.testing.assert_array_equal([s.lost for s in whole[::3]], [s.lost for s in some])


def full_law():
    share = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    step = 0.7 * np.eye(5) + 0.3 * share
    step[0] = share  # never visited
    return lossy(
        exponential_s(2.0),
        exponential_s(0.5),
        range_share_levels=LEVELS,
        range_share=0.4 + 0.7 * LEVELS,
        range_time_s=2.0,
        quality_step=step,
        quality_period_s=0.08,
    )


def test_a_run_restarted_from_a_saved_state_is_bit_identical():
    whole = drive(full_law(), range(200))
    saved = pickle.loads(pickle.dumps(drive(full_law(), range(120))[-1]))
    for one, other in zip(drive(full_law(), range(120, 200), state=saved), whole[120:], strict=True):
        for field in dataclasses.fields(one):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


def test_each_side_has_its_own_losses():
    lost = np.array([state.lost for state in drive(full_law(), range(5000))])
    assert abs(np.corrcoef(lost.T) - np.eye(SIDES)).max() < 0.2


def test_the_share_of_the_range_has_its_quantiles_and_its_correlation_time():
    states = drive(full_law(), range(0, 50_000, 50))  # every 2 s, once a correlation time
    z = np.array([state.z for state in states])
    assert kstest(ndtr(z[::4].ravel()), "uniform").pvalue > 0.01
    for column in z.T:
        found = np.corrcoef(column[:-1], column[1:])[0, 1]
        assert abs(found - np.exp(-1.0)) < 4.0 / np.sqrt(len(z))


def test_quality_steps_by_the_matrix_once_a_period():
    law = full_law()
    quality = np.array([state.quality for state in drive(law, range(6000))])
    assert (quality[1::2] == quality[::2]).all()  # two images a step
    before, after = quality[:-2:2].ravel(), quality[2::2].ravel()
    for one in range(1, 5):
        rows = after[before == one]
        share = np.bincount(rows, minlength=5) / len(rows)
        np.testing.assert_allclose(share, law.quality_step[one], atol=4.0 * np.sqrt(0.25 / len(rows)))


# --- another model takes over -------------------------------------------------------------------------


def test_where_another_law_takes_over_no_line_comes_or_goes_and_what_is_over_of_its_dwell_stays_over():
    laws = {
        "day": lossy(20.0 + 0 * LEVELS, 4.0 + 0 * LEVELS),
        "night": lossy(10.0 + 0 * LEVELS, 2.0 + 0 * LEVELS),
    }
    draws, state = Draws(4), None
    for index in range(51):
        state = advance(laws, "day", state, draws, tick(index))
    later = advance(laws, "night", state, draws, tick(51))
    np.testing.assert_array_equal(later.lost, state.lost)
    # the same share is left, of a dwell half as long; whole images
    np.testing.assert_allclose(later.until - 51, (state.until - 51) / 2.0, atol=1.0)


def test_back_and_forth_between_two_laws_alike_is_as_one_law():
    law = lossy(exponential_s(2.0), exponential_s(0.5))
    draws, state, found = Draws(4), None, []
    for index in range(3000):
        state = advance({"a": law, "b": law}, "ab"[index // 7 % 2], state, draws, tick(index))
        found.append(state.lost)
    np.testing.assert_array_equal(found, [s.lost for s in drive(law, range(3000), seed=4)])


def test_a_law_without_losses_lets_a_lost_line_come_back_in_its_time_and_loses_none():
    laws = {"night": lossy(0.4 + 0 * LEVELS, 0.4 + 0 * LEVELS), "day": law_of()}
    draws, state = Draws(4), None
    for index in range(10):
        state = advance(laws, "night", state, draws, tick(index))
    assert state.lost.any()
    for index in range(10, 100):
        later = advance(laws, "day", state, draws, tick(index))
        assert not (later.lost & ~state.lost).any()
        state = later
    assert not state.lost.any()
    later = []
    for index in range(100, 121):
        state = advance(laws, "night", state, draws, tick(index))
        later.append(state.lost)
    np.testing.assert_array_equal(later, [[10 <= n < 20] * SIDES for n in range(21)])


# --- on the report ------------------------------------------------------------------------------------


def line(side, **changes):
    given = {
        "side": side,
        "coefficients": frozen([1.8 if side in (Side.LEFT, Side.NEXT_LEFT) else -1.8, 0.0, 0.0, 0.0]),
        "covariance": frozen(np.zeros((4, 4))),
        "x_min_m": 5.0,
        "x_max_m": 90.0,
        "quality": 4,
        "kind": MarkingKind.SOLID,
        "colour": Colour.WHITE,
        "width_m": 0.15,
        "measured": True,
        "marking": 0,
        "points": int(side),
    }
    return Boundary(**given | changes)


def estimate(*lines):
    return LaneEstimate(exposed_at_ns=0, image_index=0, boundaries=lines)


def state_with(**values):
    return dataclasses.replace(drive(full_law(), [0])[0], lost=frozen(np.zeros(SIDES), bool), **values)


def test_the_view_range_ends_at_the_share_of_the_operating_range_but_not_beyond_what_is_seen():
    law = law_of(range_share_levels=np.array([0.0, 1.0]), range_share=np.array([0.0, 1.2]))
    state = state_with(z=frozen([0.0, 1.0, -8.0, 8.0]))
    lines = reported(law, state, estimate(*map(line, Side)), 80.0).boundaries
    ends = [found.x_max_m for found in lines]
    np.testing.assert_allclose(ends, [0.6 * 80.0, 1.2 * 80.0 * ndtr(1.0), 5.0, 90.0], rtol=1e-9)
    assert all(found.quality == 4 for found in lines)


def test_quality_is_that_of_the_chain_and_a_predicted_line_is_no_better_than_its_prediction():
    law = dataclasses.replace(full_law(), share=np.zeros(0))
    state = state_with(quality=frozen([2, 0, 3, 1], np.int64))
    lines = [line(Side.LEFT), line(Side.RIGHT), line(Side.NEXT_LEFT, measured=False, quality=2)]
    lines.append(line(Side.NEXT_RIGHT, measured=False, quality=2))
    found = reported(law, state, estimate(*lines), 80.0).boundaries
    assert [line.quality for line in found] == [2, 1, 2, 1]


def test_a_lost_line_leaves_no_trace_in_what_is_sent():
    from vsensor.signals import VehicleConfig, values_from
    from vsensor.types import EgoState, SensorMode

    law = law_of(dwell_levels=LEVELS, seen_dwell_s=LEVELS, lost_dwell_s=LEVELS)
    state = dataclasses.replace(state_with(), lost=frozen([True, False, False, True], bool))
    left = reported(law, state, estimate(*map(line, Side)), 80.0)
    assert left.lost == (Side.LEFT, Side.NEXT_RIGHT)
    ego = EgoState(t_ns=0, position_world_m=np.zeros(3), speed_mps=20.0)
    values = values_from(VehicleConfig(), left, ego, SensorMode.AVAILABLE)
    for word in ("left", "next_right"):
        assert [values[f"{word}.{name}"] for name in ("available", "quality", "measured", "kind")] == [
            0.0
        ] * 4
        assert math.isnan(values[f"{word}.offset_m"])
        assert math.isnan(values[f"{word}.x_max_m"])
    assert [values[f"{word}.available"] for word in ("right", "next_left")] == [1.0, 1.0]
    assert math.isnan(values["lane.width_m"])
    assert math.isnan(values["left.lane_offset_m"])
    assert values["centre.offset_m"] == pytest.approx(-1.8 + VehicleConfig().assumed_lane_width_m / 2)
