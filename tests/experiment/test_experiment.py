"""`vsensor experiment` as a user meets it; runs of 0.4 s, of which the sensor reports lines in 0.2 s."""

import csv
import re
import shutil
from pathlib import Path

import can
import numpy as np
import polars
import pytest

from vsensor.cli import main
from vsensor.config import SHIPPED
from vsensor.errors import ConfigError
from vsensor.experiment import ExperimentOptions, run_experiment, runs
from vsensor.score import score_trace
from vsensor.sinks.trace import read_trace
from vsensor.study.scenario_cells import figures

ROOT = Path(__file__).parents[2]
MATRIX = """schema = "vsensor.experiment/1"
name = "mine"
about = "How wide <must> the camera see?"
scenarios = ["highway"]
seeds = 2
duration_s = 0.4
outputs = ["trace", "truth", "log", "images"]
image_every = 5
[settings]
camera.width_px = [320, 640]
camera.height_px = 240
"""


def vsensor(capsys, *words):
    """Run one command in this process; returns (status, stdout, stderr)."""
    try:
        status = main([str(word) for word in words])
    except SystemExit as exit_:
        status = exit_.code
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def table(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def written(folder, text=MATRIX):
    path = folder / "mine.toml"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A finished experiment: its folder, and what the command said."""
    folder = tmp_path_factory.mktemp("experiment")
    said = []
    options = ExperimentOptions(out=folder / "out", workers=0)
    return folder / "out", run_experiment(str(written(folder)), options, said.append), said


def test_it_says_what_it_did_and_where_the_results_are(done):
    folder, report, said = done
    assert said == [f"4 runs into {folder}"]
    assert report.status == 0
    assert "4 of 4 runs finished, 0 of them before this run" in report.lines
    for name in ("table.csv", "table.parquet", "sides.csv", "conditions.csv", "report.html"):
        assert f"wrote {folder / name}" in report.lines
        assert (folder / name).stat().st_size > 100


def test_each_run_has_its_trace_log_and_images_in_a_folder_of_its_own(done):
    folder, *_ = done
    runs = [row["run"] for row in table(folder / "table.csv")]
    assert len(set(runs)) == 4
    assert sorted(runs) == sorted(path.name for path in (folder / "runs").iterdir())
    for run in runs:
        assert len(np.unique(read_trace(folder / "runs" / run / "trace.parquet")["tick"])) == 10
        truth = polars.read_parquet(folder / "runs" / run / "truth.parquet")
        assert truth["tick"].n_unique() == 10
        with can.LogReader(folder / "runs" / run / "bus.blf") as log:
            assert sum(1 for _ in log) == 130
        images = sorted(path.name for path in (folder / "runs" / run / "images").iterdir())
        assert images == ["000000.png", "000005.png"]


def test_a_row_is_the_score_of_the_trace_beside_it(done):
    folder, *_ = done
    rows = table(folder / "table.csv")
    for row in rows:
        score = score_trace(read_trace(folder / "runs" / row["run"] / "trace.parquet"))
        for name, value in figures(score.pooled).items():
            assert float(row[name] or "nan") == pytest.approx(value, rel=0, abs=0, nan_ok=True), name
    assert [(row["camera.width_px"], row["seed"]) for row in rows] == [
        (width, seed) for width in ("320", "640") for seed in ("1", "2")
    ]


def test_a_row_is_what_run_and_score_give(done, capsys, tmp_path):
    folder, *_ = done
    (run,) = [
        row["run"]
        for row in table(folder / "table.csv")
        if (row["camera.width_px"], row["seed"]) == ("640", "2")
    ]
    scenario = tmp_path / "mine.toml"
    text = (SHIPPED / "highway.toml").read_text()
    shutil.copy(SHIPPED / "highway.xodr", tmp_path)
    scenario.write_text(text + "\n[camera]\nwidth_px = 640\nheight_px = 240\n")
    out = tmp_path / "t.parquet"
    status, _, err = vsensor(
        capsys, "run", scenario, "--fast", "--duration", 0.4, "--seed", 2, "--trace", out
    )
    assert status == 0, err
    mine, theirs = read_trace(out), read_trace(folder / "runs" / run / "trace.parquet")
    for name, column in mine.items():
        np.testing.assert_array_equal(column, theirs[name], err_msg=name)


def test_parquet_and_csv_hold_the_same(done):
    folder, *_ = done
    for name in ("table", "sides", "conditions"):
        frame = polars.read_parquet(folder / f"{name}.parquet")
        rows = table(folder / f"{name}.csv")
        assert frame.columns == list(rows[0])
        assert len(frame) == len(rows)


def test_the_page_loads_nothing_and_says_what_ran(done):
    folder, *_ = done
    page = (folder / "report.html").read_text()
    assert "How wide &lt;must&gt; the camera see?" in page
    assert "2 values of camera.width_px" in page
    assert re.findall(r"""(?:src|href)=["'](?!data:)""", page) == []
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", page)
    assert "error, view range and availability by camera.width_px" in captions
    assert "lateral error by longest gap before the range, m" in captions
    assert "light: always day" in page


def test_a_finished_run_is_reused_and_one_whose_files_went_is_done_again(done):
    folder, *_ = done
    matrix = folder.parent / "mine.toml"
    first = (folder / "table.csv").read_bytes()
    (gone,) = list((folder / "runs").iterdir())[:1]
    (gone / "bus.blf").unlink()
    report = run_experiment(str(matrix), ExperimentOptions(out=folder, workers=0), lambda text: None)
    assert "4 of 4 runs finished, 3 of them before this run" in report.lines
    assert (gone / "bus.blf").exists()
    assert (folder / "table.csv").read_bytes() == first


SMALL = """schema = "vsensor.experiment/1"
scenarios = ["highway"]
duration_s = 0.4
[[variant]]
name = "right"
[[variant]]
name = "wrong"
settings = { output.profile = "absent" }
[[limit]]
column = "availability"
at_least = 0.99
source = "none"
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """An experiment of two runs, of which one fails and the other is beyond its limit."""
    folder = tmp_path_factory.mktemp("small")
    options = ExperimentOptions(out=folder, workers=0)
    return folder, run_experiment(str(written(folder, SMALL)), options, lambda text: None)


def test_a_failing_run_is_one_line_and_does_not_stop_the_rest(small):
    folder, report = small
    assert report.status == 1
    (line,) = report.failures
    assert line.startswith("failed: scenario=highway variant=wrong seed=1: ")
    assert "1 of 2 runs finished, 0 of them before this run, 1 failed" in report.lines
    assert [row["variant"] for row in table(folder / "table.csv")] == ["right"]
    assert "variant=wrong" in (folder / "report.html").read_text()


def test_a_run_beyond_a_limit_is_one_line_with_its_value(small):
    folder, report = small
    (row,) = table(folder / "table.csv")
    value = f"{float(row['availability']):.4g}"
    assert report.broken == (f"{row['run']}: availability is {value}, at least 0.99 was expected",)
    assert "1 times beyond a limit" in (folder / "report.html").read_text()


def test_a_limit_of_a_column_that_there_is_not_names_the_nearest(tmp_path):
    path = written(tmp_path, SMALL.replace('"availability"', '"availabilty"'))
    with pytest.raises(ConfigError, match=r"limit\[0\].column: availabilty: .*did you mean availability\?"):
        run_experiment(str(path), ExperimentOptions(out=tmp_path), lambda text: None)


def test_without_outputs_a_run_leaves_no_folder(small):
    folder, _ = small
    assert not (folder / "runs").exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["absent.toml"], ["absent.toml", "no such file"]),
        (["absent"], ["absent", "shipped experiment"]),
        (["p3", "--outputs", "trace,lgo"], ["--outputs lgo", "trace, truth, log, images"]),
        (["p3", "--workers", "0"], ["0", "from 1"]),
        (["p3", "--out", "/dev/null/x"], ["/dev/null/x", "cannot be made"]),
        ([], ["MATRIX"]),
    ],
)
def test_a_mistake_is_one_line_and_exit_status_2(capsys, words, expected):
    status, out, err = vsensor(capsys, "experiment", *words)
    assert status == 2
    assert out == ""
    assert err.splitlines()[-1].startswith("vsensor: ")
    assert all(word in err.splitlines()[-1] for word in expected), err


def test_ctrl_c_leaves_a_folder_that_the_same_command_goes_on_with(tmp_path, monkeypatch):
    path = written(tmp_path, SMALL.replace('{ output.profile = "absent" }', "{ fit.order = 2 }"))
    options = ExperimentOptions(out=tmp_path / "out", workers=0)
    run, ran = runs.run, []

    def run_until_the_second(*arguments):
        if ran:
            raise KeyboardInterrupt
        ran.append(arguments)
        return run(*arguments)

    monkeypatch.setattr(runs, "run", run_until_the_second)
    report = run_experiment(str(path), options, lambda text: None)
    assert report.status == 130
    assert report.lines[-1] == "stopped; the same command goes on with the rest"
    first = table(tmp_path / "out" / "table.csv")
    assert len(first) == 1
    assert not (tmp_path / "out" / "report.html").exists()
    monkeypatch.setattr(runs, "run", run)
    report = run_experiment(str(path), options, lambda text: None)
    assert "2 of 2 runs finished, 1 of them before this run" in report.lines
    assert table(tmp_path / "out" / "table.csv")[0] == first[0]
    assert (tmp_path / "out" / "report.html").exists()
