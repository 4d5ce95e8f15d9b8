"""Why a line was not seen, from the trace of the run that made the log."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from vsensor.apps.examine.drive import Drive
from vsensor.errors import ConfigError
from vsensor.sinks.trace_file import read_trace
from vsensor.types import Array, Side, Unseen

SAME_M = 0.05
"""Trace and log show the same line within it: the bus rounds, and an image may be sent one later."""
MOST_MISSING = 0.1


def causes_of(path: Path, drive: Drive) -> Mapping[Side, Array]:
    """Return for each side the cause (N,) at every image; the trace's first tick is the log's first image.

    Raises ConfigError if the file is no trace, or that of another run.
    """
    trace = read_trace(path)
    if not len(trace["t_ns"]):
        raise ConfigError(f"{path}: the trace has no rows")
    since_ns = trace["t_ns"] - trace["t_ns"].min()
    image_ns = drive.images.t_ns - drive.images.t_ns[0]
    period_ns = int(np.median(np.diff(image_ns)))
    found: dict[Side, Array] = {}
    for side in drive.sides:
        rows = np.flatnonzero(trace["side"] == side)
        place = np.clip(np.searchsorted(since_ns[rows], image_ns - period_ns // 2), 0, max(len(rows) - 1, 0))
        near = np.abs(since_ns[rows][place] - image_ns) <= period_ns // 2 if len(rows) else []
        codes = np.full(len(drive), np.nan)
        if len(rows):
            codes = np.where(near, trace["reason_unseen"][rows][place].astype(float), np.nan)
            _require_same(path, drive, side, np.where(near, trace["c0"][rows][place], np.nan))
        found[side] = codes
    return found


def _require_same(path: Path, drive: Drive, side: Side, offset_m: Array) -> None:
    line = drive.images.lines[side]
    both = line.is_whole & np.isfinite(offset_m)
    apart = np.abs(line.coefficients[both, 0] - offset_m[both])
    if len(apart) < (1 - MOST_MISSING) * np.count_nonzero(line.is_whole) or np.median(apart) > SAME_M:
        raise ConfigError(f"{path}: is no trace of the run that {drive.log} was recorded of")


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Images `first` to `last`, both of them, that share a value."""

    first: int
    last: int
    value: float


def stretches(values: Array) -> Iterator[Stretch]:
    """Yield the runs of equal values (N,); NaN equals NaN."""
    if not len(values):
        return
    marked = np.where(np.isnan(values), -1.0, values)
    edges = [0, *(np.flatnonzero(np.diff(marked)) + 1).tolist(), len(values)]
    for first, end in pairwise(edges):
        yield Stretch(first=first, last=end - 1, value=float(values[first]))


def cause_name(code: float) -> str:
    """Return a cause as words."""
    return Unseen(int(code)).name.lower().replace("_", " ")
