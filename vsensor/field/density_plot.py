"""Pictures of densities, as P1 draws them (fig. 2.35, 3.1 to 3.7). Needs matplotlib."""

from typing import Any

import numpy as np

from vsensor.field.density import PROFILE, SPREADS, Density, edges_of
from vsensor.field.tune.region import operating_region
from vsensor.field.tune.survey import REACH_BINS, REACH_STEP_M
from vsensor.pages import COLOURS, density, new_figure

LABELS = {
    "yaw_rate_radps": "yaw rate (rad/s)",
    "future_yaw_rate_radps": "yaw rate there, later (rad/s)",
    "acceleration_mps2": "acceleration (m/s²)",
    "curvature_per_m": "curvature there (1/m)",
    "night": "night (0 no, 1 yes)",
    "rain": "rain (0 to 1)",
}


def pages(found: Density) -> dict[str, Any]:
    """Return name -> figure."""
    return {
        "distributions.png": distributions(found),
        "error_density.png": error_density(found),
        "cube.png": cube(found),
        "blind_spots.png": blind_spots(found),
        "profile.png": profile(found),
    }


def distributions(found: Density) -> Any:
    """Draw how range, speed, the other dimensions and the error are distributed (fig. 3.1, 3.2)."""
    figure = new_figure(12.0, 9.0)
    panels = figure.subplots(3, 3).ravel()
    total = max(int(found.cube.sum()), 1)
    dimensions = [
        ("range (m)", found.range_edges_m, found.cube.sum(axis=(1, 2))),
        ("speed (m/s)", found.speed_edges_mps, found.cube.sum(axis=(0, 2))),
        *((LABELS[name], edges_of(name), found.spreads[name]) for name in SPREADS),
        ("size of the error (m)", found.error_edges_m, found.cube.sum(axis=(0, 1))),
    ]
    for panel, (label, edges, counts) in zip(panels, dimensions, strict=True):
        panel.stairs(100.0 * counts / total, edges, fill=True, color=COLOURS[0], alpha=0.7)
        used = np.flatnonzero(counts)
        if len(used):
            panel.set_xlim(edges[used[0]], edges[used[-1] + 1])
        panel.set(xlabel=label, ylabel="rows (%)")
    return figure


def error_density(found: Density) -> Any:
    """Draw the density of errors over range and over speed (fig. 3.4)."""
    figure = new_figure(11.0, 4.5)
    over_range, over_speed = figure.subplots(1, 2, sharey=True)
    density(
        over_range, found.range_edges_m, found.error_edges_m, found.cube.sum(axis=1).astype(float), "rows"
    )
    density(
        over_speed, found.speed_edges_mps, found.error_edges_m, found.cube.sum(axis=0).astype(float), "rows"
    )
    over_range.set(xlabel="range (m)", ylabel="size of the error (m)")
    over_speed.set(xlabel="speed (m/s)")
    return figure


def cube(found: Density) -> Any:
    """Draw the shares of the sub cubes of range, speed and error in space (fig. 3.5, 3.8)."""
    from matplotlib.colors import LogNorm

    figure = new_figure(9.0, 7.0)
    axes = figure.add_subplot(projection="3d")
    coarse, edges = _coarse(found)
    place = np.nonzero(coarse)
    middle = [0.5 * (edge[:-1] + edge[1:]) for edge in edges]
    share = 100.0 * coarse[place] / max(coarse.sum(), 1)
    points = axes.scatter(
        middle[0][place[0]],
        middle[1][place[1]],
        middle[2][place[2]],
        c=share,
        s=14,
        cmap="viridis",
        norm=LogNorm(),
        alpha=0.7,
        linewidths=0,
    )
    figure.colorbar(points, ax=axes, label="share of all rows (%)", shrink=0.7)
    axes.set(xlabel="range (m)", ylabel="speed (m/s)", zlabel="size of the error (m)")
    return figure


def _coarse(found: Density) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the cube in at most some 25 pieces a side, and its edges: so many points can be looked at."""
    counts = found.cube
    edges = [found.range_edges_m, found.speed_edges_mps, found.error_edges_m]
    for axis in range(3):
        step = max(counts.shape[axis] // 25, 1)
        starts = np.arange(0, counts.shape[axis], step)
        counts = np.add.reduceat(counts, starts, axis=axis)
        edges[axis] = np.append(edges[axis][starts], edges[axis][-1])
    return counts, edges


def blind_spots(found: Density) -> Any:
    """Draw rows over range and speed, and the reported range over speed (fig. 3.6, 3.7)."""
    figure = new_figure(11.0, 4.5)
    cells, reach = figure.subplots(1, 2)
    knots, values = operating_region(found.survey.reach[0], found.grid.step_mps, 0.95)
    density(cells, found.speed_edges_mps, found.range_edges_m, found.cube.sum(axis=2).T.astype(float), "rows")
    counts = found.survey.reach[0, : found.grid.speeds].astype(float)
    density(
        reach, found.speed_edges_mps, np.arange(REACH_BINS + 1) * REACH_STEP_M, counts, "images and sides"
    )
    for axes, label in ((cells, "range (m)"), (reach, "reported range (m)")):
        axes.plot(knots, values, color=COLOURS[1], label="95 % of the reported range")
        axes.set(xlabel="speed (m/s)", ylabel=label, ylim=(0.0, 1.15 * max(values.max(), 1.0)))
        axes.legend(fontsize=7, loc="lower right")
    return figure


def profile(found: Density) -> Any:
    """Draw the error profile over range and yaw rate, left and right line (fig. 2.35): largest and mean."""
    figure = new_figure(12.0, 9.0)
    mean = found.profile_sum_m / np.maximum(found.profile_rows, 1)
    middle = 0.5 * (edges_of(PROFILE)[:-1] + edges_of(PROFILE)[1:])
    used = np.flatnonzero(found.profile_rows.sum(axis=(0, 1)))
    if not len(used):
        return figure
    part = slice(used[0], used[-1] + 1)
    yaw, range_m = np.meshgrid(middle[part], found.grid.range_m)
    for row, (word, surface) in enumerate((("largest", found.profile_largest_m), ("mean", mean))):
        for side in (0, 1):
            axes = figure.add_subplot(2, 2, 2 * row + side + 1, projection="3d")
            shown = np.where(found.profile_rows[side] > 0, surface[side], np.nan)[:, part]
            points = np.isfinite(shown)
            axes.scatter(range_m[points], yaw[points], shown[points], c=shown[points], s=6, cmap="viridis")
            axes.set(xlabel="range (m)", ylabel="yaw rate (rad/s)", zlabel="|error| (m)")
            axes.set_title(f"{('left', 'right')[side]} line, {word}", fontsize=9)
    return figure
