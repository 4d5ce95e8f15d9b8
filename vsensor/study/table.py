"""What a sweep gives, as a table: one row per cell and side, CSV always, Parquet where polars is there."""

import contextlib
import csv
import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import ConfigError, MissingExtraError
from vsensor.score import SCORED_RANGES_M
from vsensor.study.cells import Outcome
from vsensor.study.sweep import Sweep

Row = dict[str, Any]
"""Column -> value: the varied keys, seed, side, then `sweep.figures`; None where nothing was counted."""

POOLED = "all"


def table_rows(sweep: Sweep, outcome: Outcome) -> list[Row]:
    """Return the rows of all finished cells, in the order of the grid."""
    return [
        {**settings, "seed": seed, "side": side, **figures}
        for settings, seed, result in zip(sweep.settings, sweep.seeds, outcome.results, strict=True)
        if result is not None
        for side, figures in result.items()
    ]


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write the table; an empty place is "nothing counted", a list stands as JSON."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    replace_file(path, text.getvalue().encode())


def write_parquet(path: Path, rows: Sequence[Row]) -> None:
    """Write the table; raises MissingExtraError without polars."""
    try:
        import polars
    except ImportError:
        raise MissingExtraError("polars", "parquet", path.name) from None
    names = list(rows[0]) if rows else []
    content = io.BytesIO()
    columns = {name: _column([row[name] for row in rows]) for name in names}
    polars.DataFrame(columns, strict=False).write_parquet(content)
    replace_file(path, content.getvalue())


def replace_file(path: Path, content: bytes) -> None:
    """Write a file beside its place and move it there; raises ConfigError where that cannot be."""
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_bytes(content)
        beside.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):  # of a disk that is full, or Ctrl-C, nothing stays
            beside.unlink(missing_ok=True)


def summary_lines(sweep: Sweep, rows: Sequence[Row]) -> list[str]:
    """Return a table for people: all sides together, each figure the mean over the seeds."""
    ranges = [f"{x} m" for x in SCORED_RANGES_M]
    header = [*sweep.varied, *ranges, "range m", "available %"]
    names = [*(f"error_{x}m_abs_95_m" for x in SCORED_RANGES_M), "range_mean_m", "availability"]
    forms = [*[".3f"] * len(ranges), ".1f", ".2f"]
    lines = [header]
    for key, group in _groups(sweep, rows).items():
        means = [mean_known([row[name] for row in group]) for name in names]
        means[-1] *= 100
        lines.append([*json.loads(key), *map(_shown, means, forms)])
    text = [[_word(cell) for cell in line] for line in lines]
    seeds = len(set(sweep.seeds))
    part = "the finished runs of " * (sum(row["side"] == POOLED for row in rows) < len(sweep.cells))
    return [
        f"95 % of the lateral error |e| in m, all lines, mean over {part}{seeds} seed{'s' * (seeds > 1)}",
        *aligned(text),
    ]


def aligned(lines: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of words as lines, every column to the right."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return ["  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]


def mean_known(values: Sequence[float | None]) -> float:
    """Return the mean of what is not None, NaN if nothing is."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else math.nan


def _groups(sweep: Sweep, rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the pooled rows by their settings (as JSON), in the order of the grid."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        if row["side"] == POOLED:
            found.setdefault(json.dumps([row[key] for key in sweep.varied]), []).append(row)
    return found


def _column(values: list[Any]) -> list[Any]:
    """Return values of one type: numbers and words as they are, anything mixed as text."""
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int, float} or (len(kinds) == 1 and not kinds & {list, dict}):
        return [float(value) if float in kinds and value is not None else value for value in values]
    return [None if value is None else _cell(value) for value in values]


def _cell(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, list | dict | bool) else value


def _word(value: Any) -> str:
    return str(_cell(value))


def _shown(value: float, form: str) -> str:
    return "-" if math.isnan(value) else format(value, form)
