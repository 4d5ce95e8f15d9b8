"""The runner of many cells: what it keeps, what it runs again, what it survives."""

import os
import random
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.study import functions
from vsensor.study import run_cells

ROOT = Path(__file__).parents[2]


def cells(count, **more):
    return [{"x": x, **more} for x in range(count)]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def until(condition, process):
    """Wait until a process that runs beside the test has made `condition` true."""
    while not condition():
        assert process.poll() is None, process.communicate()[1]
        os.sched_yield()


def test_results_come_in_the_order_of_the_cells(tmp_path):
    outcome = run_cells(functions.square, cells(7), tmp_path, workers=2)
    assert [result["square"] for result in outcome.results] == [x**2 for x in range(7)]
    assert (outcome.reused, outcome.finished, outcome.failures, outcome.interrupted) == (0, 7, (), False)


def test_finished_cells_are_not_run_again_and_give_the_same(tmp_path):
    ran = tmp_path / "ran"
    ran.mkdir()
    first = run_cells(functions.square, cells(3, ran=str(ran)), tmp_path / "cells", workers=1)
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "cells").iterdir()}
    second = run_cells(functions.square, cells(5, ran=str(ran)), tmp_path / "cells", workers=1)
    assert second.reused == 3
    assert second.results[:3] == first.results
    assert len(list(ran.iterdir())) == 5
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_a_damaged_file_is_run_again(tmp_path):
    run_cells(functions.square, cells(2), tmp_path, workers=1)
    whole = contents(tmp_path)
    next(iter(tmp_path.iterdir())).write_bytes(b'{"schema":')
    assert run_cells(functions.square, cells(2), tmp_path, workers=1).reused == 1
    assert contents(tmp_path) == whole


def test_the_number_of_workers_and_the_order_change_no_bit(tmp_path):
    shuffled = random.Random(1).sample(cells(9), 9)
    run_cells(functions.square, cells(9), tmp_path / "one", workers=1)
    run_cells(functions.square, shuffled, tmp_path / "two", workers=2)
    assert contents(tmp_path / "one") == contents(tmp_path / "two")
    assert len(contents(tmp_path / "one")) == 9


def test_a_cell_that_is_there_twice_runs_once(tmp_path):
    outcome = run_cells(functions.square, [{"x": 2}, {"x": 3}, {"x": 2}], tmp_path, workers=1)
    assert [result["square"] for result in outcome.results] == [4, 9, 4]
    assert len(contents(tmp_path)) == 2


def test_no_cells_are_no_work(tmp_path):
    assert run_cells(functions.square, [], tmp_path).results == ()


def test_a_failing_cell_is_reported_with_its_settings_and_the_others_go_on(tmp_path):
    outcome = run_cells(functions.fail_at_three, cells(6), tmp_path, workers=2)
    (failure,) = outcome.failures
    assert failure.cell == {"x": 3}
    assert failure.error.startswith("ZeroDivisionError: three is not liked (functions.py:")
    assert [result is None for result in outcome.results] == [x == 3 for x in range(6)]
    assert not outcome.interrupted


def test_a_failing_cell_is_tried_again_next_time(tmp_path):
    run_cells(functions.fail_at_three, cells(4), tmp_path, workers=1)
    outcome = run_cells(functions.fail_at_three, cells(4), tmp_path, workers=1)
    assert (outcome.reused, len(outcome.failures)) == (3, 1)


def test_an_error_that_does_not_pickle_is_a_failure_like_others(tmp_path):
    (failure,) = run_cells(functions.fail_unpicklably, cells(1), tmp_path, workers=1).failures
    assert "Unpicklable: held a lock" in failure.error


def test_a_cell_that_takes_its_process_down_fails_alone(tmp_path):
    outcome = run_cells(functions.die_at_three, cells(8), tmp_path, workers=2)
    (failure,) = outcome.failures
    assert failure.cell == {"x": 3}
    assert "died twice" in failure.error
    assert outcome.finished == 7


def test_the_cells_of_a_process_that_was_killed_are_run_again(tmp_path):
    flag = str(tmp_path / "flag")
    outcome = run_cells(functions.die_once, cells(8, flag=flag), tmp_path / "cells", workers=2)
    assert Path(flag).exists()
    assert outcome.failures == ()
    assert [result["x"] for result in outcome.results] == list(range(8))


def test_workers_compute_with_one_thread_and_our_environment_stays(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    (result,) = run_cells(functions.threads, cells(1), tmp_path, workers=1).results
    assert result == {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    assert os.environ["OPENBLAS_NUM_THREADS"] == "7"
    assert "OMP_NUM_THREADS" not in os.environ


PROGRAM = """
import sys
from pathlib import Path
from tests.study import functions
from vsensor.study import run_cells

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    cells = [{"x": x, "pids": str(folder / "pids"), "stuck_from": 4} for x in range(9)]
    outcome = run_cells(functions.wait_for_ever, cells, folder / "cells", workers=2)
    print("interrupted", outcome.interrupted, "finished", outcome.finished, "failed", len(outcome.failures))
"""


@pytest.fixture
def stuck(tmp_path):
    """A program whose first four cells are finished and whose two processes are stuck in the next."""
    (tmp_path / "pids").mkdir()
    (tmp_path / "program.py").write_text(PROGRAM)
    program = subprocess.Popen(
        [sys.executable, str(tmp_path / "program.py"), str(tmp_path)],
        env=dict(os.environ, PYTHONPATH=str(ROOT)),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    with program:
        until(lambda: len(list((tmp_path / "pids").glob("[0-9]*"))) == 2, program)
        yield program
        if program.poll() is None:
            os.killpg(program.pid, signal.SIGKILL)


def pids(folder):
    return [int(path.name) for path in (folder / "pids").glob("[0-9]*")]


def is_gone(pid):
    """Whether a process has ended; one that nobody has asked about yet (a zombie) has."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return True


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_work_at_once_and_keeps_what_is_finished(stuck, tmp_path, number):
    os.kill(stuck.pid, number)
    out, err = stuck.communicate(timeout=60)
    assert (out, err) == ("interrupted True finished 4 failed 0\n", "")
    assert len(contents(tmp_path / "cells")) == 4
    assert all(is_gone(pid) for pid in pids(tmp_path))


def blocked_signals(pid):
    return int(re.search(r"^SigBlk:\s*(\w+)", Path(f"/proc/{pid}/status").read_text(), re.M)[1], 16)


def test_ctrl_c_reaches_the_whole_group_of_processes_without_a_word_from_them(stuck, tmp_path):
    assert all(blocked_signals(pid) & 1 << signal.SIGINT - 1 for pid in pids(tmp_path))
    os.killpg(stuck.pid, signal.SIGINT)
    assert stuck.communicate(timeout=60) == ("interrupted True finished 4 failed 0\n", "")


def test_workers_do_not_outlive_a_program_that_was_killed(stuck, tmp_path):
    os.kill(stuck.pid, signal.SIGKILL)
    stuck.communicate(timeout=60)  # ends when the last holder of its stdout has ended
    assert len(contents(tmp_path / "cells")) == 4
    assert all(is_gone(pid) for pid in pids(tmp_path))
