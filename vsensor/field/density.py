"""Where the errors lie (P1's scatterplot3D): shares of sub cubes, distributions, blind spots, thin cells.

density.npz         share of each sub cube of range, speed and size of the error, and the edges
cells.csv           rows and seconds of driving of each range and speed
distributions.csv   shares of every dimension's bins
thin.csv            speeds whose driving does not suffice, and what is missing
fill.csv            stretches of drives, best first, that fill them
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsensor.field.table import Table
from vsensor.field.tune.conditions import conditions
from vsensor.field.tune.grid import Grid
from vsensor.field.tune.reading import Rows, read_log
from vsensor.field.tune.survey import Survey, SurveyPass, cell_sums
from vsensor.types import Array

SPEED_STEP_MPS = 1.0
ERROR_BINS = 60
LARGEST_MEANS = 10.0
"""The largest size that is told apart, in mean sizes of the cell with the largest errors."""
SPREADS: Mapping[str, tuple[float, float, int]] = {
    "yaw_rate_radps": (-0.3, 0.3, 121),
    "future_yaw_rate_radps": (-0.3, 0.3, 121),
    "acceleration_mps2": (-6.0, 6.0, 121),
    "curvature_per_m": (-0.02, 0.02, 121),
    "night": (-0.5, 1.5, 3),
    "rain": (0.0, 1.0, 21),
}
"""First and last edge and number of edges; what is beyond is in the outermost bin."""
PROFILE = "yaw_rate_radps"
"""The dimension beside range in the error profile (P1 fig. 2.35)."""


@dataclass(slots=True, kw_only=True)
class Density:
    """Counts over a table; R ranges, V speeds, E error bins. See the module for what is made of them.

    `cube` (R, V, E); `spreads` a histogram of each dimension; `unknown` rows where it is not known;
    `profile_largest_m` and `profile_mean_m` (2 sides, R, Y): largest and mean size over range and yaw rate.
    """

    grid: Grid
    error_edges_m: Array
    cube: np.ndarray
    survey: Survey
    seconds: Array
    spreads: dict[str, np.ndarray] = field(default_factory=dict)
    unknown: dict[str, int] = field(default_factory=dict)
    profile_rows: np.ndarray = field(default_factory=lambda: np.zeros(0))
    profile_sum_m: np.ndarray = field(default_factory=lambda: np.zeros(0))
    profile_largest_m: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def share(self) -> Array:
        """Each sub cube's share of all rows (R, V, E)."""
        return self.cube / max(int(self.cube.sum()), 1)

    @property
    def speed_edges_mps(self) -> Array:
        """Edges (V + 1,) of the speeds."""
        return np.asarray((np.arange(self.grid.speeds + 1) - 0.5) * self.grid.step_mps, np.float64)

    @property
    def range_edges_m(self) -> Array:
        """Edges (R + 1,) of the ranges."""
        middle = self.grid.range_m
        if len(middle) == 1:
            return np.array([middle[0] - 0.5, middle[0] + 0.5])
        inner = 0.5 * (middle[1:] + middle[:-1])
        return np.concatenate([[2 * middle[0] - inner[0]], inner, [2 * middle[-1] - inner[-1]]])


def edges_of(name: str) -> Array:
    """Return the edges of a dimension's histogram."""
    first, last, count = SPREADS[name]
    return np.linspace(first, last, count)


def density_of(table: Table, advance: Any = None) -> Density:
    """Count a table in two passes; raises TableError."""
    work = SurveyPass(conditions=conditions(""), step_mps=SPEED_STEP_MPS)
    survey = work.start()
    for file in table.files:
        work.add(survey, file, advance)
    grid = survey.grid(SPEED_STEP_MPS)
    rows, seconds, mean_m = cell_sums(survey, grid)
    largest = max(LARGEST_MEANS * float(mean_m[0][rows[0] > 0].max()), 1e-6)
    speeds, ranges = grid.shape
    yaws = len(edges_of(PROFILE)) - 1
    found = Density(
        grid=grid,
        error_edges_m=np.linspace(0.0, largest, ERROR_BINS + 1),
        cube=np.zeros((ranges, speeds, ERROR_BINS), np.int64),
        survey=survey,
        seconds=seconds[0].T,
        spreads={name: np.zeros(len(edges_of(name)) - 1, np.int64) for name in SPREADS},
        unknown=dict.fromkeys(SPREADS, 0),
        profile_rows=np.zeros((2, ranges, yaws), np.int64),
        profile_sum_m=np.zeros((2, ranges, yaws)),
        profile_largest_m=np.zeros((2, ranges, yaws)),
    )
    places = grid.places()
    for file in table.files:
        for part in read_log(file, progress=advance, more=tuple(SPREADS)):
            if isinstance(part, Rows) and len(part.t_ns):
                _count(found, part, places)
    return found


def _count(found: Density, rows: Rows, places: np.ndarray) -> None:
    size_m = np.abs(rows.error_m).astype(np.float64)
    at = places[np.rint(rows.range_m * np.float32(1000.0)).astype(np.int64)].astype(np.int64)
    speed = found.grid.speed_cell(rows.speed_mps)
    step = found.error_edges_m[1]
    error = np.minimum((size_m / step).astype(np.int64), ERROR_BINS - 1)
    place = (at * found.grid.speeds + speed) * ERROR_BINS + error
    found.cube += np.bincount(place, minlength=found.cube.size).reshape(found.cube.shape)
    for name, values in rows.more.items():
        known = np.isfinite(values)
        bins = _bins(values[known], name)
        found.spreads[name] += np.bincount(bins, minlength=len(found.spreads[name]))
        found.unknown[name] += int(np.count_nonzero(~known))
    yaw = rows.more[PROFILE]
    good = np.isfinite(yaw) & (rows.side < 2)
    shape = found.profile_rows.shape
    cell = (rows.side[good].astype(np.int64) * shape[1] + at[good]) * shape[2] + _bins(yaw[good], PROFILE)
    found.profile_rows += np.bincount(cell, minlength=found.profile_rows.size).reshape(shape)
    um = np.rint(size_m[good] * 1e6)  # whole numbers: their sum does not depend on the order
    found.profile_sum_m += np.bincount(cell, um, minlength=found.profile_rows.size).reshape(shape) / 1e6
    np.maximum.at(found.profile_largest_m.reshape(-1), cell, size_m[good])


def _bins(values: np.ndarray, name: str) -> np.ndarray:
    first, last, count = SPREADS[name]
    place = ((values - first) * ((count - 1) / (last - first))).astype(np.int64)
    return np.clip(place, 0, count - 2)
