"""The picture of a sweep: error and range against each setting. Needs matplotlib."""

import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import MissingExtraError
from vsensor.score import SCORED_RANGES_M
from vsensor.study.sweep import Sweep
from vsensor.study.table import POOLED, Row, mean_known, replace_file
from vsensor.types import Array

STYLES = {10: ("#56B4E9", "o"), 20: ("#0072B2", "s"), 50: ("#E69F00", "^"), 80: ("#D55E00", "D")}
"""Colours told apart by the colour-blind (Okabe and Ito), and a marker besides."""
RANGE_STYLE = ("#009E73", "o")
UNITS = {"_px": "px", "_m": "m", "_deg": "deg", "_kmh": "km/h", "_s": "s", "_ms": "ms", "_per_m": "1/m"}


def draw(path: Path, sweep: Sweep, rows: Sequence[Row]) -> None:
    """Draw one column of two panels per varied key; raises MissingExtraError without matplotlib.

    A line is the mean over the seeds of what each seed gives averaged over the other settings, its
    band the standard deviation over the seeds.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plots", path.name) from None
    pooled = [row for row in rows if row["side"] == POOLED]
    count = len(sweep.varied)
    figure = Figure(figsize=(4.6 * count + 1.6, 6.4), dpi=120, layout="constrained")
    panels = figure.subplots(2, count, squeeze=False, sharex="col", sharey="row")
    for column, key in enumerate(sweep.varied):
        for x in SCORED_RANGES_M:
            _line(panels[0, column], sweep, pooled, key, f"error_{x}m_abs_95_m", f"at {x} m", STYLES[x])
        _line(panels[1, column], sweep, pooled, key, "range_mean_m", "mean", RANGE_STYLE)
        panels[1, column].set_xlabel(_with_unit(key))
    for row, label in enumerate(("lateral error |e|, 95 %, m", "view range, m")):
        panel = panels[row, 0]
        panel.set_ylabel(label)
        panel.set_ylim(0.0, 1.1 * max(each.dataLim.ymax for each in panels[row]))
    for panel in panels.flat:
        panel.grid(visible=True, lw=0.3)
    for panel in panels[:, -1]:
        panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    figure.suptitle(_title(sweep), fontsize=10)
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    replace_file(path, picture.getvalue())


def _title(sweep: Sweep) -> str:
    seeds = len(set(sweep.seeds))
    others = ", averaged over the other settings" if len(sweep.varied) > 1 else ""
    band = f"; band: standard deviation over {seeds} seeds" if seeds > 1 else ""
    return f"{sweep.name}, all lines{others}{band}"


def _line(
    panel: Any, sweep: Sweep, rows: Sequence[Row], key: str, name: str, label: str, style: tuple[str, str]
) -> None:
    values = sweep.varied[key]
    mean, std = _over_seeds(rows, key, values, name)
    x = _places(panel, values)
    colour, marker = style
    panel.plot(x, mean, color=colour, marker=marker, ms=4, lw=1.3, label=label)
    if len({row["seed"] for row in rows}) > 1:
        panel.fill_between(x, mean - std, mean + std, color=colour, alpha=0.25, lw=0)


def _over_seeds(rows: Sequence[Row], key: str, values: Sequence[Any], name: str) -> tuple[Array, Array]:
    """Return mean and standard deviation over the seeds (len(values),), NaN where nothing was counted."""
    mean, std = np.full(len(values), np.nan), np.full(len(values), np.nan)
    for place, value in enumerate(values):
        here = [row for row in rows if _same(row[key], value)]
        seeds = sorted({row["seed"] for row in here})
        each = np.array([mean_known([row[name] for row in here if row["seed"] == seed]) for seed in seeds])
        each = each[np.isfinite(each)]
        if each.size:
            mean[place], std[place] = each.mean(), each.std()
    return mean, std


def _same(one: Any, other: Any) -> bool:
    return json.dumps(one) == json.dumps(other)  # True is not 1 here


def _places(panel: Any, values: Sequence[Any]) -> Array:
    """Return where the values stand on the x axis: numbers at their place, others side by side."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values, dtype=np.float64)
    words = [value if isinstance(value, str) else json.dumps(value) for value in values]
    panel.set_xticks(range(len(words)), words, rotation=20 if max(map(len, words)) > 8 else 0)
    panel.set_xlim(-0.5, len(words) - 0.5)
    return np.arange(len(words), dtype=np.float64)


def _with_unit(key: str) -> str:
    unit = next((unit for suffix, unit in reversed(UNITS.items()) if key.endswith(suffix)), "")
    return f"{key}, {unit}" if unit else key
