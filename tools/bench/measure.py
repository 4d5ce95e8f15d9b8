"""How everything here is timed: on one core, in turns, medians; and what the machine is."""

import os
import platform
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
PERIOD_NS = 40_000_000


@contextmanager
def one_core() -> Iterator[None]:
    """Stay on one core inside."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def elapsed_ms(work: Callable[[], object]) -> float:
    """Return how long one call takes."""
    began = time.perf_counter_ns()
    work()
    return (time.perf_counter_ns() - began) / 1e6


def in_turns(works: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, np.ndarray]:
    """Return the times (rounds,) of each work in ms, called in turns, after one call that warms up."""
    for work in works.values():
        work()
    times = {name: np.empty(rounds) for name in works}
    for k in range(rounds):
        for name, work in works.items():
            times[name][k] = elapsed_ms(work)
    return times


def ratio(slow: np.ndarray, fast: np.ndarray) -> float:
    """Return how many times faster, as the median over the rounds that both took part in."""
    return float(np.median(slow / fast))


def median(values: np.ndarray) -> float:
    """Return the median as a plain number."""
    return float(np.median(values))


def yardstick_ms() -> float:
    """Return the median time of sorting 100,000 numbers: what this machine gives just now."""
    values = np.random.default_rng(0).random(100_000)
    return median(np.array([elapsed_ms(lambda: np.sort(values)) for _ in range(15)]))


def machine() -> dict[str, object]:
    """Name the machine."""
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"model name\s*: (.*)", info)
    return {
        "processor": model[1] if model else platform.processor(),
        "cores": os.cpu_count(),
        "load_average": os.getloadavg()[0],
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
