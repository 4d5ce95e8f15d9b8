"""A model is judged by held-out drives: its own law passes, another one fails under its name."""

import dataclasses
import json
import re

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import norm
from scipy.stats import t as student

from tests.field.made_tables import Law, columns_of, made_table, write_log
from vsensor.cli import main
from vsensor.error_model import Rule, library_of, model_of, save_library
from vsensor.error_model.model import ErrorLibrary
from vsensor.errors import ConfigError, TableError
from vsensor.field.table import open_table
from vsensor.field.tune.surface import SIGNED_LEVELS
from vsensor.field.validate import validate_model
from vsensor.field.validate.place import LawTable
from vsensor.field.validate.verdict import as_json
from vsensor.field.virtual import FitSetting, VirtualSensor, fit_matrix
from vsensor.lanefit import LaneFitConfig, fit

# wide in length, so that a cubic keeps the law: what is drawn is then what is reported
LAW = Law(seen_s=6.0, length_m=200.0, ranges_m=np.array([5.0, 15.0, 25.0, 35.0]))
LEVELS = np.array([0.5, 0.8, 0.9, 0.95, 0.97, 0.99])
SPEEDS = np.arange(0.0, 41.0, 2.0)


def law_model(law=LAW, **changes):
    """The drawn law as a model."""
    scale = law.scale_m(law.grid()[:, None], SPEEDS[None])
    dwell_levels = np.linspace(0.0, 0.999, 400)
    given = {
        "range_m": law.grid(),
        "speed_mps": SPEEDS,
        "levels": LEVELS,
        "absolute_m": student.ppf(0.5 + LEVELS / 2, law.freedom)[:, None, None] * scale,
        "signed_levels": SIGNED_LEVELS,
        "signed_m": student.ppf(SIGNED_LEVELS, law.freedom)[:, None, None] * scale,
        "correlation_time_s": law.time_s,
        "correlation_length_m": law.length_m,
        "region_speed_mps": np.array([0.0, 40.0]),
        "region_range_m": np.array([40.0, 40.0]),
        "dwell_levels": dwell_levels,
        "lost_dwell_s": -law.lost_s * np.log1p(-dwell_levels),
        "seen_dwell_s": -law.seen_s * np.log1p(-dwell_levels),
    }
    return model_of(**given | changes)


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    """4 minutes of the law."""
    path = tmp_path_factory.mktemp("held")
    return made_table(path, LAW, [80.0, 100.0, 60.0], seed=21)


@pytest.fixture(scope="module")
def own(held, tmp_path_factory):
    """The law's own verdict."""
    return verdict(held, tmp_path_factory.mktemp("own"), law_model())


def verdict(held, tmp_path, model, **how):
    path = tmp_path / "model.npz"
    save_library(library_of(model, "made"), path)
    return validate_model(path, held, **how)


def failed(found):
    return [check.what for one in found.judged for check in one.checks if not check.good]


def test_the_law_itself_is_within_the_limits(own):
    assert failed(own) == []
    assert own.good
    one = own.judged[0]
    np.testing.assert_array_less(np.abs(one.coverage - LEVELS), one.half + 0.01)
    # 4 minutes of two lines, correlated over 0.8 s: some hundred independent errors, not 48,000 rows
    assert 150 < one.effective < 2500


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"absolute_m": 1.3 * law_model().absolute_m}, ["errors within the 80% surface"]),
        (
            {"signed_m": 2.0 * law_model().signed_m},
            ["evenness of the errors' places", "distance of recorded and virtual errors"],
        ),
        ({"signed_m": law_model().signed_m + 0.02}, ["evenness of the errors' places"]),
        ({"correlation_time_s": 0.4, "applied_time_s": 0.4}, ["correlation time"]),
        ({"lost_dwell_s": 3.0 * law_model().lost_dwell_s}, ["how long a line stays lost"]),
        (
            dict.fromkeys(("dwell_levels", "lost_dwell_s", "seen_dwell_s"), np.zeros(0)),
            ["how long a line stays lost"],
        ),
        ({"blind": law_model().blind | (SPEEDS > 20.0)[None]}, ["rows that the model does not know"]),
    ],
)
def test_a_model_that_is_off_fails_under_the_name_of_what_is_off(held, tmp_path, changes, expected):
    found = verdict(held, tmp_path, law_model(**changes))
    assert not found.good
    for one in expected:
        assert any(what.startswith(one) for what in failed(found))


def test_each_condition_is_judged_by_its_own_rows(tmp_path):
    for k, (night, factor) in enumerate([(False, 1.0), (True, 2.0)]):
        columns = columns_of(np.random.default_rng([31, k]), LAW, 240.0, night=night)
        columns["error_m"] = columns["error_m"] * factor
        write_log(tmp_path, f"drive_{k}", columns)
    models = {
        "night": law_model(absolute_m=2.0 * law_model().absolute_m, signed_m=2.0 * law_model().signed_m),
        "day": law_model(),
    }
    rule = (Rule(model="night", when={"night": True}), Rule(model="day", when={}))
    save_library(ErrorLibrary(source="made", rule=rule, models=models), tmp_path / "m.npz")
    found = validate_model(tmp_path / "m.npz", open_table([tmp_path]))
    assert {one.name for one in found.judged} == {"night", "day"}
    assert failed(found) == []


def test_places_in_a_normal_law_are_its_scores():
    model = law_model(signed_m=norm.ppf(SIGNED_LEVELS)[:, None, None] * np.full((4, len(SPEEDS)), 0.1))
    random = np.random.default_rng(1)
    z = random.standard_normal(2000)
    placed = LawTable(model).place(random.choice(LAW.grid(), 2000), random.uniform(0.0, 40.0, 2000), 0.1 * z)
    assert placed.known.all()
    np.testing.assert_allclose(placed.score, z, atol=1e-9)
    np.testing.assert_array_equal(placed.signed, np.searchsorted(SIGNED_LEVELS, ndtr(z)))


def test_nothing_is_placed_outside_of_the_grid_or_where_the_model_is_blind():
    blind = np.zeros((4, len(SPEEDS)), bool)
    blind[3, 5] = True
    law = LawTable(law_model(blind=blind))
    ranges, speeds = np.array([5.0, 60.0, 35.0, 35.0]), np.array([50.0, 10.0, 10.2, 12.1])
    assert law.place(ranges, speeds, np.zeros(4)).known.tolist() == [False, False, False, True]


# --- the virtual sensor in bulk ---------------------------------------------------------------------------


def test_the_fit_matrix_is_the_fit_of_the_sensor():
    x, grid, ranges = np.arange(0.0, 60.0, 0.5), np.linspace(0.0, 60.0, 31), np.array([5.0, 20.0, 50.0])
    errors = np.sin(grid / 9.0) * 0.05
    line = fit(LaneFitConfig(), x, np.interp(x, grid, errors), np.zeros(len(x)))
    found = fit_matrix(LaneFitConfig(), x, grid, ranges) @ errors
    np.testing.assert_allclose(found, [line.y_at(at) for at in ranges], atol=1e-12)


def test_the_dashes_of_a_line_go_by_as_it_is_driven_along():
    setting = FitSetting(dashes_m=(6.0, 12.0))
    driven, x = np.arange(0.1, 40.0, 1.5), np.arange(0.0, 50.0, 0.5) + 0.25
    phases = setting.phase_at(driven)
    for way, phase in zip(driven, phases.tolist(), strict=True):
        np.testing.assert_array_equal(setting.painted(x, phase), (x + way) % 18.0 < 6.0)
    assert FitSetting().painted(x, 0).all()


def test_beside_the_vehicle_a_dashed_lines_fit_errs_as_its_nearest_dash_lets_it():
    normal = norm.ppf(SIGNED_LEVELS)[:, None, None] * np.full((4, len(SPEEDS)), 0.1)
    near = dataclasses.replace(LAW, ranges_m=np.array([1.0, 15.0, 25.0, 35.0]), length_m=15.0)
    model = law_model(near, signed_m=normal, region_range_m=np.array([60.0, 60.0]))
    sensor = VirtualSensor.of(model, FitSetting(dashes_m=(6.0, 12.0)))
    z = np.random.default_rng(6).standard_normal((24_000, len(sensor.grid_m))) @ sensor.factor.T
    found = sensor.errors(z, np.full(len(z), 20.0)).std(axis=0)
    spread, column = 0.1 * sensor.factor, 10
    of_phases = [((matrix @ spread) ** 2).sum(axis=1) for matrix in sensor.matrices[column]]
    np.testing.assert_allclose(found, np.sqrt(np.mean(of_phases, axis=0)), rtol=0.02)
    solid = VirtualSensor.of(model, FitSetting())
    beside = np.sqrt(((solid.matrices[column][0] @ spread) ** 2).sum(axis=1))
    assert found[0] > 1.15 * beside[0]
    np.testing.assert_allclose(found[1:], beside[1:], rtol=0.04)


def test_virtual_errors_have_the_law_and_the_correlation_time():
    sensor = VirtualSensor.of(law_model(), FitSetting())
    z = sensor.drive(np.full(120_000, 0.04), np.random.default_rng(3))
    errors = sensor.errors(z, np.full(len(z), 20.0))
    expected = LAW.quantile_m(0.8, LAW.grid(), 20.0)
    np.testing.assert_allclose(np.quantile(np.abs(errors), 0.8, axis=0), expected, rtol=0.08)
    lag = 20  # one correlation time; some 3000 of them are known to 2 %
    rho = np.mean(z[lag:, 0] * z[:-lag, 0]) / np.mean(z[:, 0] ** 2)
    np.testing.assert_allclose(rho, np.exp(-1.0), atol=0.05)


def test_uneven_steps_in_time_are_each_their_own():
    sensor = VirtualSensor.of(law_model(), FitSetting())
    z = sensor.drive(np.array([0.04, 50.0] * 2000), np.random.default_rng(4))
    near = np.corrcoef(z[0:-1:2, 0], z[1::2, 0])[0, 1]
    far = np.corrcoef(z[1:-1:2, 0], z[2::2, 0])[0, 1]
    np.testing.assert_allclose([near, far], [np.exp(-0.05), 0.0], atol=0.08)


# --- the command -------------------------------------------------------------------------------------------


def test_a_good_model_ends_with_0_and_its_page_may_be_a_pdf(held, tmp_path, capsys):
    save_library(library_of(law_model(), "made"), tmp_path / "good.npz")
    words = ["validate", str(tmp_path / "good.npz"), str(held.files[0].path.parent)]
    words += ["--out", str(tmp_path / "good.pdf"), "--json", str(tmp_path / "good.json"), "--quiet"]
    assert main(words) == 0
    assert "within limits" in capsys.readouterr().out
    assert [one["model"] for one in json.loads((tmp_path / "good.json").read_text())["models"]] == ["all"]
    assert (tmp_path / "good.pdf").read_bytes().startswith(b"%PDF")


def test_a_bad_model_ends_with_1_and_its_page_is_one_file_that_loads_nothing(held, tmp_path, capsys):
    model = law_model(signed_m=2.0 * law_model().signed_m, absolute_m=2.0 * law_model().absolute_m)
    save_library(library_of(model, "made <here>"), tmp_path / "bad.npz")
    words = ["validate", str(tmp_path / "bad.npz"), str(held.files[0].path.parent)]
    assert main([*words, "--out", str(tmp_path / "bad.html"), "--quiet"]) == 1
    assert "beyond limits" in capsys.readouterr().out
    page = (tmp_path / "bad.html").read_text()
    assert "beyond limits" in page
    assert not re.search(r"(src|href)=\"(?!data:)", page)
    assert "made &lt;here&gt;" in page


def test_limits_come_from_a_file_and_change_the_verdict(held, tmp_path):
    limits = tmp_path / "limits.toml"
    limits.write_text('schema = "vsensor.validate/1"\ncoverage = 0.5\npit = 0.5\nwasserstein = 1.0\n')
    model = law_model(signed_m=2.0 * law_model().signed_m, absolute_m=2.0 * law_model().absolute_m)
    assert verdict(held, tmp_path, model, limits=limits).good  # not so without: see above
    limits.write_text('schema = "vsensor.validate/1"\ncoverag = 0.3\n')
    with pytest.raises(ConfigError, match=r"limits\.toml: coverag: unknown key; did you mean coverage"):
        verdict(held, tmp_path, model, limits=limits)


def test_what_cannot_be_judged_is_refused(held, tmp_path):
    with pytest.raises(ConfigError, match=r"a page ends in \.html or \.pdf"):
        verdict(held, tmp_path, law_model(), out=tmp_path / "page.doc")
    with pytest.raises(ConfigError, match="no such file"):
        validate_model(tmp_path / "none.npz", held)
    columns = columns_of(np.random.default_rng(1), LAW, 5.0)
    columns["masked"] = np.full(len(columns["masked"]), 4, np.uint8)
    write_log(tmp_path / "empty", "masked", columns)
    with pytest.raises(TableError, match="nothing to validate with"):
        verdict(open_table([tmp_path / "empty"]), tmp_path, law_model())


def test_the_verdict_can_be_read_by_programs(own):
    found = json.loads(json.dumps(as_json(own.judged)))
    assert found["good"] is True
    assert {"what", "off", "chance", "limit", "good", "shown"} == set(found["models"][0]["checks"][0])


def test_the_order_of_logs_changes_no_verdict(held, own, tmp_path):
    other = dataclasses.replace(held, files=held.files[::-1])
    assert verdict(other, tmp_path, law_model()).lines == own.lines
