import contextlib
import json

import numpy as np
import pytest

from tests.error_model.models import RANGE_M, STD_M, at, constant_model, flat_model, law_of, once
from tests.lines import line_points, tick
from tools.make_default_error_model import default_library
from vsensor.draws import Draws
from vsensor.error_model import (
    DEFAULT_FILE,
    SCHEMA,
    ErrorLibrary,
    ErrorModelConfig,
    Rule,
    compile_law,
    library_of,
    load_law,
    load_library,
    reach,
    report,
    save_library,
)
from vsensor.error_model.checks import KEYS
from vsensor.errors import ConfigError
from vsensor.types import LaneEstimate


def saved(library, path):
    save_library(library, path)
    return load_library(path)


def assert_equal(one, other):
    assert (one.source, one.rule, list(one.models)) == (other.source, other.rule, list(other.models))
    for name, model in one.models.items():
        for key in KEYS:
            np.testing.assert_array_equal(getattr(model, key), getattr(other.models[name], key), err_msg=key)


def full_model():
    """A model in which everything is fitted, one cell blind and without values."""
    blind = np.zeros(STD_M.shape, bool)
    blind[-1, 0] = True
    model = flat_model(
        blind=blind,
        rows=np.full(STD_M.shape, 7.0),
        seconds=np.full(STD_M.shape, 3600.0),
        fir=np.array([0.25, 0.5, 0.25]),
        fir_order=2.0,
        fir_cutoff_s_per_m=0.3,
        region_speed_mps=np.array([0.0, 30.0]),
        region_range_m=np.array([20.0, 100.0]),
        region_level=0.9,
        dwell_levels=np.array([0.0, 0.5, 1.0]),
        lost_dwell_s=np.array([0.04, 0.5, 3.0]),
        seen_dwell_s=np.array([0.04, 20.0, 90.0]),
        range_share_levels=np.array([0.1, 0.9]),
        range_share=np.array([0.4, 1.1]),
        range_time_s=2.0,
        quality_step=np.eye(5),
        level_step=np.full((3, 3), 1 / 3),
        log_count=12.0,
        hours=9.5,
    )
    for values in (model.absolute_m, model.signed_m):
        values.flags.writeable = True
        values[:, blind] = np.nan
    return model


def two_models():
    rule = (Rule(model="night", when={"night": True, "rain": (None, 0.5)}), Rule(model="day", when={}))
    return ErrorLibrary(source="made", rule=rule, models={"day": full_model(), "night": flat_model()})


def test_the_shipped_library_is_what_its_generator_makes(tmp_path):
    assert_equal(load_library(DEFAULT_FILE), saved(default_library(), tmp_path / "made.npz"))


@pytest.mark.parametrize(
    ("range_m", "low_m", "high_m"), [(5, 0.025, 0.035), (20, 0.04, 0.06), (80, 0.25, 0.4)]
)
def test_the_shipped_95_percent_surface_is_plausible_at_motorway_speed(range_m, low_m, high_m):
    lines = line_points((np.array([float(range_m)]), np.array([0.0])))
    moved = once(load_law(ErrorModelConfig(mode="extreme")), lines, speed_mps=33.3)
    assert low_m < moved.points_ego_m[0, 1] < high_m


def test_the_shipped_surface_grows_with_range_speed_and_level():
    model = load_library(DEFAULT_FILE).models["all"]
    assert np.all(np.diff(model.absolute_m, axis=0) > 0.0)
    assert np.all(np.diff(model.absolute_m, axis=1) > 0.0)
    assert np.all(np.diff(model.absolute_m[:, 1:], axis=2) > 0.0)


def test_a_relative_file_is_meant_from_the_folder_of_the_scenario(tmp_path):
    save_library(library_of(constant_model(0.1), "test"), tmp_path / "mine.npz")
    law = load_law(ErrorModelConfig(mode="extreme", file="mine.npz"), tmp_path)
    np.testing.assert_allclose(law.models["all"].table_m, 0.1)


def test_a_saved_library_reads_back_equal_and_leaves_nothing_beside_it(tmp_path):
    assert_equal(two_models(), saved(two_models(), tmp_path / "m.npz"))
    assert [path.name for path in tmp_path.iterdir()] == ["m.npz"]


def test_what_could_not_be_read_back_is_not_written(tmp_path):
    save_library(two_models(), tmp_path / "m.npz")
    before = (tmp_path / "m.npz").read_bytes()
    with pytest.raises(ConfigError, match=r"m\.npz: all/levels: values between 0 and 1"):
        save_library(library_of(flat_model(levels=np.array([0.5, 1.0])), "test"), tmp_path / "m.npz")
    with pytest.raises(ConfigError, match=r"nowhere.m\.npz: cannot be written"):
        save_library(two_models(), tmp_path / "nowhere" / "m.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["m.npz"]
    assert (tmp_path / "m.npz").read_bytes() == before


def test_ctrl_c_while_a_file_is_written_leaves_nothing_beside_it(tmp_path, monkeypatch):
    def pressed(file, **content):
        file.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr("numpy.savez_compressed", pressed)
    with pytest.raises(KeyboardInterrupt):
        save_library(two_models(), tmp_path / "m.npz")
    assert list(tmp_path.iterdir()) == []


# --- files of schema 1 --------------------------------------------------------------------------------


def v1(**changes):
    content = {"range_m": RANGE_M, "speed_mps": flat_model().speed_mps, "levels": flat_model().levels}
    content |= {"absolute_m": flat_model().absolute_m, "std_m": STD_M, "source": "old"}
    content |= {"correlation_time_s": 0.8, "correlation_length_m": 50.0, "schema": "vsensor.error_model/1"}
    return {key: value for key, value in (content | changes).items() if value is not None}


def test_a_file_of_schema_1_reads_as_one_model_with_a_normal_law_and_no_losses(tmp_path):
    np.savez(tmp_path / "old.npz", **v1())
    assert_equal(load_library(tmp_path / "old.npz"), library_of(flat_model(), "old"))
    lines = line_points((np.array([50.0]), np.array([0.0])))
    old, new = load_law(ErrorModelConfig(file="old.npz"), tmp_path), law_of(flat_model())
    np.testing.assert_array_equal(once(old, lines).points_ego_m, once(new, lines).points_ego_m)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"schema": "vsensor.error_model/3"}, "is newer than this version"),
        ({"schema": "vsensor.profile/1"}, "expected schema"),
        ({"std_m": None}, "entries missing or unknown: std_m"),
        ({"std": np.zeros(3)}, "entries missing or unknown: std"),
        ({"std_m": np.full((13, 3), np.nan)}, "std_m: finite numbers"),
        ({"std_m": np.full((13, 3), "a")}, "std_m: finite numbers"),
        ({"std_m": np.ones((3, 13))}, r"std_m: shape \(range, speed\)"),
        ({"std_m": -np.ones((13, 3))}, "std_m: no negative"),
        ({"absolute_m": flat_model().absolute_m[::-1]}, "absolute_m: no value that falls with the level"),
        ({"absolute_m": flat_model().absolute_m[:1]}, "absolute_m: shape"),
        ({"absolute_m": -flat_model().absolute_m}, "absolute_m: no negative|absolute_m: no value that falls"),
        ({"range_m": flat_model().range_m[::-1]}, "range_m: at least 2 increasing"),
        ({"speed_mps": np.array(3.0)}, "std_m: shape|speed_mps: at least 2 increasing"),
        ({"levels": np.array([0.5, 1.0])}, "levels: values between 0 and 1"),
        ({"levels": np.array([])}, "levels: increasing values"),
        ({"correlation_time_s": 0.0}, "(applied|correlation)_time_s: one positive"),
        ({"correlation_length_m": np.array([50.0, 50.0])}, "correlation_length_m: one positive"),
    ],
)
def test_a_file_of_schema_1_that_cannot_be_interpolated_is_refused_with_the_entry(
    tmp_path, changes, expected
):
    np.savez(tmp_path / "m.npz", **v1(**changes))
    with pytest.raises(ConfigError, match=rf"^[^\n]*m\.npz: .*({expected})[^\n]*$"):
        load_library(tmp_path / "m.npz")


# --- files that are none ------------------------------------------------------------------------------


def test_a_file_cut_off_anywhere_is_refused_by_name(tmp_path):
    save_library(two_models(), tmp_path / "whole.npz")
    whole, path = (tmp_path / "whole.npz").read_bytes(), tmp_path / "cut.npz"
    for length in {0, 1, 3, 4, 30, 100, *range(200, len(whole), 797), len(whole) - 1}:
        path.write_bytes(whole[:length])
        with pytest.raises(ConfigError, match=r"cut\.npz: not a readable error model"):
            load_library(path)


def test_a_damaged_file_is_refused_or_read_but_never_crashes(tmp_path):
    whole, path = DEFAULT_FILE.read_bytes(), tmp_path / "bad.npz"
    random = np.random.default_rng(8)
    for _ in range(300):
        damaged = bytearray(whole)
        for place in random.integers(0, len(whole), 5):
            damaged[place] = random.integers(256)
        path.write_bytes(damaged)
        with contextlib.suppress(ConfigError):  # anything else, a warning too, fails the test
            load_library(path)


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
        load_library(tmp_path / "foreign.npz")


def test_a_file_that_is_a_single_array_or_holds_objects_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(3))
    np.savez(tmp_path / "b.npz", schema=np.array([{"a": 1}], dtype=object))
    for name in ("a.npy", "b.npz"):
        with pytest.raises(ConfigError, match=f"{name}: not a readable error model"):
            load_library(tmp_path / name)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.npz: no such file"):
        load_library(tmp_path / "none.npz")
    with pytest.raises(ConfigError, match="not a readable error model"):
        load_library(tmp_path)


def entries(**changes):
    """The entries of a file of one full model, some changed, or gone (None)."""
    content = {f"all/{key}": np.asarray(getattr(full_model(), key)) for key in KEYS}
    content |= {"schema": SCHEMA, "source": "test", "rule": '[{"model": "all", "when": {}}]'}
    content |= {key if key in content else f"all/{key}": value for key, value in changes.items()}
    return {key: value for key, value in content.items() if value is not None}


def rule(*conditions, last=True):
    rules = [{"model": "all", "when": one} for one in conditions]
    return json.dumps([*rules, {"model": "all", "when": {}}] if last else rules)


FULL = full_model()
BAD = [
    ({"schema": "vsensor.error_model/3"}, "is newer than this version"),
    ({"schema": None}, "schema is 'missing'"),
    ({"fir": None}, "entries missing or unknown: all/fir"),
    ({"std_m": np.zeros(3)}, "entries missing or unknown: all/std_m"),
    ({"other/range_m": np.zeros(3)}, r"entries missing or unknown: .*other/"),
    ({"rule": "nonsense"}, "rule: JSON"),
    ({"rule": "[" * 100_000}, "rule: "),
    ({"rule": "[]"}, "rule: a last model without condition"),
    ({"rule": rule({"night": True}, last=False)}, "rule: a last model without condition"),
    ({"rule": rule({"fog": [0, 1]})}, "rule: 'fog': one of speed_mps"),
    ({"rule": rule({"night": [0, 1]})}, "rule: night: true or false"),
    ({"rule": rule({"rain": True})}, r"rule: rain: \[from, to\]"),
    ({"rule": rule({"rain": [0.1]})}, "rule: "),
    ({"rule": '[{"model": "fog", "when": {}}]'}, r"rule: 'fog': a model of the file \(all\)"),
    ({"rule": '[{"model": "all", "when": {}, "else": 1}]'}, "rule: .*else"),
    ({"range_m": FULL.range_m[::-1]}, "all/range_m: at least 2 increasing"),
    ({"range_m": np.full(13, np.nan)}, "all/range_m: finite numbers"),
    ({"speed_mps": np.array(3.0)}, "all/speed_mps: at least 2 increasing"),
    ({"levels": np.array([])}, "all/levels: increasing values"),
    ({"levels": np.array([0.5, 1.0])}, "all/levels: values between 0 and 1"),
    ({"signed_levels": np.array([0.0, 0.5, 0.9])}, "all/signed_levels: values between 0 and 1"),
    ({"absolute_m": FULL.absolute_m[:1]}, "all/absolute_m: shape"),
    ({"absolute_m": FULL.absolute_m[::-1]}, "all/absolute_m: no value that falls"),
    ({"absolute_m": FULL.absolute_m - 1.0}, "all/absolute_m: no negative"),
    ({"absolute_low_m": FULL.absolute_m[:, :, :1]}, "all/absolute_low_m: shape"),
    ({"signed_m": FULL.signed_m[:, :-1]}, "all/signed_m: shape"),
    ({"signed_m": FULL.signed_m * np.nan}, "all/signed_m: finite numbers outside of blind"),
    ({"signed_m": FULL.signed_m.astype(complex)}, "all/signed_m: numbers"),
    ({"applied_signed_m": FULL.signed_m[::-1]}, "all/applied_signed_m: no value that falls"),
    ({"applied_length_m": -1.0}, "all/applied_length_m: one positive"),
    ({"applied_time_s": np.inf}, "all/applied_time_s: finite"),
    ({"correlation_time_s": np.ones(2)}, "all/correlation_time_s: one number"),
    ({"rows": -np.ones((13, 3))}, "all/rows: no negative"),
    ({"seconds": np.ones((3, 13))}, r"all/seconds: shape \(range, speed\)"),
    ({"blind": np.zeros((13, 3))}, "all/blind: true or false"),
    ({"blind": np.ones((13, 3), bool)}, "all/blind: a cell that is not blind"),
    ({"fir": np.ones((2, 2))}, "all/fir: a list"),
    ({"region_range_m": np.ones(3)}, "all/region_range_m: a list as long as region_speed_mps"),
    ({"region_range_m": np.zeros(2)}, "all/region_range_m: positive"),
    ({"region_speed_mps": np.ones(2)}, "all/region_speed_mps: increasing"),
    ({"region_level": 1.0}, "all/region_level: a value between"),
    ({"dwell_levels": np.array([0.0, 0.5, 1.5])}, "all/dwell_levels: values from 0 to 1"),
    ({"lost_dwell_s": np.ones(2)}, "all/lost_dwell_s: a list as long as dwell_levels"),
    ({"seen_dwell_s": np.array([1.0, 0.5, 2.0])}, "all/seen_dwell_s: values that never fall"),
    ({"range_share": np.array([-0.1, 1.0])}, "all/range_share: values that never fall, from 0"),
    ({"range_time_s": 0.0}, "all/range_time_s: one positive"),
    ({"quality_step": np.eye(4)}, r"all/quality_step: shape \(5, 5\)"),
    ({"quality_step": np.full((5, 5), 0.1)}, "all/quality_step: probabilities"),
    ({"quality_step": np.eye(5)[::-1] * 3 - 2 * np.eye(5)}, "all/quality_step: probabilities"),
    ({"level_step": np.eye(2)}, r"all/level_step: shape \(3, 3\)"),
    ({"hours": -1.0}, "all/hours: no negative"),
    ({"range_m": 1e3 * FULL.range_m}, "all/range_m: values from -1000 to 1000 m"),
    ({"speed_mps": 1e3 * FULL.speed_mps}, "all/speed_mps: values from -1000 to 1000 m/s"),
    ({"signed_m": 1e300 * FULL.signed_m}, "all/signed_m: values from -1000 to 1000 m"),
    ({"applied_length_m": 1e-300}, "all/applied_length_m: values from 0.001 to 1e"),
    ({"seen_dwell_s": 1e300 * FULL.seen_dwell_s}, "all/seen_dwell_s: values from 0 to 1e"),
    ({"log_count": "many"}, "all/log_count: numbers"),
]


@pytest.mark.parametrize(("changes", "expected"), BAD)
def test_a_model_that_cannot_be_used_is_refused_in_one_line_with_the_entry(tmp_path, changes, expected):
    np.savez(tmp_path / "m.npz", **entries(**changes))
    with pytest.raises(ConfigError, match=rf"^[^\n]*m\.npz: .*{expected}[^\n]*$"):
        load_library(tmp_path / "m.npz")


def test_the_unchanged_entries_are_accepted(tmp_path):
    np.savez(tmp_path / "m.npz", **entries())
    assert_equal(load_library(tmp_path / "m.npz"), library_of(full_model(), "test"))


def test_a_name_that_is_no_name_is_refused(tmp_path):
    content = {key.replace("all", "a b"): value for key, value in entries().items()}
    np.savez(tmp_path / "m.npz", **content)
    with pytest.raises(ConfigError, match="model 'a b': a name of letters"):
        load_library(tmp_path / "m.npz")


def test_whatever_random_entries_are_read_can_be_used_and_the_others_are_refused(tmp_path):
    random, path, keys = np.random.default_rng(9), tmp_path / "m.npz", list(entries())
    odd = [np.nan, np.inf, -1.0, 0.0, 1e-300, 1e300, 1e9, 3.0, "x", True, None]
    factors = [0.0, 1e-300, 1e-3, 0.5, 1.0, 3.0, 1e6]
    lines, used = line_points((np.arange(5.0, 90.0), np.zeros(85))), 0
    for _ in range(300):
        content = entries()
        key, kind = str(random.choice(keys)), random.integers(4)
        if kind > 1 and not isinstance(content[key], str):
            content[key] = content[key] * random.choice(factors)
        elif kind == 1:
            content[key] = np.full(np.shape(content[key]), odd[random.integers(len(odd))])
        else:
            shape = tuple(random.integers(0, 4, random.integers(0, 4)))
            content[key] = np.full(shape, odd[random.integers(len(odd))])
        np.savez(path, **content)
        with contextlib.suppress(ConfigError):  # anything else, a warning too, fails the test
            library = load_library(path)
            for mode in ("extreme", "levels", "volume"):
                law = compile_law(ErrorModelConfig(mode=mode, level=float(full_model().levels[0])), library)
                report(law, None, Draws(1), tick(0), at(), LaneEstimate(**NO_LINES), reach_m(law))
                assert np.isfinite(once(law, lines).points_ego_m).all()
                used += 1
    assert used > 150


NO_LINES = {"exposed_at_ns": 0, "image_index": 0, "boundaries": ()}


def reach_m(law):
    found = reach(law, at())
    return 100.0 if found is None else found.range_m
