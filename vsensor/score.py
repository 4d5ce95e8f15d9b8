"""Output against truth, from a trace: lateral error, view range, availability, per side and pooled.

Definitions, all over the rows of a side (a row is one tick in which the side has a true line or a
report; see `vsensor.sinks.trace`):

- *lateral error* at x: reported y(x) minus true y(x) in metres, positive = reported too far left;
  counted where x is within the reported view range and the true line reaches x; measured and
  predicted reports alike. mean, std (population), and the 95 % quantile of its absolute value.
- *lane offset error*: reported minus true lane offset (inner edge, front axle), left and right only.
- *range*: x_max of the reports: mean, 5 % and 95 % quantile.
- *availability*: share of the rows with a true line in which a line was reported; of these *predicted*
  are those that were not seen in that image.
- *false reports*: reports on a side without any true line.

Quantiles interpolate linearly between the ordered values; NaN where there is nothing to count.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.types import SIDE_NAMES, Side, Unseen

SCORED_RANGES_M = (10, 20, 50, 80)
"""Where `text` gives the lateral error, x in the ego frame."""
ERROR_RANGES_M = (*SCORED_RANGES_M, 100)
"""Where it is computed."""

_RANGE_HEADER = (
    *("side", "range m", "5 %", "95 %", "true lines"),
    *("available %", "measured %", "predicted %", "false reports"),
)

_LINE_TRUTHS = ("truth_c", "truth_y_", "truth_lane_offset")
"""Columns that say where the true line is; NaN in all of them where there is none."""

Trace = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStats:
    """`n` errors in metres: mean, population standard deviation, root mean square.

    Of the absolute value the 95 % quantile and the largest.
    """

    n: int
    mean_m: float
    std_m: float
    rms_m: float
    abs_95_m: float
    abs_max_m: float

    @classmethod
    def of(cls, errors_m: NDArray[Any]) -> "ErrorStats":
        """Return the statistics of errors (N,), those that are NaN left out."""
        known = errors_m[np.isfinite(errors_m)]
        if not known.size:
            nothing = math.nan
            return cls(n=0, mean_m=nothing, std_m=nothing, rms_m=nothing, abs_95_m=nothing, abs_max_m=nothing)
        size = np.abs(known)
        return cls(
            n=int(known.size),
            mean_m=float(known.mean()),
            std_m=float(known.std()),
            rms_m=float(np.sqrt(np.mean(known**2))),
            abs_95_m=float(np.quantile(size, 0.95)),
            abs_max_m=float(size.max()),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SideScore:
    """The score of one side, or of all (`name` "all"); definitions at the head of the module.

    `unseen` counts the rows with a true line and no report, by reason; `hidden_by` those that are occluded,
    by the object that hides most of the line (its id), where the trace names it.
    """

    name: str
    true_rows: int
    reported_true_rows: int
    predicted_true_rows: int
    false_reports: int
    error: Mapping[int, ErrorStats]
    lane_offset: ErrorStats
    range_mean_m: float
    range_5_m: float
    range_95_m: float
    unseen: Mapping[Unseen, int]
    hidden_by: Mapping[int, int]

    @property
    def availability(self) -> float:
        """Share of the rows with a true line that have a report, 0..1, NaN without any."""
        return self.reported_true_rows / self.true_rows if self.true_rows else math.nan

    @property
    def predicted(self) -> float:
        """Share of the rows with a true line that have a predicted report, 0..1, NaN without any."""
        return self.predicted_true_rows / self.true_rows if self.true_rows else math.nan

    @property
    def measured(self) -> float:
        """Share of the rows with a true line that have a measured report, 0..1, NaN without any."""
        return self.availability - self.predicted


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Scores per side, those that occur, and all sides together; `ticks` that have any row."""

    ticks: int
    sides: tuple[SideScore, ...]
    pooled: SideScore

    def text(self) -> str:
        """Return aligned tables: errors, range and availability, reasons for missing lines."""
        return "\n".join(score_lines(self))


def score_trace(trace: Trace) -> Score:
    """Score the columns of a trace (`vsensor.sinks.trace.read_trace`)."""
    sides = [side for side in Side if (trace["side"] == side).any()]
    rows = [(SIDE_NAMES[side], trace["side"] == side) for side in sides]
    return Score(
        ticks=int(np.unique(trace["tick"]).size),
        sides=tuple(_score(name, _chosen(trace, mask)) for name, mask in rows),
        pooled=_score("all", trace),
    )


def _chosen(trace: Trace, mask: NDArray[Any]) -> Trace:
    return {name: column[mask] for name, column in trace.items()}


def _score(name: str, trace: Trace) -> SideScore:
    truths = [trace[column] for column in trace if column.startswith(_LINE_TRUTHS)]
    is_true = np.isfinite(truths).any(axis=0)
    is_reported = np.isfinite(trace["x_max_m"])
    x_max = trace["x_max_m"][is_reported]
    quantiles = np.quantile(x_max, (0.05, 0.95)).tolist() if x_max.size else (math.nan, math.nan)
    reasons = trace["reason_unseen"][is_true & ~is_reported]
    hiding = trace["occluded_by"][is_true & ~is_reported & (trace["reason_unseen"] == Unseen.OCCLUDED)]
    objects, counts = np.unique(hiding[hiding >= 0], return_counts=True)
    return SideScore(
        name=name,
        true_rows=int(is_true.sum()),
        reported_true_rows=int((is_true & is_reported).sum()),
        predicted_true_rows=int((is_true & is_reported & (trace["measured"] == 0)).sum()),
        false_reports=int((is_reported & ~is_true).sum()),
        error={x: ErrorStats.of(trace[f"y_{x}m"] - trace[f"truth_y_{x}m"]) for x in ERROR_RANGES_M},
        lane_offset=ErrorStats.of(trace["lane_offset_m"] - trace["truth_lane_offset_m"]),
        range_mean_m=float(x_max.mean()) if x_max.size else math.nan,
        range_5_m=quantiles[0],
        range_95_m=quantiles[1],
        unseen={reason: int((reasons == reason).sum()) for reason in Unseen if (reasons == reason).any()},
        hidden_by=dict(zip(objects.tolist(), counts.tolist(), strict=True)),
    )


def score_lines(score: Score) -> list[str]:
    """Return the score as lines of text; `-` where there is nothing to count."""
    everyone = (*score.sides, score.pooled)
    errors = [
        _error_row(side.name, f"{x} m", side.error[x]) for side in everyone for x in SCORED_RANGES_M
    ] + [_error_row(side.name, "lane offset", side.lane_offset) for side in everyone if side.lane_offset.n]
    ranges = [
        (
            side.name,
            *(_shown(v, ".1f") for v in (side.range_mean_m, side.range_5_m, side.range_95_m)),
            str(side.true_rows),
            *(_shown(100 * v, ".2f") for v in (side.availability, side.measured, side.predicted)),
            str(side.false_reports),
        )
        for side in everyone
    ]
    reasons = [row for side in score.sides for row in _reason_rows(side)]
    return [
        f"{score.ticks} ticks; lateral error in m, reported minus true, positive = too far left",
        *_aligned(("side", "at", "n", "mean", "std", "95 % of |e|"), errors),
        "",
        *_aligned(_RANGE_HEADER, ranges),
        *(["", *_aligned(("side", "not reported because", "n"), reasons)] if reasons else []),
    ]


def _reason_rows(side: SideScore) -> Iterator[tuple[str, str, str]]:
    """Yield a row for each reason, and below "occluded" one for each object that did it."""
    for reason, n in side.unseen.items():
        yield side.name, _reason_text(reason), str(n)
        if reason == Unseen.OCCLUDED:
            for number, times in side.hidden_by.items():
                yield side.name, f"occluded by object {number}", str(times)


def _reason_text(reason: Unseen) -> str:
    return "seen, but not sent yet" if reason == Unseen.SEEN else reason.name.lower().replace("_", " ")


def _error_row(name: str, place: str, stats: ErrorStats) -> tuple[str, ...]:
    numbers = (stats.mean_m, stats.std_m, stats.abs_95_m)
    return (name, place, str(stats.n), *(_shown(value, ".4f") for value in numbers))


def _shown(value: float, form: str) -> str:
    return "-" if math.isnan(value) else format(value, form)


def _aligned(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return lines with the first column to the left, the others to the right."""
    table = [header, *rows]
    widths = [max(len(row[k]) for row in table) for k in range(len(header))]
    return [
        "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
        for row in table
    ]
