import contextlib
import dataclasses
import pickle
import re

import numpy as np
import pytest

from tests.lines import line_points, points_of, tick
from tools.make_default_error_model import default_model
from vsensor.draws import Draws
from vsensor.error_model import (
    DEFAULT_FILE,
    ErrorModel,
    ErrorModelConfig,
    apply,
    compile_law,
    initial_state,
    load_law,
    load_model,
    save_model,
)
from vsensor.errors import ConfigError

SPEED_MPS = 30.0
X_M = np.arange(5.0, 101.0, 1.0)


def flat_model(**changes):
    """A model whose errors grow by 1 cm a metre and 1 cm a (m/s): every interpolation is exact."""
    range_m, speed_mps = np.arange(0.0, 121.0, 10.0), np.array([0.0, 20.0, 40.0])
    std_m = 0.01 * (range_m[:, None] + speed_mps[None, :])
    model = ErrorModel(
        range_m=range_m,
        speed_mps=speed_mps,
        levels=np.array([0.5, 0.95]),
        absolute_m=np.stack([std_m, 2.0 * std_m]),
        std_m=std_m,
        correlation_time_s=0.8,
        correlation_length_m=50.0,
        source="test",
    )
    return dataclasses.replace(model, **changes)


def constant_model(error_m):
    return flat_model(absolute_m=np.full((2, 13, 3), error_m))


def extreme(model, direction, lines, level=0.95, speed_mps=SPEED_MPS, scale=1.0, seed=1):
    config = ErrorModelConfig(mode="extreme", direction=direction, level=level, scale=scale)
    law = compile_law(config, model)
    ids = tuple(range(len(lines.marking)))
    return apply(law, initial_state(), Draws(seed), tick(0), speed_mps, ids, lines)[1]


def two_straight_lines():
    return line_points((X_M, np.full(len(X_M), 1.75)), (X_M, np.full(len(X_M), -1.75)))


def volume(model=None, **config):
    return compile_law(ErrorModelConfig(mode="volume", **config), model or default_model())


def many_lines(count, x_m):
    return line_points(*[(np.array(x_m), np.zeros(len(x_m)))] * count)


def errors(lines):
    return lines.points_ego_m[:, 1].reshape(len(lines.marking), -1)


# --- the published extreme surface ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("direction", "left_sign", "right_sign"),
    [("left", 1, 1), ("right", -1, -1), ("inward", -1, 1), ("outward", 1, -1)],
)
def test_extreme_moves_a_straight_line_sideways_by_the_surface(direction, left_sign, right_sign):
    moved = extreme(flat_model(), direction, two_straight_lines())
    surface = 2.0 * 0.01 * (X_M + SPEED_MPS)
    np.testing.assert_allclose(points_of(moved, 0)[:, 1], 1.75 + left_sign * surface, atol=1e-12)
    np.testing.assert_allclose(points_of(moved, 1)[:, 1], -1.75 + right_sign * surface, atol=1e-12)
    np.testing.assert_array_equal(moved.points_ego_m[:, 0], two_straight_lines().points_ego_m[:, 0])


def test_extreme_takes_the_surface_of_the_level_that_was_asked_for():
    lines = two_straight_lines()
    low = extreme(flat_model(), "left", lines, level=0.5).points_ego_m - lines.points_ego_m
    high = extreme(flat_model(), "left", lines, level=0.95).points_ego_m - lines.points_ego_m
    np.testing.assert_allclose(high, 2.0 * low, atol=1e-12)


def test_scale_multiplies_the_shift():
    lines = two_straight_lines()
    moved = extreme(constant_model(0.1), "left", lines, scale=3.0)
    np.testing.assert_allclose(moved.points_ego_m[:, 1] - lines.points_ego_m[:, 1], 0.3, atol=1e-12)


def test_an_inclined_line_is_moved_along_its_normal():
    moved = extreme(constant_model(0.5), "left", line_points((X_M, 0.75 * X_M)))
    shift = moved.points_ego_m - line_points((X_M, 0.75 * X_M)).points_ego_m
    np.testing.assert_allclose(shift, np.tile([-0.3, 0.4, 0.0], (len(X_M), 1)), atol=1e-12)


def test_an_arc_moved_to_its_inside_is_an_arc_of_smaller_radius():
    radius, error = 250.0, 0.3
    angle = np.arange(0.0, 100.0, 0.1) / radius
    lines = line_points((radius * np.sin(angle), radius * (1.0 - np.cos(angle))))
    moved = extreme(constant_model(error), "left", lines).points_ego_m
    found = np.hypot(moved[:, 0], moved[:, 1] - radius)
    # the direction is held over the last chord and a half: error * (7.5 m / radius)^2 / 2 = 135 um
    np.testing.assert_allclose(found, radius - error, atol=1.4e-4)


def test_the_pixel_grid_of_a_line_does_not_turn_its_normal():
    x = np.arange(5.0, 100.0, 0.1)
    stairs = np.round((1.75 + 0.01 * x) / 0.04) * 0.04
    moved = extreme(constant_model(0.5), "left", line_points((x, stairs))).points_ego_m
    assert np.abs(moved[:, 0] - x).max() < 0.5 * 0.02
    assert np.all(np.diff(moved[:, 0]) > 0.0)


def test_random_direction_is_the_same_for_a_whole_drive_and_both_occur():
    def sign(seed, index):
        law = compile_law(ErrorModelConfig(mode="extreme", direction="random"), constant_model(0.1))
        moved = apply(law, initial_state(), Draws(seed), tick(index), 30.0, (0, 1), two_straight_lines())[1]
        shift = moved.points_ego_m[:, 1] - two_straight_lines().points_ego_m[:, 1]
        assert np.allclose(shift, shift[0])
        return int(np.sign(shift[0]))

    assert all(len({sign(seed, index) for index in (0, 1, 50)}) == 1 for seed in range(5))
    assert {sign(seed, 0) for seed in range(20)} == {-1, 1}


@pytest.mark.parametrize(("speed_mps", "used_mps"), [(90.0, 40.0), (-3.0, 0.0), (np.nan, 40.0), (13.0, 13.0)])
def test_a_speed_beyond_the_grid_takes_the_nearest_and_an_unknown_one_the_highest(speed_mps, used_mps):
    moved = extreme(flat_model(), "left", line_points((X_M, 0.0 * X_M)), speed_mps=speed_mps)
    np.testing.assert_allclose(moved.points_ego_m[:, 1], 0.02 * (X_M + used_mps), atol=1e-12)


def test_a_range_beyond_the_grid_takes_the_nearest():
    x = np.array([-20.0, -1.0, 150.0, 200.0])
    moved = extreme(flat_model(), "left", line_points((x, 0.0 * x))).points_ego_m
    np.testing.assert_allclose(moved[:, 1], 0.02 * (np.clip(x, 0.0, 120.0) + SPEED_MPS), atol=1e-12)


def test_a_level_that_the_file_does_not_have_is_refused_with_those_it_has():
    with pytest.raises(ConfigError, match=r"level = 0\.94: the file has the levels 0\.5, 0\.95"):
        compile_law(ErrorModelConfig(mode="extreme", level=0.94), flat_model())


# --- the volume: a law, correlated in time and along the range ---------------------------------------


def test_volume_errors_have_the_std_of_the_surface():
    lines = many_lines(4000, [5.0, 20.0, 57.0, 80.0])
    law = volume(flat_model())
    found = errors(apply(law, initial_state(), Draws(3), tick(0), SPEED_MPS, tuple(range(4000)), lines)[1])
    expected = 0.01 * (np.array([5.0, 20.0, 57.0, 80.0]) + SPEED_MPS)
    # 4000 draws know a std to 1.1 %: four times that
    np.testing.assert_allclose(found.std(axis=0), expected, rtol=0.045)
    np.testing.assert_allclose(found.mean(axis=0) / expected, 0.0, atol=4.0 / np.sqrt(4000))


def test_volume_errors_are_correlated_along_the_range_by_the_squared_exponential():
    x = np.array([10.0, 20.0, 60.0, 110.0])
    law = volume(flat_model())
    found = errors(
        apply(law, initial_state(), Draws(4), tick(0), 30.0, tuple(range(4000)), many_lines(4000, x))[1]
    )
    expected = np.exp(-0.5 * ((x[:, None] - x[None, :]) / 50.0) ** 2)
    np.testing.assert_allclose(np.corrcoef(found.T), expected, atol=4.0 / np.sqrt(4000))


@pytest.mark.parametrize("step", [1, 5, 20])
@pytest.mark.parametrize("drop", [False, True])
def test_volume_errors_decay_with_the_correlation_time_whether_or_not_slots_were_dropped(step, drop):
    law, draws, ids, lines = volume(flat_model()), Draws(5), tuple(range(2000)), many_lines(2000, [50.0])
    state, first = apply(law, initial_state(), draws, tick(0), SPEED_MPS, ids, lines)
    for index in [step] if drop else range(1, step + 1):
        state, last = apply(law, state, draws, tick(index), SPEED_MPS, ids, lines)
    correlation = np.corrcoef(errors(first)[:, 0], errors(last)[:, 0])[0, 1]
    expected = np.exp(-step * 0.04 / 0.8)
    assert abs(correlation - expected) < 4.0 * (1.0 - expected**2) / np.sqrt(2000) + 1e-3
    np.testing.assert_allclose(errors(last).std(), 0.8, rtol=4.0 / np.sqrt(2 * 2000))


def test_a_cubic_fit_of_the_default_volume_keeps_its_law_within_five_percent():
    from vsensor.lanefit import LaneFitConfig, fit_lines

    count = 3000
    lines = many_lines(count, X_M)
    moved = apply(volume(), initial_state(), Draws(6), tick(0), 33.0, tuple(range(count)), lines)[1]
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
        state, moved = apply(law, state, draws, tick(index), SPEED_MPS, ids, two_straight_lines())
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
        state.white[0, 0] = 1.0


def test_the_errors_of_a_line_do_not_depend_on_which_others_are_seen():
    law, lines = volume(), two_straight_lines()
    together = apply(law, initial_state(), Draws(1), tick(0), 30.0, (11, 12), lines)[1]
    swapped = apply(law, initial_state(), Draws(1), tick(0), 30.0, (12, 11), lines)[1]
    alone = apply(law, initial_state(), Draws(1), tick(0), 30.0, (12,), line_points((X_M, 0 * X_M - 1.75)))[1]
    np.testing.assert_array_equal(points_of(alone, 0), points_of(together, 1))
    assert not np.allclose(points_of(swapped, 1), points_of(together, 1))


def test_a_line_that_is_hidden_for_an_image_advances_all_the_same():
    law, draws, seen = volume(), Draws(1), line_points((X_M, 0.0 * X_M))
    hidden = line_points((X_M[:0], X_M[:0]))
    state, _ = apply(law, initial_state(), draws, tick(0), 30.0, (5,), seen)
    through_hidden, _ = apply(law, state, draws, tick(1), 30.0, (5,), hidden)
    through_seen, _ = apply(law, state, draws, tick(1), 30.0, (5,), seen)
    np.testing.assert_array_equal(through_hidden.white, through_seen.white)


def test_a_line_that_is_gone_is_remembered_for_five_correlation_times():
    state = some_drive([0], ids=(11, 12))[0]
    assert some_drive([99], state, ids=(21, 22))[0].lines == (11, 12, 21, 22)
    assert some_drive([101], state, ids=(21, 22))[0].lines == (21, 22)


def test_no_lines_and_lines_of_one_point_are_no_trouble():
    empty = line_points()
    state, moved = apply(volume(), initial_state(), Draws(1), tick(0), 30.0, (), empty)
    assert len(moved.points_ego_m) == 0
    assert state.lines == ()
    single = line_points((np.array([20.0]), np.array([1.0])), (np.array([]), np.array([])))
    moved = apply(volume(), initial_state(), Draws(1), tick(0), 30.0, (1, 2), single)[1]
    assert np.isfinite(moved.points_ego_m).all()
    assert np.isfinite(extreme(flat_model(), "inward", single).points_ego_m).all()
    assert len(extreme(flat_model(), "inward", empty).points_ego_m) == 0


def test_mode_none_hands_on_the_very_same_points():
    lines, state = two_straight_lines(), initial_state()
    law = load_law(ErrorModelConfig(mode="none", file="there is no such file"))
    after, moved = apply(law, state, Draws(1), tick(0), 30.0, (1, 2), lines)
    assert after is state
    assert moved is lines


# --- the file ---------------------------------------------------------------------------------------


def test_the_shipped_model_is_what_its_generator_makes(tmp_path):
    save_model(default_model(), tmp_path / "made.npz")
    shipped, made = load_model(DEFAULT_FILE), load_model(tmp_path / "made.npz")
    for field in dataclasses.fields(ErrorModel):
        np.testing.assert_array_equal(getattr(shipped, field.name), getattr(made, field.name))


@pytest.mark.parametrize(
    ("range_m", "low_m", "high_m"), [(5, 0.025, 0.035), (20, 0.04, 0.06), (80, 0.25, 0.4)]
)
def test_the_shipped_95_percent_surface_is_plausible_at_motorway_speed(range_m, low_m, high_m):
    lines = line_points((np.array([float(range_m)]), np.array([0.0])))
    assert (
        low_m < extreme(load_model(DEFAULT_FILE), "left", lines, speed_mps=33.3).points_ego_m[0, 1] < high_m
    )


def test_the_shipped_surface_grows_with_range_speed_and_level():
    model = load_model(DEFAULT_FILE)
    assert np.all(np.diff(model.absolute_m, axis=0) > 0.0)
    assert np.all(np.diff(model.absolute_m, axis=1) > 0.0)
    assert np.all(np.diff(model.absolute_m[:, 1:], axis=2) > 0.0)


def test_a_relative_file_is_meant_from_the_folder_of_the_scenario(tmp_path):
    save_model(constant_model(0.1), tmp_path / "mine.npz")
    law = load_law(ErrorModelConfig(mode="extreme", file="mine.npz"), tmp_path)
    np.testing.assert_allclose(law.surface_m, 0.1)


def test_a_saved_model_reads_back_equal_and_leaves_nothing_beside_it(tmp_path):
    save_model(flat_model(), tmp_path / "m.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["m.npz"]
    np.testing.assert_array_equal(load_model(tmp_path / "m.npz").absolute_m, flat_model().absolute_m)


def test_a_file_cut_off_anywhere_is_refused_by_name(tmp_path):
    whole, path = DEFAULT_FILE.read_bytes(), tmp_path / "cut.npz"
    for length in {0, 1, 3, 4, 30, 100, *range(200, len(whole), 397), len(whole) - 1}:
        path.write_bytes(whole[:length])
        with pytest.raises(ConfigError, match=r"cut\.npz: not a readable error model"):
            load_model(path)


def test_a_damaged_file_is_refused_or_read_but_never_crashes(tmp_path):
    whole, path = DEFAULT_FILE.read_bytes(), tmp_path / "bad.npz"
    random = np.random.default_rng(8)
    for _ in range(300):
        damaged = bytearray(whole)
        for place in random.integers(0, len(whole), 5):
            damaged[place] = random.integers(256)
        path.write_bytes(damaged)
        with contextlib.suppress(ConfigError):  # anything else, a warning too, fails the test
            load_model(path)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"schema = 'vsensor.scenario/1'\n", "not a readable error model"),
        (b"\x93NUMPY\x01\x00", "not a readable error model"),
        (b"PK\x05\x06" + bytes(18), "schema is 'missing'"),
    ],
)
def test_a_foreign_file_is_refused_by_name(tmp_path, content, expected):
    (tmp_path / "foreign.npz").write_bytes(content)
    with pytest.raises(ConfigError, match=f"foreign.npz: {expected}"):
        load_model(tmp_path / "foreign.npz")


def test_a_file_that_is_a_single_array_or_holds_objects_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(3))
    np.savez(tmp_path / "b.npz", schema=np.array([{"a": 1}], dtype=object))
    for name in ("a.npy", "b.npz"):
        with pytest.raises(ConfigError, match=f"{name}: not a readable error model"):
            load_model(tmp_path / name)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.npz: no such file"):
        load_model(tmp_path / "none.npz")
    with pytest.raises(ConfigError, match="not a readable error model"):
        load_model(tmp_path)


def _with(**changes):
    content = {field.name: getattr(flat_model(), field.name) for field in dataclasses.fields(ErrorModel)}
    content |= {"schema": "vsensor.error_model/1"} | changes
    return {key: value for key, value in content.items() if value is not None}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"schema": "vsensor.error_model/2"}, "is newer than this version"),
        ({"schema": "vsensor.profile/1"}, "expected schema"),
        ({"std_m": None}, "entries missing or unknown: std_m"),
        ({"std": np.zeros(3)}, "entries missing or unknown: std"),
        ({"std_m": np.full((13, 3), np.nan)}, "std_m: finite numbers"),
        ({"std_m": np.full((13, 3), "a")}, "std_m: finite numbers"),
        ({"std_m": np.ones((3, 13))}, r"std_m: shape \(range, speed\)"),
        ({"std_m": -np.ones((13, 3))}, "std_m: no negative"),
        ({"absolute_m": flat_model().absolute_m[::-1]}, "absolute_m: no value that falls with the level"),
        ({"absolute_m": flat_model().absolute_m[:1]}, "absolute_m: shape"),
        ({"absolute_m": -flat_model().absolute_m}, "absolute_m: no negative"),
        ({"range_m": flat_model().range_m[::-1]}, "range_m: at least 2 increasing"),
        ({"speed_mps": np.array(3.0)}, "speed_mps: at least 2 increasing"),
        ({"levels": np.array([0.5, 1.0])}, "levels: values between 0 and 1"),
        ({"levels": np.array([])}, "levels: increasing values"),
        ({"correlation_time_s": 0.0}, "correlation_time_s: one positive"),
        ({"correlation_length_m": np.array([50.0, 50.0])}, "correlation_length_m: one positive"),
    ],
)
def test_a_model_that_cannot_be_interpolated_is_refused_with_the_entry(tmp_path, changes, expected):
    np.savez(tmp_path / "m.npz", **_with(**changes))
    with pytest.raises(ConfigError, match=rf"m\.npz: {expected}|m\.npz: .*{expected}"):
        load_model(tmp_path / "m.npz")


def test_an_unchanged_test_model_is_accepted(tmp_path):
    np.savez(tmp_path / "m.npz", **_with())
    assert re.match("test", load_model(tmp_path / "m.npz").source)
