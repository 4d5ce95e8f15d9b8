"""The same cells on a Dask cluster, here of two processes that only this machine reaches."""

import os
import signal

import pytest

from tests.study import functions
from tests.study.test_cells import cells, contents
from vsensor.cli import main
from vsensor.errors import ConfigError, MissingExtraError
from vsensor.study import run_cells


def test_a_cluster_gives_the_same_bytes_as_local_processes(tmp_path, scheduler):
    run_cells(functions.square, cells(9), tmp_path / "local", workers=2)
    outcome = run_cells(functions.square, cells(9), tmp_path / "dask", scheduler=scheduler)
    assert contents(tmp_path / "dask") == contents(tmp_path / "local")
    assert [result["square"] for result in outcome.results] == [x**2 for x in range(9)]


def test_a_failing_cell_on_a_cluster_does_not_stop_the_others(tmp_path, scheduler):
    outcome = run_cells(functions.fail_at_three, cells(6), tmp_path, scheduler=scheduler)
    (failure,) = outcome.failures
    assert failure.cell == {"x": 3}
    assert "ZeroDivisionError: three is not liked" in failure.error
    assert outcome.finished == 5


def test_what_a_killed_worker_had_is_done_again(tmp_path, scheduler):
    flag = str(tmp_path / "flag")
    outcome = run_cells(functions.die_once, cells(8, flag=flag), tmp_path / "cells", scheduler=scheduler)
    assert os.path.exists(flag)
    assert outcome.failures == ()
    assert [result["x"] for result in outcome.results] == list(range(8))


def test_more_cells_than_a_scheduler_holds_at_a_time_all_come(tmp_path, scheduler, monkeypatch):
    monkeypatch.setattr("vsensor.study.workers.CLUSTER_AHEAD", 4)
    outcome = run_cells(functions.square, cells(11), tmp_path, scheduler=scheduler)
    assert outcome.finished == 11


def test_ctrl_c_leaves_what_has_arrived(tmp_path, scheduler, monkeypatch):
    arrived = []
    from vsensor.study import workers

    original = workers._arrived

    def interrupting(*words):
        if len(arrived) == 3:
            signal.raise_signal(signal.SIGINT)
        arrived.append(original(*words))
        return arrived[-1]

    monkeypatch.setattr(workers, "_arrived", interrupting)
    outcome = run_cells(functions.square, cells(8), tmp_path, scheduler=scheduler)
    assert outcome.interrupted
    assert outcome.finished == len(contents(tmp_path)) == 3


def test_sweep_on_a_cluster_writes_the_same_table(capsys, tmp_path, scheduler):
    words = ["sweep", "highway", "--vary", "fit.order=1,3", "--duration", "0.4", "--quiet"]
    assert main([*words, "--out", str(tmp_path / "local")]) == 0
    assert main([*words, "--out", str(tmp_path / "dask"), "--scheduler", scheduler]) == 0
    local, dask = (tmp_path / name / "table.csv" for name in ("local", "dask"))
    assert local.read_bytes() == dask.read_bytes()
    assert contents(tmp_path / "local" / "cells") == contents(tmp_path / "dask" / "cells")


@pytest.mark.parametrize("address", ["127.0.0.1:1", "nonsense://x", "tcp://127.0.0.1:99999"])
def test_an_address_where_no_scheduler_answers_is_named(tmp_path, address, monkeypatch):
    monkeypatch.setattr("vsensor.study.workers.CONNECT_S", 0.5)
    with pytest.raises(ConfigError, match=f"--scheduler {address}: no Dask scheduler"):
        run_cells(functions.square, cells(1), tmp_path, scheduler=address)


def test_without_dask_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'vsensor\[cluster\]'"):
        run_cells(functions.square, cells(1), tmp_path, scheduler="127.0.0.1:1")
