"""The closed loop on vcan0: `vsensor run` shows the ECU a lane, the ECU steers the vehicle in it.

    tools/vcan .venv/bin/python -m tools.ecu.closed_loop [--seconds 60] [--scenario FILE] [--folder DIR]

Prints one line of JSON: what the ECU found in the frames, where the vehicle drove in its lane (the truth of
the trace), how regularly vsensor sent. Exit status 1 where the ECU found an error or a wheel left the lane.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vsensor.config import load_scenario
from vsensor.sinks.trace import read_trace
from vsensor.types import Side

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SCENARIO = HERE / "closed_loop.toml"
LONGER_S = 5  # vsensor goes on for longer, so that its end is no timeout
MESSAGES = 13
BLIND_SLOTS = 5  # the ECU steers by an image for 250 ms
PAUSE_SLOTS = 2  # so many dropped in a row, and half a cycle late, are the ECU's 3.5 cycles
PERIODS = ("sensor_not_ready", "left_not_available", "right_not_available")
"""What the sensor may say of itself and of the road: no errors of its frames."""


def built(folder: Path) -> Path:
    """Build the ECU into `folder` and return the program; raises CalledProcessError."""
    environment = dict(os.environ, ECU_PYTHON=sys.executable)
    subprocess.run([HERE / "build", folder], check=True, env=environment, stdout=subprocess.DEVNULL)
    return folder / "ecu"


def vsensor(*words: object) -> str:
    """Run `vsensor` with these words and return what it said; raises CalledProcessError."""
    command = [sys.executable, "-m", "vsensor.cli", *map(str, words)]
    return subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.PIPE, text=True).stdout


def drive(
    ecu: Path, seconds: float, scenario: Path, folder: Path, run: Callable[..., str] = vsensor
) -> dict[str, object]:
    """Run the closed loop on vcan0 and return the ECU's report, in `vsensor` what that said at its end.

    The trace is `folder`/loop.npz. `run` takes the words of vsensor's command line and does what it does.
    """
    listens = [ecu, "--bus", "vcan0", "--duration", str(seconds)]
    words = ["run", scenario, "--bus", "socketcan:vcan0", "--quiet"]
    words += ["--duration", seconds + LONGER_S, "--trace", folder / "loop.npz"]
    pipe = subprocess.PIPE
    with subprocess.Popen(listens, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            if "listening" not in (said := process.stderr.readline()):
                raise SystemExit(said.strip())
            summary = run(*words)
            return {**json.loads(process.communicate(timeout=60)[0]), "vsensor": summary}
        finally:
            process.kill()


def kept(trace_file: Path, seconds: float, half_width_m: float) -> dict[str, float]:
    """Return how vsensor sent for `seconds` and where the vehicle drove, from the truth.

    `margin_m` is the least distance of a side of the vehicle to the inner edge of its line at the front
    axle, where that side has a line; below 0 the line was crossed. It is judged for `judged_s`: up to the
    first time that vsensor stood still for longer than the ECU holds an image (a machine without time for
    it), because after that nobody could have steered.
    """
    trace = read_trace(trace_file)
    ticks = np.unique(trace["tick"][trace["t_ns"] < seconds * 1e9])
    missing = np.diff(ticks) - 1
    blind = ticks[:-1][missing >= BLIND_SLOTS]
    last = blind[0] if len(blind) else ticks[-1]
    driven = trace["tick"] <= last
    left, right = (driven & (trace["side"] == side) for side in (Side.LEFT, Side.RIGHT))
    offsets_m = np.concatenate([trace["truth_lane_offset_m"][left], -trace["truth_lane_offset_m"][right]])
    speed_mps, t_s = trace["speed_mps"][left], trace["t_ns"][left] / 1e9
    return {
        "slots_dropped": int(missing.sum()),
        "pauses": int((missing >= PAUSE_SLOTS).sum()),
        "blind": len(blind),
        "judged_s": float(t_s[-1]),
        "margin_m": float(np.nanmin(offsets_m)) - half_width_m,
        "driven_m": float((speed_mps[1:] * np.diff(t_s)).sum()),
        "lateral_mps2": float(np.abs(trace["yaw_rate_radps"][left] * speed_mps).max()),
    }


def unexcused(report: dict[str, object], way: dict[str, float]) -> dict[str, int]:
    """Return what the ECU found in the frames and ought not to, name -> count.

    On a machine that had no time for it vsensor dropped slots. Where it dropped some in a row (`pauses`) a
    timeout is right; where the ECU was `blind` nobody steered, and lines move as no driver would let them.
    """
    errors: dict[str, int] = report["errors"]  # type: ignore[assignment]
    allowed = {
        **dict.fromkeys(PERIODS, math.inf),
        "timeout": MESSAGES * way["pauses"],
        "implausible_jump": math.inf if way["blind"] else 0,
    }
    return {name: count for name, count in errors.items() if count > allowed.get(name, 0)}


def problems(report: dict[str, object], way: dict[str, float]) -> list[str]:
    """Return what is not as it should be, as sentences."""
    found = [f"{name}: {count}" for name, count in unexcused(report, way).items()]
    if report["frames_overrun"]:
        found.append(f"frames_overrun: {report['frames_overrun']}")
    if way["margin_m"] <= 0:
        found.append(f"the vehicle left its lane by {-way['margin_m']:.2f} m")
    return found


def closed_loop(seconds: float, scenario: Path, folder: Path) -> dict[str, object]:
    """Build, drive and judge; returns all of it, `problems` empty where all is well."""
    report = drive(built(folder / "ecu"), seconds, scenario, folder)
    vehicle = load_scenario(scenario).config.vehicle
    way = kept(folder / "loop.npz", seconds, vehicle.width_m / 2)
    return {"problems": problems(report, way), **way, "ecu": report}


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tools.ecu.closed_loop", description="ECU and vsensor on vcan0"
    )
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--scenario", type=Path, default=SCENARIO)
    parser.add_argument("--folder", type=Path, help="keep ECU and trace here")
    arguments = parser.parse_args(words)
    with tempfile.TemporaryDirectory(prefix="vsensor-loop-") as name:
        folder = arguments.folder or Path(name)
        result = closed_loop(arguments.seconds, arguments.scenario, folder)
    print(json.dumps(result))
    return 1 if result["problems"] else 0


if __name__ == "__main__":
    sys.exit(main())
