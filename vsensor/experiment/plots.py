"""The pictures of an experiment's report: errors by condition, figures by setting. Needs matplotlib."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsensor.experiment.conditions import AXES, Axis
from vsensor.pages import COLOURS, new_figure
from vsensor.score import ERROR_RANGES_M
from vsensor.study.table import Row
from vsensor.types import Array

MARKERS = ("o", "s", "^", "D", "v")
FEWEST = 20
"""Fewer errors than that make no point."""


def condition_figures(tables: Mapping[str, Array]) -> list[tuple[str, Any]]:
    """Return (caption, figure) for every condition that varies: RMS error by it, one line for each range.

    Raises MissingExtraError without matplotlib.
    """
    found = []
    for axis in AXES:
        count = tables[axis.name][..., 0]
        if (count.max(axis=1) >= FEWEST).sum() > 1:
            found.append((f"lateral error by {axis.title}", _condition(axis, tables[axis.name])))
    return found


def steady(tables: Mapping[str, Array]) -> list[str]:
    """Say which conditions did not vary, in sentences."""
    said = []
    for axis in AXES:
        seen = [k for k, row in enumerate(tables[axis.name][..., 0]) if row.max() >= FEWEST]
        if len(seen) == 1:
            said.append(f"{axis.title}: always {axis.labels[seen[0]]}")
    return said


def _condition(axis: Axis, table: Array) -> Any:
    figure = new_figure(8.0, 4.2, "the report's pictures")
    panel, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    seen = np.flatnonzero(table[..., 0].max(axis=1) >= FEWEST)
    places = np.arange(len(seen))
    for column, x in enumerate(ERROR_RANGES_M):
        count, _, squares, largest = table[seen, column].T
        enough = count >= FEWEST
        if not enough.any():
            continue
        colour, marker = COLOURS[column], MARKERS[column]
        rms = np.sqrt(squares / np.maximum(count, 1.0))
        panel.plot(places[enough], rms[enough], color=colour, marker=marker, ms=5, label=f"at {x} m")
        panel.plot(places[enough], largest[enough], color=colour, lw=0.6, ls=":")
        below.bar(places + 0.15 * (column - 2), count, 0.15, color=colour)
    panel.set_ylabel("lateral error, m\nRMS, dotted: largest")
    panel.set_yscale("log")
    panel.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    below.set_ylabel("errors")
    below.set_xticks(places, [axis.labels[k] for k in seen], fontsize=7)
    below.set_xlabel(axis.title)
    for each in (panel, below):
        each.grid(visible=True, lw=0.3)
    return figure


SETTING_FIGURES = (
    ("error_50m_abs_95_m", "95 % of |e| at 50 m, m"),
    ("range_mean_m", "view range, m"),
    ("availability", "availability"),
)


def setting_figures(rows: Sequence[Row], columns: Sequence[str]) -> list[tuple[str, Any]]:
    """Return (caption, figure) for each column that takes several values: error, range, availability by it.

    A point is a run, the line the mean. Raises MissingExtraError without matplotlib.
    """
    found = []
    for column in columns:
        values = list({json.dumps(row[column]): row[column] for row in rows}.values())
        if len(values) > 1:
            found.append((f"error, view range and availability by {column}", _setting(rows, column, values)))
    return found


def _setting(rows: Sequence[Row], column: str, values: Sequence[Any]) -> Any:
    figure = new_figure(9.0, 3.4, "the report's pictures")
    words = [value if isinstance(value, str) else json.dumps(value) for value in values]
    for panel, (name, label) in zip(figure.subplots(1, len(SETTING_FIGURES)), SETTING_FIGURES, strict=True):
        groups = [[row[name] for row in rows if row[column] == value] for value in values]
        known = [[y for y in group if y is not None] for group in groups]
        for place, group in enumerate(known):
            panel.plot([place] * len(group), group, color=COLOURS[5], marker=".", ls="")
        means = [float(np.mean(group)) if group else np.nan for group in known]
        panel.plot(range(len(values)), means, color=COLOURS[0], marker="o", ms=4, lw=1.2)
        panel.set_xticks(range(len(values)), words, rotation=25 if max(map(len, words)) > 6 else 0)
        panel.set_ylabel(label)
        panel.set_xlabel(column)
        panel.set_ylim(bottom=0.0, top=1.08 * max(panel.get_ylim()[1], 1e-9))
        panel.grid(visible=True, lw=0.3)
    return figure
