"""The virtual sensor's errors in bulk: what `vsensor run` does to the points of an image, as matrix products.

    white noise ──► z over the range, AR(1) in time ──► error of the points ──► polynomial ──► read at ranges
                    error_model's kernel                error_model's law       lanefit, which is linear in
                                                                                the points: one matrix

On a straight line; its points every half metre up to the operating range.
"""

import functools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import exp, sqrt

import numpy as np

from vsensor.error_model import ErrorLibrary, ErrorModel
from vsensor.error_model.law import correlation_factor, quantile, range_grid, table_on
from vsensor.lanefit import LaneFitConfig, fit
from vsensor.types import Array

POINT_STEP_M = 0.5
UNLIMITED = 1e12


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSetting:
    """How the sensor that will use a model fits: its configuration, and where its points begin."""

    config: LaneFitConfig = field(default_factory=LaneFitConfig)
    seen_from_m: float = 0.0


def fit_matrix(setting: FitSetting, reach_m: float, grid_m: Array, range_m: Array) -> Array:
    """Return (R, G): errors on `grid_m` of points up to `reach_m` ──► those of the polynomial at `range_m`.

    Zero where the points are too few for a line.
    """
    x, powers = _impulses(setting, round(reach_m, 1))
    if not powers.size:
        return np.zeros((len(range_m), len(grid_m)))
    on_points = np.stack([np.interp(x, grid_m, unit) for unit in np.eye(len(grid_m))], axis=1)
    return np.asarray(np.vander(range_m, len(powers), increasing=True) @ powers @ on_points)


@functools.lru_cache(maxsize=1024)
def _impulses(setting: FitSetting, reach_m: float) -> tuple[Array, Array]:
    """Return x (N,) of the points and the coefficients (K, N) of the fit to 1 m at each of them alone."""
    count = int((reach_m - setting.seen_from_m) / POINT_STEP_M) + 1
    x = np.asarray(setting.seen_from_m + POINT_STEP_M * np.arange(max(count, 0)), np.float64)
    limits = ("max_offset_m", "max_slope", "max_curvature_per_m", "max_misfit_m", "max_std_at_ego_m")
    free = replace_config(setting.config, **dict.fromkeys(limits, UNLIMITED))
    lines = [fit(free, x, impulse, np.zeros(len(x))) for impulse in np.eye(len(x))]
    if not lines or lines[0] is None:
        return x, np.zeros((0, 0))
    return x, np.stack([line.coefficients for line in lines if line is not None], axis=1)


def replace_config(config: LaneFitConfig, **changes: float) -> LaneFitConfig:
    """Return the configuration with some values changed."""
    import msgspec

    return msgspec.structs.replace(config, **changes)


def reach_of(model: ErrorModel, speed_mps: Array) -> Array:
    """Return the operating range (N,) at speeds; without a fitted one the model's last range."""
    if not len(model.region_speed_mps):
        return np.full(np.shape(speed_mps), float(model.range_m[-1]))
    return np.interp(speed_mps, model.region_speed_mps, model.region_range_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualSensor:
    """One model ready for bulk: per speed column a table (S, G) and a fit matrix (R, G)."""

    model: ErrorModel
    grid_m: Array
    knots: Array
    tables_m: Array
    matrices: Mapping[int, Array]
    factor: Array

    @classmethod
    def of(
        cls, model: ErrorModel, setting: FitSetting, columns: Iterable[int] | None = None
    ) -> "VirtualSensor":
        """Compile a model, for all speed columns or some."""
        from scipy.special import ndtri

        grid = range_grid(model.range_m, model.applied_length_m)
        reach = reach_of(model, model.speed_mps)
        chosen = range(len(reach)) if columns is None else columns
        return cls(
            model=model,
            grid_m=grid,
            knots=ndtri(model.signed_levels),
            tables_m=table_on(grid, model, model.applied_signed_m),
            matrices={k: fit_matrix(setting, float(reach[k]), grid, model.range_m) for k in chosen},
            factor=correlation_factor(grid, model.applied_length_m),
        )

    def points(self, z: Array, column: int) -> Array:
        """Return the errors (N, R) of the points at the model's ranges, of processes `z` (N, G)."""
        at = np.searchsorted(self.grid_m, self.model.range_m)
        return quantile(self.knots, self.tables_m[column][:, at], z[:, at])

    def errors(self, z: Array, speed_mps: Array) -> Array:
        """Return the reported errors (N, R) of processes `z` (N, G) at speeds (N,), of the nearest column."""
        step = np.searchsorted(0.5 * (self.model.speed_mps[1:] + self.model.speed_mps[:-1]), speed_mps)
        found = np.empty((len(z), len(self.model.range_m)))
        for column in np.unique(step).tolist():
            here = step == column
            moved = quantile(self.knots, self.tables_m[column], z[here])
            found[here] = moved @ self.matrices[column].T
        return found

    def drive(self, steps_s: Array, random: np.random.Generator) -> Array:
        """Return a process z (N, G) in time: `steps_s` (N - 1,) between its images."""
        noise = random.standard_normal((len(steps_s) + 1, len(self.grid_m))) @ self.factor.T
        for k, step in enumerate(steps_s.tolist()):
            keep = exp(-step / self.model.applied_time_s)
            noise[k + 1] = keep * noise[k] + sqrt(1.0 - keep * keep) * noise[k + 1]
        return noise


def lost_runs_s(
    model: ErrorModel, seconds: float, random: np.random.Generator
) -> Iterator[tuple[bool, float]]:
    """Yield (seen, duration) drawn from the dwell tables, seen first, until `seconds` are full."""
    left = seconds
    seen = True
    while left > 0.0:
        table = model.seen_dwell_s if seen else model.lost_dwell_s
        took = float(np.interp(random.random(), model.dwell_levels, table)) if len(table) else left
        took = max(took, 1e-3)
        yield seen, min(took, left)
        left -= took
        seen = not seen


def with_applied(model: ErrorModel, signed_m: Array, length_m: float, time_s: float) -> ErrorModel:
    """Return the model with another law of the points."""
    return replace(model, applied_signed_m=signed_m, applied_length_m=length_m, applied_time_s=time_s)


def models_of(library: ErrorLibrary) -> list[tuple[str, ErrorModel]]:
    """Return the models of a library in the order of its rule."""
    names = dict.fromkeys(rule.model for rule in library.rule)
    return [(name, library.models[name]) for name in names]
