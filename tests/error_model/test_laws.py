"""The law of what is made, against closed forms: heavy-tailed, lopsided, over speed, in time."""

import dataclasses

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import kstest
from scipy.stats import t as student_t

from tests.error_model.models import (
    GRID_MPS,
    RANGE_M,
    STD_M,
    X_M,
    at,
    errors,
    flat_model,
    law_of,
    many_lines,
    once,
    two_straight_lines,
)
from tests.lines import line_points, tick
from vsensor.draws import Draws
from vsensor.error_model import (
    Conditions,
    ErrorLibrary,
    ErrorModelConfig,
    Rule,
    apply,
    compile_law,
    initial_state,
    model_of,
)
from vsensor.error_model.law import quantile, range_grid
from vsensor.error_model.rule import pick

DEGREES = 5
LEVELS = np.array([0.5, 0.8, 0.9, 0.95, 0.97, 0.99])
SIGNED = np.concatenate([[0.001, 0.0025, 0.005], np.linspace(0.01, 0.99, 50), [0.995, 0.9975, 0.999]])
COUNT = 2000


def scale_m(range_m, speed_mps):
    return 0.01 + 4e-5 * np.asarray(range_m) ** 2 * (0.5 + speed_mps / 40.0)


def student_model(bias_m=0.02, **fitted):
    """Student-t of 5 degrees, wider with range and speed, its middle off to the left."""
    scale = scale_m(RANGE_M[:, None], GRID_MPS[None, :])
    return model_of(
        range_m=RANGE_M,
        speed_mps=GRID_MPS,
        levels=LEVELS,
        absolute_m=student_t.ppf(0.5 + LEVELS / 2, DEGREES)[:, None, None] * scale,
        signed_levels=SIGNED,
        signed_m=student_t.ppf(SIGNED, DEGREES)[:, None, None] * scale + bias_m,
        correlation_time_s=0.8,
        correlation_length_m=50.0,
        **fitted,
    )


# --- volume -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed_mps", [0.0, 20.0, 33.0])
def test_errors_of_the_volume_follow_the_signed_quantiles_at_nodes_of_the_grid(speed_mps):
    x = np.array([10.0, 50.0, 100.0])
    found = errors(once(law_of(student_model()), many_lines(COUNT, x), speed_mps, seed=11))
    for column, range_m in zip(found.T, x, strict=True):
        unit = (column - 0.02) / scale_m(range_m, speed_mps)
        # linear in z between quantiles 2 % apart the law is met to 2e-4; KS sees 1.63 / sqrt(2000) = 0.036
        assert kstest(unit, student_t(DEGREES).cdf).pvalue > 0.01


@pytest.mark.parametrize("level", LEVELS)
def test_the_share_of_errors_within_an_absolute_surface_is_its_level(level):
    x = np.array([15.0, 57.0, 93.0])
    lines = many_lines(COUNT, x)
    found = np.abs(errors(once(law_of(student_model(bias_m=0.0)), lines, 30.0, seed=12)))
    surface = errors(once(law_of(student_model(bias_m=0.0), "extreme", level=float(level)), lines, 30.0))
    share = (found <= surface).mean(axis=0)
    # binomial: four standard deviations; between nodes surface and quantiles are interpolated alike
    np.testing.assert_allclose(share, level, atol=4.0 * np.sqrt(level * (1 - level) / COUNT))


def test_errors_between_nodes_of_range_and_speed_have_the_bilinear_quantiles():
    law, z = law_of(student_model()), np.full((1, 1), 1.3)
    table = law.models["all"].at_speed(28.0)
    column = int(np.argmin(np.abs(law.grid_m - 45.0)))
    found = quantile(law.models["all"].knots, table[:, [column]], z)[0, 0]
    corners = (
        student_t.ppf(ndtr(1.3), DEGREES) * scale_m(np.array([40.0, 50.0])[:, None], np.array([20.0, 40.0]))
        + 0.02
    )
    expected = corners.mean(axis=0) @ [0.6, 0.4]
    assert found == pytest.approx(expected, rel=2e-3)


def test_quantiles_rise_with_z_everywhere_and_go_on_straight_beyond_the_outermost():
    law = law_of(student_model()).models["all"]
    z = np.linspace(-6.0, 6.0, 601)
    table = law.at_speed(17.0)
    rows = quantile(law.knots, table, np.repeat(z[:, None], table.shape[1], axis=1))
    assert (np.diff(rows, axis=0) > 0.0).all()
    beyond = np.diff(rows[z > law.knots[-1] + 0.02], axis=0)
    np.testing.assert_allclose(beyond, beyond[:1].repeat(len(beyond), axis=0), rtol=1e-6)


def test_the_mirrored_law_makes_the_mirrored_errors():
    """With a law -Q(1 - u) and -z: a mirrored world has the mirrored errors."""
    model = student_model()
    mirrored = dataclasses.replace(
        model, signed_levels=1.0 - model.signed_levels[::-1], applied_signed_m=-model.applied_signed_m[::-1]
    )
    one, other = (law_of(m).models["all"] for m in (model, mirrored))
    table = one.at_speed(30.0)
    z = np.linspace(-4.0, 4.0, 81)[:, None] * np.ones(table.shape[1])
    np.testing.assert_allclose(
        quantile(other.knots, other.at_speed(30.0), -z), -quantile(one.knots, table, z), atol=1e-9
    )


def test_mirrored_lines_are_moved_to_the_mirrored_places_by_the_opposite_errors():
    x = np.arange(5.0, 101.0, 1.0)
    bend = x**2 / 600.0
    law = law_of(student_model(), "extreme", direction="left")
    other = law_of(student_model(), "extreme", direction="right")
    moved = once(law, line_points((x, 1.75 + bend))).points_ego_m
    mirrored = once(other, line_points((x, -1.75 - bend))).points_ego_m
    np.testing.assert_array_equal(moved[:, 0], mirrored[:, 0])
    np.testing.assert_array_equal(moved[:, 1], -mirrored[:, 1])


def test_normal_scores_of_heavy_tailed_errors_are_ar1_with_the_correlation_time():
    law, draws, ids, lines = law_of(student_model()), Draws(5), tuple(range(COUNT)), many_lines(COUNT, [50.0])
    state, z = initial_state(), []
    for index in range(0, 41, 10):
        state, moved = apply(law, state, draws, tick(index), at(20.0), ids, lines)
        unit = (errors(moved)[:, 0] - 0.02) / scale_m(50.0, 20.0)
        z.append(np.clip(student_t.cdf(unit, DEGREES), 1e-12, 1 - 1e-12))
    scores = ndtri(np.array(z))
    for lag in range(1, 5):
        expected = np.exp(-lag * 0.4 / 0.8)
        found = np.mean([np.corrcoef(scores[k], scores[k + lag])[0, 1] for k in range(5 - lag)])
        assert abs(found - expected) < 4.0 * (1 - expected**2) / np.sqrt(COUNT)


@pytest.mark.parametrize(("length_m", "widest_m"), [(20.0, 4.0), (200.0, 5.0)])
def test_the_range_grid_has_the_files_nodes_and_between_them_points_close_to_each_other(length_m, widest_m):
    nodes = np.array([0.0, 2.0, 10.0, 47.0])
    grid = range_grid(nodes, length_m)
    assert np.isin(nodes, grid).all()
    assert (np.diff(grid) > 0.0).all()
    assert np.diff(grid).max() <= widest_m


# --- levels -------------------------------------------------------------------------------------------


def run_levels(model, count, indices, seed=3, **config):
    law, draws, ids = law_of(model, "levels", **config), Draws(seed), tuple(range(count))
    state, found = initial_state(), []
    for index in indices:
        state, _ = apply(law, state, draws, tick(index), at(), ids, many_lines(count, [50.0]))
        found.append(state.process[:, 0].astype(int))
    return np.array(found)


def test_the_share_of_images_within_each_level_is_the_level():
    found = run_levels(student_model(), COUNT, [0])[0]
    for place, level in enumerate(LEVELS):
        share = (found <= place).mean()
        assert abs(share - level) < 4.0 * np.sqrt(level * (1.0 - level) / COUNT)


def test_errors_of_the_levels_are_the_surfaces_the_highest_beyond_the_last():
    lines = many_lines(500, [50.0, 80.0])
    found = errors(once(law_of(student_model(), "levels"), lines, seed=2))
    surfaces = np.array(
        [
            errors(once(law_of(student_model(), "extreme", level=float(level)), many_lines(1, [50.0, 80.0])))[
                0
            ]
            for level in LEVELS
        ]
    )
    places = np.argmin(np.abs(found[:, :1] - surfaces[:, 0]), axis=1)
    np.testing.assert_allclose(found, surfaces[places], atol=1e-12)
    assert set(places) == set(range(len(LEVELS)))
    for place, level in enumerate(LEVELS[:-1]):  # beyond the last there is no surface
        share = (places <= place).mean()
        assert abs(share - level) < 4.0 * np.sqrt(level * (1.0 - level) / len(places))


@pytest.mark.parametrize("step", [1, 4])
def test_levels_jump_by_the_matrix_of_the_file_whether_or_not_slots_were_dropped(step):
    keep, size = 0.9, len(LEVELS) + 1
    matrix = keep * np.eye(size) + (1.0 - keep) / size
    model = student_model(level_step=matrix, level_period_s=0.04)
    ahead = np.linalg.matrix_power(matrix, step)
    for indices in ([0, step], range(step + 1)):
        first, *_, last = run_levels(model, COUNT, indices)
        for state in range(size):
            rows = last[first == state]
            share = np.bincount(rows, minlength=size) / len(rows)
            np.testing.assert_allclose(share, ahead[state], atol=4.5 * np.sqrt(0.25 / len(rows)))


def test_levels_jump_no_oftener_than_once_a_period():
    model = student_model(level_step=np.full((7, 7), 1.0 / 7.0), level_period_s=0.2)
    found = run_levels(model, 50, range(20))
    for index in range(1, 20):
        if index % 5:
            np.testing.assert_array_equal(found[index], found[index - 1])
    assert (found[5] != found[4]).any()


def test_without_a_fitted_matrix_levels_forget_with_the_correlation_time():
    found = run_levels(student_model(), COUNT, [0, 10])
    keep = np.exp(-0.4 / 0.8)
    share = np.diff([0.0, *LEVELS, 1.0])
    expected = keep + (1.0 - keep) * (share**2).sum()
    assert abs((found[0] == found[1]).mean() - expected) < 4.0 * np.sqrt(0.25 / COUNT)


# --- the rule -----------------------------------------------------------------------------------------


def day_and_night():
    rule = (Rule(model="night", when={"night": True}), Rule(model="day", when={}))
    day, night = flat_model(), flat_model(std_m=3.0 * STD_M)
    return ErrorLibrary(source="", rule=rule, models={"day": day, "night": night})


def test_the_rule_picks_the_model_image_by_image_and_only_the_law_changes():
    law = compile_law(ErrorModelConfig(), day_and_night())
    draws, lines = Draws(1), two_straight_lines()

    def drive(nights):
        state, found = initial_state(), []
        for index, night in enumerate(nights):
            state, moved = apply(law, state, draws, tick(index), at(night=night), (1, 2), lines)
            found.append((moved.points_ego_m - lines.points_ego_m)[:, 1])
        return np.array(found)

    day, night, both = drive([False] * 10), drive([True] * 10), drive([False] * 5 + [True] * 5)
    np.testing.assert_array_equal(both[:5], day[:5])
    np.testing.assert_array_equal(both[5:], night[5:])  # same z, the other law: no jump but the law's
    assert not np.allclose(day, night)


def test_where_two_models_differ_in_correlation_alone_errors_go_on_without_a_jump():
    day = flat_model()
    night = dataclasses.replace(day, applied_length_m=20.0, applied_time_s=5.0)
    rule = (Rule(model="night", when={"night": True}), Rule(model="day", when={}))
    law = compile_law(
        ErrorModelConfig(), ErrorLibrary(source="", rule=rule, models={"day": day, "night": night})
    )
    draws, lines, ids = Draws(2), many_lines(300, X_M), tuple(range(300))
    state, found = initial_state(), []
    for index in range(4):
        state, moved = apply(law, state, draws, tick(index), at(night=index >= 2), ids, lines)
        found.append(errors(moved) / (0.01 * (X_M + 30.0)))
    steps = np.std(np.diff(found, axis=0), axis=(1, 2))
    expected = [np.sqrt(2 * (1 - np.exp(-0.04 / time_s))) for time_s in (0.8, 5.0, 5.0)]
    np.testing.assert_allclose(steps, expected, rtol=0.1)
    np.testing.assert_allclose(np.std(found, axis=(1, 2)), 1.0, rtol=0.1)


@pytest.mark.parametrize(
    ("conditions", "expected"),
    [
        ({"night": True}, "night"),
        ({"rain": 0.2}, "wet"),
        ({"rain": 1.0}, "wet"),
        ({"rain": 0.19}, "day"),
        ({"speed_mps": np.nan}, "day"),
        ({"speed_mps": 41.0}, "fast"),
        ({"curvature_per_m": 0.01, "speed_mps": 10.0}, "bend"),
        ({"curvature_per_m": 0.01, "speed_mps": 30.0}, "day"),
        ({"curvature_per_m": np.nan, "speed_mps": 10.0}, "day"),
    ],
)
def test_the_first_rule_all_of_whose_conditions_hold_counts(conditions, expected):
    rule = (
        Rule(model="night", when={"night": True}),
        Rule(model="wet", when={"rain": (0.2, 1.0)}),
        Rule(model="fast", when={"speed_mps": (40.0, None)}),
        Rule(model="bend", when={"curvature_per_m": (0.005, None), "speed_mps": (None, 15.0)}),
        Rule(model="day", when={"night": False}),
        Rule(model="any", when={}),
    )
    assert pick(rule, Conditions(**conditions)) == expected
