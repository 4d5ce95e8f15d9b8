"""Pictures of a lane departure: the distance to the lane's edge and the lateral acceleration over time."""

from typing import Any

import numpy as np

from vsensor.experiment.matrix import Matrix
from vsensor.experiment.plan import Plan
from vsensor.pages import COLOURS, new_figure
from vsensor.study.cells import Outcome

MOST_RUNS = 60
"""So many courses are drawn in one picture, the first ones."""


def course_figures(plan: Plan, outcome: Outcome, matrix: Matrix) -> list[tuple[str, Any]]:
    """Return (caption, figure) for each scenario: every run's course, with the limits that are drawn there.

    Raises MissingExtraError without matplotlib.
    """
    found = []
    for entry in matrix.config.scenarios:
        runs = [
            (told, result)
            for told, result in zip(plan.told, outcome.results, strict=True)
            if result is not None and told["scenario"] == entry and result.get("course")
        ]
        if runs:
            found.append((f"{entry}: courses of {len(runs)} runs", _courses(runs[:MOST_RUNS], entry, matrix)))
    return found


def _courses(runs: list[tuple[dict[str, Any], dict[str, Any]]], entry: str, matrix: Matrix) -> Any:
    figure = new_figure(9.0, 5.4, "the report's pictures")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for number, (told, result) in enumerate(runs):
        colour = COLOURS[number % len(COLOURS)]
        t, dtle, _, acceleration, _ = np.array(result["course"], dtype=np.float64).T
        words = " ".join(str(told[column]) for column in matrix.columns)
        upper.plot(t, dtle, color=colour, lw=1.0, label=words if number < 2 * len(COLOURS) else None)
        lower.plot(t, acceleration, color=colour, lw=0.8)
    upper.axhline(0.0, color="black", lw=0.8)
    for limit in matrix.config.limit:
        for_this = not limit.scenarios or entry in limit.scenarios
        if limit.column == "dtle_min_m" and limit.at_least is not None and for_this:
            upper.axhline(limit.at_least, color="#b00000", lw=1.0, ls="--")
    upper.set_ylabel("tyre to lane edge, m")
    lower.set_ylabel("lateral acceleration,\nm/s\N{SUPERSCRIPT TWO}")
    lower.set_xlabel("time, s")
    upper.legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    for panel in (upper, lower):
        panel.grid(visible=True, lw=0.3)
    return figure
