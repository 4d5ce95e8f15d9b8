"""One pass over all logs: here in threads, or on a Dask cluster as a tree of sums."""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from functools import reduce
from typing import Any, Protocol, TypeVar

import numpy as np

from vsensor.field.table import LogFile, Table
from vsensor.field.tune.reading import Progress

S = TypeVar("S")
TASKS_PER_WORKER = 2


class Pass(Protocol[S]):
    """What is done with every log: sums that start empty, and to which a log is added."""

    def start(self) -> S:
        """Return sums of nothing."""
        ...

    def add(self, sums: S, file: LogFile, progress: Progress | None = None) -> None:
        """Add one log."""
        ...


Spread = Callable[[Pass[Any], Sequence[LogFile]], Any]
"""Runs a pass over files and returns its sums."""


class _StoppedError(Exception):
    """Another thread has failed, or the user has ended all."""


def threads(progress: Progress | None = None, count: int | None = None) -> Spread:
    """Return what runs a pass in `count` threads (all cores): its work is numpy's and polars', not Python's.

    Sums of whole numbers do not depend on who added them. What one thread raises ends the others with their
    chunk, and so does Ctrl-C.
    """
    wanted = count or len(os.sched_getaffinity(0))
    lock = threading.Lock()

    def run(work: Pass[Any], files: Sequence[LogFile]) -> Any:
        number = min(wanted, len(files))
        if number < 2:
            return sums_of(work, files, progress)
        over = threading.Event()

        def advance(rows: int) -> None:
            if over.is_set():
                raise _StoppedError
            if progress is not None:
                with lock:
                    progress(rows)

        with ThreadPoolExecutor(number) as pool:
            parts = [pool.submit(sums_of, work, files[k::number], advance) for k in range(number)]
            try:
                found = [part.result() for part in as_completed(parts)]
            except BaseException:
                over.set()
                raise
        return reduce(merged, found)

    return run


@contextmanager
def rows_bar(table: Table, passes: int, *, shown: bool) -> Iterator[Progress | None]:
    """Give what is told how many rows were read, and shows a bar of all passes; None if none is shown."""
    if not shown:
        yield None
        return
    from tqdm import tqdm

    total = passes * sum(int(file.info.get("rows", 0)) for file in table.files)
    with tqdm(total=total, unit="row", unit_scale=True, leave=False) as bar:

        def advance(rows: int) -> None:
            bar.update(rows)

        yield advance


def sums_of(work: Pass[S], files: Sequence[LogFile], progress: Progress | None = None) -> S:
    """Return the sums over some logs."""
    sums = work.start()
    for file in files:
        work.add(sums, file, progress)
    return sums


def merged(one: Any, other: Any) -> Any:
    """Return the sum of two sums; the first may be changed."""
    if isinstance(one, np.ndarray):
        one = one if one.flags.writeable else one.copy()  # as it came from another process
        one += other
        return one
    return one.merge(other)


def on_cluster(client: Any) -> Spread:
    """Return what runs a pass on a Dask cluster, whose machines must see the table under the same path."""

    def run(work: Pass[Any], files: Sequence[LogFile]) -> Any:
        workers = max(len(client.scheduler_info()["workers"]), 1)
        tasks = min(len(files), TASKS_PER_WORKER * workers)
        shared = client.scatter(work, broadcast=True)
        parts = [client.submit(sums_of, shared, list(files[k::tasks]), pure=False) for k in range(tasks)]
        while len(parts) > 1:
            pairs = zip(parts[::2], parts[1::2], strict=False)
            rest = parts[len(parts) - 1 :] if len(parts) % 2 else []
            parts = [client.submit(merged_copy, a, b, pure=False) for a, b in pairs] + rest
        return parts[0].result()

    return run


def merged_copy(one: Any, other: Any) -> Any:
    """Return the sum of two sums, neither changed: a cluster may run a task twice."""
    import copy

    return merged(copy.deepcopy(one), other)
