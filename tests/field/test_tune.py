"""Tuning finds drawn laws again: surfaces, intervals, correlation, reach, losses, conditions; and refuses."""

import dataclasses
import sys

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import ndtr
from scipy.stats import norm

from tests.field.made_tables import Law, columns_of, made_table, write_log
from vsensor.cli import main
from vsensor.error_model import load_library, save_library
from vsensor.errors import TableError
from vsensor.field.table import open_table
from vsensor.field.tune import TuneOptions, tune_table
from vsensor.field.tune.text import text_lines

LAW = Law(ranges_m=np.array([5.0, 25.0, 45.0, 65.0]))
SECONDS = [240.0, 420.0, 300.0, 180.0, 360.0]
OPEN = TuneOptions(close_loop=False, block_s=30.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """25 minutes in five logs."""
    path = tmp_path_factory.mktemp("table")
    made_table(path, LAW, SECONDS, seed=3)
    return path


@pytest.fixture(scope="module")
def tuned(folder):
    return tune_table(open_table([folder]), OPEN)


@pytest.fixture(scope="module")
def model(tuned):
    return tuned.library.models["all"]


def true_surfaces(model, law=LAW):
    at = model.range_m[:, None], model.speed_mps[None]
    return np.array([law.quantile_m(level, *at) for level in model.levels])


def arrays(model):
    return {field.name: getattr(model, field.name) for field in dataclasses.fields(model)}


def assert_same_models(one, other):
    for name, value in arrays(one).items():
        np.testing.assert_array_equal(value, getattr(other, name), err_msg=name)


# --- the law ----------------------------------------------------------------------------------------------


def test_surfaces_of_a_student_law_are_found_within_a_tenth(model):
    seen = ~model.blind
    off = (model.absolute_m / true_surfaces(model) - 1.0)[:, seen]
    assert seen.sum() > 100
    # 25 min, 4 of them in the filter's width: a cell is known to some 5 %, and 7 of them are independent
    assert np.abs(off[:4]).mean() < 0.06
    assert abs(off[:4].mean()) < 3 * 0.05 / np.sqrt(7)


def test_the_true_surface_lies_in_most_of_the_stated_intervals(model):
    truth, seen = true_surfaces(model), ~model.blind
    inside = (model.absolute_low_m <= truth) & (truth <= model.absolute_high_m)
    assert inside[:, seen].mean() > 0.85  # one seed: its cells are correlated


def test_surfaces_and_intervals_rise_with_the_level_and_the_interval_holds_the_value(model):
    seen = ~model.blind
    assert np.all(np.diff(model.absolute_m[:, seen], axis=0) >= 0.0)
    assert np.all(np.diff(model.signed_m[:, seen], axis=0) >= 0.0)
    assert np.all(model.absolute_low_m[:, seen] <= model.absolute_m[:, seen])
    assert np.all(model.absolute_m[:, seen] <= model.absolute_high_m[:, seen])


def test_a_bias_stands_in_the_signed_surfaces_alone(tmp_path):
    law = dataclasses.replace(LAW, bias=1.0)
    found = tune_table(made_table(tmp_path, law, [600.0], seed=4), OPEN).library.models["all"]
    middle = found.signed_m[len(found.signed_levels) // 2]
    scale = law.scale_m(found.range_m[:, None], found.speed_mps[None])
    seen = ~found.blind
    np.testing.assert_allclose((middle / scale)[seen].mean(), 1.0, atol=0.1)


def test_correlation_time_and_length_are_found_within_a_tenth(model):
    np.testing.assert_allclose(model.correlation_time_s, LAW.time_s, rtol=0.1)
    np.testing.assert_allclose(model.correlation_length_m, LAW.length_m, rtol=0.1)


def test_the_operating_range_is_the_quantile_of_the_reported_range(model):
    # reach * uniform(0.9, 1): its 95 % quantile is 0.995 of the reach; bins of 0.5 m
    np.testing.assert_allclose(
        model.region_range_m, 0.995 * LAW.reach_m(model.region_speed_mps), atol=1.0, rtol=0.01
    )


def test_how_long_lines_stay_lost_and_seen_is_found(model):
    lost, seen = (np.interp(0.5, model.dwell_levels, x) for x in (model.lost_dwell_s, model.seen_dwell_s))
    # some 70 runs of each: an exponential's median is known to 12 %; runs end on whole images
    np.testing.assert_allclose(lost, LAW.lost_s * np.log(2.0), rtol=0.4)
    np.testing.assert_allclose(seen, LAW.seen_s * np.log(2.0), rtol=0.4)


def test_quality_from_image_to_image_and_the_reported_ranges_correlation_are_found(tmp_path):
    step = np.array([[0.8, 0.2, 0, 0], [0, 0.7, 0.3, 0], [0, 0, 0.8, 0.2], [0.4, 0, 0, 0.6]])
    random, seconds, time_s = np.random.default_rng(12), 500.0, 2.0
    columns = columns_of(random, LAW, seconds)
    image = (columns["t_ns"] - columns["t_ns"][0]) // 40_000_000
    seen = np.isfinite(columns["range_m"])
    for side in (0, 1):
        draws, quality = random.random(int(image.max()) + 1), [0]
        for one in draws[1:]:
            quality.append(int(np.searchsorted(np.cumsum(step[quality[-1]]), one)))
        rows = seen & (columns["side"] == side)
        columns["quality"][rows] = 1 + np.array(quality)[image[rows]]
        keep = np.exp(-0.04 / time_s)
        white = np.sqrt(1.0 - keep**2) * random.standard_normal(len(draws))
        share = 1.0 - 0.1 * ndtr(lfilter([1.0], [1.0, -keep], white))
        columns["x_max_m"][rows] = (LAW.reach_m(columns["speed_mps"]) * share[image])[rows]
    write_log(tmp_path, "one", columns)
    found = tune_table(open_table([tmp_path]), OPEN).library.models["all"]
    assert found.quality_period_s == 0.04
    # the rarest state has some 5000 of 25,000 images: a share of it is known to 1 %
    np.testing.assert_allclose(found.quality_step[1:, 1:], step, atol=0.05)
    np.testing.assert_allclose(found.range_time_s, time_s, rtol=0.2)  # of 500 correlation times


def test_bands_between_surfaces_have_the_shares_of_the_levels(model):
    step = model.level_step
    share = np.linalg.matrix_power(step, 4000)[0]
    np.testing.assert_allclose(share, np.diff([0.0, *model.levels, 1.0]), atol=0.01)


def test_no_cell_is_known_where_nothing_was_driven_or_reported(model):
    range_m, speed = np.meshgrid(model.range_m, model.speed_mps, indexing="ij")
    beyond = (range_m > LAW.reach_m(speed) + 5.0) | (speed < 4.0)
    assert beyond.any()
    assert model.blind[beyond].all()
    assert not model.blind[(range_m < 0.85 * LAW.reach_m(speed)) & (speed > 7) & (speed < 33)].any()


def test_seconds_are_those_of_driving_not_of_lines(tuned):
    counts = tuned.survey.ranges[5000][1].sum()  # of both sides
    seen_share = LAW.seen_s / (LAW.seen_s + LAW.lost_s)
    np.testing.assert_allclose(counts / 2e9, sum(SECONDS) * seen_share, rtol=0.05)
    assert tuned.library.models["all"].hours == pytest.approx(sum(SECONDS) / 3600.0, rel=0.01)


def test_logs_that_differ_widen_the_intervals(tmp_path):
    for k in range(12):
        columns = columns_of(np.random.default_rng([9, k]), LAW, 60.0, low=15.0, high=17.0)
        columns["error_m"] = columns["error_m"] * (0.5 if k % 2 else 1.5)
        write_log(tmp_path, f"drive_{k}", columns)
    found = tune_table(open_table([tmp_path]), dataclasses.replace(OPEN, block_s=10.0))
    assert found.conditions[0].spread.between_logs > 2.0


# --- order, merging, where it is computed ------------------------------------------------------------------


def test_the_order_of_logs_changes_nothing(folder, model):
    files = sorted(folder.iterdir(), reverse=True)
    assert_same_models(tune_table(open_table(files), OPEN).library.models["all"], model)


def test_two_folders_are_one_table(folder, model, tmp_path):
    parts = [tmp_path / "a", tmp_path / "b"]
    for part in parts:
        part.mkdir()
    for k, file in enumerate(sorted(folder.iterdir())):
        (parts[k % 2] / file.name).write_bytes(file.read_bytes())
    assert_same_models(tune_table(open_table(parts), OPEN).library.models["all"], model)


def test_a_cluster_gives_the_same_bits(folder, model, scheduler):
    found = tune_table(open_table([folder]), dataclasses.replace(OPEN, scheduler=scheduler))
    assert_same_models(found.library.models["all"], model)


def test_small_chunks_give_the_same_model(folder, model, monkeypatch):
    monkeypatch.setattr("vsensor.field.tune.reading.CHUNK", 40_001)
    monkeypatch.setattr("vsensor.field.tune.counting.PIECE", 7_777)
    assert_same_models(tune_table(open_table([folder]), OPEN).library.models["all"], model)


# --- conditions --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    """Day, night and rain: at night twice, in rain three times as large."""
    path = tmp_path_factory.mktemp("mixed")
    for k, (night, rain, factor) in enumerate([(False, 0.0, 1.0), (True, 0.0, 2.0), (False, 0.5, 3.0)]):
        columns = columns_of(
            np.random.default_rng([5, k]), LAW, 400.0, night=night, rain=rain, low=15.0, high=25.0
        )
        columns["error_m"] = columns["error_m"] * factor
        write_log(path, f"drive_{k}", columns)
    return open_table([path])


def test_each_condition_has_its_own_model_and_the_rule_that_picks_it(mixed, tmp_path):
    found = tune_table(mixed, dataclasses.replace(OPEN, by="night,rain"))
    save_library(found.library, tmp_path / "model.npz")
    library = load_library(tmp_path / "model.npz")
    assert [one.model for one in library.rule] == ["night", "rain", "day"]
    assert found.skipped == ("night_rain",)
    for name, factor in (("night", 2.0), ("rain", 3.0), ("day", 1.0)):
        model = library.models[name]
        off = (model.absolute_m / true_surfaces(model) / factor)[:, ~model.blind]
        np.testing.assert_allclose(off[:4].mean(), 1.0, atol=0.15)


def test_a_column_with_edges_makes_a_model_for_each_class(mixed):
    found = tune_table(mixed, dataclasses.replace(OPEN, by="speed_mps:20"))
    assert set(found.library.models) == {"speed_mps_from_20", "rest"}
    fast = found.library.models["speed_mps_from_20"]
    assert fast.speed_mps[~fast.blind.all(axis=0)].min() > 17.0


# --- what is refused ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"by": "rain:0.9"}, "--by rain: no used row of the table has it"),
        ({"by": "fog"}, "--by fog: one of speed_mps, "),
        ({"by": "speed_mps"}, "expected its edges too, such as speed_mps:10:20"),
        ({"by": "speed_mps:20:10"}, "rising numbers"),
        ({"by": "night,night"}, "a column twice"),
        ({"levels": (0.9, 0.5)}, "rising values between 0 and 1"),
        ({"levels": (0.5, 1.0)}, "rising values between 0 and 1"),
        ({"cutoff_s_per_m": 0.5}, "some taps are negative"),
        ({"cutoff_s_per_m": 3.0}, "Nyquist"),
        ({"least_seconds": 1e6}, "at least 1e\\+06 s were expected"),
        ({"least_seconds": 900.0}, "every cell is blind"),
    ],
)
def test_what_cannot_be_tuned_is_refused_in_one_line(folder, changes, expected):
    with pytest.raises(TableError, match=expected) as refused:
        tune_table(open_table([folder]), dataclasses.replace(OPEN, **changes))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("text", "expected"), [("6", "paint and gap such as 6,12"), ("0,12", "some paint")])
def test_dashes_that_are_none_are_refused(text, expected, tmp_path, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["tune", str(tmp_path), "--out", str(tmp_path / "m.npz"), "--dashes", text])
    assert expected in capsys.readouterr().err


def test_a_table_without_a_usable_row_is_refused(tmp_path):
    columns = columns_of(np.random.default_rng(1), LAW, 5.0)
    columns["masked"] = np.full(len(columns["masked"]), 4, np.uint8)
    write_log(tmp_path, "masked", columns)
    with pytest.raises(TableError, match="nothing to learn from"):
        tune_table(open_table([tmp_path]), OPEN)


def test_all_rows_in_one_cell_are_refused(tmp_path):
    law = dataclasses.replace(LAW, ranges_m=np.array([25.0]))
    write_log(tmp_path, "one", columns_of(np.random.default_rng(1), law, 100.0, low=20.0, high=20.0))
    with pytest.raises(TableError, match="all rows are at one range"):
        tune_table(open_table([tmp_path]), OPEN)


@pytest.mark.parametrize(
    ("column", "value", "expected"), [("side", 9, "side 9: 0 to 3"), ("quality", 7, "quality 7: 0 to 4")]
)
def test_codes_that_there_are_not_are_refused_by_name(tmp_path, column, value, expected):
    columns = columns_of(np.random.default_rng(1), LAW, 5.0)
    columns[column][7] = value
    write_log(tmp_path, "odd", columns)
    with pytest.raises(TableError, match=f"odd.parquet: {expected} was expected"):
        tune_table(open_table([tmp_path]), OPEN)


def test_a_log_that_was_interrupted_for_years_gives_the_same_model(tmp_path):
    columns = columns_of(np.random.default_rng(1), LAW, 120.0, low=15.0, high=17.0)
    late = columns["t_ns"] - columns["t_ns"][0] >= 60e9
    long = columns | {"t_ns": columns["t_ns"] + late * (60 * 10**9), "log": 0}
    far = columns | {"t_ns": columns["t_ns"] + late * (40 * 365 * 86_400 * 10**9)}
    long.pop("log")
    options = dataclasses.replace(OPEN, block_s=10.0, least_seconds=10.0)
    for name, one in (("long", long), ("far", far)):
        write_log(tmp_path / name, "drive", one)
    one, other = (tune_table(open_table([tmp_path / name]), options) for name in ("long", "far"))
    assert_same_models(one.library.models["all"], other.library.models["all"])


def test_a_single_log_is_tuned_from_its_blocks(tmp_path):
    found = tune_table(made_table(tmp_path, LAW, [600.0]), OPEN)
    assert found.library.models["all"].log_count == 1.0
    assert found.conditions[0].spread.between_logs == 1.0


def test_a_truncated_log_is_refused_by_name_and_no_model_is_written(folder, tmp_path, capsys):
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    cut = tmp_path / "drive_1.parquet"
    cut.write_bytes(cut.read_bytes()[:-5000])
    assert main(["tune", str(tmp_path), "--out", str(tmp_path / "model.npz"), "--quiet"]) == 2
    assert "drive_1.parquet" in capsys.readouterr().err
    assert not list(tmp_path.glob("*model*"))


def test_an_error_within_a_log_is_told_and_no_model_is_written(folder, tmp_path, capsys):
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    damaged = tmp_path / "drive_2.parquet"
    content = bytearray(damaged.read_bytes())
    content[1000:60_000] = bytes(59_000)
    damaged.write_bytes(content)
    assert main(["tune", str(tmp_path), "--out", str(tmp_path / "model.npz"), "--quiet"]) == 2
    told = capsys.readouterr().err
    assert "drive_2.parquet" in told
    assert told.count("\n") == 1
    assert not list(tmp_path.glob("*model*"))


def test_a_place_where_no_model_or_picture_can_be_is_refused_before_the_work(
    folder, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("vsensor.field.tune.tune_table", None)  # nobody gets so far
    model = str(tmp_path / "m.npz")
    (tmp_path / "file").write_text("")
    cases = [
        (["--out", str(tmp_path / "nowhere" / "m.npz")], "there is no folder"),
        (["--out", str(tmp_path)], "is a folder"),
        (["--out", model, "--plots", str(tmp_path / "file")], "file: cannot be made"),
    ]
    for words, expected in cases:
        assert main(["tune", str(folder), *words, "--quiet"]) == 2
        assert expected in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["tune", str(folder), "--out", model, "--plots", str(tmp_path / "p"), "--quiet"]) == 2
    assert "pip install 'vsensor[plots]'" in capsys.readouterr().err


def test_the_command_writes_a_model_and_pages_and_says_what_it_found(folder, tmp_path, capsys):
    words = ["tune", str(folder), "--out", str(tmp_path / "m.npz"), "--plots", str(tmp_path / "pages")]
    assert main([*words, "--open-loop", "--block", "30", "--quiet"]) == 0
    told = capsys.readouterr().out
    assert "correlation time 0." in told
    assert load_library(tmp_path / "m.npz").models["all"].levels.tolist() == [0.5, 0.8, 0.9, 0.95, 0.97, 0.99]
    assert {path.name for path in (tmp_path / "pages").iterdir()} == {
        f"all_{name}.png" for name in ("surface", "confidence", "reach", "correlation")
    }


def test_blocks_that_hardly_outlast_the_correlation_are_told(tuned):
    assert not any("too narrow" in line for line in text_lines(tuned))
    time_s = tuned.library.models["all"].correlation_time_s
    expected = f"intervals are too narrow; --block {10.0 * time_s:.0f} or more"
    assert any(expected in line for line in text_lines(dataclasses.replace(tuned, block_s=5.0 * time_s)))


def test_normal_errors_give_the_normal_law(tmp_path):
    law = dataclasses.replace(LAW, freedom=1e6)
    found = tune_table(made_table(tmp_path, law, [1200.0], seed=8), OPEN).library.models["all"]
    scale = law.scale_m(found.range_m[:, None], found.speed_mps[None])
    seen = ~found.blind
    law_found = (found.signed_m / scale)[:, seen].mean(axis=1)
    np.testing.assert_allclose(law_found[3:-3], norm.ppf(found.signed_levels)[3:-3], atol=0.12)
