"""From a known law through the sensor, its bus and a log back to the law: make, scan, tune, validate, run.

VSENSOR_ROUND_TRIP_HOURS says how long is driven (0.2); `tools/round_trip.py` does hours and generations.
"""

import os

import numpy as np
import pytest

from tools.compared import compare, law_truth
from tools.made_law import CORRELATION_TIME_S
from tools.round_trip import DASHED, learned, scanned
from vsensor.cli import main
from vsensor.error_model import load_library
from vsensor.field.table import open_table
from vsensor.field.tune import TuneOptions
from vsensor.field.validate import validate_model

HOURS = float(os.environ.get("VSENSOR_ROUND_TRIP_HOURS", "0.2"))
OPTIONS = TuneOptions() if HOURS >= 1.0 else TuneOptions(block_s=10.0, least_seconds=30.0)

SHORT = "coverage = 0.04\npit = 0.1\nwasserstein = 0.4\ncorrelation_time = 0.25\n"
"""Limits for minutes of driving: what was learned from them is itself no more exact."""

pytestmark = pytest.mark.timeout(3600)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("round_trip")


@pytest.fixture(scope="module")
def model(place):
    table = scanned(place / "learned", HOURS, 1, drive_s=min(600.0, HOURS * 900.0), workers=0)
    return learned(table, place / "model.npz", OPTIONS)


def test_the_law_is_learned_back_from_the_logs_alone(model, place):
    law = load_library(place / "learned" / "drives" / "law.npz").models["day"]
    found = compare(model, law_truth(law, DASHED, count=24_000), CORRELATION_TIME_S)
    level = int(np.argmin(np.abs(found.levels - 0.95)))
    assert np.median(np.abs(found.off[level])) < 0.12
    assert found.inside.mean() > 0.75  # one drive: its cells are correlated
    assert abs(found.time_off) < 0.15
    np.testing.assert_allclose(model.correlation_length_m, 50.0, rtol=0.2)


def test_the_model_is_within_the_limits_on_a_drive_that_it_has_not_seen(model, place):
    held = scanned(place / "held", HOURS / 4.0, 77, drive_s=min(600.0, HOURS * 900.0), workers=0)
    limits = place / "limits.toml"
    limits.write_text('schema = "vsensor.validate/1"\n' + ("" if HOURS >= 1.0 else SHORT))
    found = validate_model(place / "model.npz", open_table([held]), out=place / "report.html", limits=limits)
    wrong = [check.what for one in found.judged for check in one.checks if not check.good]
    assert [what for what in wrong if not what.startswith("rows that the model does not know")] == []


def test_the_learned_model_drives_the_virtual_sensor(model, place, capsys):
    scenario = place / "learned.toml"
    scenario.write_text(
        'schema = "vsensor.scenario/1"\nsource = "learned/drives/map.xodr"\n[ego]\nspeed_kmh = 72.0\n'
        '[error_model]\nfile = "model.npz"\n'
    )
    assert main(["run", str(scenario), "--fast", "--duration", "4", "--quiet"]) == 0
    assert "100 ticks" in capsys.readouterr().out
