"""`vsensor experiment` on a Dask cluster, here of two processes that only this machine reaches."""

import polars

from tests.experiment.test_experiment import vsensor, written
from tests.study.test_cells import contents
from vsensor.sinks.trace import read_trace

MATRIX = """schema = "vsensor.experiment/1"
scenarios = ["highway"]
duration_s = 0.4
outputs = ["trace", "log"]
[settings]
fit.order = [1, 3]
"""


def test_on_a_cluster_it_leaves_the_same_tables_cells_and_files(capsys, tmp_path, scheduler, monkeypatch):
    monkeypatch.setattr("vsensor.experiment.report._page", lambda *words: [])  # pictures take their time
    path = written(tmp_path, MATRIX)
    for name, where in (("local", ("--workers", 1)), ("dask", ("--scheduler", scheduler))):
        status, out, err = vsensor(capsys, "experiment", path, "--quiet", "--out", tmp_path / name, *where)
        assert status == 0, out + err
    local, dask = tmp_path / "local", tmp_path / "dask"
    for name in ("table.csv", "sides.csv", "conditions.csv"):
        assert (local / name).read_bytes() == (dask / name).read_bytes()
    assert contents(local / "cells") == contents(dask / "cells")
    runs = polars.read_csv(local / "table.csv")["run"].to_list()
    assert len(runs) == 2
    for run in runs:
        one, other = (read_trace(folder / "runs" / run / "trace.parquet") for folder in (local, dask))
        assert all((one[column] == other[column])[one[column] == one[column]].all() for column in one)
        assert (dask / "runs" / run / "bus.blf").stat().st_size > 1000
