"""What an experiment gives, as tables: a row per run, a row per run and side, limits judged."""

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsensor.errors import ConfigError
from vsensor.experiment.course import LOOP_FIGURES
from vsensor.experiment.matrix import LimitConfig, Matrix
from vsensor.experiment.plan import Plan
from vsensor.score import score_trace
from vsensor.sinks.trace_file import COLUMNS, ROW
from vsensor.study.cells import Outcome
from vsensor.study.scenario_cells import figures
from vsensor.study.table import Row

POOLED = "all"
NOTHING_SCORED = score_trace({name: np.empty(0, ROW[name]) for name in COLUMNS}).pooled


@dataclass(frozen=True, slots=True, kw_only=True)
class Broken:
    """A limit that a run is beyond, or has no value for."""

    row: Row
    limit: LimitConfig

    def text(self) -> str:
        """Return it as a sentence."""
        value = self.row.get(self.limit.column)
        said = "has no value" if value is None else f"is {value:.4g}"
        return f"{self.row['run']}: {self.limit.column} {said}, {limit_text(self.limit)} was expected"


def limit_text(limit: LimitConfig) -> str:
    """Return a limit as a person says it."""
    low, high = limit.at_least, limit.at_most
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    return f"at least {low:g}" if low is not None else f"at most {high:g}"


def require_columns(matrix: Matrix) -> None:
    """Refuse limits of columns that there are not; raises ConfigError naming the nearest one."""
    known = ["seconds", *figures(NOTHING_SCORED), *(LOOP_FIGURES if matrix.config.loop else ())]
    for number, limit in enumerate(matrix.config.limit):
        if limit.column not in known:
            near = difflib.get_close_matches(limit.column, known, n=1)
            hint = f"; did you mean {near[0]}?" if near else f"; such as {', '.join(known[:4])}"
            raise ConfigError(f"{matrix.path}: limit[{number}].column: {limit.column}: no such column{hint}")


def run_rows(plan: Plan, outcome: Outcome) -> list[Row]:
    """Return a row for each finished run: what tells it apart, then the figures of all its lines."""
    return [
        {
            **told,
            "seconds": result["seconds"],
            **result.get("loop", {}),
            **result["sides"].get(POOLED, {}),
        }
        for told, result in zip(plan.told, outcome.results, strict=True)
        if result is not None
    ]


def side_rows(plan: Plan, outcome: Outcome) -> list[Row]:
    """Return a row for each side of each finished run."""
    return [
        {**told, "side": side, **figures}
        for told, result in zip(plan.told, outcome.results, strict=True)
        if result is not None
        for side, figures in result["sides"].items()
        if side != POOLED
    ]


def judged(rows: Sequence[Row], limits: Sequence[LimitConfig]) -> list[Broken]:
    """Return the limits that runs are beyond."""
    return [
        Broken(row=row, limit=limit)
        for row in rows
        for limit in limits
        if (not limit.scenarios or row["scenario"] in limit.scenarios)
        and not keeps(limit, row.get(limit.column))
    ]


def with_verdict(rows: Sequence[Row], broken: Sequence[Broken]) -> list[Row]:
    """Return the rows with a column `beyond`: the columns whose limits they are beyond, "-" if none."""
    beyond: dict[str, list[str]] = {}
    for one in broken:
        beyond.setdefault(one.row["run"], []).append(one.limit.column)
    return [{**row, "beyond": " ".join(beyond.get(row["run"], ["-"]))} for row in rows]


def keeps(limit: LimitConfig, value: float | None) -> bool:
    """Return whether a value is within a limit; none is not."""
    if value is None or math.isnan(value):
        return False
    low = -math.inf if limit.at_least is None else limit.at_least
    high = math.inf if limit.at_most is None else limit.at_most
    return low <= value <= high


def short_table(rows: Sequence[Row], columns: Sequence[str], shown: Mapping[str, str]) -> list[list[str]]:
    """Return a table for people, header first: `columns`, then the figures in `shown`, name -> form."""
    head = [*columns, *shown]
    return [
        head,
        *([*(str(row[c]) for c in columns), *(_shown(row, n, f) for n, f in shown.items())] for row in rows),
    ]


def _shown(row: Row, name: str, form: str) -> str:
    value = row.get(name)
    return "-" if value is None else format(value, form)
