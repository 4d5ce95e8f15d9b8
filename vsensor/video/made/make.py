"""`vsensor video make`: many events, in parallel; what is finished stays and is not made again."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsensor.errors import ConfigError
from vsensor.image import import_opencv
from vsensor.sinks.rows import import_polars
from vsensor.study.cells import Failure, Outcome, run_cells
from vsensor.study.folder import clear_parts, own_folder
from vsensor.study.store import Store, cell_key
from vsensor.video.made.drives import EVENT_S, planned
from vsensor.video.made.event import EVENT, write_event
from vsensor.video.made.kinds import KINDS

FORMAT = 2
"""Of what is drawn: events of another one are made again. A change of the program alone does not do that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MakeOptions:
    """What the command line says."""

    out: Path
    kind: str = "eor"
    events: int = 10
    seed: int = 1
    duration_s: float = EVENT_S
    workers: int | None = None
    scheduler: str | None = None
    progress: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MakeReport:
    """What was made: `lines` for people, `failures` one line each."""

    lines: tuple[str, ...]
    failures: tuple[str, ...]
    interrupted: bool

    @property
    def status(self) -> int:
        """The exit status: 0 done, 1 an event failed, 130 stopped."""
        return 130 if self.interrupted else int(bool(self.failures))


@dataclass(frozen=True, slots=True)
class EventCell:
    """Makes the event of a cell in a worker, in a folder of its own in `out`."""

    out: Path

    def __call__(self, cell: dict[str, Any]) -> Mapping[str, Any]:
        """Return the number of frames and what it shows."""
        plan = planned(cell["kind"], cell["seed"], cell["number"], cell["duration_s"])
        with own_folder(self.out / event_name(cell), True) as folder:
            frames = write_event(folder, cell["kind"], plan)
        return {"frames": frames, **plan.conditions}


def event_name(cell: Mapping[str, Any]) -> str:
    """Return the name of an event's folder."""
    return f"{cell['kind']}_seed{cell['seed']}_{cell['number']:04d}"


def make_events(options: MakeOptions) -> MakeReport:
    """Make the events 0 to N - 1 of a seed that are not there yet; raises VsensorError subclasses."""
    if options.kind not in KINDS:
        raise ConfigError(f"--kind {options.kind}: {' or '.join(KINDS)} was expected")
    import_opencv("a made video")
    import_polars()
    cells = [
        {
            "format": FORMAT,
            "kind": options.kind,
            "seed": options.seed,
            "number": number,
            "duration_s": options.duration_s,
        }
        for number in range(options.events)
    ]
    out = options.out.absolute()
    store = Store(out / "cells")
    clear_parts(out)
    for cell in cells:
        if not (out / event_name(cell) / EVENT).is_file():
            store.forget(cell_key(cell))
    outcome = run_cells(
        EventCell(out),
        cells,
        store.folder,
        scheduler=options.scheduler,
        workers=options.workers,
        progress=options.progress,
    )
    failures = [_failed(failure) for failure in outcome.failures]
    return MakeReport(
        lines=tuple(_lines(options, outcome)), failures=tuple(failures), interrupted=outcome.interrupted
    )


def _failed(failure: Failure) -> str:
    return f"failed: {event_name(failure.cell)}: {failure.error}"


def _lines(options: MakeOptions, outcome: Outcome) -> list[str]:
    made = [result for result in outcome.results if result is not None]
    reused = f", {outcome.reused} of them were there" if outcome.reused else ""
    frames = sum(result["frames"] for result in made)
    lines = [f"{options.out}: {len(made)} of {options.events} events{reused}, {frames} frames"]
    for key in ("light", "place"):
        words = [result[key] for result in made]
        shares = ", ".join(f"{word} {words.count(word)}" for word in dict.fromkeys(words))
        lines += [f"{key}: {shares}"] if words else []
    return lines
