"""One event on disk: everything that a method, an evaluation and a person need of it, in one folder.

| file | what |
|---|---|
| `event.toml` | kind, conditions, the video's camera and its vehicle, names of the other files |
| `camera.toml` | that camera and vehicle alone, for `--camera` |
| `video.avi` | without loss (FFV1) |
| `can.blf` | the same drive as the vehicle's own sensor sent it: offsets, confidences, motion (profile p2) |
| `truth.parquet` | the truth of every frame |
| `drive.toml`, `road.toml` or `road.xodr` | what it was made from: `vsensor run drive.toml --fast` |
"""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsensor.camera import Camera, CameraConfig
from vsensor.clock import SimulatedClock
from vsensor.config import SHIPPED, Scenario, load_scenario
from vsensor.draws import Draws
from vsensor.line import build_line
from vsensor.profile_new.toml import toml_key, toml_value
from vsensor.runner import run_loop
from vsensor.schema import convert
from vsensor.sinks import Sink
from vsensor.sinks.image import ImageSink
from vsensor.sinks.log import LogSink
from vsensor.types import NANOSECONDS_PER_SECOND, Output
from vsensor.video.made.drives import CYCLE_MS, Plan
from vsensor.video.made.kinds import KINDS
from vsensor.video.made.truth import TruthRows

EVENT_SCHEMA = "vsensor.event/1"
EVENT, CAMERA, VIDEO = "event.toml", "camera.toml", "video.avi"
LOG, TRUTH, DRIVE = "can.blf", "truth.parquet", "drive.toml"


class EveryNth:
    """A sink that hands on the first of every so many outputs."""

    def __init__(self, sink: Sink, every: int) -> None:
        self._sink, self._every = sink, every

    def write(self, output: Output) -> None:
        """Hand on an output, if its turn has come."""
        if output.tick.index % self._every == 0:
            self._sink.write(output)

    def close(self) -> None:
        """Close the sink."""
        self._sink.close()


def write_event(folder: Path, kind_name: str, plan: Plan) -> int:
    """Make an event in an empty folder and return its number of frames; raises VsensorError subclasses."""
    _write_source(folder, plan)
    write_toml(folder / DRIVE, {"schema": "vsensor.scenario/1", **plan.scenario})
    scenario = load_scenario(str(folder / DRIVE))
    frames = _drive(folder, kind_name, plan, scenario)
    mounted = {"camera": plan.camera, "vehicle": plan.scenario["vehicle"]}
    write_toml(folder / CAMERA, {"schema": "vsensor.camera/1", **mounted})
    write_toml(folder / EVENT, {**_event_table(kind_name, plan, frames), **mounted})
    return frames


def _write_source(folder: Path, plan: Plan) -> None:
    place = folder / str(plan.scenario["source"])
    if plan.road is None:
        shutil.copyfile(SHIPPED / str(plan.shipped), place)
    else:
        write_toml(place, {"schema": "vsensor.road/1", "road": [plan.road]})


def _drive(folder: Path, kind_name: str, plan: Plan, scenario: Scenario) -> int:
    """Run the drive in simulated time into video, log and truth."""
    kind, config = KINDS[kind_name], scenario.config
    camera = Camera.from_config(convert(plan.camera, CameraConfig, "camera"))
    period_ns = CYCLE_MS * 1_000_000
    every = round(1000 / CYCLE_MS / kind.rate_hz)
    ticks = round(plan.scenario["duration_s"] * 1000 / CYCLE_MS)
    video = ImageSink(
        camera,
        config.image,
        Draws(config.seed),
        video=folder / VIDEO,
        period_ns=NANOSECONDS_PER_SECOND // kind.rate_hz,
    )
    sinks: list[Sink] = [LogSink(folder / LOG), EveryNth(video, every)]
    sinks.append(EveryNth(TruthRows(folder / TRUTH, camera, config.vehicle), every))
    try:
        summary = run_loop(
            build_line(scenario),
            SimulatedClock(),
            period_ns=period_ns,
            ticks=ticks,
            sinks=sinks,
            real_time=False,
        )
    finally:
        for sink in sinks:
            sink.close()
    return -(-summary.ticks // every)


def _event_table(kind_name: str, plan: Plan, frames: int) -> dict[str, Any]:
    return {
        "schema": EVENT_SCHEMA,
        "name": plan.scenario["name"],
        "kind": kind_name,
        "is_made": True,
        "seed": plan.scenario["seed"],
        "video": VIDEO,
        "rate_hz": KINDS[kind_name].rate_hz,
        "frames": frames,
        "can": LOG,
        "profile": "p2",
        "video_starts_at_log_s": 0.0,
        "truth": TRUTH,
        "conditions": plan.conditions,
    }


def write_toml(path: Path, data: Mapping[str, Any]) -> None:
    """Write a TOML file: plain keys first, then a table for each dict; what is deeper stands in one line."""
    plain = [f"{toml_key(key)} = {_value(value)}" for key, value in data.items() if not _is_table(value)]
    tables = [line for key, value in data.items() if _is_table(value) for line in _table(key, value)]
    path.write_text("\n".join([*plain, *tables, ""]), encoding="utf-8")


def _is_table(value: object) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))


def _table(key: str, value: Any) -> list[str]:
    is_list = isinstance(value, list)
    head = f"[[{key}]]" if is_list else f"[{key}]"
    lines: list[str] = []
    for one in value if is_list else [value]:
        lines += ["", head, *(f"{toml_key(name)} = {_value(item)}" for name, item in one.items())]
    return lines


def _value(value: object) -> str:
    """Return a value as TOML; long lists of tables get a line each."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + "".join(f"  {toml_value(one)},\n" for one in value) + "]"
    return toml_value(value)
