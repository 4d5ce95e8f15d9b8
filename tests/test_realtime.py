"""`--realtime`: asked for where it is allowed, said in one line where it is not, gone afterwards."""

import ctypes
import gc
import os
import re
import resource
import subprocess
import sys
import threading

import pytest

from vsensor import realtime
from vsensor.config import load_scenario
from vsensor.errors import ConfigError
from vsensor.realtime import calm_collector, real_time_priority
from vsensor.run import RunOptions, run_scenario

SHOW = "import os, sys; print(os.sched_getscheduler(0))"


def locked_kb():
    with open("/proc/self/status", encoding="ascii") as status:
        return int(re.search(r"VmLck:\s+(\d+) kB", status.read())[1])


def may_schedule():
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        return False
    os.sched_setscheduler(0, *before)
    return True


needs_fifo = pytest.mark.skipif(not may_schedule(), reason="SCHED_FIFO is not permitted here")


@needs_fifo
def test_inside_it_is_fifo_and_afterwards_what_it_was():
    before = os.sched_getscheduler(0)
    with real_time_priority(lambda text: None):
        assert os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        assert os.sched_getparam(0).sched_priority == realtime.PRIORITY
    assert os.sched_getscheduler(0) == before


@needs_fifo
def test_a_process_started_inside_has_ordinary_priority():
    with real_time_priority(lambda text: None):
        shown = subprocess.run([sys.executable, "-c", SHOW], capture_output=True, text=True, check=True)
    assert int(shown.stdout) == os.SCHED_OTHER


@pytest.mark.skipif(not realtime._may_lock_without_limit(), reason="locking memory is limited here")
def test_memory_is_locked_inside_and_not_afterwards():
    with real_time_priority(lambda text: None):
        assert locked_kb() > 10_000
    assert locked_kb() == 0


def test_what_is_not_permitted_is_one_line_each_with_how_to_allow_it(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    said = []
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(realtime, "_may_lock_without_limit", lambda: False)
    monkeypatch.setattr(resource, "getrlimit", lambda which: (8 << 20, 8 << 20))
    with real_time_priority(said.append):
        pass
    assert len(said) == 2
    assert "SCHED_FIFO is not permitted" in said[0]
    assert "ulimit -r 20" in said[0]
    assert "limited to 8 MB" in said[1]
    assert "ulimit -l unlimited" in said[1]
    assert all("setcap cap_sys_nice,cap_ipc_lock=ep" in text and "\n" not in text for text in said)
    assert locked_kb() == 0


def test_a_lock_that_the_kernel_refuses_is_said_with_its_reason(monkeypatch):
    class Library:
        def mlockall(self, flags):
            ctypes.set_errno(12)
            return -1

    said = []
    monkeypatch.setattr(ctypes, "CDLL", lambda name, use_errno=False: Library())
    monkeypatch.setattr(realtime, "_may_lock_without_limit", lambda: True)
    assert not realtime._lock_memory(said.append)
    assert "ENOMEM" in said[0]


def test_the_collector_is_off_inside_and_on_afterwards():
    with calm_collector() as look:
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 1000
        cycle = []
        cycle.append(cycle)
        del cycle
        assert realtime.COLLECT_EVERY > 1
        look(realtime.COLLECT_EVERY + 1)
        assert gc.collect() >= 1  # the look above was none
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_garbage_in_cycles_is_looked_for_every_so_many_ticks():
    class Thing:
        pass

    freed = []
    with calm_collector() as look:
        thing = Thing()
        thing.itself = thing
        import weakref

        weakref.finalize(thing, freed.append, True)
        del thing
        look(1)
        assert not freed
        look(realtime.COLLECT_EVERY)
        assert freed


def test_realtime_with_fast_is_refused():
    with pytest.raises(ConfigError, match="--realtime and --fast exclude each other"):
        run_scenario(load_scenario("highway"), RunOptions(fast=True, realtime=True), say=lambda text: None)


def test_a_run_has_no_thread_beside_its_own():
    before = set(threading.enumerate())  # of other tests: Dask's stay
    threads = set()

    def stopped():
        threads.update(set(threading.enumerate()) - before)
        return False

    scenario = load_scenario("highway", {"duration_s": 0.2})
    options = RunOptions(bus="virtual:threads", realtime=may_schedule())
    summary = run_scenario(scenario, options, say=lambda text: None, stopped=stopped)
    assert summary.ticks == 5
    assert threads == set()
