"""What `vsensor check` says of a scenario's error model, and of a drive that leaves what it knows."""

import shutil

import numpy as np
import pytest

from tests.error_model.models import GRID_MPS, RANGE_M, flat_model
from tests.shared import SHARED_DATA, needs_shared
from vsensor.check import check_file
from vsensor.check.errors import error_findings, error_lines
from vsensor.config import SHIPPED, load_scenario
from vsensor.error_model import ErrorLibrary, Rule, library_of, save_library
from vsensor.line import build_line

REGION = {"region_speed_mps": np.array([0.0, 40.0]), "region_range_m": np.array([40.0, 120.0])}


def blind_beyond(range_m, *speeds_mps):
    return (RANGE_M[:, None] > range_m) & np.isin(GRID_MPS, speeds_mps)[None, :]


@pytest.fixture
def found(tmp_path):
    """Return a function: library and scenario text -> findings, lines."""

    def said(library, text):
        shutil.copy(SHIPPED / "highway.xodr", tmp_path / "highway.xodr")
        save_library(library, tmp_path / "model.npz")
        path = tmp_path / "scenario.toml"
        head = 'schema = "vsensor.scenario/1"\nsource = "highway.xodr"\n'
        path.write_text(f'{head}{text}\n[error_model]\nfile = "model.npz"\n', encoding="utf-8")
        scenario = load_scenario(str(path))
        line = build_line(scenario)
        return error_findings(scenario, line), error_lines(scenario, line.sensor.law)

    return said


def test_a_drive_within_the_model_has_no_finding_and_the_models_data_is_said(found):
    model = flat_model(**REGION, hours=9.5, log_count=12.0, blind=blind_beyond(110.0, 0.0))
    findings, lines = found(library_of(model, "12 logs of May", "day"), "[ego]\nspeed_kmh = 100")
    assert findings == []
    assert lines == [
        "error model model.npz: 12 logs of May",
        "  model day: 9.5 h in 12 logs, 0 to 120 m, 0 to 144 km/h, 1 of 39 cells blind, fitted too: region",
    ]


def test_a_drive_faster_than_the_grid_is_told_for_how_long_and_what_is_done(found):
    text = "duration_s = 40\n[ego]\nspeed_kmh = [[0, 100], [20, 100], [20.01, 180]]"
    findings, _ = found(library_of(flat_model(), "test"), text)
    assert findings == [
        "error_model: 50 % of the drive at 180 km/h, beyond the speeds of model all, 0 to 144 km/h: "
        "the nearest ones are used"
    ]


def test_blind_cells_within_the_range_of_the_drive_are_told_with_what_becomes_of_the_points(found):
    model = flat_model(**REGION, blind=blind_beyond(60.0, 20.0))
    text = "duration_s = 40\n[ego]\nspeed_kmh = [[0, 72], [10, 72], [10.0001, 140]]"
    findings, _ = found(library_of(model, "test"), text)
    assert findings == [
        "error_model: 25 % of the drive at 72 km/h has cells of which model all knows too little, "
        "from 65 m to 80 m: points there are dropped"
    ]
    findings, _ = found(library_of(model, "test"), text + "\n[region]\nspeed_kmh = [0]\nrange_m = [70]\n")
    assert findings[0].endswith("they are used all the same, as [region] says")


def test_the_rule_is_said_and_only_the_model_that_holds_is_judged(found):
    rule = (
        Rule(model="night", when={"night": True}),
        Rule(model="wet", when={"rain": (0.2, 1.0), "speed_mps": (None, 30.0)}),
        Rule(model="day", when={}),
    )
    fast = flat_model(speed_mps=np.array([0.0, 20.0, 60.0]))
    library = ErrorLibrary(source="", rule=rule, models={"day": fast, "night": flat_model(), "wet": fast})
    findings, lines = found(library, "[ego]\nspeed_kmh = 180")
    assert findings == []
    assert lines[-1] == "  rule: night when night; wet when rain 0.2..1 and speed_mps ..30; else day"
    findings, _ = found(library, '[ego]\nspeed_kmh = 180\n[environment]\nlight = "night"')
    assert "beyond the speeds of model night" in findings[0]


@needs_shared
def test_the_speeds_of_a_recorded_drive_are_judged_too(tmp_path):
    save_library(library_of(flat_model(speed_mps=np.array([0.0, 5.0, 15.0])), "test"), tmp_path / "m.npz")
    dbc = SHARED_DATA / "dbc" / "toyota_rav4_2017_pt_generated.dbc"
    text = f'[drive]\nprofile = ["toyota_rav4"]\ndbc = "{dbc}"\n[error_model]\nfile = "m.npz"\n'
    source = SHARED_DATA / "can" / "rav4_drive.log"
    path = tmp_path / "drive.toml"
    path.write_text(f'schema = "vsensor.scenario/1"\nsource = "{source}"\n{text}', encoding="utf-8")
    report = check_file(str(path))
    (finding,) = [text for text in report.findings if text.startswith("error_model")]
    assert "km/h, beyond the speeds of model all, 0 to 54 km/h" in finding
    assert any(line.startswith("error model m.npz: test") for line in report.lines)
