"""The report of a run: how often the lines were there, offsets over time, pictures with them drawn."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from vsensor.pages import COLOURS, new_figure
from vsensor.types import Array, BoolArray
from vsensor.video.evaluate.page import drawing, page_of, paragraph, photograph, table
from vsensor.video.methods import Setup
from vsensor.video.rows import Rows
from vsensor.video.types import Picture
from vsensor.video.views import MAGENTA, Signal, Views

SIDES = ("left", "right")


def shares(rows: Rows) -> list[str]:
    """Return how often each line was seen, and what the lane's width was, as lines for a person."""
    left, right = rows.left_confidence > 0, rows.right_confidence > 0
    parts = [
        f"{name} {_percent(seen)}"
        for name, seen in (("left", left), ("right", right), ("both", left & right))
    ]
    return [
        f"offsets seen in pictures: {', '.join(parts)}",
        f"lane width {_spread(rows.lane_width_m, left & right)}",
    ]


def _percent(mask: BoolArray) -> str:
    return f"{100.0 * float(np.mean(mask)):.1f} %" if len(mask) else "-"


def _spread(values: Array, mask: BoolArray) -> str:
    known = values[mask & np.isfinite(values)]
    return f"{known.mean():.2f} m, standard deviation {known.std():.3f} m" if len(known) else "unknown"


def report_page(
    title: str,
    told: Sequence[Sequence[str]],
    rows: Rows,
    setup: Setup,
    spread: Sequence[Picture],
    notes: Sequence[str],
) -> str:
    """Return the page; `told` are lines of what was run, `spread` pictures of which each has its row."""
    parts = [table([["run", ""], *told]), table(_numbers(rows)), *map(paragraph, notes)]
    parts += [
        paragraph(
            "Offsets are from the vehicle's centreline to the marking's inner edge at the front axle, "
            "positive to the left; nothing is drawn where nothing was seen. Confidence is 0 (none) to 4."
        ),
        drawing(over_time(rows), "Offsets, lane width, heading and confidence over time"),
        "<h2>Pictures</h2>",
        paragraph("The offsets as seen, drawn where the camera has them, 15 m ahead of the front axle."),
        *_photographs(rows, setup, spread),
    ]
    return page_of(title, parts)


def _numbers(rows: Rows) -> list[list[str]]:
    lines = [["", "seen", "mean", "standard deviation"]]
    for name, values, unit in (
        ("left offset", rows.left_offset_m, "m"),
        ("right offset", rows.right_offset_m, "m"),
        ("lane width", rows.lane_width_m, "m"),
        ("heading", np.degrees(rows.heading_rad), "deg"),
    ):
        known = values[np.isfinite(values)]
        figures = [f"{known.mean():.3f} {unit}", f"{known.std():.3f} {unit}"] if len(known) else ["-", "-"]
        lines.append([name, _percent(np.isfinite(values)), *figures])
    return lines


def over_time(rows: Rows) -> Any:
    """Return the figure of all columns over time."""
    figure = new_figure(9.0, 9.0, "--report")
    axes = figure.subplots(4, 1, sharex=True, height_ratios=[3, 1.5, 1.5, 1])
    axes[0].plot(rows.t_s, rows.left_offset_m, ".-", color=COLOURS[0], ms=3, lw=0.8, label="left")
    axes[0].plot(rows.t_s, rows.right_offset_m, ".-", color=COLOURS[1], ms=3, lw=0.8, label="right")
    axes[0].legend(loc="center right")
    axes[0].set_ylabel("lane offset, m")
    axes[1].plot(rows.t_s, rows.lane_width_m, ".-", color=COLOURS[2], ms=3, lw=0.8)
    axes[1].set_ylabel("lane width, m")
    axes[2].plot(rows.t_s, np.degrees(rows.heading_rad), ".-", color=COLOURS[4], ms=3, lw=0.8)
    axes[2].set_ylabel("heading, deg")
    for side, colour, shift in zip(SIDES, COLOURS, (0.05, -0.05), strict=False):
        axes[3].step(rows.t_s, getattr(rows, f"{side}_confidence") + shift, color=colour, lw=0.8, where="mid")
    axes[3].set_ylim(-0.3, 4.3)
    axes[3].set_ylabel("confidence")
    axes[3].set_xlabel("time, s")
    for one in axes:
        one.grid(alpha=0.3)
    return figure


def _photographs(rows: Rows, setup: Setup, spread: Sequence[Picture]) -> list[str]:
    views = Views(setup.camera, setup.vehicle.wheelbase_m)
    found = []
    for picture in spread:
        place = int(np.searchsorted(rows.t_s, picture.t_ns / 1e9 - 1e-9))
        left_m, right_m = float(rows.left_offset_m[place]), float(rows.right_offset_m[place])
        signal = Signal(
            name="video",
            colour=MAGENTA,
            left_m=left_m,
            right_m=right_m,
            heading_rad=float(rows.heading_rad[place]),
        )
        caption = f"{picture.t_ns / 1e9:.2f} s: left {_metres(left_m)}, right {_metres(right_m)}"
        found.append(photograph(views.both(picture, [signal]), caption))
    return found


def _metres(value: float) -> str:
    return f"{value:+.2f} m" if np.isfinite(value) else "not seen"
