"""A sweep from its words to its folder: cells, table, picture."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from vsensor.errors import MissingExtraError
from vsensor.study.cells import Outcome
from vsensor.study.plot import draw
from vsensor.study.sweep import Sweep, make_sweep, run_sweep, settings_text
from vsensor.study.table import Row, summary_lines, table_rows, write_csv, write_parquet


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepOptions:
    """What the command line says."""

    vary: tuple[str, ...]
    seeds: int = 1
    out: Path | None = None
    duration_s: float | None = None
    scheduler: str | None = None
    workers: int | None = None
    progress: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepReport:
    """What a sweep did: `lines` for people, `failures` one line each."""

    lines: tuple[str, ...]
    failures: tuple[str, ...]
    interrupted: bool


def sweep_scenario(name_or_path: str, options: SweepOptions, say: Callable[[str], None]) -> SweepReport:
    """Run what is not finished yet, then write table.csv, table.parquet and plot.png beside cells/.

    Interrupted, it writes no table: the same command goes on. Raises VsensorError subclasses.
    """
    sweep = make_sweep(name_or_path, options.vary, seeds=options.seeds, duration_s=options.duration_s)
    folder = options.out or Path(f"sweep_{sweep.name}")
    say(f"{len(sweep.cells)} cells into {folder}")
    outcome = run_sweep(
        sweep,
        folder / "cells",
        scheduler=options.scheduler,
        workers=options.workers,
        progress=options.progress,
    )
    lines = [_counted(outcome)]
    if outcome.interrupted:
        lines.append("stopped; the same command goes on with the rest")
    elif rows := table_rows(sweep, outcome):
        lines = [*summary_lines(sweep, rows), *lines, *_written(folder, sweep, rows)]
    places = {id(cell): number for number, cell in enumerate(sweep.cells)}
    settings = [places[id(failure.cell)] for failure in outcome.failures]
    return SweepReport(
        lines=tuple(lines),
        failures=tuple(
            f"failed: {settings_text(sweep.settings[k], sweep.seeds[k])}: {failure.error}"
            for k, failure in zip(settings, outcome.failures, strict=True)
        ),
        interrupted=outcome.interrupted,
    )


def _counted(outcome: Outcome) -> str:
    failed = f", {len(outcome.failures)} failed" if outcome.failures else ""
    return (
        f"{outcome.finished} of {len(outcome.results)} cells finished, "
        f"{outcome.reused} of them before this run{failed}"
    )


def _written(folder: Path, sweep: Sweep, rows: list[Row]) -> list[str]:
    """Write what can be; returns what was written, and what an extra would add."""
    write_csv(folder / "table.csv", rows)
    lines = [f"wrote {folder / 'table.csv'}"]
    try:
        write_parquet(folder / "table.parquet", rows)
        lines.append(f"wrote {folder / 'table.parquet'}")
    except MissingExtraError as error:
        lines.append(str(error))
    try:
        draw(folder / "plot.png", sweep, rows)
        lines.append(f"wrote {folder / 'plot.png'}")
    except MissingExtraError as error:
        lines.append(str(error))
    return lines
