"""The report of an experiment: one HTML page that loads nothing from outside."""

import html
from collections.abc import Mapping, Sequence
from typing import Any

from vsensor.errors import MissingExtraError
from vsensor.experiment.matrix import Matrix
from vsensor.experiment.plots import condition_figures, setting_figures, steady
from vsensor.experiment.tables import Broken, limit_text
from vsensor.pages import html_image
from vsensor.study.table import Row
from vsensor.types import Array

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 70em; padding: 0 1em; color: #222 }
table { border-collapse: collapse; font-size: 13px }
td, th { padding: .2em .7em; border-bottom: 1px solid #ddd }
td { text-align: right } td:first-child, th:first-child { text-align: left } th { text-align: right }
.bad { color: #b00000; font-weight: 600 } .good { color: #00703c; font-weight: 600 }
figure { margin: 1.5em 0 } img { max-width: 100% } .wide { overflow-x: auto } figcaption { color: #555 }
"""


def page(
    matrix: Matrix,
    table: Sequence[Sequence[str]],
    rows: Sequence[Row],
    tables: Mapping[str, Array],
    broken: Sequence[Broken],
    failures: Sequence[str],
    more: Sequence[tuple[str, Any]] = (),
) -> tuple[str, list[str]]:
    """Return the page, and what an extra would add to it; `more`: (caption, figure) before the others."""
    parts = [f"<h1>{_text(matrix.name)}</h1>", f"<p>{_text(matrix.config.about)}</p>"]
    parts += [f"<p>{len(rows)} runs: {_text(_what(matrix))}</p>", *_verdict(matrix, broken, failures)]
    parts += ["<h2>Runs</h2>", _table(table)]
    pictures, missing = _pictures(matrix, rows, tables, more)
    parts += ["<h2>Pictures</h2>", *pictures] if pictures else []
    if said := steady(tables):
        parts.append(f"<p>What did not vary: {_text('; '.join(said))}.</p>")
    parts.append(
        "<p>Lateral error: reported minus true y, m, where the line was reported and the true line reaches; "
        "availability: share of the images with a true line in which it was reported.</p>"
    )
    body = "\n".join(parts)
    head = f"<meta charset='utf-8'><title>{_text(matrix.name)}</title><style>{STYLE}</style>"
    return f"<!doctype html><html lang='en'><head>{head}</head><body>{body}</body></html>\n", missing


def _what(matrix: Matrix) -> str:
    config = matrix.config
    counted = [f"{len(config.scenarios)} scenario{'s' * (len(config.scenarios) > 1)}"]
    varied = {**matrix.axes, **matrix.varied}
    return " x ".join([*counted, *(f"{len(values)} values of {key}" for key, values in varied.items())])


def _verdict(matrix: Matrix, broken: Sequence[Broken], failures: Sequence[str]) -> list[str]:
    parts = []
    if matrix.config.limit:
        said = f"{len(broken)} times beyond a limit" if broken else "all limits kept"
        parts.append(f"<p class='{'bad' if broken else 'good'}'>{said}</p>")
        limits = [["column", "limit", "source"]]
        for limit in matrix.config.limit:
            doubt = "" if limit.checked else " (not compared with the text)"
            limits.append([limit.column, limit_text(limit), limit.source + doubt])
        parts += [_table(limits), *(f"<p class='bad'>{_text(one.text())}</p>" for one in broken)]
    return parts + [f"<p class='bad'>{_text(failure)}</p>" for failure in failures]


def _pictures(
    matrix: Matrix, rows: Sequence[Row], tables: Mapping[str, Array], more: Sequence[tuple[str, Any]]
) -> tuple[list[str], list[str]]:
    try:
        columns = ("scenario", *matrix.columns)
        figures = [*more, *condition_figures(tables), *setting_figures(rows, columns)]
        return [html_image(figure, _text(caption)) for caption, figure in figures], []
    except MissingExtraError as error:
        return [], [str(error)]


def _table(rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{_text(cell)}</th>" for cell in rows[0])
    body = "".join(f"<tr>{''.join(f'<td>{_text(cell)}</td>' for cell in row)}</tr>" for row in rows[1:])
    return f"<div class='wide'><table><tr>{head}</tr>{body}</table></div>"


def _text(words: str) -> str:
    return html.escape(words)
