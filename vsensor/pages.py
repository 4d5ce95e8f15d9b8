"""What all pages of pictures share: figures of matplotlib, an extra."""

import base64
import io
import os
from pathlib import Path
from typing import Any

from vsensor.errors import ConfigError, MissingExtraError

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56B4E9", "#999999")
"""Okabe and Ito."""
DENSITY = "viridis"


def new_figure(width: float = 9.0, height: float = 6.0, purpose: str = "a picture") -> Any:
    """Return an empty figure; raises MissingExtraError without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plots", purpose) from None
    return Figure(figsize=(width, height), dpi=110, layout="constrained")


def png_of(figure: Any) -> bytes:
    """Return the figure as a PNG."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    return picture.getvalue()


def html_image(figure: Any, text: str) -> str:
    """Return an image for a page that loads nothing from outside."""
    content = base64.b64encode(png_of(figure)).decode()
    image = f'<img alt="{text}" src="data:image/png;base64,{content}">'
    return f"<figure>{image}<figcaption>{text}</figcaption></figure>"


def pdf_of(figures: list[Any]) -> bytes:
    """Return the figures as the pages of a PDF."""
    from matplotlib.backends.backend_pdf import PdfPages

    content = io.BytesIO()
    with PdfPages(content) as pages:
        for figure in figures:
            pages.savefig(figure)
    return content.getvalue()


def density(axes: Any, x: Any, y: Any, counts: Any, label: str) -> None:
    """Draw counts (X, Y) between edges `x`, `y` as a map on a logarithmic scale; empty places stay white."""
    import numpy as np
    from matplotlib.colors import LogNorm

    shown = np.ma.masked_less_equal(counts.T, 0.0)
    if shown.count():
        least, most = float(shown.min()), float(shown.max())
        norm = LogNorm(vmin=least, vmax=max(most, least * 1.001))
        mesh = axes.pcolormesh(x, y, shown, cmap=DENSITY, norm=norm)
        axes.figure.colorbar(mesh, ax=axes, label=label)


def require_place(path: Path) -> None:
    """Refuse a file that could not be written, before the work that it is for; raises ConfigError."""
    if path.is_dir():
        raise ConfigError(f"{path}: cannot be written: is a folder")
    if not path.parent.is_dir():
        raise ConfigError(f"{path}: cannot be written: there is no folder {path.parent}")
    if not os.access(path.parent, os.W_OK):
        raise ConfigError(f"{path}: cannot be written: {path.parent} may not be changed")


def require_pictures(folder: Path, purpose: str) -> None:
    """Make a folder for pictures, before the work that they show.

    Raises MissingExtraError without matplotlib, ConfigError.
    """
    new_figure(purpose=purpose)
    require_folder(folder)


def require_folder(path: Path) -> None:
    """Make a folder of results; raises ConfigError where it cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be made: {error.strerror or error}") from None
