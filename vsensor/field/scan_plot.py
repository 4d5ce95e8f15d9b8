"""One page per log: path, lane width, view range, error over range and yaw rate (P1 fig. 2.32, 2.35)."""

from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import TableError
from vsensor.field.masks import CODE
from vsensor.field.rows import Work, block_of, yaw_rate_radps
from vsensor.field.table import Info, Masked
from vsensor.logs.convert import Replacing
from vsensor.pages import new_figure
from vsensor.types import SIDE_NAMES, Array, BoolArray, Side

PLOTTED = 1500
"""Images of which errors are drawn: as many as a page can show."""
COLOURS = {Side.LEFT: "#0072B2", Side.RIGHT: "#D55E00", Side.NEXT_LEFT: "#56B4E9", Side.NEXT_RIGHT: "#E69F00"}
"""Colours told apart by the colour-blind (Okabe and Ito)."""


def draw_log(path: Path, work: Work, info: Info) -> None:
    """Draw a log's page as the suffix says (.png, .pdf, .svg); raises MissingExtraError, TableError."""
    figure = new_figure(11.7, 8.3, purpose="--plots")
    panels = figure.subplot_mosaic(
        [["path", "path", "width"], ["path", "path", "range"], ["error_0", "error_1", "masked"]]
    )
    _path(panels["path"], work)
    _over_time(panels["width"], work, work.width_m, "lane width (m)")
    for side, line in work.images.lines.items():
        x_max = np.where(line.reported & np.isfinite(line.x_max_m), line.x_max_m, np.nan)
        _over_time(panels["range"], work, x_max, "view range (m)", side)
    picked = np.unique(np.linspace(0, len(work.images) - 1, PLOTTED).astype(np.int64))
    for number, side in enumerate((Side.LEFT, Side.RIGHT)):
        _errors(figure, panels[f"error_{number}"], work, side, picked)
    _masked(panels["masked"], work)
    figure.suptitle(
        f"{info['log']}: {info['seconds']:.0f} s, {info['metres'] / 1000:.1f} km, {info['images']} images, "
        f"reference {str(info['reference']).rsplit('/', 1)[-1]}",
        fontsize=10,
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with Replacing(path) as part:
            figure.savefig(part, format=path.suffix[1:])
    except (OSError, ValueError) as error:
        raise TableError(f"{path}: cannot be drawn: {error}") from None


def _path(axes: Any, work: Work) -> None:
    """Draw the driven path and where the lines are beside it."""
    poses = work.reference.poses
    x, y, yaw = poses.x_m, poses.y_m, poses.yaw_rad
    axes.plot(x, y, color="black", lw=1.0, label="vehicle")
    for side, line in work.images.lines.items():
        offset = np.where(line.is_whole, line.coefficients[:, 0], np.nan)
        axes.plot(
            x - offset * np.sin(yaw),
            y + offset * np.cos(yaw),
            lw=0.7,
            color=COLOURS[side],
            label=SIDE_NAMES[side],
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_title("Path and reported lines beside the vehicle", fontsize=9)
    axes.legend(fontsize=7, frameon=False, loc="upper left")
    axes.grid(visible=True, lw=0.3)


def _over_time(axes: Any, work: Work, values: Array, label: str, side: Side | None = None) -> None:
    t_s = (work.images.t_ns - work.images.t_ns[0]) / 1e9
    colour = "black" if side is None else COLOURS[side]
    axes.plot(t_s, values, lw=0.7, color=colour, label=None if side is None else SIDE_NAMES[side])
    axes.set(xlabel="time (s)", ylabel=label)
    axes.grid(visible=True, lw=0.3)
    if side is not None:
        axes.legend(fontsize=7, frameon=False, loc="upper left")


def _errors(figure: Any, axes: Any, work: Work, side: Side, picked: Any) -> None:
    """Draw the size of the error over range and yaw rate, the mean in each cell."""
    error, used = _used_errors(work, side, picked)
    rate = np.degrees(yaw_rate_radps(work, work.images.t_ns[picked]))
    x = np.broadcast_to(work.ranges_m, error.shape)[used]
    y = np.broadcast_to(rate[:, None], error.shape)[used]
    if len(x):
        edges = [np.linspace(0.0, work.ranges_m[-1], 26), np.linspace(*_span(y), 21)]
        total, *_ = np.histogram2d(x, y, edges, weights=np.abs(error[used]))
        count, *_ = np.histogram2d(x, y, edges)
        mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
        shown = axes.pcolormesh(edges[0], edges[1], mean.T, cmap="viridis", rasterized=True)
        figure.colorbar(shown, ax=axes, label="mean |error| (m)")
    axes.set(xlabel="range (m)", ylabel="yaw rate (deg/s)")
    axes.set_title(f"{SIDE_NAMES[side]} line: error over range and yaw rate", fontsize=9)


def _used_errors(work: Work, side: Side, picked: Any) -> tuple[Array, BoolArray]:
    """Return errors (K, R) of some images of the log and which of them count."""
    errors, used = [], []
    for image in np.split(picked, np.flatnonzero(np.diff(picked // 2048)) + 1):
        block = block_of(work, side, int(image[0]), int(image[-1]) + 1, image)
        errors.append(block.error_m)
        used.append((block.masked == CODE[Masked.USED]) & ~np.isnan(block.error_m))
    return np.concatenate(errors), np.concatenate(used)


def _span(values: Array) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low - 0.5, high + 0.5) if high - low < 1e-6 else (low, high)


def _masked(axes: Any, work: Work) -> None:
    """Draw why images are left out, over time."""
    t_s = (work.images.t_ns - work.images.t_ns[0]) / 1e9
    names = {code: str(mask) or "used" for mask, code in CODE.items()}
    for side, codes in work.codes.items():
        axes.plot(t_s, codes + 0.15 * int(side), ".", ms=2, color=COLOURS[side], label=SIDE_NAMES[side])
    axes.set_yticks(list(names), list(names.values()), fontsize=7)
    axes.set(xlabel="time (s)")
    axes.set_title("Images left out as a whole", fontsize=9)
    axes.grid(visible=True, lw=0.3)
