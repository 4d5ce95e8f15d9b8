"""The pictures of a sensitivity analysis (P2 fig. 3.17 to 3.20, and all parameters together)."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from vsensor.pages import COLOURS, new_figure
from vsensor.video.sensitivity.one_by_one import Course
from vsensor.video.sensitivity.reproject import ANGLES, DISTANCES, PARAMETERS
from vsensor.video.sensitivity.together import Shares

COLOUR = dict(zip(PARAMETERS, COLOURS, strict=False))


def published_plots(courses: Mapping[str, Course]) -> Any:
    """Draw the four published plots: relative and absolute change, with angles and with distances."""
    figure = new_figure(11.0, 8.0)
    panels = figure.subplots(2, 2, sharex="col", sharey="row")
    for column, (names, label) in enumerate(((ANGLES, "angle (deg)"), (DISTANCES, "distance (m)"))):
        for row, (key, unit) in enumerate(
            (("mean_percent", "relative change (%)"), ("mean_m", "change (m)"))
        ):
            axes = panels[row, column]
            for name in names:
                _course(axes, name, courses[name], key)
            axes.axhline(0.0, color="black", lw=0.6)
            axes.axvline(0.0, color="black", lw=0.6)
            axes.set_title(f"{unit.split(' (')[0]} of the distance to the marking", fontsize=10)
            axes.legend(fontsize=8)
            if column == 0:
                axes.set_ylabel(f"original less changed, {unit}")
        panels[1, column].set_xlabel(f"change of the {label}")
    return figure


def _course(axes: Any, name: str, course: Course, key: str) -> None:
    for row, (side, style) in enumerate((("left", "-"), ("right", "--"))):
        values = getattr(course, key)[row]
        axes.plot(course.change, values, style, color=COLOUR[name], lw=1.4, label=f"{name}, {side}")
        if key == "mean_m":
            axes.fill_between(
                course.change, course.low_m[row], course.high_m[row], color=COLOUR[name], alpha=0.12, lw=0
            )


def share_plots(together: Shares, within: Mapping[str, float]) -> Any:
    """Draw what each parameter has of the variance, and what pairs have together."""
    figure = new_figure(11.0, 4.2)
    bars, matrix = figure.subplots(1, 2)
    names = list(PARAMETERS)
    x = np.arange(len(names))
    for place, (label, found) in enumerate((("alone", together.first), ("with others", together.total))):
        share, half = 100.0 * np.array([found[name] for name in names]).T
        bars.bar(
            x + 0.36 * place - 0.18, share, 0.36, yerr=half, color=COLOURS[place], label=label, capsize=2
        )
    bars.set_xticks(x, [f"{name}\n+-{within[name]:g} {PARAMETERS[name]}" for name in names], fontsize=8)
    bars.set(ylabel="share of the variance (%)", title="all parameters together")
    bars.legend(fontsize=8)
    joint = np.full((len(names), len(names)), np.nan)
    for (one, other), (value, _) in together.joint.items():
        joint[names.index(other), names.index(one)] = 100.0 * value
    most = max(float(np.nanmax(np.abs(joint))), 0.1)
    mesh = matrix.imshow(joint, cmap="PuOr", vmin=-most, vmax=most)
    figure.colorbar(mesh, ax=matrix, label="share of the variance (%)")
    for row, column in zip(*np.nonzero(np.isfinite(joint)), strict=True):
        matrix.text(column, row, f"{joint[row, column]:.2f}", ha="center", va="center", fontsize=8)
    matrix.set_xticks(x, names, fontsize=8)
    matrix.set_yticks(x, names, fontsize=8)
    matrix.set_title("joint effects of pairs", fontsize=10)
    return figure
