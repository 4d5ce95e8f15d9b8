"""Methods over events: each pair a cell, in parallel, what is finished is not run again."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from vsensor.camera import Camera
from vsensor.profile import load_profiles
from vsensor.study import Outcome, run_cells
from vsensor.study.digest import file_digest, program_digest
from vsensor.types import NANOSECONDS_PER_SECOND
from vsensor.video.can_motion import read_motions
from vsensor.video.event_folder import FILE, EventFolder, read_event
from vsensor.video.frames import open_pictures
from vsensor.video.methods import Setup, open_method, require_method, rows_by
from vsensor.video.rows import COLUMNS, Rows, rows_from
from vsensor.video.settings import VideoConfig
from vsensor.video.types import Picture

CELLS = "cells"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """Which pictures methods look at (of `rate_hz`, the first `limit`), and where the work is done."""

    settings: VideoConfig = field(default_factory=VideoConfig)
    rate_hz: float | None = None
    limit: int | None = None
    scheduler: str | None = None
    workers: int | None = None
    progress: bool = False


def run_methods(
    events: Sequence[EventFolder], methods: Sequence[str], out: Path, options: RunOptions
) -> tuple[dict[tuple[str, str], Rows], Outcome]:
    """Return the rows of each (event, method) that ran, and what became of all; raises as run_cells."""
    for method in methods:
        require_method(method)
    cells = [event_cell(event, method, options) for event in events for method in methods]
    outcome = run_cells(
        run_cell,
        cells,
        out / CELLS,
        scheduler=options.scheduler,
        workers=options.workers,
        progress=options.progress,
    )
    found = {
        (Path(cell["event"]).name, cell["method"]): rows_of_result(result)
        for cell, result in zip(cells, outcome.results, strict=True)
        if result is not None
    }
    return found, outcome


def event_cell(event: EventFolder, method: str, options: RunOptions) -> dict[str, Any]:
    """Return all that the rows of an event depend on; video and log by size and time, they may be large."""
    return {
        "event": str(event.path.resolve()),
        "method": method,
        "files": {path.name: _stamp(path) for path in (event.video, event.log)},
        "told": file_digest(event.path / FILE),
        "settings": msgspec.to_builtins(options.settings),
        "rate_hz": options.rate_hz,
        "limit": options.limit,
        "program": program_digest(),
    }


def _stamp(path: Path) -> list[int]:
    about = path.stat()
    return [about.st_size, about.st_mtime_ns]


def run_cell(cell: dict[str, Any]) -> Mapping[str, Any]:
    """Run one method over one event, in any process that sees the same files."""
    event = read_event(Path(cell["event"]))
    rows = run_event(
        event,
        cell["method"],
        msgspec.convert(cell["settings"], VideoConfig),
        cell["rate_hz"],
        cell["limit"],
    )
    return {name: column.tolist() for name, column in rows.columns().items()}


def run_event(
    event: EventFolder,
    method: str,
    settings: VideoConfig,
    rate_hz: float | None = None,
    limit: int | None = None,
) -> Rows:
    """Return what a method says of an event, with its CAN log's motion; raises VsensorError subclasses."""

    def pictures() -> Iterator[Picture]:
        with open_pictures(event.video, event.config.rate_hz) as reader:
            event.require_size(reader.size)
            yield from thinned(reader, rate_hz, limit)

    t_s = np.array([picture.t_ns for picture in pictures()]) / NANOSECONDS_PER_SECOND
    at_s = t_s + event.config.video_starts_at_log_s
    motions = read_motions(event.log, load_profiles(event.profiles), at_s)
    camera = Camera.from_config(event.config.camera)
    setup = Setup(camera=camera, vehicle=event.config.vehicle, settings=settings, pictures=pictures)
    looking = open_method(method, setup)
    state, estimates = looking.begin(), []
    for picture, motion in zip(pictures(), motions, strict=True):
        state, estimate = looking.look(state, picture, motion)
        estimates.append(estimate)
    return rows_by(method, setup, estimates)


def thinned(
    pictures: Iterable[Picture], rate_hz: float | None, limit: int | None = None
) -> Iterator[Picture]:
    """Yield the pictures at about this rate (P2 2.3.1), all without one; at most `limit`."""
    taken, last = 0, -1
    for picture in pictures:
        if limit is not None and taken >= limit:
            return
        slot = (
            picture.index if rate_hz is None else int(picture.t_ns / NANOSECONDS_PER_SECOND * rate_hz + 1e-6)
        )
        if slot > last:
            last, taken = slot, taken + 1
            yield picture


def rows_of_result(result: Mapping[str, Any]) -> Rows:
    """Return the rows that a cell's result has."""
    columns = [[nan if value is None else value for value in result[name]] for name in COLUMNS]
    return rows_from(zip(*columns, strict=True))
