"""The trace: truth beside output, one row per tick and side that has a true line or a report.

Columns: `trace_file.COLUMNS`; unit by suffix, SI, left positive, road-level ego frame. A side that was
not reported has NaN in x_min_m, x_max_m, c0..c3, y_* and 0 in kind, quality, measured; a report
without a true line has NaN in truth_c*, truth_y_*, map_*, fit_*. `y_*` is the reported line's place, NaN
outside of its view range. Lane, pose and weather are those of the tick, the same in all of its rows.
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.camera import Camera
from vsensor.signals import VehicleConfig
from vsensor.sinks.rows import RowFile
from vsensor.sinks.trace_file import LANE_QUANTITIES, ROW, SCHEMA, UNITS, read_trace
from vsensor.types import SIDE_NAMES, Array, Boundary, IntArray, Output, Side, Unseen
from vsensor.world.truth import RANGES_M, LineTruth, hiders, lane_truth, line_truths

__all__ = ["TraceSink", "read_trace", "rows"]

_NO_REPORT = (0, 0, 0, *(math.nan,) * 6)
_NO_Y = (math.nan,) * len(RANGES_M)
_NOT_HIDDEN = (-1, math.nan)


class TraceSink:
    """Writes the trace of a run to `path`: .npz, .csv or .parquet."""

    def __init__(
        self,
        path: Path,
        *,
        front_axle_x_m: float,
        metadata: Mapping[str, object] | None = None,
        vehicle: VehicleConfig | None = None,
        camera: Camera | None = None,
    ) -> None:
        """Refuse an unknown suffix or a place that cannot be written, before the run begins.

        `front_axle_x_m` is the wheelbase; `metadata` (scenario, profile, seed, quantisation ...) goes
        into the file as JSON. `vehicle` (else the default one) is what crosses a line; without a `camera`
        it is not said which object hides a line. Raises ConfigError, MissingExtraError.
        """
        self._vehicle = _of_wheelbase(vehicle, front_axle_x_m)
        self._camera = camera
        self._file = RowFile(path, ROW, {"schema": SCHEMA, "units": dict(UNITS), **(metadata or {})})

    def write(self, output: Output) -> None:
        """Keep the rows of one tick."""
        for row in rows(output, self._vehicle.wheelbase_m, self._vehicle, self._camera):
            self._file.add(row)

    def close(self) -> None:
        """Write the file and move it to its place; a second call does nothing."""
        self._file.close()


def rows(
    output: Output,
    front_axle_x_m: float,
    vehicle: VehicleConfig | None = None,
    camera: Camera | None = None,
) -> Iterator[tuple[Any, ...]]:
    """Yield one tuple in the order of COLUMNS per side that has a true line or a report; see TraceSink."""
    vehicle = _of_wheelbase(vehicle, front_axle_x_m)
    reported = {line.side: line for line in output.estimate.boundaries if _is_sent(output, line.side)}
    truths = line_truths(output, front_axle_x_m)
    who = hiders(output, camera) if camera is not None else None
    ego, tick = output.snapshot.ego, output.tick
    tail = (*_lane(output, vehicle, truths), *_tick(output))
    for side, truth in truths.items():
        line = reported.get(side)
        report, y = (_NO_REPORT, _NO_Y) if line is None else (_report(line), _places(line))
        offset_m = output.values.get(f"{SIDE_NAMES[side]}.lane_offset_m", math.nan) if line else math.nan
        place = (*_truth(truth), *y, offset_m, truth.lane_offset_m)
        motion = (ego.speed_mps, ego.yaw_rate_radps)
        known = (*_hidden(output, truth, who), *_p3(truth.taylor), *_p3(truth.whole.coefficients))
        yield (
            *(tick.t_ns, tick.index, side, *report, *place, truth.reason_unseen, *motion),
            *(*known, truth.whole.std_m, *tail),
        )


def _of_wheelbase(vehicle: VehicleConfig | None, wheelbase_m: float) -> VehicleConfig:
    return VehicleConfig(wheelbase_m=wheelbase_m) if vehicle is None else vehicle


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


def _p3(cubic: Array) -> tuple[float, float, float, float]:
    """Return y0, eps, C0, C1 of P3's equation (1) from c0..c3 (4,)."""
    c0, c1, c2, c3 = cubic.tolist()
    return c0, math.atan(c1), 2 * c2, 6 * c3


def _hidden(output: Output, truth: LineTruth, who: IntArray | None) -> tuple[int, float]:
    """Return which object hides most of what is hidden of a true line, and how much of its paint that is."""
    if truth.line < 0:
        return _NOT_HIDDEN
    observation = output.observation
    part = slice(
        int(observation.candidates.starts[truth.line]), int(observation.candidates.starts[truth.line + 1])
    )
    reason = observation.reason[part]
    painted = int(np.count_nonzero(reason != Unseen.NO_PAINT))
    hidden = int(np.count_nonzero(reason == Unseen.OCCLUDED))
    share = hidden / painted if painted else math.nan
    if not hidden or who is None:
        return -1, share
    ids, counts = np.unique(who[part][reason == Unseen.OCCLUDED], return_counts=True)
    return int(ids[counts.argmax()]), share


def _lane(output: Output, vehicle: VehicleConfig, truths: Mapping[Side, LineTruth]) -> tuple[float, ...]:
    """Return LANE_QUANTITIES as sent, and beside each the truth."""
    lane = lane_truth(vehicle, truths, output.snapshot.ego)
    true = (lane.width_m, lane.lateral_speed_mps, lane.time_to_crossing_s)
    sent = [output.values.get(f"lane.{name.removeprefix('lane_')}", math.nan) for name in LANE_QUANTITIES]
    return tuple(value for pair in zip(sent, true, strict=True) for value in pair)


def _tick(output: Output) -> tuple[float, ...]:
    """Return pose, accelerations and weather."""
    ego, air = output.snapshot.ego, output.snapshot.scene.environment
    pose = (*ego.position_world_m.tolist(), ego.roll_rad, ego.pitch_rad, ego.yaw_rad)
    motion = (ego.acceleration_mps2, ego.lateral_acceleration_mps2)
    return (*pose, *motion, air.light, air.rain, air.visibility_m)
