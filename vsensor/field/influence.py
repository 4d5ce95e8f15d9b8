"""What the error depends on: P1's principal components as published, and the share each dimension explains.

P1 (table 3.1) takes the variance of the inputs, in their units, so range "explains" 94 %: metres squared are
large numbers, and the error is not in it. The real question is how much of the error's size goes with each
dimension. Size and dimensions are taken by rank (normal scores), which no unit changes:

    alone     share of the size's variance that the mean over classes of one dimension explains
    shared    Shapley value of R^2 of the linear model of all dimensions: what each adds, averaged over all
              orders in which they can be added; these sum to R^2

with 95 % intervals from drawing logs (or blocks of 60 s, where there are few) with replacement.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np
from scipy.special import ndtri
from scipy.stats import rankdata

from vsensor.errors import TableError
from vsensor.field.table import Table
from vsensor.field.tune.reading import Progress, Rows, read_log
from vsensor.types import Array, IntArray

PUBLISHED = ("range_m", "speed_mps", "acceleration_mps2", "night", "yaw_rate_radps", "rain")
DIMENSIONS = (*PUBLISHED, "curvature_per_m")
WORDS = {
    "range_m": "Range",
    "speed_mps": "Speed",
    "acceleration_mps2": "Acceleration",
    "night": "Lightning Conditions",
    "yaw_rate_radps": "Yaw Rate",
    "rain": "Weather Conditions",
    "curvature_per_m": "Curvature ahead",
}
"""P1's words; lightning is its spelling of the light."""
MOST_ROWS = 2_000_000
FEWEST_LOGS = 10
BLOCK_NS = 60_000_000_000
CLASSES = 20
DRAWS = 400
ABSOLUTE = frozenset({"acceleration_mps2", "yaw_rate_radps", "curvature_per_m"})
"""A bend to the left is as hard as one to the right: the size counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """A principal component of the inputs: the dimension that it mostly is, its variance and its share."""

    dimension: str
    share: float
    variance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Influence:
    """A dimension's shares of the variance of the error's size (by rank), each (value, low, high)."""

    dimension: str
    alone: tuple[float, float, float]
    shared: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Influences:
    """All of them; `units` were drawn (`by` log or block), `unknown` dimensions are not in the table."""

    components: tuple[Component, ...]
    influences: tuple[Influence, ...]
    explained: tuple[float, float, float]
    rows: int
    units: int
    by: str
    unknown: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Sample:
    """Every k-th image of a table: columns (N,), error's size (N,), unit (N,)."""

    columns: dict[str, Array]
    size_m: Array
    unit: np.ndarray
    by: str


def influence_of(table: Table, *, seed: int = 0, progress: Progress | None = None) -> Influences:
    """Return what the error depends on; raises TableError where nothing can be said."""
    sample = _sampled(table, progress)
    known = [name for name in DIMENSIONS if _varies(sample.columns[name])]
    unknown = tuple(name for name in DIMENSIONS if name not in known)
    units = int(sample.unit.max()) + 1
    if not known or np.ptp(sample.size_m) == 0.0:
        raise TableError("no dimension or no error of the table varies: nothing to explain")
    if units < 2:
        raise TableError(f"one block of {BLOCK_NS / 1e9:g} s only: no interval; more was expected")
    scores = np.stack([_scores(_directed(name, sample.columns[name])) for name in known])
    target = _scores(sample.size_m)
    alone, shared, total = _bootstrapped(scores, target, sample.unit, np.random.default_rng(seed))
    return Influences(
        components=tuple(principal_components(sample.columns)),
        influences=tuple(
            Influence(dimension=name, alone=_interval(alone[:, k]), shared=_interval(shared[:, k]))
            for k, name in enumerate(known)
        ),
        explained=_interval(total),
        rows=len(target),
        units=units,
        by=sample.by,
        unknown=unknown,
    )


def _sampled(table: Table, progress: Progress | None) -> _Sample:
    total = sum(int(file.info.get("rows", 0)) for file in table.files)
    every = max(-(-total // MOST_ROWS), 1)
    by = "log" if len(table.files) >= FEWEST_LOGS else "block"
    parts: dict[str, list[np.ndarray]] = {name: [] for name in DIMENSIONS}
    sizes, units, first = list[np.ndarray](), list[np.ndarray](), 0
    for file in sorted(table.files, key=lambda one: one.log):
        last = 0
        began = -1
        for rows in read_log(file, progress=progress, more=DIMENSIONS):
            if not isinstance(rows, Rows) or not len(rows.t_ns):
                continue
            began = int(rows.t_ns[0]) if began < 0 else began
            chosen = np.cumsum(np.diff(rows.t_ns, prepend=rows.t_ns[0]) != 0) % every == 0
            unit = (rows.t_ns[chosen] - began) // BLOCK_NS if by == "block" else np.zeros(chosen.sum(), int)
            units.append(unit + first)
            sizes.append(np.abs(rows.error_m[chosen]).astype(np.float64))
            for name in DIMENSIONS:
                parts[name].append(rows.more[name][chosen].astype(np.float64))
            last = max(last, int(unit.max(initial=0)))
        first += last + 1
    if not sizes:
        raise TableError("no row of the table has an error that is used: nothing to explain")
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    unit = np.unique(np.concatenate(units), return_inverse=True)[1]  # a pause of a log makes none
    return _Sample(columns, np.concatenate(sizes), unit, by)


def _varies(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return len(known) > 0.5 * len(values) and float(np.ptp(known)) > 0.0


def _directed(name: str, values: Array) -> Array:
    filled = np.where(np.isfinite(values), values, np.nanmedian(values))
    return np.abs(filled) if name in ABSOLUTE else filled


def _scores(values: Array) -> Array:
    """Return normal scores of the ranks, ties in their middle, with mean 0 and variance 1."""
    scores = ndtri((rankdata(values) - 0.5) / len(values))
    return np.asarray((scores - scores.mean()) / scores.std())


def principal_components(columns: dict[str, Array]) -> list[Component]:
    """Return P1's table 3.1: eigenvalues of the inputs' covariance, in their units (eq. 2.52), largest first.

    Each component has the name of the dimension that weighs most in it. Unknown values count as the median,
    a dimension that is never known as constant.
    """
    names = list(PUBLISHED)
    filled = [np.nan_to_num(columns[name], nan=_median(columns[name])) for name in names]
    covariance = np.cov(np.stack(filled))
    values, vectors = np.linalg.eigh(covariance)
    free, found = list(range(len(names))), []
    for place in np.argsort(values)[::-1]:
        dimension = max(free, key=lambda k: abs(vectors[k, place]))
        free.remove(dimension)
        variance = max(float(values[place]), 0.0)
        share = variance / max(float(np.trace(covariance)), 1e-300)
        found.append(Component(dimension=names[dimension], share=share, variance=variance))
    return found


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else 0.0


def _bootstrapped(
    scores: Array, target: Array, unit: np.ndarray, random: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Return alone (1 + DRAWS, D), shared (1 + DRAWS, D) and R^2 (1 + DRAWS,), the first of all units.

    Units' sums are drawn, not rows: that is the same, and as fast for many rows as for few.
    """
    units = int(unit.max()) + 1
    joint = np.vstack([np.ones(len(target)), scores, target])
    products = np.stack(
        [np.bincount(unit, a * b, minlength=units) for a in joint for b in joint], axis=1
    ).reshape(units, len(joint), len(joint))
    classes = [_classes(row) for row in scores]
    counts, sums = (
        [np.stack([_by_unit(k, c, w, units) for c in range(CLASSES)], axis=1) for k in classes]
        for w in _weights(unit, target)
    )
    draws = np.vstack([np.ones(units), random.multinomial(units, np.full(units, 1 / units), DRAWS)])
    alone = np.empty((len(draws), len(scores)))
    shared = np.empty_like(alone)
    for place, weight in enumerate(draws):
        total = np.tensordot(weight, products, 1)
        shared[place] = shapley(_correlation(total))
        mean, square = total[0, -1] / total[0, 0], total[-1, -1] / total[0, 0]
        for k in range(len(scores)):
            count, summed = weight @ counts[k], weight @ sums[k]
            between = np.sum(summed**2 / np.maximum(count, 1.0)) / total[0, 0] - mean**2
            alone[place, k] = between / (square - mean**2)
    return alone, shared, shared.sum(axis=1)


def _weights(unit: np.ndarray, target: Array) -> tuple[tuple[np.ndarray, Array], ...]:
    return (unit, np.ones(len(target))), (unit, target)


def _by_unit(classes: np.ndarray, one: int, weights: tuple[np.ndarray, Array], units: int) -> Array:
    here = classes == one
    unit, weight = weights
    return np.asarray(np.bincount(unit[here], weight[here], minlength=units), np.float64)


def _classes(scores: Array) -> IntArray:
    """Return the class (N,) of about equally many rows each; equal values are in one class."""
    edges = np.unique(np.quantile(scores, np.linspace(0.0, 1.0, CLASSES + 1)[1:-1]))
    return np.asarray(np.searchsorted(edges, scores, side="right"), np.int64)


def _correlation(total: Array) -> Array:
    """Return the correlation matrix of dimensions and size, of summed products with a leading 1."""
    mean = total[0, 1:] / total[0, 0]
    covariance = total[1:, 1:] / total[0, 0] - np.outer(mean, mean)
    std = np.sqrt(np.maximum(np.diag(covariance), 1e-12))
    return np.asarray(covariance / np.outer(std, std))


def shapley(correlation: Array) -> Array:
    """Return the Shapley values (D,) of R^2 of the last variable by the D others."""
    count = len(correlation) - 1
    found = {
        frozenset(chosen): _r2(correlation, chosen)
        for size in range(count + 1)
        for chosen in combinations(range(count), size)
    }
    values = np.zeros(count)
    for one in range(count):
        for chosen, without in found.items():
            if one not in chosen:
                size = len(chosen)
                weight = factorial(size) * factorial(count - size - 1) / factorial(count)
                values[one] += weight * (found[chosen | {one}] - without)
    return values


def _r2(correlation: Array, chosen: Sequence[int]) -> float:
    if not chosen:
        return 0.0
    inputs = correlation[np.ix_(chosen, chosen)] + 1e-9 * np.eye(len(chosen))
    with_size = correlation[list(chosen), -1]
    return float(with_size @ np.linalg.solve(inputs, with_size))


def _interval(draws: Array) -> tuple[float, float, float]:
    low, high = np.quantile(draws[1:], [0.025, 0.975])
    return float(draws[0]), float(low), float(high)


def published_lines(found: Influences) -> list[str]:
    """Return P1's table 3.1 in its form."""
    lines = [f"{'Dimension':22}{'Explanation (%)':>16}{'Variance':>14}"]
    lines += [
        f"{WORDS[one.dimension]:22}{100.0 * one.share:16.3f}{one.variance:14.4g}" for one in found.components
    ]
    return [*lines, "variance of the inputs in their units; the error is not in it"]


def influence_lines(found: Influences) -> list[str]:
    """Return what explains the error, largest first."""
    lines = [
        f"share of the variance of the error's size (by rank) in {found.rows} rows; 95 % intervals from "
        f"drawing {found.units} {found.by}s",
        f"{'dimension':20}{'shared':>9}{'interval':>18}{'alone':>9}{'interval':>18}",
    ]
    for one in sorted(found.influences, key=lambda one: -one.shared[0]):
        lines.append(f"{one.dimension:20}{_percent(one.shared)}{_percent(one.alone)}")
    lines.append(f"{'together':20}{_percent(found.explained)}")
    if found.unknown:
        lines.append(f"unknown or the same everywhere: {', '.join(found.unknown)}")
    return lines


def _percent(value: tuple[float, float, float]) -> str:
    share, low, high = (100.0 * one for one in value)
    return f"{share:8.1f}%{f'[{low:.1f}, {high:.1f}]':>18}"
