import pickle

import numpy as np
import pytest

from tests.error_model.models import (
    SPEED_MPS,
    X_M,
    at,
    errors,
    flat_model,
    law_of,
    many_lines,
    once,
    two_straight_lines,
)
from tests.lines import line_points, points_of, tick
from vsensor.draws import Draws
from vsensor.error_model import ErrorModelConfig, apply, initial_state, load_law


def volume(model=None, **config):
    return load_law(ErrorModelConfig(**config)) if model is None else law_of(model, **config)


def test_volume_errors_have_the_std_of_the_surface():
    lines = many_lines(4000, [5.0, 20.0, 57.0, 80.0])
    law = volume(flat_model())
    found = errors(once(law, lines, seed=3))
    expected = 0.01 * (np.array([5.0, 20.0, 57.0, 80.0]) + SPEED_MPS)
    # 4000 draws know a std to 1.1 %: four times that
    np.testing.assert_allclose(found.std(axis=0), expected, rtol=0.045)
    np.testing.assert_allclose(found.mean(axis=0) / expected, 0.0, atol=4.0 / np.sqrt(4000))


def test_volume_errors_are_correlated_along_the_range_by_the_squared_exponential():
    x = np.array([10.0, 20.0, 60.0, 110.0])
    law = volume(flat_model())
    found = errors(once(law, many_lines(4000, x), seed=4))
    expected = np.exp(-0.5 * ((x[:, None] - x[None, :]) / 50.0) ** 2)
    np.testing.assert_allclose(np.corrcoef(found.T), expected, atol=4.0 / np.sqrt(4000))


@pytest.mark.parametrize("step", [1, 5, 20])
@pytest.mark.parametrize("drop", [False, True])
def test_volume_errors_decay_with_the_correlation_time_whether_or_not_slots_were_dropped(step, drop):
    law, draws, ids, lines = volume(flat_model()), Draws(5), tuple(range(2000)), many_lines(2000, [50.0])
    state, first = apply(law, initial_state(), draws, tick(0), at(), ids, lines)
    for index in [step] if drop else range(1, step + 1):
        state, last = apply(law, state, draws, tick(index), at(), ids, lines)
    correlation = np.corrcoef(errors(first)[:, 0], errors(last)[:, 0])[0, 1]
    expected = np.exp(-step * 0.04 / 0.8)
    assert abs(correlation - expected) < 4.0 * (1.0 - expected**2) / np.sqrt(2000) + 1e-3
    np.testing.assert_allclose(errors(last).std(), 0.8, rtol=4.0 / np.sqrt(2 * 2000))


def test_a_cubic_fit_of_the_default_volume_keeps_its_law_within_five_percent():
    from vsensor.lanefit import LaneFitConfig, fit_lines

    count = 3000
    lines = many_lines(count, X_M)
    moved = once(volume(), lines, 33.0, seed=6)
    fits = fit_lines(LaneFitConfig(), moved, np.zeros(len(moved.points_ego_m)))
    x = np.array([10.0, 20.0, 50.0, 80.0, 95.0])
    reported = np.array([[fit.y_at(at) for at in x] for fit in fits]).std(axis=0)
    drawn = errors(moved)[:, (x - 5.0).astype(int)].std(axis=0)
    np.testing.assert_allclose(reported / drawn, 1.0, atol=0.05)


def some_drive(indices, state=None, seed=7, ids=(11, 12)):
    """Drive over the given ticks; return the last state and the points of each tick."""
    law, draws, found = volume(), Draws(seed), []
    state = initial_state() if state is None else state
    for index in indices:
        state, moved = apply(law, state, draws, tick(index), at(), ids, two_straight_lines())
        found.append(moved.points_ego_m)
    return state, found


def test_a_run_restarted_from_a_saved_state_is_bit_identical():
    whole = some_drive(range(30))[1]
    saved = pickle.loads(pickle.dumps(some_drive(range(17))[0]))
    np.testing.assert_array_equal(some_drive(range(17, 30), saved)[1], whole[17:])


def test_another_seed_gives_other_errors():
    assert not np.array_equal(some_drive([0], seed=1)[1][0], some_drive([0], seed=2)[1][0])


def test_the_state_that_was_given_is_not_changed():
    state = some_drive(range(3))[0]
    before = pickle.dumps(state)
    some_drive(range(3, 9), state)
    assert pickle.dumps(state) == before
    with pytest.raises(ValueError, match="read-only"):
        state.process[0, 0] = 1.0


def test_the_errors_of_a_line_do_not_depend_on_which_others_are_seen():
    law, lines = volume(), two_straight_lines()
    together = apply(law, initial_state(), Draws(1), tick(0), at(), (11, 12), lines)[1]
    swapped = apply(law, initial_state(), Draws(1), tick(0), at(), (12, 11), lines)[1]
    alone = apply(law, initial_state(), Draws(1), tick(0), at(), (12,), line_points((X_M, 0 * X_M - 1.75)))[1]
    np.testing.assert_array_equal(points_of(alone, 0), points_of(together, 1))
    assert not np.allclose(points_of(swapped, 1), points_of(together, 1))


def test_a_line_that_is_hidden_for_an_image_advances_all_the_same():
    law, draws, seen = volume(), Draws(1), line_points((X_M, 0.0 * X_M))
    hidden = line_points((X_M[:0], X_M[:0]))
    state, _ = apply(law, initial_state(), draws, tick(0), at(), (5,), seen)
    through_hidden, _ = apply(law, state, draws, tick(1), at(), (5,), hidden)
    through_seen, _ = apply(law, state, draws, tick(1), at(), (5,), seen)
    np.testing.assert_array_equal(through_hidden.process, through_seen.process)


def test_a_line_that_is_gone_is_remembered_for_five_correlation_times():
    state = some_drive([0], ids=(11, 12))[0]
    assert some_drive([99], state, ids=(21, 22))[0].lines == (21, 22, 11, 12)
    assert some_drive([101], state, ids=(21, 22))[0].lines == (21, 22)


def test_no_lines_and_lines_of_one_point_are_no_trouble():
    empty = line_points()
    state, moved = apply(volume(), initial_state(), Draws(1), tick(0), at(), (), empty)
    assert len(moved.points_ego_m) == 0
    assert state.lines == ()
    single = line_points((np.array([20.0]), np.array([1.0])), (np.array([]), np.array([])))
    moved = apply(volume(), initial_state(), Draws(1), tick(0), at(), (1, 2), single)[1]
    assert np.isfinite(moved.points_ego_m).all()
    inward = law_of(flat_model(), "extreme", direction="inward")
    assert np.isfinite(once(inward, single).points_ego_m).all()
    assert len(once(inward, empty).points_ego_m) == 0


def test_mode_none_hands_on_the_very_same_points():
    lines, state = two_straight_lines(), initial_state()
    law = load_law(ErrorModelConfig(mode="none", file="there is no such file"))
    after, moved = apply(law, state, Draws(1), tick(0), at(), (1, 2), lines)
    assert after is state
    assert moved is lines
