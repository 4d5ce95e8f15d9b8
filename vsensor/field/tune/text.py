"""What tuning says when it is done, and its pages of pictures (P1 fig. 3.9 to 3.11, 3.7)."""

from pathlib import Path
from typing import Any

import numpy as np

from vsensor.error_model import ErrorModel
from vsensor.field.tune.correlation import time_curve
from vsensor.field.tune.survey import REACH_BINS, REACH_STEP_M
from vsensor.field.tune.tuned import Condition, Tuned, shown_row
from vsensor.pages import COLOURS, density, new_figure, png_of, require_folder
from vsensor.study.table import replace_file

LONG = 10.0
"""Correlation times that a block lasts at least: it then misses a tenth of the variance between blocks."""
SHOWN_RANGES_M = (10.0, 20.0, 50.0, 80.0)


def text_lines(tuned: Tuned) -> list[str]:
    """Return what was learned, a block per model."""
    lines = [tuned.library.source]
    for one in tuned.conditions:
        lines += ["", *_lines(one)]
        if tuned.block_s < LONG * one.model.correlation_time_s:
            lines.append(
                f"  blocks of {tuned.block_s:g} s hardly outlast the correlation: intervals are too narrow; "
                f"--block {LONG * one.model.correlation_time_s:.0f} or more was expected"
            )
    if tuned.skipped:
        lines += ["", f"no rows, so no model of their own: {', '.join(tuned.skipped)}"]
    return lines


def _lines(one: Condition) -> list[str]:
    model, seen = one.model, ~one.model.blind
    place = int(np.argmin(np.abs(model.levels - 0.95)))
    busiest = int(np.argmax(np.where(seen, model.seconds, 0.0).sum(axis=0)))
    half = 0.5 * (model.absolute_high_m[place] - model.absolute_low_m[place]) / model.absolute_m[place]
    lines = [
        f"model {one.name!r}: {seen.mean():.0%} of {seen.size} cells known, the others are blind",
        f"  {model.levels[place]:.0%} of |e| at {model.speed_mps[busiest]:.1f} m/s, 95 % interval, driving:",
    ]
    for range_m in SHOWN_RANGES_M:
        row = int(np.argmin(np.abs(model.range_m - range_m)))
        if seen[row, busiest]:
            low, high = (s[place, row, busiest] for s in (model.absolute_low_m, model.absolute_high_m))
            lines.append(
                f"    {model.range_m[row]:5.0f} m  {model.absolute_m[place, row, busiest]:.3f} m  "
                f"[{low:.3f}, {high:.3f}]  {model.seconds[row, busiest] / 60.0:.0f} min"
            )
    lines.append(f"  interval, half of it over the value: median {np.nanmedian(half[seen]):.1%}")
    lines.append(
        f"  correlation time {model.correlation_time_s:.2f} s, length {model.correlation_length_m:.0f} m; "
        f"operating range {model.region_range_m[0]:.0f} m at {model.region_speed_mps[0]:.0f} m/s to "
        f"{model.region_range_m[-1]:.0f} m at {model.region_speed_mps[-1]:.0f} m/s"
    )
    if one.spread.between_logs > 1.0:
        lines.append(
            f"  from log to log errors vary {one.spread.between_logs:.1f} times as much as within logs "
            "(variance of shares): the intervals take it in"
        )
    if len(model.dwell_levels):
        lost, kept = (np.interp(0.5, model.dwell_levels, s) for s in (model.lost_dwell_s, model.seen_dwell_s))
        lines.append(f"  a line stays lost for {lost:.2f} s, seen for {kept:.1f} s (medians)")
    if one.closed is not None:
        lines.append(
            f"  through the fit: the middle 95 % would miss by {one.closed.missed_open[1]:.1%} on average "
            f"(largest {one.closed.missed_open[0]:.0%}), corrected {one.closed.missed[1]:.1%} "
            f"({one.closed.missed[0]:.0%})"
        )
    return lines


def write_plots(folder: Path, tuned: Tuned) -> list[Path]:
    """Write the pages into a folder; raises MissingExtraError without matplotlib, ConfigError."""
    require_folder(folder)
    written = []
    for one in tuned.conditions:
        pages = {
            "surface": surface_page(one.model),
            "confidence": confidence_page(one),
            "reach": reach_page(one, tuned),
            "correlation": correlation_page(one),
        }
        for name, figure in pages.items():
            path = folder / f"{one.name}_{name}.png"
            replace_file(path, png_of(figure))
            written.append(path)
    return written


def surface_page(model: ErrorModel) -> Any:
    """Draw the surfaces over range and speed (P1 fig. 3.11); blind cells are left out."""
    figure = new_figure(12.0, 8.0)
    chosen = np.unique([0, len(model.levels) // 2, int(np.argmin(np.abs(model.levels - 0.95)))])
    speed, range_m = np.meshgrid(model.speed_mps, model.range_m)
    shown = [np.where(model.blind, np.nan, model.absolute_m[k]) for k in chosen]
    for column, (k, surface) in enumerate(zip(chosen, shown, strict=True)):
        axes = figure.add_subplot(2, len(chosen), column + 1, projection="3d")
        axes.plot_surface(speed, range_m, surface, cmap="viridis", vmin=0.0, vmax=np.nanmax(shown[-1]))
        axes.set(xlabel="speed (m/s)", ylabel="range (m)", zlabel="|error| (m)")
        axes.set_title(f"{model.levels[k]:.0%} of the errors are below", fontsize=9)
        flat = figure.add_subplot(2, len(chosen), len(chosen) + column + 1)
        mesh = flat.pcolormesh(model.speed_mps, model.range_m, surface, cmap="viridis", vmin=0.0)
        figure.colorbar(mesh, ax=flat, label="|error| (m)")
        flat.set(xlabel="speed (m/s)", ylabel="range (m)")
        flat.plot(model.region_speed_mps, model.region_range_m, color=COLOURS[1], label="operating range")
        flat.legend(loc="lower right", fontsize=7)
    return figure


def confidence_page(one: Condition) -> Any:
    """Draw each level over range at the busiest speed, and over speed at 20 m (P1 fig. 3.9, 3.10).

    Over speed thin lines are what each speed alone says, before the low-pass.
    """
    model, figure = one.model, new_figure(11.0, 4.5)
    seen = ~model.blind
    column = int(np.argmax(np.where(seen, model.seconds, 0.0).sum(axis=0)))
    row = shown_row(model)
    over_range, over_speed = figure.subplots(1, 2)
    for k, level in enumerate(model.levels):
        colour = COLOURS[k % len(COLOURS)]
        for axes, x, part in (
            (over_range, model.range_m, np.s_[:, column]),
            (over_speed, model.speed_mps, np.s_[row, :]),
        ):
            known = seen[part]
            line = np.where(known, model.absolute_m[k][part], np.nan)
            axes.plot(x, line, color=colour, label=f"{level:.0%}")
            low, high = model.absolute_low_m[k][part], model.absolute_high_m[k][part]
            axes.fill_between(x, low, high, where=known, color=colour, alpha=0.25, lw=0)
        over_speed.plot(model.speed_mps, one.unfiltered_m[k], color=colour, lw=0.6, alpha=0.6)
    over_range.set(xlabel="range (m)", ylabel="|error| (m)")
    over_range.set_title(
        f"confidence levels at {model.speed_mps[column]:.1f} m/s, 95 % intervals", fontsize=9
    )
    over_speed.set(xlabel="speed (m/s)", ylabel="|error| (m)")
    over_speed.set_title(f"at {model.range_m[row]:.0f} m, unfiltered and through the low-pass", fontsize=9)
    over_speed.legend(
        [over_speed.lines[1], over_speed.lines[0]], ["unfiltered", "filtered"], fontsize=7, loc="upper left"
    )
    over_range.legend(fontsize=7, loc="upper left")
    return figure


def reach_page(one: Condition, tuned: Tuned) -> Any:
    """Draw reported range against speed (P1 fig. 3.7), and the driving behind each cell (3.6)."""
    model = one.model
    figure = new_figure(11.0, 4.5)
    reach, driving = figure.subplots(1, 2)
    step = float(model.speed_mps[1] - model.speed_mps[0])
    speeds = np.arange(len(model.speed_mps) + 1) * step - 0.5 * step
    counts = tuned.survey.reach[one.place, : len(model.speed_mps)].astype(float)
    density(reach, speeds, np.arange(REACH_BINS + 1) * REACH_STEP_M, counts, "images")
    reach.plot(model.region_speed_mps, model.region_range_m, color=COLOURS[1], label="operating range")
    reach.set(xlabel="speed (m/s)", ylabel="reported range (m)", ylim=(0.0, 1.2 * model.region_range_m.max()))
    reach.legend(fontsize=7, loc="lower right")
    mesh = driving.pcolormesh(model.speed_mps, model.range_m, model.seconds / 60.0, cmap="viridis")
    figure.colorbar(mesh, ax=driving, label="driving within the filter's width (min)")
    driving.contour(model.speed_mps, model.range_m, model.blind, levels=[0.5], colors=COLOURS[1])
    driving.set(xlabel="speed (m/s)", ylabel="range (m)", title="inside of the line: not blind")
    return figure


def correlation_page(one: Condition) -> Any:
    """Draw the correlation in time with the exponential that was fitted, and the quality's steps."""
    model = one.model
    figure = new_figure(11.0, 4.5)
    time, quality = figure.subplots(1, 2)
    lags, rho = time_curve(one.sums.time[one.place][:, :, :-1], model.quality_period_s)
    fine = np.linspace(0.0, float(lags[-1]), 200)
    time.plot(lags, rho, "o", color=COLOURS[0], label="recorded")
    time.plot(fine, np.exp(-fine / model.correlation_time_s), color=COLOURS[1], label="fitted")
    time.set(xlabel="lag (s)", ylabel="correlation of the error's normal score")
    time.legend(fontsize=7, loc="upper right")
    if len(model.quality_step):
        mesh = quality.imshow(model.quality_step, cmap="viridis", vmin=0.0, vmax=1.0)
        figure.colorbar(mesh, ax=quality, label="probability of a step")
        quality.set(xlabel="quality of the next image", ylabel="quality of an image")
    return figure
