"""The exact truth of every frame, in the columns that a method's rows have.

vehicle   front axle                20 m                        60 m
[  o  o]------|======================|---- ---- ---- ---- ----|
                confidence 4: paint      1: paint only here      beyond it nothing counts: 0, no offset
"""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vsensor.camera import Camera, observe
from vsensor.scene import SceneConfig
from vsensor.signals import VehicleConfig
from vsensor.sinks.rows import RowFile
from vsensor.types import Array, Observation, Output, Side, Unseen
from vsensor.world.truth import LineTruth, lane_truth, line_truths

COLUMNS = (
    *("t_s", "left_offset_m", "right_offset_m", "lane_width_m"),
    *("heading_rad", "left_confidence", "right_confidence"),
)
"""Offsets to the inner edge at the front axle, left positive; heading: of the lane against the vehicle."""
ROW = np.dtype([(name, np.float64) for name in COLUMNS])
SCHEMA = "vsensor.lane_offset_rows/1"

NEAR_M, FAR_M = 20.0, 60.0
"""A marking counts as there within the first, as absent beyond the second, ahead of the front axle."""
_SIDES = (Side.LEFT, Side.RIGHT)
_LEAST_POINTS = 5
"""Of paint, 0.1 m or more apart: less is a crumb."""


class TruthRows:
    """A sink that writes one row per output: where the lines are, what the video's camera sees of them."""

    def __init__(self, path: Path, camera: Camera, vehicle: VehicleConfig) -> None:
        """Refuse a place that cannot be written; raises ConfigError, MissingExtraError."""
        self._camera, self._vehicle = camera, vehicle
        self._view = SceneConfig(range_m=vehicle.wheelbase_m + FAR_M)
        self._file = RowFile(path, ROW, {"schema": SCHEMA})

    def write(self, output: Output) -> None:
        """Add the row of one frame."""
        self._file.add(truth_row(output, self._camera, self._view, self._vehicle))

    def close(self) -> None:
        """Write the file."""
        self._file.close()


def truth_row(output: Output, camera: Camera, view: SceneConfig, vehicle: VehicleConfig) -> tuple[float, ...]:
    """Return COLUMNS of one output; a side without paint in view has NaN and confidence 0."""
    axle_m = vehicle.wheelbase_m
    truths = line_truths(output, axle_m)
    observation = observe(camera, view, output.seen)
    confidence = {side: _confidence(observation, truths.get(side), axle_m) for side in _SIDES}
    there = {side: truths[side] for side, how_sure in confidence.items() if how_sure}
    offsets = [there[side].lane_offset_m if side in there else math.nan for side in confidence]
    width_m = lane_truth(vehicle, there, output.snapshot.ego).width_m
    return (output.tick.t_ns / 1e9, *offsets, width_m, _heading_rad(there), *map(float, confidence.values()))


def _heading_rad(truths: Mapping[Side, LineTruth]) -> float:
    slopes = [truth.axle_slope for truth in truths.values()]
    return math.atan(sum(slopes) / len(slopes)) if slopes else math.nan


def _confidence(observation: Observation, truth: LineTruth | None, axle_m: float) -> int:
    """Return 4 where the camera sees paint of the line in the first NEAR_M, 1 up to FAR_M, else 0."""
    if truth is None or truth.marking < 0 or math.isnan(truth.lane_offset_m):
        return 0
    seen_x_m = _seen(observation, truth.marking)
    if np.count_nonzero(seen_x_m <= axle_m + NEAR_M) >= _LEAST_POINTS:
        return 4
    return int(np.count_nonzero(seen_x_m <= axle_m + FAR_M) >= _LEAST_POINTS)


def _seen(observation: Observation, marking: int) -> Array:
    """Return x of the points of a marking that the camera sees."""
    candidates = observation.candidates
    (lines,) = np.nonzero(candidates.marking == marking)
    if not len(lines):
        return np.zeros(0)
    start, stop = candidates.starts[lines[0] : lines[0] + 2].tolist()
    is_seen = observation.reason[start:stop] == Unseen.SEEN
    seen: Array = candidates.points_ego_m[start:stop, 0][is_seen]
    return seen
