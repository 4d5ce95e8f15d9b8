"""The errors of the real sensor: a surface over range and speed, read from a file, correlated in time.

    level, range, speed ──► |error| not exceeded in `level` of the cases     mode "extreme" (P1 3.3)
    range, speed        ──► standard deviation of the signed error           mode "volume"

Each point is moved along the normal of its line (ERRATA, P1 2.2.2), left positive. In "volume" the
error divided by its standard deviation is a Gaussian process: AR(1) from image to image with the
file's correlation time, and along the range a squared-exponential kernel with the file's
correlation length, so that the polynomial fitted afterwards keeps the law (an exponential kernel of
20 m would lose up to 29 % of it in a cubic). Every line has its own draws, so what one line does
never depends on which others are seen. Beyond the grid of the file the nearest value holds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import exp, isnan, sqrt
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from vsensor.draws import Draws, Stage
from vsensor.error_model.file import DEFAULT_FILE, ErrorModel, load_model
from vsensor.errors import ConfigError
from vsensor.schema import Config
from vsensor.types import Array, LinePoints, Tick, frozen

FORGET_AFTER = 5.0
"""Correlation times after which an unseen line is forgotten: exp(-5) = 0.7 % of it would be left."""
CHORD_M = 5.0
"""Length over which a line's direction is taken, and the widest step of the range grid."""
WHOLE_DRIVE = 2**64 - 1
"""Number of the stream for what is drawn once per drive; no tick has it."""


class ErrorModelConfig(Config, frozen=True, kw_only=True):
    """What errors the sensor makes.

    `file` is a model file, the shipped one where absent; a relative path is meant from the folder of
    the scenario. `level` (one of the file's) and `direction` are for mode "extreme": left and right
    as seen when driving, inward towards the vehicle, random one of left and right for a whole drive.
    `scale` multiplies every error.
    """

    mode: Literal["none", "extreme", "volume"] = "volume"
    file: str | None = None
    level: Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)] = 0.95
    direction: Literal["left", "right", "inward", "outward", "random"] = "left"
    scale: Annotated[float, msgspec.Meta(ge=0.0, le=20.0)] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErrorLaw:
    """A model compiled for one mode: `surface_m` (G, V) on `grid_m` (G,) and `speed_mps` (V,).

    `factor` (G, G) is the Cholesky factor of the correlation along the range, None in mode "extreme".
    """

    grid_m: Array
    speed_mps: Array
    surface_m: Array
    factor: Array | None
    correlation_time_s: float
    direction: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErrorState:
    """Per known line its id, the tick it was last drawn at, and its white process `white` (M, G)."""

    lines: tuple[int, ...] = ()
    ticks: tuple[int, ...] = ()
    white: Array = field(default_factory=lambda: frozen(np.zeros((0, 0))))


def load_law(config: ErrorModelConfig, folder: Path = Path()) -> ErrorLaw | None:
    """Read and compile the configured model; None in mode "none". Raises ConfigError."""
    if config.mode == "none":
        return None
    path = DEFAULT_FILE if config.file is None else folder / config.file
    return compile_law(config, load_model(path), str(path))


def compile_law(config: ErrorModelConfig, model: ErrorModel, where: str = "error model") -> ErrorLaw:
    """Lay the surface of the mode on a range grid fine enough for the correlation length."""
    step_m = min(model.correlation_length_m / 5.0, CHORD_M)  # between such points 99.5 % of the std is kept
    pieces = [
        np.linspace(a, b, max(int(np.ceil((b - a) / step_m)), 1), endpoint=False)
        for a, b in zip(model.range_m[:-1], model.range_m[1:], strict=True)
    ]
    grid = np.concatenate([*pieces, model.range_m[-1:]])
    surface = model.std_m if config.mode == "volume" else _level_surface(config.level, model, where)
    columns = [np.interp(grid, model.range_m, column) for column in surface.T]
    return ErrorLaw(
        grid_m=frozen(grid),
        speed_mps=model.speed_mps,
        surface_m=frozen(config.scale * np.stack(columns, axis=1)),
        factor=_correlation_factor(grid, model.correlation_length_m) if config.mode == "volume" else None,
        correlation_time_s=model.correlation_time_s,
        direction=config.direction,
    )


def _level_surface(level: float, model: ErrorModel, where: str) -> Array:
    place = int(np.argmin(np.abs(model.levels - level)))
    if abs(model.levels[place] - level) > 1e-9:
        known = ", ".join(f"{value:g}" for value in model.levels)
        raise ConfigError(f"{where}: error_model.level = {level:g}: the file has the levels {known}")
    return np.asarray(model.absolute_m[place])


def _correlation_factor(grid_m: Array, length_m: float) -> Array:
    distance = (grid_m[:, None] - grid_m[None, :]) / length_m
    correlation = np.exp(-0.5 * distance**2)
    nugget = 1e-6  # the kernel alone is singular in float64; 0.1 % of the std becomes white
    return frozen(np.linalg.cholesky((1.0 - nugget) * correlation + nugget * np.eye(len(grid_m))))


def initial_state() -> ErrorState:
    """Return the state before the first image: no line is known."""
    return ErrorState()


def apply(
    law: ErrorLaw | None,
    state: ErrorState,
    draws: Draws,
    tick: Tick,
    speed_mps: float,
    line_ids: tuple[int, ...],
    lines: LinePoints,
) -> tuple[ErrorState, LinePoints]:
    """Move the points of every line along its normal by the error of this image.

    `line_ids` (K,) name the lines for good (a marking's group), seen or not: lines without points
    advance too. An unknown speed (NaN) takes the highest of the grid. Cost: nothing without a law.
    """
    if law is None:
        return state, lines
    std = _at_speed(law, speed_mps)
    if law.factor is None:
        return state, _shift(lines, law.grid_m, _signs(law.direction, draws, lines)[:, None] * std)
    state = _advance(law, state, draws, tick, line_ids)
    white = dict(zip(state.lines, state.white, strict=True))
    # one product per line: a joint one rounds differently with the number of lines, BLAS with the cores
    smooth = [np.einsum("gh,h", law.factor, white[line]) for line in line_ids]
    return state, _shift(lines, law.grid_m, [std * curve for curve in smooth])


def _at_speed(law: ErrorLaw, speed_mps: float) -> Array:
    """Return the surface (G,) at a speed, linear between the columns."""
    grid = law.speed_mps
    speed = float(grid[-1]) if isnan(speed_mps) else min(max(speed_mps, float(grid[0])), float(grid[-1]))
    column = min(max(int(np.searchsorted(grid, speed)) - 1, 0), len(grid) - 2)
    part = (speed - grid[column]) / (grid[column + 1] - grid[column])
    left, right = law.surface_m[:, column], law.surface_m[:, column + 1]
    return np.asarray(left + part * (right - left))


def _advance(
    law: ErrorLaw, state: ErrorState, draws: Draws, tick: Tick, line_ids: tuple[int, ...]
) -> ErrorState:
    """AR(1) over the ticks since each line's last one; a new line starts from the stationary law."""
    size = len(law.grid_m)
    decay_per_tick = tick.period_ns * 1e-9 / law.correlation_time_s
    known = {line: (at, white) for line, at, white in zip(state.lines, state.ticks, state.white, strict=True)}
    for line in line_ids:
        noise = draws.at(Stage.ERROR_MODEL, tick.index, line).standard_normal(size)
        if line in known:
            at, white = known[line]
            keep = exp(-max(tick.index - at, 0) * decay_per_tick)
            noise = keep * white + sqrt(1.0 - keep * keep) * noise
        known[line] = (tick.index, noise)
    horizon = tick.index - FORGET_AFTER / decay_per_tick
    kept = sorted(line for line, (at, _) in known.items() if at >= horizon)
    return ErrorState(
        lines=tuple(kept),
        ticks=tuple(known[line][0] for line in kept),
        white=frozen(np.array([known[line][1] for line in kept]).reshape(len(kept), size)),
    )


def _signs(direction: str, draws: Draws, lines: LinePoints) -> Array:
    """Return +1 (to the left) or -1 for each line (K,)."""
    count = len(lines.marking)
    if direction == "random":
        to_left = draws.at(Stage.ERROR_MODEL, WHOLE_DRIVE).random() < 0.5
        return np.full(count, 1.0 if to_left else -1.0)
    if direction in ("left", "right"):
        return np.full(count, 1.0 if direction == "left" else -1.0)
    first = np.minimum(lines.starts[:-1], max(len(lines.points_ego_m) - 1, 0))
    y = lines.points_ego_m[first, 1] if len(lines.points_ego_m) else np.zeros(count)
    return np.where(y >= 0.0, 1.0, -1.0) * (1.0 if direction == "outward" else -1.0)


def _shift(lines: LinePoints, grid_m: Array, errors_m: Sequence[Array] | Array) -> LinePoints:
    """Move line k by `errors_m[k]` (G,) given on `grid_m`, along its normal, left positive."""
    points = lines.points_ego_m.copy()
    moved = np.empty(len(points), complex)  # error + i slope: one search of the grid gives both
    for row, (start, stop) in enumerate(pairwise(lines.starts.tolist())):
        if stop > start:
            x = points[start:stop, 0].copy()
            on_grid = errors_m[row] + 1j * _slope(x, points[start:stop, 1], grid_m)
            moved[start:stop] = np.interp(x, grid_m, on_grid)
    offset, slope = moved.real, moved.imag
    along_y = offset / np.sqrt(1.0 + slope * slope)
    points[:, 0] -= along_y * slope
    points[:, 1] += along_y
    points.flags.writeable = False
    return LinePoints(marking=lines.marking, starts=lines.starts, index=lines.index, points_ego_m=points)


def _slope(x: Array, y: Array, grid_m: Array) -> Array:
    """Return dy/dx (G,) of one line on the grid, from chords of about `CHORD_M`.

    Between neighbours of 0.1 m the pixel grid would turn the normal by tens of degrees.
    """
    stride = max(int((len(x) - 1) * CHORD_M / max(x[-1] - x[0], CHORD_M)), 1)
    x_node, y_node = x[::stride], y[::stride]
    if len(x_node) < 2:
        return np.zeros(len(grid_m))
    run = x_node[1:] - x_node[:-1]
    return np.asarray(np.interp(grid_m, x_node[:-1] + 0.5 * run, (y_node[1:] - y_node[:-1]) / run))
