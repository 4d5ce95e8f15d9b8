"""Cells for tests: functions of a module, so that other processes can import them."""

import os
import signal
import threading
import time
from pathlib import Path


def square(cell):
    """Give the square of `x`, and say in the folder `ran` that it ran."""
    if "ran" in cell:
        Path(cell["ran"], f"{cell['x']}.{os.getpid()}.{time.monotonic_ns()}").touch()
    return {"square": cell["x"] ** 2, "root": cell["x"] ** 0.5, "nothing": float("nan")}


def fail_at_three(cell):
    if cell["x"] == 3:
        raise ZeroDivisionError("three\nis not liked")
    return {"x": cell["x"]}


class Unpicklable(Exception):
    """An error that another process cannot be told as it is."""

    def __init__(self, first, second):
        super().__init__("held a lock")
        self.lock = threading.Lock()


def fail_unpicklably(cell):
    raise Unpicklable(1, 2)


def die_at_three(cell):
    """Take the process down at x = 3, every time."""
    if cell["x"] == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"x": cell["x"]}


def die_once(cell):
    """Take the process down at x = 3, the first time."""
    flag = Path(cell["flag"])
    if cell["x"] == 3 and not flag.exists():
        flag.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"x": cell["x"]}


def threads(cell):
    return {name: os.environ.get(name, "") for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")}


def wait_for_ever(cell):
    """Say which process this is, then stay; the cells before it finish."""
    if cell["x"] < cell["stuck_from"]:
        return {"x": cell["x"]}
    beside = Path(cell["pids"], f".{os.getpid()}")
    beside.touch()
    beside.rename(Path(cell["pids"], str(os.getpid())))
    threading.Event().wait()
    return {}
