"""Where cells run: processes of this machine, or a Dask cluster.

A local worker keeps its finished cell itself, so that nothing is lost whatever happens to the others;
what a cluster computes is kept on arrival, since its machines need not see our folder.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from itertools import islice
from multiprocessing.connection import wait as wait_for_end
from pathlib import Path
from typing import Any

from vsensor.errors import ConfigError, MissingExtraError, VsensorError
from vsensor.study.store import Cell, Result, Store, decoded, encoded

WORKER_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",  # one thread each: the processes already fill the cores
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "MALLOC_TRIM_THRESHOLD_": str(64 << 20),  # glibc keeps freed memory, see `run._keep_memory`
    "MALLOC_TOP_PAD_": str(16 << 20),
    "MALLOC_MMAP_THRESHOLD_": str(32 << 20),
}
"""Read when a worker starts, before it imports anything."""

AHEAD = 2  # cells per process that are handed over, so that none waits for the next
CLUSTER_AHEAD = 1024  # cells that a scheduler holds at a time: it keeps 3 kB of each
CONNECT_S = 10

_ONE_AT_A_TIME = threading.Lock()  # a Dask worker has threads, the stages were not written for them


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """The result of a cell, or the error if `result` is None."""

    key: str
    result: Result | None = None
    error: str = ""


@dataclass(frozen=True, slots=True)
class Attempt:
    """Computes one cell in a worker: returns (content of its file, "") or (b"", error)."""

    function: Callable[[dict[str, Any]], Mapping[str, Any]]
    folder: Path | None = None

    def __call__(self, key: str, cell: Cell) -> tuple[bytes, str]:
        """Compute, and keep the result if a folder was given. Errors come back as text: not all pickle."""
        try:
            with _ONE_AT_A_TIME:
                content = encoded(cell, self.function(dict(cell)))
            if self.folder is not None:
                Store(self.folder).write(key, content)
        except VsensorError as error:
            return b"", " ".join(str(error).split())
        except Exception as error:  # whatever it is, it is this cell's, and is reported with it
            place = traceback.extract_tb(error.__traceback__)[-1]
            text = " ".join(str(error).split())
            return b"", f"{type(error).__name__}: {text} ({Path(place.filename).name}:{place.lineno})"
        return content, ""


def on_processes(
    function: Callable[[dict[str, Any]], Mapping[str, Any]],
    todo: Mapping[str, Cell],
    store: Store,
    workers: int | None = None,
) -> Iterator[Answer]:
    """Yield the answers of the cells as they finish in local processes.

    If a process dies (killed, out of memory), the cells that were under way are run again, one after
    the other; one that brings its process down again has failed.
    """
    count = min(workers or len(os.sched_getaffinity(0)), len(todo))
    attempt = Attempt(function, store.folder)
    left = dict(todo)
    while left:
        under_way: set[str] = set()
        with contextlib.closing(_until_broken(attempt, left, count, under_way)) as answers:
            for answer in answers:
                del left[answer.key]
                yield answer
        yield from _one_by_one(attempt, {key: left.pop(key) for key in sorted(under_way)})


def on_this_process(
    function: Callable[[dict[str, Any]], Mapping[str, Any]], todo: Mapping[str, Cell], store: Store
) -> Iterator[Answer]:
    """Yield the answers of the cells one after the other: for what there is only one of, such as a bus."""
    attempt = Attempt(function, store.folder)
    for key, cell in todo.items():
        content, error = attempt(key, cell)
        yield Answer(key=key, result=decoded(content), error=error)


def _one_by_one(attempt: Attempt, suspects: dict[str, Cell]) -> Generator[Answer]:
    while suspects:
        under_way: set[str] = set()
        with contextlib.closing(_until_broken(attempt, suspects, 1, under_way, ahead=1)) as answers:
            for answer in answers:
                del suspects[answer.key]
                yield answer
        for key in under_way:  # one at most
            del suspects[key]
            yield Answer(key=key, error="its process died twice (killed, or out of memory)")


def _until_broken(
    attempt: Attempt, todo: Mapping[str, Cell], count: int, under_way: set[str], ahead: int = AHEAD
) -> Generator[Answer]:
    """Yield answers until all are there or a process died; then `under_way` has the keys handed over."""
    waiting = iter(list(todo.items()))
    futures: dict[Future[tuple[bytes, str]], str] = {}
    with _pool(count) as pool:
        try:
            while True:
                with _interrupts_held():
                    for key, cell in islice(waiting, ahead * count - len(futures)):
                        futures[pool.submit(attempt, key, cell)] = key
                if not futures:
                    return
                for future in wait(futures, return_when=FIRST_COMPLETED).done:
                    content, error = future.result()
                    yield Answer(key=futures.pop(future), result=decoded(content), error=error)
        except BrokenProcessPool:
            under_way.update(futures.values())


@contextlib.contextmanager
def _pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Open processes that end with the block, or with this process; ends those at work on an exception."""
    before = {name: os.environ.get(name) for name in WORKER_ENVIRONMENT}
    others = set(multiprocessing.active_children())
    os.environ.update(WORKER_ENVIRONMENT)
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _end_with_parent)
    try:
        yield pool
    except BaseException:
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _end_with_parent() -> None:
    """End this worker when its parent has gone: waiting for the next cell it would stay for ever."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            wait_for_end([parent.sentinel])
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back: processes started meanwhile never see it, their parent does and ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def on_cluster(
    function: Callable[[dict[str, Any]], Mapping[str, Any]],
    todo: Mapping[str, Cell],
    store: Store,
    address: str,
) -> Iterator[Answer]:
    """Yield the answers of the cells as they finish on a Dask cluster, which redoes what a dead worker had.

    Raises ConfigError if no scheduler answers at `address`, MissingExtraError without Dask.
    """
    client, as_completed = cluster_client(address)
    waiting = iter(list(todo.items()))
    attempt = Attempt(function)
    keys: dict[Any, str] = {}

    def hand_over(count: int) -> list[Any]:
        batch = list(islice(waiting, count))
        futures = client.map(attempt, *zip(*batch, strict=True), pure=False) if batch else []
        keys.update(zip(futures, (key for key, _ in batch), strict=True))
        return list(futures)

    with client:
        try:
            completed = as_completed(hand_over(CLUSTER_AHEAD))
            for future in completed:
                key = keys.pop(future)
                completed.update(hand_over(CLUSTER_AHEAD - len(keys)))
                yield _arrived(future, key, store)
        finally:
            client.cancel(list(keys))


def _arrived(future: Any, key: str, store: Store) -> Answer:
    if future.status != "finished":
        problem = future.exception() if future.status == "error" else future.status
        return Answer(key=key, error=f"Dask gave it up: {' '.join(str(problem).split())}")
    content, error = future.result()
    if content:
        store.write(key, content)
    return Answer(key=key, result=decoded(content), error=error)


def cluster_client(address: str) -> tuple[Any, Any]:
    """Return a client of the scheduler, and what waits for its futures."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise MissingExtraError("distributed", "cluster", "--scheduler") from None
    try:
        make: Any = Client  # its constructor has no types
        return make(address, timeout=CONNECT_S), as_completed
    except (OSError, ValueError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise ConfigError(
            f"--scheduler {address}: no Dask scheduler answers there ({reason}); "
            "expected an address such as tcp://host:8786, where `dask scheduler` runs"
        ) from None
