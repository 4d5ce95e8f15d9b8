"""The pictures of an evaluation (P2 fig. 3.6 to 3.16, and what it did not show). Needs matplotlib."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import norm

from vsensor.pages import COLOURS, new_figure
from vsensor.types import Array
from vsensor.video.evaluate.categories import Compared, errors_in
from vsensor.video.evaluate.statistics import Moments, Pooled

BINS = 50
WIDEST_M, NARROWEST_M = 1.0, 0.05
"""Histograms end at the 99.5 % quantile of |e|, within these; what lies beyond is told."""
LEAST_STD_M = 1e-4
"""Narrower normal distributions are not drawn."""
SHOWN = ("general", "daytime", "nighttime", "straight", "curvy", "constant speed", "non-constant speed")


def histograms(events: Sequence[Compared], figures: Mapping[str, Pooled], shown: Sequence[str]) -> Any:
    """Draw the errors of some categories with the normal distribution of their mean and total deviation.

    Dashed is the published one, whose deviation leaves out what events differ by.
    """
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure = new_figure(4.4 * columns, 3.2 * rows)
    panels = figure.subplots(rows, columns, squeeze=False)
    for axes, name in zip(panels.flat, shown, strict=False):
        _histogram(axes, np.concatenate([np.empty(0), *errors_in(name, events)]), figures[name])
        axes.set_title(name, fontsize=10)
    for axes in list(panels.flat)[len(shown) :]:
        axes.set_axis_off()
    handles, labels = panels.flat[0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return figure


def _histogram(axes: Any, errors: Array, one: Pooled) -> None:
    axes.set(xlabel="error, positive too far out (m)", ylabel="density (1/m)")
    if not len(errors):
        axes.text(0.5, 0.5, "no measurement", ha="center", va="center", transform=axes.transAxes)
        return
    widest = float(np.clip(np.quantile(np.abs(errors), 0.995), NARROWEST_M, WIDEST_M))
    edges = np.linspace(-widest, widest, BINS + 1)
    inside = np.abs(errors) <= widest
    counts, _ = np.histogram(errors[inside], edges)
    axes.stairs(
        counts / (len(errors) * (edges[1] - edges[0])),
        edges,
        fill=True,
        color=COLOURS[0],
        alpha=0.45,
        label="errors",
    )
    x = np.linspace(-widest, widest, 401)
    total = np.sqrt(max(one.rms_m**2 - one.mean_m**2, 1e-12))
    axes.plot(x, norm.pdf(x, one.mean_m, total), color=COLOURS[1], lw=1.4, label="normal, total deviation")
    if one.within_m > LEAST_STD_M:
        label = "normal, published deviation"
        axes.plot(x, norm.pdf(x, one.mean_m, one.within_m), "--", color=COLOURS[2], lw=1.2, label=label)
    axes.axvline(0.0, color="black", lw=0.6)
    axes.set_xlim(-widest, widest)
    beyond = 100.0 * float(1.0 - inside.mean())
    axes.text(
        0.98,
        0.95,
        f"n {len(errors)}\nmean {one.mean_m:+.3f} m\nRMS {one.rms_m:.3f} m\nbeyond {beyond:.1f} %",
        ha="right",
        va="top",
        fontsize=7,
        transform=axes.transAxes,
    )


def normals(methods: Mapping[str, Mapping[str, Pooled]]) -> Any:
    """Draw the normal distribution of each category, as published (fig. 3.16): a panel for each method."""
    figure = new_figure(5.5 * len(methods), 4.0)
    panels = figure.subplots(1, len(methods), squeeze=False, sharex=True)[0]
    known = [one for figures in methods.values() for one in figures.values() if one.within_m > LEAST_STD_M]
    widest = max((abs(one.mean_m) + 3.0 * one.within_m for one in known), default=1.0)
    x = np.linspace(-widest, widest, 801)
    for axes, (method, figures) in zip(panels, methods.items(), strict=True):
        for name, colour in zip(SHOWN, COLOURS, strict=True):
            if figures[name].within_m > LEAST_STD_M:
                one = figures[name]
                axes.plot(x, norm.pdf(x, one.mean_m, one.within_m), color=colour, label=name, lw=1.3)
        axes.axvline(0.0, color="black", lw=0.6)
        axes.set(xlabel="error, positive too far out (m)", ylabel="density (1/m)", title=method)
    if known:
        panels[-1].legend(fontsize=8)
    return figure


def event_biases(methods: Mapping[str, Sequence[Compared]]) -> Any:
    """Draw each event's mean error and its deviation: what the published deviation leaves out."""
    figure = new_figure(9.0, 1.0 + 2.4 * len(methods))
    panels = figure.subplots(len(methods), 1, squeeze=False, sharex=True)[:, 0]
    for axes, (method, events) in zip(panels, methods.items(), strict=True):
        colour = colour_of(method)
        moments = [Moments.of(one.error_m) for one in events]
        x = np.arange(len(moments)) + 1
        mean = np.array([one.mean_m for one in moments])
        night = np.array([one.reference.light == "night" for one in events])
        for marker, chosen, label in (("o", ~night, "day or mixed"), ("s", night, "night")):
            if chosen.any():
                std = np.nan_to_num([one.std_m for one in moments])[chosen]
                face = colour if marker == "o" else "white"
                axes.errorbar(
                    *(x[chosen], mean[chosen], std),
                    **{"fmt": marker, "color": colour, "mfc": face, "ms": 4, "lw": 0.8, "label": label},
                )
        axes.axhline(0.0, color="black", lw=0.6)
        axes.set(ylabel="mean error (m)", title=method)
        axes.legend(fontsize=8)
    panels[-1].set_xlabel("event; bars: standard deviation within it")
    return figure


def offsets_over_time(name: str, t_s: Array, told: Mapping[str, Array], truth: Array | None) -> Any:
    """Draw distances to the left and right marking over time: CAN, methods, truth where there is one."""
    figure = new_figure(9.0, 4.6)
    panels = figure.subplots(2, 1, sharex=True)
    for column, (axes, side) in enumerate(zip(panels, ("left", "right"), strict=True)):
        if truth is not None:
            axes.plot(t_s, np.abs(truth[:, column]), color="black", lw=2.6, alpha=0.25, label="truth")
        for place, (label, offset) in enumerate(told.items()):
            colour = colour_of(label, place)
            axes.plot(t_s, np.abs(offset[:, column]), ".-", color=colour, lw=0.9, ms=3, label=label)
        axes.set_ylabel(f"{side} (m)")
    panels[0].legend(fontsize=8, ncols=4)
    panels[0].set_title(f"{name}: distance to the marking's inner edge at the front axle", fontsize=10)
    panels[1].set_xlabel("time (s)")
    return figure


def colour_of(name: str, place: int = 0) -> str:
    """Return the colour of a signal: P2 has CAN green and its own magenta."""
    known = {"CAN": COLOURS[2], "published": COLOURS[4], "ours": COLOURS[0]}
    return known.get(name, COLOURS[(1, 3, 5)[place % 3]])


def errors_by_confidence(methods: Mapping[str, tuple[Array, Array]]) -> Any:
    """Draw the 95 % of |e| and the number of values for each confidence; (errors, confidences) (M,) each."""
    figure = new_figure(9.0, 3.4)
    left, right = figure.subplots(1, 2)
    for place, (method, (errors, confidence)) in enumerate(methods.items()):
        colour = colour_of(method, place)
        size, share = [], []
        for level in range(1, 5):
            here = np.abs(errors[(confidence == level) & np.isfinite(errors)])
            size.append(float(np.quantile(here, 0.95)) if len(here) else np.nan)
            share.append(100.0 * len(here) / max(len(errors), 1))
        left.plot(range(1, 5), size, "o-", color=colour, label=method)
        right.bar(np.arange(1, 5) + 0.35 * place - 0.17, share, 0.33, color=colour, label=method)
    left.set(xlabel="confidence", ylabel="95 % of |e| (m)", xticks=range(1, 5))
    left.set_ylim(bottom=0.0)
    left.legend(fontsize=8)
    right.set(xlabel="confidence", ylabel="share of all values (%)", xticks=range(1, 5))
    return figure
