"""`vsensor sweep` as a user meets it; runs of 0.4 s, of which the sensor reports lines in 0.2 s."""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars
import pytest

from vsensor.cli import main
from vsensor.config import SHIPPED
from vsensor.score import score_trace
from vsensor.sinks.trace import read_trace
from vsensor.study import scenario_cells
from vsensor.study import sweep as module
from vsensor.study.scenario_cells import figures
from vsensor.study.store import cell_key
from vsensor.study.sweep import make_sweep

ROOT = Path(__file__).parents[2]
VARY = ["--vary", "camera.width_px=320,1280"]


def vsensor(capsys, *words):
    """Run one command in this process; returns (status, stdout, stderr)."""
    try:
        status = main([str(word) for word in words])
    except SystemExit as exit_:
        status = exit_.code
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def sweep(capsys, out, *words, seconds=0.4):
    return vsensor(capsys, "sweep", "highway", "--out", out, "--duration", seconds, "--quiet", *words)


def table(folder):
    with (folder / "table.csv").open() as file:
        return list(csv.DictReader(file))


def own_scenario(folder):
    folder.mkdir()
    for name in ("highway.toml", "highway.xodr"):
        shutil.copy(SHIPPED / name, folder / name)
    return folder / "highway.toml"


def keys(path, *vary, **options):
    return [cell_key(cell) for cell in make_sweep(str(path), vary or ("fit.order=3",), **options).cells]


def test_a_sweep_leaves_table_plot_and_cells_and_says_what_it_did(capsys, tmp_path):
    status, out, err = sweep(capsys, tmp_path / "out", *VARY, "--vary", "fit.order=1,3", "--seeds", 2)
    assert status == 0
    assert err == f"vsensor: 8 cells into {tmp_path / 'out'}\n"
    assert "8 of 8 cells finished, 0 of them before this run\n" in out
    assert len(re.findall(r"^ +1280 +3 ", out, re.MULTILINE)) == 1
    rows = table(tmp_path / "out")
    grid = [(row["camera.width_px"], row["fit.order"], row["seed"]) for row in rows if row["side"] == "all"]
    assert grid == [(w, o, s) for w in ("320", "1280") for o in ("1", "3") for s in ("1", "2")]
    assert {row["side"] for row in rows} == {"left", "right", "next_left", "next_right", "all"}
    assert (tmp_path / "out" / "plot.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert len(list((tmp_path / "out" / "cells").iterdir())) == 8


def test_a_row_is_what_run_and_score_give_for_the_same_settings(capsys, tmp_path):
    scenario = own_scenario(tmp_path / "mine")
    scenario.write_text(scenario.read_text() + "\n[camera]\nwidth_px = 320\n")
    trace = tmp_path / "trace.npz"
    vsensor(capsys, "run", scenario, "--fast", "--duration", 0.4, "--seed", 2, "--trace", trace)
    score = score_trace(read_trace(trace))
    sweep(capsys, tmp_path / "out", *VARY, "--seeds", 2)
    rows = [row for row in table(tmp_path / "out") if (row["camera.width_px"], row["seed"]) == ("320", "2")]
    assert len(rows) == len(score.sides) + 1
    for side in (*score.sides, score.pooled):
        (row,) = (row for row in rows if row["side"] == side.name)
        for name, value in figures(side).items():
            assert float(row[name] or "nan") == pytest.approx(value, rel=0, abs=0, nan_ok=True), name


def test_parquet_and_csv_hold_the_same(capsys, tmp_path):
    sweep(capsys, tmp_path, "--vary", "camera.pixel_grid=true,false")
    rows, frame = table(tmp_path), polars.read_parquet(tmp_path / "table.parquet")
    assert frame.columns == list(rows[0])
    assert frame["camera.pixel_grid"].to_list()[0] is True
    for name in frame.columns[3:]:
        read = [float(row[name] or "nan") for row in rows]
        np.testing.assert_array_equal(read, frame[name].cast(polars.Float64).fill_null(np.nan).to_list())


def test_the_same_command_reuses_every_cell_and_more_values_only_add(capsys, tmp_path):
    sweep(capsys, tmp_path, *VARY)
    first, stamps = table(tmp_path), {p: p.stat().st_mtime_ns for p in (tmp_path / "cells").iterdir()}
    _, out, _ = sweep(capsys, tmp_path, *VARY)
    assert "2 of 2 cells finished, 2 of them before this run" in out
    assert table(tmp_path) == first
    _, out, _ = sweep(capsys, tmp_path, "--vary", "camera.width_px=320,640,1280")
    assert "3 of 3 cells finished, 2 of them before this run" in out
    assert {path: path.stat().st_mtime_ns for path in stamps} == stamps


def test_one_and_two_workers_write_the_same_bytes(capsys, tmp_path):
    for workers in (1, 2):
        sweep(capsys, tmp_path / str(workers), *VARY, "--workers", workers)
    one, two = ({p.name: p.read_bytes() for p in (tmp_path / w / "cells").iterdir()} for w in "12")
    assert one == two
    assert (tmp_path / "1" / "table.csv").read_bytes() == (tmp_path / "2" / "table.csv").read_bytes()


def test_a_failing_cell_is_one_line_with_its_settings_and_exit_status_1(capsys, tmp_path):
    status, out, err = sweep(capsys, tmp_path, "--vary", "output.profile=native,absent")
    assert status == 1
    (line,) = (line for line in err.splitlines() if "failed" in line)
    assert line.startswith("vsensor: failed: output.profile=absent seed=1: ")
    assert "1 of 2 cells finished, 0 of them before this run, 1 failed" in out
    assert {row["output.profile"] for row in table(tmp_path)} == {"native"}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--vary", "camera.widht_px=3"], ["highway.toml", "camera.widht_px", "did you mean width_px?"]),
        (["--vary", "camera.width_px"], ["--vary camera.width_px", "KEY=VALUES"]),
        (["--vary", "seed=1,2"], ["--vary seed", "--seeds N"]),
        (["--vary", "duration_s=1,2"], ["--vary duration_s", "--duration S"]),
        (["--vary", "fit.order=1,2", "--seeds", "60000"], ["120000 cells", "100000"]),
        (["--vary", "fit.order=1", "--seeds", "0"], ["0", "from 1"]),
        (["--vary", "fit.order=1", "--workers", "two"], ["two", "from 1"]),
        ([], ["--vary"]),
        (["--vary", "fit.order=1", "--out", "/dev/null/x"], ["/dev/null/x", "cannot be made"]),
    ],
)
def test_a_mistake_is_one_line_and_exit_status_2(capsys, tmp_path, words, expected):
    status, out, err = vsensor(
        capsys, "sweep", "highway", "--duration", 0.4, "--out", tmp_path / "out", *words
    )
    assert status == 2
    assert out == ""
    assert err.splitlines()[-1].startswith("vsensor: ")
    assert all(word in err.splitlines()[-1] for word in expected), err


def test_a_drive_that_never_ends_asks_for_a_duration(capsys, tmp_path):
    scenario = own_scenario(tmp_path / "mine")
    scenario.write_text(scenario.read_text().replace("duration_s = 90\n", ""))
    status, _, err = vsensor(capsys, "sweep", scenario, "--vary", "fit.order=1", "--out", tmp_path / "out")
    assert status == 2
    assert "--duration S" in err


def test_without_the_extras_the_table_is_csv_and_the_rest_is_said(capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "polars", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    status, out, _ = sweep(capsys, tmp_path, "--vary", "fit.order=3")
    assert status == 0
    assert "table.parquet needs polars, which is not installed: pip install 'vsensor[parquet]'" in out
    assert "plot.png needs matplotlib, which is not installed: pip install 'vsensor[plots]'" in out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cells", "table.csv"]


# --- what a cell depends on ---------------------------------------------------------------------------


def test_a_cell_depends_on_settings_seed_and_duration_not_on_the_place_or_comments(tmp_path):
    here, there = own_scenario(tmp_path / "here"), own_scenario(tmp_path / "there")
    there.write_text("# a comment\n" + there.read_text())
    plain = keys(here)
    assert keys(there) == plain
    assert keys(here, "fit.order=2") != plain
    assert keys(here, duration_s=1.0) != plain
    assert keys(here, seeds=2)[0] == plain[0]
    assert keys(here, seeds=2)[1] != plain[0]


def test_a_cell_depends_on_the_files_that_its_scenario_names(tmp_path):
    scenario = own_scenario(tmp_path / "mine")
    scenario.write_text(scenario.read_text().replace('profile = "native"', 'profile = "own.toml"'))
    for name in ("native.toml", "lds.dbc"):
        shutil.copy(ROOT / "dbc" / name, scenario.with_name("own.toml" if name == "native.toml" else name))
    found = [keys(scenario)]
    for name in ("highway.xodr", "own.toml", "lds.dbc"):
        with scenario.with_name(name).open("a") as file:
            file.write("\n")
        found.append(keys(scenario))
    assert len({key for (key,) in found}) == 4


def test_a_cell_depends_on_the_program(tmp_path, monkeypatch):
    before = keys("highway")
    monkeypatch.setattr(scenario_cells, "program_digest", lambda: "another")
    assert keys("highway") != before


def test_a_worker_refuses_a_map_that_is_not_the_one_of_the_cell(tmp_path):
    scenario = own_scenario(tmp_path / "mine")
    made = make_sweep(str(scenario), ("fit.order=3",), duration_s=0.4)
    with (tmp_path / "mine" / "highway.xodr").open("a") as file:
        file.write("\n")
    with pytest.raises(module.ConfigError, match=r"highway.xodr: not the file that the sweep began with"):
        module.SweepCell(made.folder)(made.cells[0])


def test_a_worker_refuses_a_cell_of_another_program():
    made = make_sweep("highway", ("fit.order=3",), duration_s=0.4)
    with pytest.raises(module.ConfigError, match="vsensor is not the one"):
        module.SweepCell(made.folder)({**made.cells[0], "program": "another"})


def test_a_cell_is_small_and_json():
    (cell,) = make_sweep("highway", ("fit.order=3",)).cells
    assert len(json.dumps(cell)) < 20_000


# --- Ctrl-C -------------------------------------------------------------------------------------------


def test_ctrl_c_ends_with_130_and_the_next_run_reuses_what_was_finished(tmp_path):
    out = tmp_path / "out"
    words = ["sweep", "highway", "--out", str(out), "--duration", "0.4", "--vary", "fit.order=1,3"]
    command = [sys.executable, "-m", "vsensor.cli", *words, "--seeds", "150"]
    environment = dict(os.environ, PYTHONPATH=str(ROOT))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": environment}
    with subprocess.Popen(command, start_new_session=True, **pipes) as process:
        while len(list(out.glob("cells/*.json"))) < 4:  # two workers: the first seed's are among them
            assert process.poll() is None, process.communicate()[1]
            os.sched_yield()
        os.killpg(process.pid, signal.SIGINT)
        stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "the same command goes on with the rest" in stdout
    assert stderr == f"vsensor: 300 cells into {out}\n"
    finished = {path: path.stat().st_mtime_ns for path in out.glob("cells/*.json")}
    assert "mean over the finished runs of 150 seeds" in stdout
    with open(out / "table.csv", newline="", encoding="utf-8") as file:
        assert sum(row["side"] == "all" for row in csv.DictReader(file)) == len(finished)
    assert not (out / "plot.png").exists()
    assert 0 < len(finished) < 300
    assert f"{len(finished)} of 300 cells finished" in stdout
    shorter = [*command[:-1], "1"]
    again = subprocess.run(shorter, check=True, timeout=100, capture_output=True, text=True, env=environment)
    assert "2 of 2 cells finished, " in again.stdout
    assert "0 of them before" not in again.stdout
    assert {path: path.stat().st_mtime_ns for path in finished} == finished
