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
.beside tr:first-child th { text-align: center } .wide { overflow-x: auto }
figure { margin: 1.5em 0 } img { max-width: 100% }
figcaption { color: #555 } .note { color: #555 }
"""


def page_of(title: str, parts: Sequence[str]) -> str:
    """Return the page of a title and its parts, HTML each."""
    head = f"<meta charset='utf-8'><title>{text(title)}</title><style>{STYLE}</style>"
    body = "\n".join([f"<h1>{text(title)}</h1>", *parts])
    return f"<!doctype html><html lang='en'><head>{head}</head><body>{body}</body></html>\n"


def beside(tables: Sequence[tuple[str, Sequence[Sequence[str]]]]) -> str:
    """Return tables that begin with the same column as one, their titles above their columns."""
    names = [row[0] for row in tables[0][1]]
    titles = "".join(f"<th colspan='{len(rows[0]) - 1}'>{text(title)}</th>" for title, rows in tables)
    lines = []
    for name in names:
        cell = "th" if name == names[0] else "td"
        found = [name]
        for _, rows in tables:
            known = {row[0]: row[1:] for row in rows}
            found += known.get(name, [""] * (len(rows[0]) - 1))
        lines.append("<tr>" + "".join(f"<{cell}>{text(word)}</{cell}>" for word in found) + "</tr>")
    return f"<div class='wide'><table class='beside'><tr><th></th>{titles}</tr>{''.join(lines)}</table></div>"


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
