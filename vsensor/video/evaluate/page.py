"""The report of an evaluation: one HTML page that loads nothing from outside."""

import base64
import html
from collections.abc import Sequence
from typing import Any

from vsensor.pages import html_image

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 86em; padding: 0 1em; color: #222 }
table { border-collapse: collapse; font-size: 13px; margin: .6em 0 }
td, th { padding: .2em .5em; border-bottom: 1px solid #ddd; text-align: right }
th { max-width: 7em; vertical-align: bottom } td:first-child, th:first-child { text-align: left }
.beside { display: flex; flex-wrap: wrap; gap: 0 2.5em } figure { margin: 1.5em 0 } img { max-width: 100% }
figcaption { color: #555 } .note { color: #555 }
"""


def page_of(title: str, parts: Sequence[str]) -> str:
    """Return the page of a title and its parts, HTML each."""
    head = f"<meta charset='utf-8'><title>{text(title)}</title><style>{STYLE}</style>"
    body = "\n".join([f"<h1>{text(title)}</h1>", *parts])
    return f"<!doctype html><html lang='en'><head>{head}</head><body>{body}</body></html>\n"


def beside(tables: Sequence[tuple[str, Sequence[Sequence[str]]]]) -> str:
    """Return tables with their titles, side by side where there is room."""
    parts = "".join(f"<div><h3>{text(title)}</h3>{table(rows)}</div>" for title, rows in tables)
    return f"<div class='beside'>{parts}</div>"


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return a table; the first row are its headings."""
    head = "".join(f"<th>{text(cell)}</th>" for cell in rows[0])
    body = "".join(f"<tr>{''.join(f'<td>{text(cell)}</td>' for cell in row)}</tr>" for row in rows[1:])
    return f"<table><tr>{head}</tr>{body}</table>"


def paragraph(words: str) -> str:
    """Return a sentence that explains."""
    return f"<p class='note'>{text(words)}</p>"


def drawing(figure: Any, caption: str) -> str:
    """Return a figure of matplotlib."""
    return html_image(figure, text(caption))


def photograph(image: Any, caption: str) -> str:
    """Return an image (H, W, 3), blue first, as a JPEG in the page."""
    from vsensor.image import import_opencv

    cv2 = import_opencv("a picture of a report")
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 85])
    content = base64.b64encode(data.tobytes()).decode()
    picture = f'<img alt="{text(caption)}" src="data:image/jpeg;base64,{content}">'
    return f"<figure>{picture}<figcaption>{text(caption)}</figcaption></figure>"


def text(words: str) -> str:
    """Return words as HTML."""
    return html.escape(words)
