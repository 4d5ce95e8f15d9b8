"""What an error may depend on: radius, gap, speed, what hides the line, light, rain, fog; errors by each.

For every tick and side of a trace, at each range x of ERROR_RANGES_M:

- *radius*: of the true line at x, from the curvature of its best cubic there.
- *gap*: the longest stretch without paint that begins between the vehicle and x.
- *hidden*: the share of the line's paint between the vehicle and x that other vehicles hide.
- *speed*, *light*, *rain*, *visibility*: at the tick.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.score import ERROR_RANGES_M, Trace
from vsensor.types import Array, BoolArray, Light, Output, Side, Unseen
from vsensor.world.truth import true_sides

_X = np.array(ERROR_RANGES_M, dtype=np.float64)
KMH_PER_MPS = 3.6


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A condition in bins: bin k holds the values from edges[k] up to edges[k + 1]."""

    name: str
    title: str
    edges: tuple[float, ...]
    labels: tuple[str, ...]

    def bins(self, values: Array) -> NDArray[np.int64]:
        """Return the bin of each value, -1 outside of all and for NaN."""
        found = np.searchsorted(self.edges, values, side="right") - 1
        inside = np.isfinite(values) & (found >= 0) & (found < len(self.labels))
        return np.where(inside, found, -1)


def _stretches(name: str, title: str, *edges: float) -> Axis:
    labels = [f"{a:g} to {b:g}" for a, b in itertools.pairwise(edges[:-1])]
    return Axis(name=name, title=title, edges=edges, labels=(*labels, f"from {edges[-2]:g}"))


FAR = 1e12
AXES = (
    _stretches(
        "radius", "radius of the true line, m", 0, 325, 500, 700, 900, 1250, 2500, FAR
    ),  # P3's radii 250, 400, 600, 800, 1000, 1500 m are one to a bin
    _stretches("gap", "longest gap before the range, m", 0, 3, 7.5, 15, 35, FAR),  # P3: 5, 10, 20, 50 m
    _stretches("speed", "speed, km/h", 0, 40, 60, 80, 100, 120, 140, FAR),
    Axis(
        name="hidden",
        title="share of the paint that vehicles hide, %",
        edges=(0.0, 1e-9, 25.0, 50.0, 75.0, 101.0),
        labels=("0", "to 25", "to 50", "to 75", "to 100"),
    ),
    Axis(
        name="light",
        title="light",
        edges=(0.0, 1.0, 2.0, 3.0),
        labels=tuple(light.name.lower() for light in Light),
    ),
    Axis(
        name="rain",
        title="rain, 0 dry to 1 heaviest",
        edges=(0.0, 1e-9, 0.35, 0.75, 1.01),
        labels=("0", "to 0.35", "to 0.75", "to 1"),
    ),
    Axis(
        name="visibility",
        title="visibility in fog, m",
        edges=(0.0, 50.0, 100.0, 200.0, 1000.0, 2.0 * FAR),
        labels=("0 to 50", "50 to 100", "100 to 200", "200 to 1000", "clear"),
    ),
)
"""In the order of the report."""

_ROW = np.dtype(
    [("tick", np.int64), ("side", np.uint8), ("gap", np.float64, len(_X)), ("hidden", np.float64, len(_X))]
)


class ConditionSink:
    """A sink that keeps gaps and what is hidden, for each tick and side with a true line."""

    def __init__(self) -> None:
        self._rows: list[tuple[Any, ...]] = []

    def write(self, output: Output) -> None:
        """Keep the rows of one tick."""
        candidates, observation = output.observation.candidates, output.observation
        for side, k in true_sides(candidates, output.snapshot).items():
            a, b = int(candidates.starts[k]), int(candidates.starts[k + 1])
            marking = output.snapshot.scene.markings[int(candidates.marking[k])]
            painted = marking.painted[candidates.index[a:b]]
            x = candidates.points_ego_m[a:b, 0]
            hidden = observation.reason[a:b] == Unseen.OCCLUDED
            self._rows.append((output.tick.index, side, gaps_m(x, painted), shares(x, painted, hidden)))

    def close(self) -> None:
        """Nothing to close."""

    def joined(self, trace: Trace) -> dict[str, Array]:
        """Return {axis: (rows of the trace, ranges)}, NaN where nothing is known of a row."""
        kept = np.array(self._rows, dtype=_ROW)
        found = {axis.name: np.full((len(trace["tick"]), len(_X)), np.nan) for axis in AXES}
        found["radius"] = radii_m(trace)
        found["speed"][:] = KMH_PER_MPS * np.abs(trace["speed_mps"])[:, None]
        found["light"][:] = trace["light"][:, None]
        found["rain"][:] = trace["rain"][:, None]
        found["visibility"][:] = np.minimum(trace["visibility_m"], FAR)[:, None]
        if len(kept):
            kept = kept[np.lexsort((kept["side"], kept["tick"]))]
            keys = kept["tick"] * len(Side) + kept["side"]
            wanted = trace["tick"] * len(Side) + trace["side"]
            place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            known = keys[place] == wanted
            found["gap"][known] = kept["gap"][place[known]]
            found["hidden"][known] = 100.0 * kept["hidden"][place[known]]
        return found


def gaps_m(x_m: Array, painted: BoolArray) -> Array:
    """Return the longest stretch without paint that begins before each range (ranges,), NaN without paint.

    `x_m` (N,) of the points of a line, rising; a stretch is as long as the unpainted points stand apart,
    and is counted from the vehicle on, not behind it.
    """
    inked = x_m[painted]
    if not inked.size:
        return np.full(len(_X), np.nan)
    spacing = float(np.median(np.diff(x_m))) if x_m.size > 1 else 0.0
    first = max(float(x_m[0]), 0.0)
    ahead = inked[inked >= first]
    borders = np.concatenate([[first], ahead, [max(float(x_m[-1]), first)]])
    lengths = np.maximum(np.diff(borders) - spacing, 0.0)
    return np.array([lengths[borders[:-1] <= x].max(initial=0.0) for x in _X])


def shares(x_m: Array, painted: BoolArray, hidden: BoolArray) -> Array:
    """Return the share of the painted points before each range that are hidden (ranges,), NaN without any."""
    found = np.full(len(_X), np.nan)
    for place, x in enumerate(_X):
        near = painted & (x_m <= x)
        if count := int(near.sum()):
            found[place] = int((near & hidden).sum()) / count
    return found


def radii_m(trace: Trace) -> Array:
    """Return the radius of the true line at each range (rows, ranges): its best cubic's, NaN without one."""
    c1, c2, c3 = (trace[f"truth_c{k}"][:, None] for k in (1, 2, 3))
    slope = c1 + _X * (2.0 * c2 + _X * 3.0 * c3)
    bend = np.abs(2.0 * c2 + 6.0 * c3 * _X)
    return np.hypot(1.0, slope) ** 3 / np.maximum(bend, 1.0 / (0.99 * FAR))


Binned = dict[str, list[list[list[float]]]]
"""Axis -> bin -> range -> number of errors, their sum, sum of their squares, largest size."""


def binned(trace: Trace, conditions: Mapping[str, Array]) -> Binned:
    """Return the errors of a trace by every condition; what is pooled of several runs is exact."""
    errors = np.stack([trace[f"y_{x}m"] - trace[f"truth_y_{x}m"] for x in ERROR_RANGES_M], axis=1)
    known = np.isfinite(errors)
    return {axis.name: _by(axis, errors, known, conditions[axis.name]) for axis in AXES}


def _by(axis: Axis, errors: Array, known: BoolArray, values: Array) -> list[list[list[float]]]:
    places = axis.bins(values)
    table = []
    for number in range(len(axis.labels)):
        row = []
        for column in range(len(_X)):
            some = errors[known[:, column] & (places[:, column] == number), column]
            row.append(
                [
                    float(some.size),
                    float(some.sum()),
                    float((some**2).sum()),
                    float(np.abs(some).max(initial=0.0)),
                ]
            )
        table.append(row)
    return table


def pooled(runs: Sequence[Binned]) -> dict[str, Array]:
    """Return {axis: (bins, ranges, 4)} of several runs: sums added, the largest of the largest."""
    found = {}
    for axis in AXES:
        table = np.zeros((len(axis.labels), len(_X), 4))
        for run in runs:
            one = np.array(run[axis.name])
            table[..., :3] += one[..., :3]
            table[..., 3] = np.maximum(table[..., 3], one[..., 3])
        found[axis.name] = table
    return found


def condition_rows(tables: Mapping[str, Array]) -> list[dict[str, Any]]:
    """Return a table of the errors by condition: axis, bin, range, number, mean, RMS, largest."""
    return [
        {
            **{"axis": axis.name, "bin": label, "range_m": x, "n": int(n)},
            **{"mean_m": total / n, "rms_m": (squares / n) ** 0.5, "abs_max_m": largest},
        }
        for axis in AXES
        for label, row in zip(axis.labels, tables[axis.name].tolist(), strict=True)
        for x, (n, total, squares, largest) in zip(ERROR_RANGES_M, row, strict=True)
        if n
    ]
