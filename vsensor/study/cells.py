"""One resumable runner of many cells: what is finished is a file and is not run again."""

import contextlib
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from vsensor.study.store import Cell, Result, Store, cell_key
from vsensor.study.workers import Answer, on_cluster, on_processes, on_this_process

CellFunction = Callable[[dict[str, Any]], Mapping[str, Any]]
"""Computes a cell from nothing but its content; a function or frozen object of a module, to be pickled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A cell that gave an error instead of a result."""

    cell: Cell
    error: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of the cells: `results` in their order, None where there is none.

    `reused` of them were finished before; `interrupted` by Ctrl-C or SIGTERM before all were tried.
    """

    results: tuple[Result | None, ...]
    reused: int
    failures: tuple[Failure, ...]
    interrupted: bool

    @property
    def finished(self) -> int:
        """The number of cells that have a result."""
        return sum(result is not None for result in self.results)


def run_cells(
    function: CellFunction,
    cells: Sequence[Cell],
    folder: Path,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: bool = False,
) -> Outcome:
    """Run `function` on every cell that has no result in `folder` yet.

    `workers` local processes (all cores; 0: in this one), or the Dask cluster at the address `scheduler`.
    A cell that fails, or whose process dies twice, is a Failure; the others go on. Ctrl-C ends the work,
    finished cells stay. Same results whatever the order and place: a result depends on the cell alone, and is
    returned as its file has it. Raises ConfigError, MissingExtraError.
    """
    store = Store(folder)
    keys = [cell_key(cell) for cell in cells]
    by_key = dict(zip(keys, cells, strict=True))
    results = {key: result for key in by_key if (result := store.read(key)) is not None}
    reused = sum(key in results for key in keys)
    todo = {key: cell for key, cell in by_key.items() if key not in results}
    errors: dict[str, str] = {}
    with (
        _bar(progress, len(by_key), len(results)) as advance,
        _interruption() as interrupted,
        contextlib.closing(_answers(function, todo, store, scheduler, workers)) as answers,
    ):
        for answer in answers:
            if answer.result is not None:
                results[answer.key] = answer.result
            else:
                errors[answer.key] = answer.error
            advance(answer.error)
    if interrupted:  # what a worker has finished since we last looked
        results |= {key: late for key in todo if (late := store.read(key)) is not None}
    return Outcome(
        results=tuple(results.get(key) for key in keys),
        reused=reused,
        failures=tuple(Failure(cell=by_key[key], error=errors[key]) for key in by_key if key in errors),
        interrupted=bool(interrupted),
    )


def _answers(
    function: CellFunction, todo: Mapping[str, Cell], store: Store, scheduler: str | None, workers: int | None
) -> Generator[Answer]:
    if todo and scheduler is not None:
        yield from on_cluster(function, todo, store, scheduler)
    elif todo and workers == 0:
        yield from on_this_process(function, todo, store)
    elif todo:
        yield from on_processes(function, todo, store, workers)


@contextlib.contextmanager
def _interruption() -> Iterator[list[bool]]:
    """Note Ctrl-C, and SIGTERM like it, as an entry in the list instead of an exception.

    SIGINT is set anew too: polars, which asammdf imports, puts its handler before Python's with
    SA_RESTART, and then waiting for a lock, as we do for results, does not end on Ctrl-C.
    """
    interrupted: list[bool] = []

    def stop(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    is_main = threading.current_thread() is threading.main_thread()  # others get no signals
    numbers = (signal.SIGINT, signal.SIGTERM) if is_main else ()
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield interrupted
    except KeyboardInterrupt:
        interrupted.append(True)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def _bar(wanted: bool, cells: int, finished: int) -> Iterator[Callable[[str], None]]:
    """Show a progress bar of cells on stderr, and how many failed, if wanted."""
    if not wanted:
        yield lambda error: None
        return
    from tqdm import tqdm

    failed = 0
    with tqdm(total=cells, initial=finished, unit="cell") as bar:

        def advance(error: str) -> None:
            nonlocal failed
            if error:
                failed += 1
                bar.set_postfix(failed=failed)
            bar.update()

        yield advance
