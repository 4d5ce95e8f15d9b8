"""A picture of a road file: its paint from above, heights, and curvature over s. Needs matplotlib."""

from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import ConfigError, MissingExtraError
from vsensor.types import Colour, MarkingKind
from vsensor.world.borders import border_lines, extra_line
from vsensor.world.lane_piece import LanePiece
from vsensor.world.opendrive.network import Place
from vsensor.world.opendrive.road import Road, RoadMap

STEP_M = 0.5
INK = {
    Colour.WHITE: "#222222",
    Colour.YELLOW: "#E69F00",
    Colour.BLUE: "#0072B2",
    Colour.RED: "#D55E00",
    Colour.GREEN: "#009E73",
    Colour.ORANGE: "#D55E00",
    Colour.UNKNOWN: "#999999",
}


def plot_map(road_map: RoadMap, path: Path) -> None:
    """Write a picture of a map; raises MissingExtraError, and ConfigError where it cannot be written."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plots", "--plot") from None
    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise ConfigError(f"{path}: a picture ends in .png, .svg, .pdf")
    figure = Figure(figsize=(10.0, 11.0), layout="constrained")
    above, height, curvature = figure.subplots(3, 1, height_ratios=(5, 1, 1))
    for road in road_map.roads.values():
        _draw_road(above, road)
        s = np.linspace(0.0, road.length_m, max(2, int(road.length_m / STEP_M)))
        label = f"road {road.id}"
        height.plot(s, road.cross(s).line[2], lw=1, label=label)
        curvature.plot(s, 1000.0 * road.curvature(s), lw=1, label=label)
    above.set(aspect="equal", xlabel="x, m", ylabel="y, m", title=f"{road_map.path.name}: paint from above")
    height.set(ylabel="height, m")
    curvature.set(xlabel="s, m", ylabel="curvature, 1/km")
    if len(road_map.roads) > 1:
        height.legend(fontsize="small")
    try:
        figure.savefig(path, dpi=150)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: picture cannot be written: {error}") from None


def _draw_road(axes: Any, road: Road) -> None:
    """Draw a road's asphalt, each border's paint in its colour, ghosts thin, and painted areas."""
    for number, section in enumerate(road.sections):
        s = np.arange(section.start_m, section.end_m, STEP_M)
        if not len(s):
            continue
        piece = LanePiece(road, Place(road.id, number, 0, 1), section.start_m, section.end_m)
        cross = road.cross(s)
        lines = list(border_lines(piece, s, cross, section.ids))
        left, right = (line.stripes[0].points_world_m for line in (lines[0], lines[-1]))
        axes.fill(*np.concatenate([left, right[::-1]])[:, :2].T, color="#E8E8E8", lw=0)
        for extra in road.lines:
            there = s[(s >= extra.from_m) & (s <= extra.to_m)]
            if len(there):
                lines.append(extra_line(piece, extra, there, road.cross(there)))
        for line in lines:
            _draw_line(axes, line)
    for area in road.ground:
        points = road.point(np.clip(area.corners[:, 0], 0.0, road.length_m), area.corners[:, 1])
        axes.fill(*points[:, :2].T, color=INK[area.colour], lw=0)


def _draw_line(axes: Any, line: Any) -> None:
    counts = np.ones(len(line.kind), bool) if line.valid is None else line.valid
    for stripe in line.stripes:
        painted = stripe.painted & (line.kind != MarkingKind.NONE)
        for colour in np.unique(line.colour[painted]).tolist():
            for shown, width in ((painted & counts, 0.9), (painted & ~counts, 0.3)):
                mine = shown & (line.colour == colour)
                if mine.any():
                    points = np.where(mine[:, None], stripe.points_world_m, np.nan)
                    axes.plot(*points[:, :2].T, color=INK[Colour(colour)], lw=width)
