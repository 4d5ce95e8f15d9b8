"""A sweep from its words to its folder: cells, table, picture."""

from collections.abc import Callable, Sequence
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

    Interrupted, it writes the tables of what is finished, no picture: the same command goes on. Raises
    VsensorError subclasses.
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
    lines = [counted(outcome)]
    if rows := table_rows(sweep, outcome):
        lines = [*summary_lines(sweep, rows), *lines, *write_tables(folder, "table", rows)]
        lines += [] if outcome.interrupted else _picture(folder, sweep, rows)
    if outcome.interrupted:
        lines.append("stopped; the same command goes on with the rest")
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


def counted(outcome: Outcome, what: str = "cells") -> str:
    """Return how many are finished, were before, and failed."""
    failed = f", {len(outcome.failures)} failed" if outcome.failures else ""
    return (
        f"{outcome.finished} of {len(outcome.results)} {what} finished, "
        f"{outcome.reused} of them before this run{failed}"
    )


def write_tables(folder: Path, name: str, rows: Sequence[Row]) -> list[str]:
    """Write NAME.csv and NAME.parquet, what can be; returns what was written, and what an extra would add."""
    write_csv(folder / f"{name}.csv", rows)
    csv_line = f"wrote {folder / f'{name}.csv'}"
    try:
        write_parquet(folder / f"{name}.parquet", rows)
    except MissingExtraError as error:
        return [csv_line, str(error)]
    return [csv_line, f"wrote {folder / f'{name}.parquet'}"]


def _picture(folder: Path, sweep: Sweep, rows: list[Row]) -> list[str]:
    try:
        draw(folder / "plot.png", sweep, rows)
    except MissingExtraError as error:
        return [str(error)]
    return [f"wrote {folder / 'plot.png'}"]
