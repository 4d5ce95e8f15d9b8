"""Figures of the page as the browser's plots take them: plain dicts, no library."""

import math
from typing import Any

import numpy as np

from vsensor.apps.examine.causes import cause_name, stretches
from vsensor.apps.examine.decimate import decimated
from vsensor.apps.examine.drive import Drive
from vsensor.apps.examine.views import Series, View, series_of
from vsensor.pages import COLOURS as PALETTE
from vsensor.types import SIDE_NAMES, Array, Side, Unseen

Figure = dict[str, Any]

STRIPS = 1200
"""Columns of the quality strips: about as many as a page has pixels there."""
FONT = {"family": "system-ui, sans-serif", "size": 12}
MARGIN = {"l": 92, "r": 14, "t": 26, "b": 40}
QUALITY_COLOURS = ("#ffffff", "#cc79a7", "#e69f00", "#56b4e9", "#0072b2")
_ROWS = (Side.RIGHT, Side.LEFT)


def analysis_figure(drive: Drive, view: View, low: float = -math.inf, high: float = math.inf) -> Figure:
    """Return the analysis window from `low` to `high`, decimated so that no peak is lost."""
    curves, y_title = series_of(drive, view)
    is_empty = not any(np.isfinite(curve.y).any() for curve in curves)
    layout = _layout(view.x_title, y_title)
    layout |= {"uirevision": f"{view.function} {view.sort} {view.signal}", "showlegend": len(curves) > 1}
    if math.isfinite(low) and math.isfinite(high):
        layout["xaxis"] |= {"range": [low, high], "autorange": False}
    if view.is_one_image:
        layout["title"] = {"text": f"image {view.number}, {drive.t_s[view.number]:.2f} s", "font": FONT}
    if is_empty:
        layout["annotations"] = [_note("nothing to show: not reported, masked, or beyond the range")]
    return {"data": [_curve(curve, view, low, high) for curve in curves], "layout": layout}


def quality_figure(drive: Drive) -> Figure:
    """Return the timeline: the least quality of each line in every stretch, and causes where known."""
    layout = _layout("time (s)", "")
    layout["yaxis"] |= {"tickvals": [], "ticktext": []}
    data: list[dict[str, Any]] = []
    edges = np.linspace(0, len(drive), min(STRIPS, len(drive)) + 1).astype(np.int64)
    rows = [SIDE_NAMES[side] for side in _ROWS]
    strips = [np.minimum.reduceat(drive.images.lines[side].quality, edges[:-1]).tolist() for side in _ROWS]
    places = [1.0, 2.0]
    steps = [(k / 5, colour) for k, colour in enumerate(QUALITY_COLOURS)]
    scale = [
        point for k, (low, colour) in enumerate(steps) for point in ([low, colour], [(k + 1) / 5, colour])
    ]
    data.append(
        {
            "type": "heatmap",
            "x": drive.t_s[edges[:-1]].tolist(),
            "y": places,
            "z": strips,
            "zmin": -0.5,
            "zmax": 4.5,
            "colorscale": scale,
            "showscale": False,
            "hovertemplate": "%{x:.2f} s: quality %{z}<extra></extra>",
        }
    )
    names = [f"{row} quality" for row in rows]
    if drive.causes:
        data += _causes(drive)
        places, names = [*places, 3.0, 4.0], [*names, *(f"{row} cause" for row in rows)]
    layout["yaxis"] |= {"tickvals": places, "ticktext": names, "range": [0.4, max(places) + 0.6]}
    layout["legend"] = {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0, "font": {"size": 10}}
    data += [_key(f"quality {k}" if k else "not reported", c) for k, c in enumerate(QUALITY_COLOURS)]
    return {"data": data, "layout": layout}


def _key(name: str, colour: str) -> dict[str, Any]:
    """Return an entry of the legend for a colour of the strips."""
    marker = {"symbol": "square", "size": 10, "color": colour, "line": {"width": 1, "color": "#444444"}}
    return {"type": "scatter", "x": [None], "y": [None], "mode": "markers", "name": name, "marker": marker}


def _causes(drive: Drive) -> list[dict[str, Any]]:
    """Return a thick line for each cause, in pieces where it holds."""
    found: dict[int, tuple[list[float | None], list[float | None]]] = {}
    end_s = float(drive.t_s[-1])
    least_s = end_s / STRIPS
    for place, side in zip((3.0, 4.0), _ROWS, strict=True):
        for run in stretches(drive.causes[side]):
            if math.isnan(run.value) or run.value == Unseen.SEEN:
                continue
            first_s = float(drive.t_s[run.first])
            x, y = found.setdefault(int(run.value), ([], []))
            x += [first_s, max(float(drive.t_s[run.last]), first_s + least_s), None]
            y += [place, place, None]
    return [
        {
            "type": "scatter",
            "mode": "lines",
            "x": x,
            "y": y,
            "name": cause_name(code),
            "line": {"width": 12, "color": PALETTE[k % len(PALETTE)]},
            "hoverinfo": "name",
        }
        for k, (code, (x, y)) in enumerate(sorted(found.items()))
    ]


def _curve(curve: Series, view: View, low: float, high: float) -> dict[str, Any]:
    kept = decimated(curve.x, curve.y, low, high)
    is_line = view.is_one_image or view.sort == "time"
    return {
        "type": "scatter",
        "mode": "lines+markers" if view.is_one_image else "lines" if is_line else "markers",
        "x": _cells(curve.x[kept]),
        "y": _cells(curve.y[kept]),
        "customdata": curve.numbers[kept].tolist(),
        "name": curve.name,
        "line": {"color": curve.colour, "width": 1.3, "dash": "dot" if curve.is_other else "solid"},
        "marker": {"color": curve.colour, "size": 4, "symbol": "x" if curve.is_other else "circle"},
        "connectgaps": False,
        "hovertemplate": "%{x:.3f}: %{y:.4g}, image %{customdata}<extra>" + curve.name + "</extra>",
    }


def _cells(values: Array) -> list[float | None]:
    return [None if value != value else value for value in values.tolist()]


def _layout(x_title: str, y_title: str) -> dict[str, Any]:
    axis = {"zeroline": False, "gridcolor": "#dddddd", "linecolor": "#444444", "automargin": False}
    return {
        "xaxis": {"title": {"text": x_title, "standoff": 4}, **axis},
        "yaxis": {"title": {"text": y_title, "standoff": 4}, **axis},
        "margin": dict(MARGIN),
        "font": FONT,
        "paper_bgcolor": "rgba(0,0,0,0)",  # the cursor stands behind
        "plot_bgcolor": "rgba(0,0,0,0)",
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0},
    }


def _note(text: str) -> dict[str, Any]:
    place = {"xref": "paper", "yref": "paper", "x": 0.5, "y": 0.5, "showarrow": False}
    return {"text": text, "font": {"size": 14}, **place}
