"""The virtual sensor's errors in bulk: what `vsensor run` does to the points of an image, as matrix products.

    white noise ──► z over the range, AR(1) in time ──► error of the points ──► polynomial ──► read at ranges
                    error_model's kernel                error_model's law       lanefit, which is linear in
                                                                                the points: one matrix

On a straight line; its points every half metre up to the operating range.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import exp, sqrt

import numpy as np
from scipy.signal import lfilter

from vsensor.error_model import ErrorLibrary, ErrorModel
from vsensor.error_model.law import correlation_factor, quantile, range_grid, table_on
from vsensor.error_model.reach import Region
from vsensor.lanefit import LaneFitConfig, operator
from vsensor.scene import SceneConfig
from vsensor.types import Array, BoolArray, IntArray

POINT_STEP_M = 0.5
PHASES = 12
"""Places of a dashed line's dashes that are told apart."""
EVEN = 0.05
"""Steps in time that differ by less than this part are one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSetting:
    """How the sensor that will use a model fits: its configuration, and where its points are.

    They begin at `seen_from_m` and end at `seen_to_m`; `dashes_m`: paint and gap of a dashed line, a gap of
    0 is a solid one.
    """

    config: LaneFitConfig = field(default_factory=LaneFitConfig)
    seen_from_m: float = 0.0
    seen_to_m: float = SceneConfig().range_m
    dashes_m: tuple[float, float] = (1.0, 0.0)

    @property
    def phases(self) -> int:
        """In how many places the dashes may lie: 1 of a solid line."""
        return PHASES if self.dashes_m[1] > 0.0 else 1

    def painted(self, x_m: Array, phase: int) -> BoolArray:
        """Return where there is paint (N,) when the vehicle has passed so many phases of the dashes."""
        period_m = sum(self.dashes_m)
        return np.asarray((x_m + phase / self.phases * period_m) % period_m < self.dashes_m[0])

    def phase_at(self, driven_m: Array) -> IntArray:
        """Return the phase (N,) after ways driven (N,)."""
        part = driven_m / sum(self.dashes_m) % 1.0
        return np.minimum((part * self.phases).astype(np.int64), self.phases - 1)


def fit_matrix(config: LaneFitConfig, x_m: Array, grid_m: Array, range_m: Array) -> Array:
    """Return (R, G): errors on `grid_m` of points at `x_m` ──► those of the polynomial at `range_m`.

    Zero where the points are too few for a line.
    """
    if len(x_m) < config.min_points:
        return np.zeros((len(range_m), len(grid_m)))
    on_points = np.stack([np.interp(x_m, grid_m, unit) for unit in np.eye(len(grid_m))], axis=1)
    powers = operator(config, x_m)
    return np.asarray(np.vander(range_m, len(powers), increasing=True) @ powers @ on_points)


def points_at(model: ErrorModel, setting: FitSetting, speed_mps: float, phase: int = 0) -> Array:
    """Return x (N,) of a line's points at a speed: up to the operating range, without what is blind."""
    x = np.asarray(np.arange(setting.seen_from_m, setting.seen_to_m, POINT_STEP_M), np.float64)
    x = x[setting.painted(x, phase)]
    region = Region.of(model)
    if region is None:
        return x
    reach = region.at(speed_mps)
    keep = x <= reach.points_m
    for low, high in reach.blind_m.tolist():
        keep &= (x < low) | (x > high)
    return x[keep]


def reach_of(model: ErrorModel, speed_mps: Array) -> Array:
    """Return the operating range (N,) at speeds; without a fitted one the model's last range."""
    if not len(model.region_speed_mps):
        return np.full(np.shape(speed_mps), float(model.range_m[-1]))
    return np.interp(speed_mps, model.region_speed_mps, model.region_range_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualSensor:
    """One model ready for bulk: per speed column a table (S, G) and a fit matrix (R, G) for each phase."""

    model: ErrorModel
    setting: FitSetting
    grid_m: Array
    knots: Array
    tables_m: Array
    matrices: Mapping[int, tuple[Array, ...]]
    factor: Array

    @classmethod
    def of(
        cls, model: ErrorModel, setting: FitSetting, columns: Iterable[int] | None = None
    ) -> "VirtualSensor":
        """Compile a model, for all speed columns or some."""
        from scipy.special import ndtri

        grid = range_grid(model.range_m, model.applied_length_m)
        chosen = range(len(model.speed_mps)) if columns is None else columns
        phases = range(setting.phases)
        points = {
            k: [points_at(model, setting, float(model.speed_mps[k]), phase) for phase in phases]
            for k in chosen
        }
        return cls(
            model=model,
            setting=setting,
            grid_m=grid,
            knots=ndtri(model.signed_levels),
            tables_m=table_on(grid, model, model.applied_signed_m),
            matrices={
                k: tuple(fit_matrix(setting.config, x, grid, model.range_m) for x in each)
                for k, each in points.items()
            },
            factor=correlation_factor(grid, model.applied_length_m),
        )

    def points(self, z: Array, column: int) -> Array:
        """Return the errors (N, R) of the points at the model's ranges, of processes `z` (N, G)."""
        at = np.searchsorted(self.grid_m, self.model.range_m)
        return quantile(self.knots, self.tables_m[column][:, at], z[:, at])

    def errors(self, z: Array, speed_mps: Array, driven_m: Array | None = None) -> Array:
        """Return the reported errors (N, R) of processes `z` (N, G) at speeds (N,), of the nearest column.

        `driven_m` (N,) is the way to each image: where the dashes are. Without it every phase in turn.
        """
        step = np.searchsorted(0.5 * (self.model.speed_mps[1:] + self.model.speed_mps[:-1]), speed_mps)
        phases = self.setting.phases
        phase = np.arange(len(z)) % phases if driven_m is None else self.setting.phase_at(driven_m)
        place = step * phases + phase
        found = np.empty((len(z), len(self.model.range_m)))
        for one in np.unique(place).tolist():
            here = place == one
            column = one // phases
            moved = quantile(self.knots, self.tables_m[column], z[here])
            found[here] = moved @ self.matrices[column][one % phases].T
        return found

    def drive(self, steps_s: Array, random: np.random.Generator) -> Array:
        """Return a process z (N, G) in time: `steps_s` (N - 1,) between its images."""
        noise = random.standard_normal((len(steps_s) + 1, len(self.grid_m))) @ self.factor.T
        if len(steps_s) and np.ptp(steps_s) < EVEN * np.median(steps_s):
            keep = exp(-float(np.median(steps_s)) / self.model.applied_time_s)
            noise[1:] *= sqrt(1.0 - keep * keep)
            return np.asarray(lfilter([1.0], [1.0, -keep], noise, axis=0))
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
