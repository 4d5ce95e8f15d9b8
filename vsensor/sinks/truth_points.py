"""The points of the true lines: the ground truth sensor of P3, one row per tick, line and point.

Points stand every 0.1 m along the lane, from beside the rear axle to the end of the window ([scene] range_m),
exact from the map, of the lines on the four sides, painted or not. `marking` names the line for the whole
run; reason as in the trace, here of each point.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.camera import Camera
from vsensor.sinks.rows import RowFile
from vsensor.types import SIDE_NAMES, Output
from vsensor.world.truth import hiders, true_sides

SCHEMA = "vsensor.truth/1"
SUFFIXES = (".npz", ".parquet")
ROW = np.dtype(
    [
        ("t_ns", np.int64),
        ("tick", np.int64),
        ("side", np.uint8),
        ("marking", np.int32),
        ("x_m", np.float64),
        ("y_m", np.float64),
        ("z_m", np.float64),
        ("reason", np.uint8),
        ("occluded_by", np.int32),
    ]
)
UNITS: Mapping[str, str] = {
    "t_ns": "ns from the start of the run",
    "side": " ".join(f"{side.value}={name}" for side, name in SIDE_NAMES.items()),
    "marking": "id of the line, the same for the whole run",
    "x_m, y_m, z_m": "road-level ego frame: x forward, y left, z up, from the centre of the rear axle",
    "reason": "0 seen, else why not: see vsensor.types.Unseen",
    "occluded_by": "id of the object that hides the point, -1 none",
}


class TruthSink:
    """Writes the points of every `every`-th tick to `path`: .npz or .parquet."""

    def __init__(
        self, path: Path, *, camera: Camera, every: int = 1, metadata: Mapping[str, object] | None = None
    ) -> None:
        """Refuse an unknown suffix, a place that cannot be written. Raises ConfigError, MissingExtraError."""
        self._camera, self._every = camera, every
        told = {"schema": SCHEMA, "units": dict(UNITS), **(metadata or {})}
        self._file = RowFile(path, ROW, told, SUFFIXES)

    def write(self, output: Output) -> None:
        """Keep the points of one tick."""
        if output.tick.index % self._every == 0:
            self._file.add_all(points(output, self._camera))

    def close(self) -> None:
        """Write the file and move it to its place; a second call does nothing."""
        self._file.close()


def points(output: Output, camera: Camera) -> np.ndarray[Any, np.dtype[Any]]:
    """Return the points of the true lines of one tick, an array of ROW."""
    observation = output.observation
    candidates = observation.candidates
    who = hiders(output, camera)
    parts = []
    for side, k in sorted(true_sides(candidates, output.snapshot).items()):
        part = slice(int(candidates.starts[k]), int(candidates.starts[k + 1]))
        rows = np.empty(part.stop - part.start, ROW)
        rows["t_ns"], rows["tick"], rows["side"] = output.tick.t_ns, output.tick.index, side
        rows["marking"] = output.snapshot.scene.markings[int(candidates.marking[k])].id
        for axis, name in enumerate(("x_m", "y_m", "z_m")):
            rows[name] = candidates.points_ego_m[part, axis]
        rows["reason"], rows["occluded_by"] = observation.reason[part], who[part]
        parts.append(rows)
    return np.concatenate(parts) if parts else np.empty(0, ROW)
