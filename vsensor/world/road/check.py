"""Roads that cannot be: lanes that fold over inside a bend, a road that crosses itself."""

from math import ceil

import numpy as np

from vsensor.errors import ConfigError
from vsensor.types import Array, IntArray
from vsensor.world.opendrive.planview import PlanView
from vsensor.world.opendrive.polynomial import Cubics
from vsensor.world.road.config import RoadConfig
from vsensor.world.road.heights import elevation_rows
from vsensor.world.road.layout import Layout
from vsensor.world.road.line import Line

STEP_M = 2.0
MOST_STATIONS = 50_000
NARROWEST = 0.01
"""Length of a border per length of the line, at least."""

CLEARANCE_M = 3.5
"""A road that passes so far above itself is a bridge."""

CHUNK = 32


def check_shape(config: RoadConfig, line: Line, layout: Layout, where: str) -> None:
    """Raise ConfigError for a road that folds over or crosses itself."""
    plan = PlanView(line.records)
    s = _stations(line)
    edges = [Cubics.of(layout.t(border)).at(s)[0] for border in (layout.borders[0], layout.borders[-1])]
    x, y, heading, curvature = plan.at(s)
    for t in edges:
        _check_fold(config, line, s, 1.0 - curvature * t, t, where)
    z = Cubics.of(elevation_rows(config, line.length_m, where)).at(s)[0]
    paths = [np.column_stack([x - t * np.sin(heading), y + t * np.cos(heading), z]) for t in edges]
    crossing = _crossing(paths, config.closed)
    if crossing is not None:
        a, b = sorted(s[[crossing[0] % (len(s) - 1), crossing[1] % (len(s) - 1)]].tolist())
        raise ConfigError(
            f"{where}: the road crosses itself at s = {a:.0f} m and {b:.0f} m; a bridge needs "
            f"{CLEARANCE_M:g} m of height between them"
        )


def _stations(line: Line) -> Array:
    """Return places along the line, at most 2 m apart, where pieces begin and end among them."""
    step = max(STEP_M, line.length_m / MOST_STATIONS)
    parts = [
        np.linspace(r.s_m, r.s_m + r.length_m, max(2, ceil(r.length_m / step)), endpoint=False)
        for r in line.records
    ]
    return np.concatenate([*parts, [line.length_m]])


def _check_fold(config: RoadConfig, line: Line, s: Array, along: Array, t: Array, where: str) -> None:
    worst = int(along.argmin())
    if along[worst] >= NARROWEST:
        return
    starts = np.array([record.s_m for record in line.records])
    piece = line.elements[int(np.searchsorted(starts, s[worst], side="right")) - 1].piece
    radius = abs(t[worst]) / (1.0 - along[worst])
    raise ConfigError(
        f"{where}.line[{piece}]: the inner lane folds over: its border lies {abs(t[worst]):.4g} m inside a "
        f"bend of {radius:.4g} m at s = {s[worst]:.4g} m"
    )


def _crossing(paths: list[Array], closed: bool) -> tuple[int, int] | None:
    """Return two segments (counted over all paths) that cross at about one height, None if none do."""
    starts = np.concatenate([path[:-1] for path in paths])
    ends = np.concatenate([path[1:] for path in paths])
    count = len(paths[0]) - 1
    edges = np.arange(0, len(starts), CHUNK)
    low = np.minimum.reduceat(np.minimum(starts, ends), edges)[:, :2]
    high = np.maximum.reduceat(np.maximum(starts, ends), edges)[:, :2]
    for i in range(len(edges)):
        meets = ((low[i:] <= high[i]) & (high[i:] >= low[i])).all(axis=1)
        for j in (np.flatnonzero(meets) + i).tolist():
            chunks = _chunk(edges, i, starts), _chunk(edges, j, starts)
            found = _crossing_in(starts, ends, chunks, count, closed)
            if found is not None:
                return found
    return None


def _chunk(edges: IntArray, number: int, starts: Array) -> IntArray:
    return np.arange(edges[number], min(edges[number] + CHUNK, len(starts)))


def _crossing_in(
    starts: Array, ends: Array, chunks: tuple[IntArray, IntArray], count: int, closed: bool
) -> tuple[int, int] | None:
    i, j = (grid.ravel() for grid in np.meshgrid(*chunks, indexing="ij"))
    apart = np.abs(i % count - j % count)
    if closed:
        apart = np.minimum(apart, count - apart)
    far = (apart > 1) & (i < j)
    i, j = i[far], j[far]
    a, b, c, d = starts[i], ends[i], starts[j], ends[j]
    cross = (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)
    hits = np.flatnonzero(cross & (np.abs(a[:, 2] - c[:, 2]) < CLEARANCE_M))
    return (int(i[hits[0]]), int(j[hits[0]])) if len(hits) else None


def _side(a: Array, b: Array, p: Array) -> Array:
    """Return twice the area of triangles, positive where p lies to the left of a to b."""
    return np.asarray((b[:, 0] - a[:, 0]) * (p[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (p[:, 0] - a[:, 0]))
