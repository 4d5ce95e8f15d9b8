"""What seeing lines again leaves out: a method run on an event with each changed camera, beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from vsensor.camera import CameraConfig
from vsensor.errors import ConfigError
from vsensor.study import run_cells
from vsensor.types import Array
from vsensor.video.evaluate.runs import RunOptions, event_cell, rows_of_result, run_event
from vsensor.video.event_folder import EventFolder, read_event
from vsensor.video.methods import require_method
from vsensor.video.rows import Rows
from vsensor.video.sensitivity.reproject import PARAMETERS, Lines, changed_offsets
from vsensor.video.settings import VideoConfig

CELLS = "cells"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rerun:
    """One changed camera: by how much the distances to the left and right marking grow, mean in m.

    `seen_again_m` of measured lines through the changed camera, `run_again_m` of the method with it, over the
    same pictures; `reported` is the share of all values that it still reports.
    """

    parameter: str
    change: float
    seen_again_m: tuple[float, float]
    run_again_m: tuple[float, float]
    reported: float


def changed_camera(camera: CameraConfig, change: Sequence[float]) -> CameraConfig:
    """Return the camera with a row of PARAMETERS added."""
    height, lateral, yaw, pitch, roll = change
    x, y, z = camera.position_m
    return msgspec.structs.replace(
        camera,
        position_m=(x, y + lateral, z + height),
        yaw_deg=camera.yaw_deg + yaw,
        pitch_deg=camera.pitch_deg + pitch,
        roll_deg=camera.roll_deg + roll,
    )


def rerun(
    event: EventFolder, method: str, within: Mapping[str, float], out: Path, options: RunOptions
) -> list[Rerun]:
    """Run a method with the camera as it is and with each parameter at both ends of its tolerance.

    Raises ConfigError where a run fails or is interrupted: the same command goes on.
    """
    require_method(method)
    changes = [np.zeros(len(PARAMETERS))]
    for place, name in enumerate(PARAMETERS):
        changes += [sign * within[name] * np.eye(len(PARAMETERS))[place] for sign in (-1.0, 1.0)]
    cells = [{**event_cell(event, method, options), "change": change.tolist()} for change in changes]
    outcome = run_cells(rerun_cell, cells, out / CELLS, workers=options.workers, progress=options.progress)
    results = [result for result in outcome.results if result is not None]
    if len(results) < len(cells):
        failed = outcome.failures[0].error if outcome.failures else "interrupted; the same command goes on"
        raise ConfigError(f"{event.path}: {failed}")
    first, *others = [rows_of_result(result) for result in results]
    names = [name for name in PARAMETERS for _ in range(2)]
    return [
        _compared(event, name, change, first, rows)
        for name, change, rows in zip(names, changes[1:], others, strict=True)
    ]


def rerun_cell(cell: dict[str, Any]) -> Mapping[str, Any]:
    """Run a method over an event with a changed camera, in any process that sees the same files."""
    event = read_event(Path(cell["event"]))
    camera = changed_camera(event.config.camera, cell["change"])
    changed = replace(event, config=msgspec.structs.replace(event.config, camera=camera))
    settings = msgspec.convert(cell["settings"], VideoConfig)
    rows = run_event(changed, cell["method"], settings, cell["rate_hz"], cell["limit"])
    return {name: column.tolist() for name, column in rows.columns().items()}


def _compared(event: EventFolder, name: str, change: Array, first: Rows, rows: Rows) -> Rerun:
    config = event.config
    seen, again = [], []
    for side, outward in (("left", 1.0), ("right", -1.0)):
        before, after = (getattr(one, f"{side}_offset_m") for one in (first, rows))
        both = np.isfinite(before) & np.isfinite(after) & np.isfinite(first.heading_rad)
        lines = Lines(offset_m=before[both], slope=np.tan(first.heading_rad[both]))
        moved = changed_offsets(config.camera, config.vehicle.wheelbase_m, lines, change[None])[0]
        seen.append(outward * _mean(moved - before[both]))
        again.append(outward * _mean(after[both] - before[both]))
    reported = np.isfinite([rows.left_offset_m, rows.right_offset_m]).mean()
    return Rerun(
        parameter=name,
        change=float(change[list(PARAMETERS).index(name)]),
        seen_again_m=(seen[0], seen[1]),
        run_again_m=(again[0], again[1]),
        reported=float(reported),
    )


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else float("nan")


def rerun_table(found: Sequence[Rerun]) -> list[list[str]]:
    """Return what was found as words."""
    rows = [["changed", "by", "left: seen again", "run again", "right: seen again", "run again", "reported"]]
    for one in found:
        sides = [
            f"{value:+.3f}" for pair in zip(one.seen_again_m, one.run_again_m, strict=True) for value in pair
        ]
        by = f"{one.change:+g} {PARAMETERS[one.parameter]}"
        rows.append([one.parameter, by, *sides, f"{100 * one.reported:.1f} %"])
    return rows
