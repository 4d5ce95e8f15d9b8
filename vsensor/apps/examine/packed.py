"""What the browser gets once, so that the cursor moves without asking: float32 columns behind a JSON head.

4 bytes: length of the head | head (JSON, padded to 4) | columns, each of head["columns"][name] values
"""

import json
import struct
from typing import Any

import numpy as np

from vsensor.apps.examine.drive import Drive
from vsensor.apps.examine.totals import clock, lane_changes, totals
from vsensor.field.scan_plot import COLOURS
from vsensor.types import SIDE_NAMES, Array, Side


def packed(drive: Drive) -> bytes:
    """Return the drive for the browser: poses, lines, reference lines in coordinates of the reference."""
    columns = columns_of(drive)
    head = json.dumps({**_head(drive), "columns": {name: len(v) for name, v in columns.items()}}).encode()
    head += b" " * (-len(head) % 4)
    parts = (np.ascontiguousarray(values, dtype="<f4").tobytes() for values in columns.values())
    return struct.pack("<I", len(head)) + head + b"".join(parts)


def columns_of(drive: Drive) -> dict[str, Array]:
    """Return the columns: of images (N,), and for each side the reference line's points.

    `SIDE.place` (N,) is where on these points a line stands beside the vehicle; the points of several
    reference lines follow each other, NaN between them and where there is a gap.
    """
    poses = drive.scanned.work.reference.poses
    x0, y0 = (
        float(values[np.isfinite(values)][0]) if np.isfinite(values).any() else 0.0 for values in _xy(drive)
    )
    found = {
        "t": drive.t_s,
        "x": poses.x_m - x0,
        "y": poses.y_m - y0,
        "yaw": poses.yaw_rad,
        "speed": drive.speed_mps,
        "yaw_rate": drive.yaw_rate_radps,
        "width": drive.scanned.work.width_m,
    }
    for side in drive.sides:
        word, line = SIDE_NAMES[side], drive.images.lines[side]
        for k in range(4):
            found[f"{word}.c{k}"] = np.where(line.is_whole, line.coefficients[:, k], np.nan)
        found[f"{word}.x_max"] = np.where(line.reported & np.isfinite(line.x_max_m), line.x_max_m, np.nan)
        found[f"{word}.quality"] = line.quality
        found[f"{word}.measured"] = line.measured.astype(float)
        if side in drive.causes:
            found[f"{word}.cause"] = drive.causes[side]
        x, y, place = _reference(drive, side)
        found[f"{word}.ref_x"], found[f"{word}.ref_y"], found[f"{word}.place"] = x - x0, y - y0, place
    return found


def _xy(drive: Drive) -> tuple[Array, Array]:
    poses = drive.scanned.work.reference.poses
    return poses.x_m, poses.y_m


def _reference(drive: Drive, side: Side) -> tuple[Array, Array, Array]:
    """Return the points of all reference lines of a side, and each image's place among them."""
    place = np.full(len(drive), np.nan)
    xs: list[Array] = []
    ys: list[Array] = []
    starts: dict[int, int] = {}
    count = 0
    for near in drive.scanned.work.reference.near(0, len(drive), side):
        line = near.line
        if id(line) not in starts:
            starts[id(line)] = count
            gap = np.append(line.gap, True)
            xs.append(np.where(gap, np.nan, line.x_m))
            ys.append(np.where(gap, np.nan, line.y_m))
            count += len(line.x_m)
        place[near.images] = starts[id(line)] + near.place
    empty = np.empty(0)
    return np.concatenate(xs or [empty]), np.concatenate(ys or [empty]), place


def _head(drive: Drive) -> dict[str, Any]:
    changes = [
        {"number": c.number, "text": f"{clock(float(drive.t_s[c.number]))} {c.direction}".strip()}
        for c in lane_changes(drive)
    ]
    spacing = {}
    for side in drive.sides:
        near = next(iter(drive.scanned.work.reference.near(0, len(drive), side)), None)
        spacing[SIDE_NAMES[side]] = 1.0 if near is None else near.line.spacing_m
    return {
        "log": drive.log.name,
        "images": len(drive),
        "sides": [SIDE_NAMES[side] for side in drive.sides],
        "colours": {SIDE_NAMES[side]: COLOURS[side] for side in drive.sides},
        "spacing": spacing,
        "totals": list(totals(drive)),
        "lane_changes": changes,
        "notes": list(drive.scanned.notes),
    }
