"""A library compiled for one mode: tables on one range grid, ready to be read at a speed.

    extreme   |error| not exceeded in `level` of the cases                             P1 3.3
    levels    the surfaces of all levels, between which a Markov chain jumps           P1 4.2
    volume    quantiles of the signed error: a Gaussian copula, error = Q(Phi(z); range, speed)

Q is linear in the normal quantile z between the levels of the file, and goes on straight beyond them: so a
normal law is exact with two levels, and no Phi is needed. Along range and speed tables are linear.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import isnan
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from scipy.special import ndtri

from vsensor.error_model.chain import below, stationary
from vsensor.error_model.file import DEFAULT_FILE, load_library
from vsensor.error_model.model import ErrorLibrary, ErrorModel
from vsensor.error_model.reach import Region
from vsensor.error_model.report import ReportLaw
from vsensor.error_model.rule import Conditions, Rule, pick
from vsensor.error_model.shift import CHORD_M
from vsensor.errors import ConfigError
from vsensor.schema import Config, user_path
from vsensor.types import Array, frozen

NUGGET = 1e-6
"""The squared-exponential kernel alone is singular in float64; 0.1 % of the std becomes white."""
FINEST_M = 0.5
"""Between points of the range grid."""


class ErrorModelConfig(Config, frozen=True, kw_only=True):
    """What errors the sensor makes.

    `file` is a model file, the shipped one where absent; a relative path is meant from the folder of
    the scenario. `level` (one of the file's) is for mode "extreme", `direction` for it and "levels": left
    and right as seen when driving, inward towards the vehicle, random one of left and right for a whole
    drive. `scale` multiplies every error. `losses`: in "volume" and "levels" lines are lost, end nearer and
    have the quality as the file says, where it does; false: as the camera alone sees them.
    """

    mode: Literal["none", "extreme", "levels", "volume"] = "volume"
    file: str | None = None
    level: Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)] = 0.95
    direction: Literal["left", "right", "inward", "outward", "random"] = "left"
    scale: Annotated[float, msgspec.Meta(ge=0.0, le=20.0)] = 1.0
    losses: bool = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelLaw:
    """One model: where it reports, and `table_m` (V, S, G) over `speed_mps` (V,), S knots and the range grid.

    Volume: `knots` (S,) are normal quantiles, `factor` (G, G) the Cholesky factor of the correlation along
    the range, which lasts `time_s`. Levels: `step` (L + 1, L + 1) after each `period_s` (`below` its sums),
    `start` (L + 1,) the share of each in the long run.
    """

    region: Region | None
    speed_mps: Array
    table_m: Array
    knots: Array
    factor: Array
    time_s: float
    step: Array
    below: tuple[list[float], ...]
    start: Array
    period_s: float

    def at_speed(self, speed_mps: float) -> Array:
        """Return the table (S, G) at a speed, linear between the columns; NaN = the highest speed."""
        grid = self.speed_mps
        top = float(grid[-1])
        speed = top if isnan(speed_mps) else min(max(speed_mps, float(grid[0])), top)
        column = min(max(int(grid.searchsorted(speed)) - 1, 0), len(grid) - 2)
        part = (speed - grid[column]) / (grid[column + 1] - grid[column])
        low, high = self.table_m[column], self.table_m[column + 1]
        return np.asarray(low + part * (high - low))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErrorLaw:
    """A library compiled for one mode, on `grid_m` (G,) that all its models share.

    `reports` is empty where no model says what is lost of a line.
    """

    library: ErrorLibrary
    mode: str
    direction: str
    grid_m: Array
    models: Mapping[str, ModelLaw]
    reports: Mapping[str, ReportLaw]
    rule: tuple[Rule, ...]

    def name_at(self, conditions: Conditions) -> str:
        """Return the name of the model that holds."""
        return self.rule[0].model if len(self.rule) == 1 else pick(self.rule, conditions)


def load_law(config: ErrorModelConfig, folder: Path = Path()) -> ErrorLaw | None:
    """Read and compile the configured file; None in mode "none". Raises ConfigError."""
    if config.mode == "none":
        return None
    path = DEFAULT_FILE if config.file is None else folder / user_path(config.file)
    return compile_law(config, load_library(path), str(path))


def compile_law(config: ErrorModelConfig, library: ErrorLibrary, where: str = "error model") -> ErrorLaw:
    """Lay the tables of the mode on a range grid fine enough for the correlation length."""
    grid = _grid(library.models.values())
    is_lossy = config.losses and config.mode in ("levels", "volume")
    reports = {name: ReportLaw.of(model) for name, model in library.models.items() if is_lossy}
    return ErrorLaw(
        library=library,
        mode=config.mode,
        direction=config.direction,
        grid_m=grid,
        models={name: _compiled(config, model, grid, where) for name, model in library.models.items()},
        reports={} if all(report.is_empty for report in reports.values()) else reports,
        rule=library.rule,
    )


def _grid(models: Collection[ErrorModel]) -> Array:
    nodes = np.unique(np.concatenate([model.range_m for model in models]))
    length_m = min(model.applied_length_m for model in models)
    return range_grid(nodes, length_m)


def range_grid(nodes_m: Array, length_m: float) -> Array:
    """Return the nodes and points between, so close that 99.5 % of the std is kept between two.

    Of what changes within less than a metre no polynomial keeps anything.
    """
    step_m = min(max(length_m / 5.0, FINEST_M), CHORD_M)
    pieces = [
        np.linspace(a, b, max(int(np.ceil((b - a) / step_m)), 1), endpoint=False)
        for a, b in pairwise(nodes_m.tolist())
    ]
    return frozen(np.concatenate([*pieces, nodes_m[-1:]]))


def _compiled(config: ErrorModelConfig, model: ErrorModel, grid_m: Array, where: str) -> ModelLaw:
    surfaces, knots, factor = model.absolute_m, np.zeros(0), np.zeros((0, 0))
    if config.mode == "extreme":
        surfaces = surfaces[_place(config.level, model, where)][None]
    elif config.mode == "volume":
        surfaces, knots = model.applied_signed_m, ndtri(model.signed_levels)
        factor = correlation_factor(grid_m, model.applied_length_m)
    step = level_step(model)
    return ModelLaw(
        region=Region.of(model),
        speed_mps=model.speed_mps,
        table_m=frozen(config.scale * table_on(grid_m, model, surfaces)),
        knots=frozen(knots),
        factor=factor,
        time_s=model.applied_time_s,
        step=step,
        below=below(step),
        start=stationary(step),
        period_s=model.level_period_s,
    )


def _place(level: float, model: ErrorModel, where: str) -> int:
    place = int(np.argmin(np.abs(model.levels - level)))
    if abs(model.levels[place] - level) > 1e-9:
        known = ", ".join(f"{value:g}" for value in model.levels)
        raise ConfigError(f"{where}: error_model.level = {level:g}: the file has the levels {known}")
    return place


def table_on(grid_m: Array, model: ErrorModel, surfaces_m: Array) -> Array:
    """Return surfaces (S, R, V) as a table (V, S, G); blind cells have the nearest cell's values."""
    if model.blind.any():
        from scipy.ndimage import distance_transform_edt  # 0.2 s to import: only such a model pays for it

        steps = (1.0, 2.0)  # of two cells as near the one at the same speed
        place = distance_transform_edt(model.blind, steps, return_distances=False, return_indices=True)
        surfaces_m = surfaces_m[:, place[0], place[1]]
    return np.array(
        [
            [np.interp(grid_m, model.range_m, row) for row in column]
            for column in surfaces_m.transpose(2, 0, 1)
        ]
    )


def correlation_factor(grid_m: Array, length_m: float) -> Array:
    """Return the Cholesky factor (G, G) of the squared-exponential correlation."""
    distance = (grid_m[:, None] - grid_m[None, :]) / length_m
    correlation = np.exp(-0.5 * distance**2)
    return frozen(np.linalg.cholesky((1.0 - NUGGET) * correlation + NUGGET * np.eye(len(grid_m))))


def quantile(knots: Array, table_m: Array, z: Array) -> Array:
    """Return Q (..., G) at normal quantiles `z` (..., G): `table_m` (S, G) at `knots` (S,)."""
    below, size = knots[1:-1].searchsorted(z), z.shape[-1]
    flat, place = table_m.ravel(), below * size + np.arange(size)  # two indices take thrice the time of one
    low, start = flat.take(place), knots.take(below)
    rise, part = flat.take(place + size) - low, z - start
    part /= knots.take(below + 1) - start
    return np.asarray(low + rise * part)


def level_step(model: ErrorModel) -> Array:
    """Return the Markov matrix of the levels; where none was fitted, one that forgets like the errors do."""
    if len(model.level_step):
        return model.level_step
    share = np.diff([0.0, *model.levels, 1.0])
    keep = np.exp(-model.level_period_s / model.applied_time_s)
    return frozen(keep * np.eye(len(share)) + (1.0 - keep) * share)
