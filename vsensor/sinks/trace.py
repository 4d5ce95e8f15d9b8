"""The trace: truth beside output, one row per tick and side that has a true line or a report.

Columns: `trace_file.COLUMNS`; unit by suffix, SI, left positive, road-level ego frame. A side that was
not reported has NaN in x_min_m, x_max_m, c0..c3, y_* and 0 in kind, quality, measured; a report
without a true line has NaN in truth_*. `y_*` is the reported line's place, NaN outside of its view
range. Written beside its place and moved there at close, so a file with the right name is whole.
"""

import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.errors import ConfigError
from vsensor.sinks.trace_file import ROW, SCHEMA, UNITS, read_trace, writer_for
from vsensor.types import SIDE_NAMES, Boundary, Output, Side
from vsensor.world.truth import RANGES_M, LineTruth, line_truths

__all__ = ["TraceSink", "read_trace", "rows"]

_CHUNK_ROWS = 4096
_NO_REPORT = (0, 0, 0, *(math.nan,) * 6)
_NO_Y = (math.nan,) * len(RANGES_M)


class TraceSink:
    """Writes the trace of a run to `path`: .npz, .csv or .parquet."""

    def __init__(
        self, path: Path, *, front_axle_x_m: float, metadata: Mapping[str, object] | None = None
    ) -> None:
        """Refuse an unknown suffix or a place that cannot be written, before the run begins.

        `front_axle_x_m` is the wheelbase; `metadata` (scenario, profile, seed, quantisation ...) goes
        into the file as JSON. Raises ConfigError, MissingExtraError.
        """
        self._write_file = writer_for(path)
        self._path, self._temporary = path, path.with_name(f".{path.name}.{os.getpid()}.part")
        self._front_axle_x_m = front_axle_x_m
        self._metadata = {"schema": SCHEMA, "units": dict(UNITS), **(metadata or {})}
        self._full: list[NDArray[Any]] = []
        self._chunk, self._used = np.zeros(_CHUNK_ROWS, ROW), 0
        self._closed = False
        try:
            self._temporary.touch()
        except OSError as error:
            raise ConfigError(f"{path}: cannot be written: {error.strerror or error}") from None

    def write(self, output: Output) -> None:
        """Keep the rows of one tick."""
        for row in rows(output, self._front_axle_x_m):
            if self._used == _CHUNK_ROWS:
                self._full.append(self._chunk)
                self._chunk, self._used = np.zeros(_CHUNK_ROWS, ROW), 0
            self._chunk[self._used] = row
            self._used += 1

    def close(self) -> None:
        """Write the file and move it to its place; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        table = np.concatenate([*self._full, self._chunk[: self._used]])
        try:
            self._write_file(self._temporary, table, self._metadata)
            self._temporary.replace(self._path)
        except OSError as error:
            raise ConfigError(f"{self._path}: cannot be written: {error.strerror or error}") from None
        finally:
            self._temporary.unlink(missing_ok=True)


def rows(output: Output, front_axle_x_m: float) -> Iterator[tuple[Any, ...]]:
    """Yield one tuple in the order of COLUMNS per side that has a true line or a report."""
    reported = {line.side: line for line in output.estimate.boundaries if _is_sent(output, line.side)}
    ego, tick = output.snapshot.ego, output.tick
    for side, truth in line_truths(output, front_axle_x_m).items():
        line = reported.get(side)
        report, y = (_NO_REPORT, _NO_Y) if line is None else (_report(line), _places(line))
        offset_m = output.values.get(f"{SIDE_NAMES[side]}.lane_offset_m", math.nan) if line else math.nan
        place = (*_truth(truth), *y, offset_m, truth.lane_offset_m)
        motion = (ego.speed_mps, ego.yaw_rate_radps)
        yield (tick.t_ns, tick.index, side, *report, *place, truth.reason_unseen, *motion)


def _is_sent(output: Output, side: Side) -> bool:
    """Whether the line went out: a sensor that is not up yet, or failed, fits lines and keeps silent."""
    return output.values.get(f"{SIDE_NAMES[side]}.available", 0.0) > 0.0


def _report(line: Boundary) -> tuple[float, ...]:
    c = line.coefficients.tolist()
    cubic = (*c[:4], *(0.0,) * (4 - len(c)))
    return (line.kind, line.quality, line.measured, line.x_min_m, line.x_max_m, *cubic)


def _places(line: Boundary) -> tuple[float, ...]:
    """Return the reported y at RANGES_M, all powers of the polynomial, NaN outside of its view range."""
    coefficients = line.coefficients.tolist()[::-1]
    found = []
    for x in RANGES_M:
        y = 0.0
        for coefficient in coefficients:
            y = y * x + coefficient
        found.append(y if line.x_min_m <= x <= line.x_max_m else math.nan)
    return tuple(found)


def _truth(truth: LineTruth) -> tuple[float, ...]:
    return (*truth.coefficients.tolist(), *truth.y_m.tolist())
