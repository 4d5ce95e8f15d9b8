"""Where the errors lie (P1's scatterplot3D): shares of sub cubes, distributions, blind spots, thin cells.

density.npz         share of each sub cube of range, speed and size of the error, and the edges
cells.csv           rows and seconds of driving of each range and speed
distributions.csv   shares of every dimension's bins
thin.csv            speeds whose driving does not suffice, and what is missing
fill.csv            stretches of drives, best first, that fill them
"""

import csv
import io
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsensor.field.table import LogFile, Table
from vsensor.field.tune.conditions import conditions
from vsensor.field.tune.grid import MAX_SPEED_MPS, Grid, speed_cell
from vsensor.field.tune.reading import Images, Rows, read_log
from vsensor.field.tune.region import operating_region
from vsensor.field.tune.survey import REACH_BINS, REACH_STEP_M, Survey, SurveyPass, cell_sums
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Thin:
    """A speed whose driving does not suffice: seconds that it has at the range where it has fewest of them.

    `to_m` is the operating range there: cells beyond it stay empty however far one drives.
    """

    speed_mps: float
    to_m: float
    seconds: float
    missing_s: float


def thin_cells(found: Density, wanted_s: float) -> list[Thin]:
    """Return the speeds with less than `wanted_s` of driving at some range within the operating range."""
    reach = found.survey.reach[0]
    knots, values = operating_region(reach, found.grid.step_mps, 0.95)
    thin = []
    for place, speed in enumerate(found.grid.speed_mps.tolist()):
        to_m = float(np.interp(speed, knots, values))
        within = found.grid.range_m <= 0.9 * to_m
        seconds = float(found.seconds[within, place].min()) if within.any() else 0.0
        if seconds < wanted_s:
            thin.append(Thin(speed_mps=speed, to_m=to_m, seconds=seconds, missing_s=wanted_s - seconds))
    return thin


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A stretch of a drive at thin speeds: from and to in s from the log's begin, and what it would fill."""

    log: str
    from_s: float
    to_s: float
    speed_low_mps: float
    speed_high_mps: float
    fills_s: float


def filling_drives(candidates: Table, thin: list[Thin], step_mps: float) -> list[Stretch]:
    """Return the stretches of drives at thin speeds, those that fill most first.

    A second counts by how much of that speed's driving is missing: the emptier, the more.
    """
    worth = np.zeros(round(MAX_SPEED_MPS / step_mps) + 1)
    for one in thin:
        worth[round(one.speed_mps / step_mps)] = one.missing_s / (one.missing_s + one.seconds)
    found = [stretch for file in candidates.files for stretch in _stretches(file, worth, step_mps)]
    return sorted(found, key=lambda one: (-one.fills_s, one.log, one.from_s))


def _stretches(file: LogFile, worth: Array, step_mps: float) -> Iterator[Stretch]:
    images = [part for part in read_log(file, images=True) if isinstance(part, Images)]
    if not images:
        return
    t_ns, first = np.unique(images[0].t_ns, return_index=True)
    speed = images[0].speed_mps[first]
    good = np.isfinite(speed)
    cell = speed_cell(np.where(good, speed, 0.0).astype(np.float32), step_mps, len(worth))
    value = np.where(good, worth[cell], 0.0)
    long = np.diff(t_ns, append=t_ns[-1]) / 1e9
    long = np.where(long < 1.0, long, 0.0)
    joined = _closed_gaps(value > 0.0, t_ns, 5.0)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], joined.astype(np.int8), [0]])))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        part = slice(start, stop)
        yield Stretch(
            log=file.log,
            from_s=float(t_ns[start] - t_ns[0]) / 1e9,
            to_s=float(t_ns[stop - 1] - t_ns[0]) / 1e9,
            speed_low_mps=float(speed[part].min()),
            speed_high_mps=float(speed[part].max()),
            fills_s=float((value[part] * long[part]).sum()),
        )


def _closed_gaps(inside: np.ndarray, t_ns: np.ndarray, longest_s: float) -> np.ndarray:
    """Return `inside` with gaps of less than so many seconds closed: one stretch, not many."""
    at = np.flatnonzero(inside)
    closed = inside.copy()
    for one, other in itertools.pairwise(at):
        if other > one + 1 and (t_ns[other] - t_ns[one]) < longest_s * 1e9:
            closed[one:other] = True
    return closed


def csv_text(header: list[str], rows: list[list[Any]]) -> bytes:
    """Return a table as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue().encode()


def files_of(found: Density, thin: list[Thin], fill: list[Stretch]) -> dict[str, bytes]:
    """Return name -> content of the arrays and tables."""
    arrays = io.BytesIO()
    np.savez_compressed(
        arrays,
        share=found.share,
        rows=found.cube,
        range_m=found.grid.range_m,
        speed_edges_mps=found.speed_edges_mps,
        error_edges_m=found.error_edges_m,
        seconds=found.seconds,
        reach_rows=found.survey.reach[0, : found.grid.speeds],
        reach_edges_m=np.arange(REACH_BINS + 1) * REACH_STEP_M,
    )
    cells = [
        [f"{r:g}", f"{v:g}", int(found.cube[i, k].sum()), f"{found.seconds[i, k]:.2f}"]
        for i, r in enumerate(found.grid.range_m)
        for k, v in enumerate(found.grid.speed_mps)
    ]
    return {
        "density.npz": arrays.getvalue(),
        "cells.csv": csv_text(["range_m", "speed_mps", "rows", "seconds"], cells),
        "distributions.csv": csv_text(["dimension", "from", "to", "share"], _distributions(found)),
        "thin.csv": csv_text(
            ["speed_mps", "operating_range_m", "seconds", "missing_s"],
            [[f"{x.speed_mps:g}", f"{x.to_m:.1f}", f"{x.seconds:.0f}", f"{x.missing_s:.0f}"] for x in thin],
        ),
        "fill.csv": csv_text(
            ["log", "from_s", "to_s", "speed_low_mps", "speed_high_mps", "fills_s"],
            [
                [
                    x.log,
                    *(f"{v:.2f}" for v in (x.from_s, x.to_s, x.speed_low_mps, x.speed_high_mps, x.fills_s)),
                ]
                for x in fill
            ],
        ),
    }


def _distributions(found: Density) -> list[list[Any]]:
    total = max(int(found.cube.sum()), 1)
    dimensions = [
        ("range_m", found.range_edges_m, found.cube.sum(axis=(1, 2))),
        ("speed_mps", found.speed_edges_mps, found.cube.sum(axis=(0, 2))),
        ("error_m", found.error_edges_m, found.cube.sum(axis=(0, 1))),
        *((name, edges_of(name), counts) for name, counts in found.spreads.items()),
    ]
    return [
        [name, f"{low:.6g}", f"{high:.6g}", f"{count / total:.6g}"]
        for name, edges, counts in dimensions
        for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True)
    ]
