"""Make logs of drives whose error law is known: the sensor itself on a map, and the vehicle's own frames.

    python -m tools.made_drives --out DIR --hours 1 --profile native
    vsensor scan DIR/*.blf --profile native --profile vehicle --reference DIR/map.xodr --out TABLE

Each drive is a log of its own (10 minutes): lane frames of the profile, and beside them, as a gateway would
send them, speed and yaw rate every 12 ms, the yaw rate in steps of 0.244 deg/s with an offset as a Toyota
RAV4 has it, the pose of every image, wipers and lamps. Beside the logs: `law.npz` and `map.xodr`. The same
command goes on with what is missing. From Python, without processes: `made(cell)` for each of `drive_cells`.
"""

import argparse
import os
from collections.abc import Iterator, Mapping
from copy import deepcopy
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from tests.vehicle_frames import Gateway
from tools.made_law import day_library, student_library
from vsensor.config import SHIPPED, load_scenario
from vsensor.error_model import save_library
from vsensor.line import Line, build_line
from vsensor.logs import open_log_writer
from vsensor.study import run_cells
from vsensor.types import EgoState, Frame, Light, Tick

PERIOD_NS = 40_000_000
MOTION_NS = 12_000_000
BODY_NS = 200_000_000
YAW_STEP_DEGPS, YAW_OFFSET_DEGPS = 0.244, -0.41
YAW_NOISE_DEGPS = 0.08
"""A third of a step: it dithers the rounding, as the road does in the recorded log."""
DRIVE_S = 600.0
HOLD_S, CHANGE_S = 40.0, 20.0
SLOWEST_KMH, FASTEST_KMH = 25.0, 130.0
OWN_BORDERS = ("-2", "-3")
"""Lanes whose outer lines are those of the driven lane -3."""
START_NS = 1_700_000_000_000_000_000


def drive_speeds(seed: int, seconds: float) -> list[list[float]]:
    """Return [time in s, km/h]: held for 40 s, changed within 20 s, evenly spread over all speeds."""
    random = np.random.default_rng([7, seed])
    times = np.arange(0.0, seconds, HOLD_S + CHANGE_S)
    speeds = random.uniform(SLOWEST_KMH, FASTEST_KMH, len(times)).round(1)
    pairs = zip(times.tolist(), speeds.tolist(), strict=True)
    return [point for t_s, kmh in pairs for point in ([t_s, kmh], [t_s + HOLD_S, kmh])]


def scenario_of(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Return the top-level keys of a drive's scenario."""
    random = np.random.default_rng([8, cell["seed"]])
    output = {"profile": cell["profile"]} | ({"dbc": cell["dbc"]} if cell.get("dbc") else {})
    speeds = drive_speeds(cell["seed"], cell["seconds"])
    start_m = float(random.uniform(0.0, 1300.0))
    return {
        "source": cell["map"],
        "seed": cell["seed"],
        "duration_s": cell["seconds"],
        "ego": {"road": "1", "lane": -3, "s_m": start_m, "speed_kmh": speeds},
        "traffic": [],
        "camera": {"model": "none"},
        "scene": {"lateral_m": 4.0},
        "environment": {"light": "night" if cell["night"] and cell["seed"] % 3 == 2 else "day"},
        "error_model": {"file": cell["law"]} | cell.get("error_model", {}),
        "output": output,
    }


def made(cell: Mapping[str, Any]) -> dict[str, float]:
    """Make one drive's log, a cell of `run_cells`; written beside its place, then moved there."""
    path = Path(cell["path"])
    beside = path.with_name(f".{path.stem}.part{path.suffix}")
    line = build_line(load_scenario("highway", scenario_of(cell)))
    ticks = round(cell["seconds"] * 1e9) // PERIOD_NS
    with open_log_writer(beside, ()) as writer:
        for frame in drive_frames(line, ticks, cell["seed"]):
            writer.write(frame, START_NS + cell["seed"] * round(2 * DRIVE_S * 1e9))
    os.replace(beside, path)
    return {"ticks": float(ticks)}


def drive_frames(line: Line, ticks: int, seed: int) -> Iterator[Frame]:
    """Yield the lane frames and the vehicle's in the order of their times."""
    vehicle, state, before, lane = VehicleFrames(seed), line.initial_state(), None, tuple[Frame, ...]()
    for index in range(ticks):
        computed = line.compute(state, Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS))
        if computed is None:
            break
        state, output = computed.state_if_sent, computed.output
        ego, light = output.snapshot.ego, output.snapshot.scene.environment.light
        if before is not None:
            yield from sorted((*lane, *vehicle.between(before, ego, light)), key=lambda frame: frame.due_ns)
        before, lane = ego, output.frames
    yield from lane


class VehicleFrames:
    """What the vehicle itself sends: motion every 12 ms, the pose of each image, lamps and wipers."""

    def __init__(self, seed: int) -> None:
        self._gateway, self._random = Gateway(), np.random.default_rng([9, seed])
        self._offset = YAW_OFFSET_DEGPS + self._random.normal(0.0, 0.05)

    def between(self, before: EgoState, after: EgoState, light: Light) -> Iterator[Frame]:
        """Yield the frames from one image to the next."""
        first_ns, last_ns = before.t_ns, after.t_ns
        x, y, _ = before.position_world_m.tolist()
        yaw = float(np.arctan2(np.sin(before.yaw_rad), np.cos(before.yaw_rad)))
        yield from self._gateway.pose(first_ns, x, y, yaw)
        if first_ns % BODY_NS == 0:
            yield self._gateway.frame("VEH_Body", first_ns, wiper=0.0, low_beam=float(light is Light.NIGHT))
        for t_ns in range(-(-first_ns // MOTION_NS) * MOTION_NS, last_ns, MOTION_NS):
            part = (t_ns - first_ns) / (last_ns - first_ns)
            speed = before.speed_mps + part * (after.speed_mps - before.speed_mps)
            rate = before.yaw_rate_radps + part * (after.yaw_rate_radps - before.yaw_rate_radps)
            yield self._gateway.motion(t_ns, speed, self._read(rate))

    def _read(self, yaw_rate_radps: float) -> float:
        """Return the yaw rate as the vehicle's sensor has it, in its steps."""
        noise = radians(self._offset + self._random.normal(0.0, YAW_NOISE_DEGPS))
        step = radians(YAW_STEP_DEGPS)
        return round((yaw_rate_radps + noise) / step) * step


def dashed_map(path: Path) -> bytes:
    """Return the shipped map with the driven lane's lines dashed all the way.

    Where one becomes double its inner stripe begins 15 cm beside it, and where paint is missing it is seen
    late: for a second or two each lap, fits err by up to 0.3 m, which is in no law.
    """
    tree = etree.parse(path)
    borders = [lane for lane in tree.iter("lane") if lane.get("id") in OWN_BORDERS]
    dashes = borders[0].find("roadMark")
    for lane in borders:
        for mark in lane.findall("roadMark"):
            lane.remove(mark)
        lane.append(deepcopy(dashes))
    return etree.tostring(tree, xml_declaration=True, encoding="UTF-8")


def drive_cells(
    folder: Path,
    hours: float,
    profile: str = "native",
    dbc: Path | None = None,
    *,
    law: Path | None = None,
    night: bool = False,
    first_seed: int = 1,
    drive_s: float = DRIVE_S,
    suffix: str = ".blf",
) -> list[dict[str, Any]]:
    """Lay map and law into `folder`, and return a cell of `made` for each drive of so many hours.

    `law` is an error model; without one that of `tools.made_law`, with `night` its library of two.
    """
    folder.mkdir(parents=True, exist_ok=True)
    road_map = folder / "map.xodr"
    road_map.write_bytes(dashed_map(SHIPPED / "highway.xodr"))
    if law is None:
        law = folder / "law.npz"
        save_library(student_library() if night else day_library(), law)
    count = max(1, round(hours * 3600.0 / drive_s))
    return [
        {
            "seed": seed,
            "seconds": min(drive_s, hours * 3600.0),
            "profile": profile,
            "dbc": None if dbc is None else str(dbc.resolve()),
            "map": str(road_map.resolve()),
            "night": night,
            "law": str(law.resolve()),
            "path": str(folder.resolve() / f"{Path(profile).stem}_{seed:04d}{suffix}"),
        }
        for seed in range(first_seed, first_seed + count)
    ]


def make_drives(folder: Path, cells: list[dict[str, Any]], workers: int | None = None) -> list[Path]:
    """Make the drives that are missing in processes of their own, all cores without `workers`."""
    outcome = run_cells(made, cells, folder / "cells", workers=workers, progress=True)
    if outcome.failures:
        raise SystemExit(outcome.failures[0].error)
    return [Path(cell["path"]) for cell in cells]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of the logs")
    parser.add_argument("--hours", type=float, default=1.0, help="of driving, in drives of 10 minutes (1)")
    parser.add_argument("--profile", default="native", help="of the lane frames (native)")
    parser.add_argument("--dbc", type=Path, help="database of a profile without one")
    parser.add_argument("--law", type=Path, help="error model; else the known one, written to DIR/law.npz")
    parser.add_argument(
        "--night", action="store_true", help="every third drive at night, with a law of its own"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the first drive, the next ones count on (1)")
    parser.add_argument("--workers", type=int, help="processes (all cores)")
    told = parser.parse_args()
    cells = drive_cells(
        told.out,
        told.hours,
        told.profile,
        told.dbc,
        law=told.law,
        night=told.night,
        first_seed=told.seed,
    )
    print(f"{len(make_drives(told.out, cells, told.workers))} logs in {told.out}")


if __name__ == "__main__":
    main()
