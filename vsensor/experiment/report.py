"""An experiment from its words to its folder: runs, tables, report page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsensor.errors import ConfigError, MissingExtraError
from vsensor.experiment.conditions import condition_rows, pooled
from vsensor.experiment.course_plots import course_figures
from vsensor.experiment.ecu import ECUS
from vsensor.experiment.matrix import KEPT, Matrix, load_matrix
from vsensor.experiment.page import page
from vsensor.experiment.plan import Plan, forget_incomplete, make_plan
from vsensor.experiment.runs import FILES
from vsensor.experiment.tables import (
    Broken,
    judged,
    require_columns,
    run_rows,
    short_table,
    side_rows,
    with_verdict,
)
from vsensor.image import import_opencv
from vsensor.sinks.rows import writer_for
from vsensor.study.cells import Outcome, run_cells
from vsensor.study.folder import clear_parts
from vsensor.study.report import counted, write_tables
from vsensor.study.store import Store
from vsensor.study.table import Row, aligned, replace_file

SHOWN = {
    "error_20m_rms_m": ".3f",
    "error_50m_rms_m": ".3f",
    "error_80m_rms_m": ".3f",
    "error_50m_abs_95_m": ".3f",
    "lane_offset_error_rms_m": ".3f",
    "range_mean_m": ".1f",
    "availability": ".4f",
    "lost_rows": "d",
    "false_reports": "d",
}
"""Figures of the table that people see, and how."""
SHOWN_LOOP = {
    "departure_mps": ".2f",
    "dtle_min_m": ".2f",
    "dtle_at_warning_m": ".2f",
    "time_to_crossing_at_warning_s": ".2f",
    "dtle_at_intervention_m": ".2f",
    "lateral_acceleration_max_mps2": ".2f",
    "lateral_jerk_max_mps3": ".2f",
    "returning_mps": ".2f",
    "availability": ".4f",
}
"""The same of a closed loop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentOptions:
    """What the command line says; `outputs`, `ecu` and `duration_s` stand in place of the matrix's.

    With `bus` the runs are in real time, one after the other, with the ECU under test on that bus.
    """

    out: Path | None = None
    outputs: tuple[str, ...] | None = None
    ecu: str | None = None
    bus: str | None = None
    duration_s: float | None = None
    scheduler: str | None = None
    workers: int | None = None
    progress: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentReport:
    """What an experiment did: `lines` for people, `failures` and `broken` limits one line each."""

    lines: tuple[str, ...]
    failures: tuple[str, ...]
    broken: tuple[str, ...]
    interrupted: bool

    @property
    def status(self) -> int:
        """The exit status: 0 done, 1 a run failed or is beyond a limit, 130 stopped."""
        return 130 if self.interrupted else int(bool(self.failures or self.broken))


def run_experiment(
    name_or_path: str, options: ExperimentOptions, say: Callable[[str], None]
) -> ExperimentReport:
    """Run what is not finished yet, then write tables and report.html beside cells/ and runs/.

    Interrupted, it writes the tables of what is finished, no page: the same command goes on. Raises
    VsensorError subclasses.
    """
    matrix = load_matrix(name_or_path)
    require_columns(matrix)
    outputs = _outputs(matrix, options)
    ecu = _ecu(matrix, options)
    plan = make_plan(matrix, outputs=outputs, ecu=ecu, duration_s=options.duration_s)
    folder = options.out or Path(f"experiment_{plan.name}")
    say(f"{len(plan.cells)} runs into {folder}")
    if matrix.config.loop is not None and options.bus is None:
        say(f"steered by the ECU {ecu!r} of this program; yours with --bus INTERFACE:CHANNEL")
    outcome = _run(plan, folder, options)
    failures = _failures(plan, outcome)
    lines, broken = [counted(outcome, "runs")], list[Broken]()
    if rows := run_rows(plan, outcome):
        broken = judged(rows, matrix.config.limit)
        shown = {**(SHOWN if matrix.config.loop is None else SHOWN_LOOP)}
        if matrix.config.limit:
            rows, shown = with_verdict(rows, broken), {**shown, "beyond": ""}
            lines.append(f"{len({one.row['run'] for one in broken})} of {len(rows)} runs beyond a limit")
        table = short_table(rows, ("scenario", *matrix.columns, "seed"), shown)
        lines = [*aligned(table), *lines, *_written(folder, matrix, plan, outcome, rows)]
        if not outcome.interrupted:
            lines += _page(folder, matrix, plan, table, rows, outcome, broken, failures)
    if outcome.interrupted:
        lines.append("stopped; the same command goes on with the rest")
    return ExperimentReport(
        lines=tuple(lines),
        failures=tuple(failures),
        broken=tuple(one.text() for one in broken),
        interrupted=outcome.interrupted,
    )


def _outputs(matrix: Matrix, options: ExperimentOptions) -> tuple[str, ...]:
    """Return what is kept of each run; raises at once what would fail in each of them."""
    outputs = matrix.config.outputs if options.outputs is None else options.outputs
    for kind in outputs:
        if kind not in KEPT:
            raise ConfigError(f"--outputs {kind}: {', '.join(KEPT)} were expected")
    if {"trace", "truth"} & set(outputs):
        writer_for(Path(FILES["trace"]))
    if "images" in outputs:
        import_opencv("outputs = images")
    return tuple(outputs)


def _ecu(matrix: Matrix, options: ExperimentOptions) -> str:
    """Return who answers on the bus; raises ConfigError for what cannot be."""
    if matrix.config.loop is None:
        if options.ecu is not None or options.bus is not None:
            word = "--ecu" if options.bus is None else "--bus"
            raise ConfigError(f"{word}: {matrix.path} has no [loop]: nothing in it listens to a bus")
        return "none"
    if options.bus is not None:
        if options.ecu is not None or options.scheduler is not None or options.workers is not None:
            raise ConfigError(
                "--bus: one run after the other in this process: no --ecu, --scheduler, --workers"
            )
        return f"on {options.bus}"
    ecu = options.ecu or matrix.config.loop.ecu
    if ecu not in ECUS:
        word = "--ecu" if options.ecu else f"{matrix.path}: loop.ecu ="
        raise ConfigError(f"{word} {ecu}: {', '.join(ECUS)} were expected")
    return ecu


def _run(plan: Plan, folder: Path, options: ExperimentOptions) -> Outcome:
    runs = (folder / "runs").absolute()
    store = Store(folder / "cells")
    clear_parts(runs)
    forget_incomplete(plan, store, runs)
    return run_cells(
        plan.function(runs, options.bus),
        plan.cells,
        store.folder,
        scheduler=options.scheduler,
        workers=options.workers if options.bus is None else 0,
        progress=options.progress,
    )


def _failures(plan: Plan, outcome: Outcome) -> list[str]:
    names = {id(cell): told for cell, told in zip(plan.cells, plan.told, strict=True)}
    found = []
    for failure in outcome.failures:
        told = names[id(failure.cell)]
        words = " ".join(f"{key}={value}" for key, value in told.items() if key != "run")
        found.append(f"failed: {words}: {failure.error}")
    return found


def _written(folder: Path, matrix: Matrix, plan: Plan, outcome: Outcome, rows: Sequence[Row]) -> list[str]:
    """Write the tables; returns what was written."""
    sides = side_rows(plan, outcome)
    conditions = condition_rows(_conditions(outcome))
    tables: dict[str, Sequence[Row]] = {"table": rows, "sides": sides, "conditions": conditions}
    return [line for name, each in tables.items() if each for line in write_tables(folder, name, each)]


def _conditions(outcome: Outcome) -> Any:
    return pooled([result["conditions"] for result in outcome.results if result is not None])


def _page(
    folder: Path,
    matrix: Matrix,
    plan: Plan,
    table: list[list[str]],
    rows: Sequence[Row],
    outcome: Outcome,
    broken: Sequence[Broken],
    failures: Sequence[str],
) -> list[str]:
    try:
        more = course_figures(plan, outcome, matrix) if matrix.config.loop is not None else []
        text, missing = page(matrix, table, rows, _conditions(outcome), broken, failures, more)
    except MissingExtraError as error:
        return [str(error)]
    replace_file(folder / "report.html", text.encode())
    return [*missing, f"wrote {folder / 'report.html'}"]
