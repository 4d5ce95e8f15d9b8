"""The verdict as one page: HTML with its pictures inside, or PDF. Needs matplotlib."""

import html
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import ConfigError
from vsensor.field.validate.judge import LEVELS
from vsensor.field.validate.verdict import Judged, as_json, summary
from vsensor.pages import COLOURS, html_image, new_figure, pdf_of, require_place
from vsensor.study.table import replace_file

STYLE = """
body { font: 15px/1.45 sans-serif; margin: 2em auto; max-width: 75em; padding: 0 1em; color: #222 }
table { border-collapse: collapse; margin: 1em 0 }
td, th { border-bottom: 1px solid #ccc; padding: .3em .8em; text-align: left }
.no { color: #a00; font-weight: bold }
figure { margin: 1em 0 } img { max-width: 100% } figcaption { color: #555 }
"""


def require_page(path: Path) -> None:
    """Refuse a page that cannot be written, before the work; raises ConfigError, MissingExtraError."""
    if path.suffix.lower() not in (".html", ".pdf"):
        raise ConfigError(f"{path}: a page ends in .html or .pdf")
    require_place(path)
    new_figure(purpose=path.name)


def write_json(path: Path, judged: Sequence[Judged]) -> None:
    """Write the verdict for programs; raises ConfigError."""
    replace_file(path, json.dumps(as_json(judged), indent=1).encode() + b"\n")


def write_page(path: Path, title: str, source: str, judged: Sequence[Judged]) -> None:
    """Write the page; it appears when it is whole."""
    figures = [(one, picture_of(one)) for one in judged]
    if path.suffix.lower() == ".pdf":
        replace_file(path, pdf_of([_text_figure(title, source, judged), *(f for _, f in figures)]))
        return
    parts = [f"<h1>{html.escape(title)}</h1>", f"<p>{html.escape(source)}</p>"]
    for one, figure in figures:
        word = "within limits" if one.good else '<span class="no">beyond limits</span>'
        parts.append(f"<h2>Model {html.escape(one.name)}: {word}</h2>")
        parts.append(f"<p>{one.rows} rows, worth {one.effective:.0f} independent ones.</p>")
        parts.append(_table(one))
        parts.append(html_image(figure, f"Model {html.escape(one.name)} on held-out logs"))
    page = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{STYLE}</style></head><body>\n{chr(10).join(parts)}\n</body></html>\n"
    )
    replace_file(path, page.encode())


def _table(one: Judged) -> str:
    rows = [
        f"<tr><td>{html.escape(check.what)}</td><td>{html.escape(check.shown)}</td>"
        f"<td>{check.off:.3g}</td><td>{check.chance:.3g}</td><td>{check.limit:g}</td>"
        + ("<td>yes</td></tr>" if check.good else '<td class="no">no</td></tr>')
        for check in one.checks
    ]
    head = "".join(f"<th>{word}</th>" for word in ("figure", "found", "off by", "chance", "limit", "good"))
    return f"<table><tr>{head}</tr>{''.join(rows)}</table>"


def _text_figure(title: str, source: str, judged: Sequence[Judged]) -> Any:
    figure = new_figure(11.0, 8.0)
    lines = [title, "", source, "", *summary(judged)]
    figure.text(0.03, 0.97, "\n".join(lines), va="top", fontsize=7, family="monospace")
    return figure


def picture_of(one: Judged) -> Any:
    """Draw coverage, places in the law, distances, autocorrelation and durations."""
    figure = new_figure(13.0, 8.0)
    panels = figure.subplots(2, 3)
    _coverage(panels[0, 0], one)
    _places(panels[0, 1], one)
    _distances(panels[0, 2], one)
    _correlation(panels[1, 0], one)
    _durations(panels[1, 1], one.lost_s, "a line stays lost (s)")
    _durations(panels[1, 2], one.seen_s, "a line stays seen (s)")
    return figure


def _coverage(axes: Any, one: Judged) -> None:
    level = one.model.levels
    axes.axhline(0.0, color="black", lw=0.8)
    axes.errorbar(level, 100 * (one.coverage - level), 100 * one.half, fmt="o", color=COLOURS[0], capsize=3)
    axes.set(xlabel="level of the surface", ylabel="errors within it less the level (pp)")
    axes.set_title("coverage, with 95 % intervals", fontsize=9)


def _places(axes: Any, one: Judged) -> None:
    edges = np.concatenate([[0.0], one.model.signed_levels, [1.0]])
    axes.stairs(one.pit, edges, color=COLOURS[0], fill=True, alpha=0.5)
    axes.axhline(1.0, color="black", lw=0.8)
    axes.set(
        xlabel="place of an error in the law (PIT)", ylabel="density", ylim=(0.0, max(2.0, one.pit.max()))
    )
    axes.set_title("even if the law is right", fontsize=9)


def _distances(axes: Any, one: Judged) -> None:
    ranges = sorted({band.range_m for band in one.bands})
    speeds = sorted({band.speed_mps for band in one.bands})
    if not ranges:
        return
    found = np.full((len(ranges), len(speeds)), np.nan)
    for band in one.bands:
        found[ranges.index(band.range_m), speeds.index(band.speed_mps)] = band.distance_m / band.mean_m
    mesh = axes.imshow(100 * found, cmap="viridis", vmin=0.0, aspect="auto", origin="lower")
    axes.figure.colorbar(mesh, ax=axes, label="Wasserstein distance over mean size (%)")
    axes.set_xticks(range(len(speeds)), [f"{low:.0f}-{high:.0f}" for low, high in speeds])
    axes.set_yticks(range(len(ranges)), [f"{low:.0f}-{high:.0f}" for low, high in ranges])
    axes.set(xlabel="speed (m/s)", ylabel="range (m)")
    axes.set_title("recorded against virtual errors", fontsize=9)


def _correlation(axes: Any, one: Judged) -> None:
    for rho, word, mark, colour in zip(
        one.rho, ("recorded", "virtual"), ("o", "-"), COLOURS[:2], strict=True
    ):
        axes.plot(one.lags_s, rho, mark, color=colour, label=word)
    axes.axhline(0.0, color="black", lw=0.8)
    axes.set(xlabel="lag (s)", ylabel="autocorrelation of the normal score")
    axes.legend(fontsize=8, loc="upper right")


def _durations(axes: Any, curves: Any, label: str) -> None:
    axes.set(xlabel=label, ylabel="share of the runs that are shorter", ylim=(0.0, 1.0))
    if curves.size:
        for curve, word, colour in zip(curves, ("recorded", "virtual"), COLOURS[:2], strict=True):
            axes.plot(np.maximum(curve, 1e-3), LEVELS, color=colour, label=word)
        axes.set_xscale("log")
        axes.legend(fontsize=8, loc="upper right")
