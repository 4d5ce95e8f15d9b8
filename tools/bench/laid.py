"""A sensor laid over traffic: `python -m tools.bench.laid`, `overlay SPEED LOG SECONDS` or `gateway SECONDS`.

Prints JSON. An overlay is played as its users start it, into a socket as in `tools.bench.schedule`; a gateway
stands between two vcans, a car on the one of them.
"""

import itertools
import json
import multiprocessing
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from tests.vehicle_frames import Gateway as Car
from tools.bench.schedule import NotingPort
from vsensor.bus import FrameBus, open_bus
from vsensor.gateway import GatewayOptions, run_gateway
from vsensor.replay import ReplayOptions, open_outputs, replay_log
from vsensor.types import Frame

START_S = 10.0
"""Of the drive: it stands before."""
SCENARIO = """schema = "vsensor.scenario/1"
source = "{log}"
[drive]
profile = ["toyota_rav4"]
dbc = "{dbc}"
"""
CAR_HZ = 1500
"""Frames of the car, as many as the drive has: every thirtieth tells its motion."""


def overlay(speed: str, log: Path, seconds: float) -> dict[str, object]:
    """Lay a sensor over `seconds` of a drive's log; late is the first frame of each time."""
    dbc = log.parents[1] / "dbc" / "toyota_rav4_2017_pt_generated.dbc"
    with tempfile.TemporaryDirectory() as name, closing(NotingPort()) as port:
        scenario = Path(name) / "drive.toml"
        scenario.write_text(SCENARIO.format(log=log, dbc=dbc))
        open_outputs.open_bus = lambda name, fd=False, echo=True: FrameBus(port, name, is_simulated=True)
        options = ReplayOptions(
            path=log,
            bus="noting",
            overlay=str(scenario),
            speed=speed,
            start=str(START_S),
            stop=str(START_S + seconds),
        )
        report = replay_log(options, _tell)
    return {
        "frames": report.frames_sent,
        "lateness": report.timing.lateness.figures_ms(),
        "duration_error_ms": report.duration_error_ns / 1e6,
        "frames_per_s": len(port.called_ns) / ((port.called_ns[-1] - port.called_ns[0]) / 1e9),
    }


def gateway(seconds: float) -> dict[str, object]:
    """Hand the frames of a car on vcan0 on to vcan1; latency is from the kernel's stamp to after sending."""
    car = multiprocessing.get_context("fork").Process(target=_drive, daemon=True)
    car.start()
    options = GatewayOptions(near="vcan0", far="vcan1", overlay="live_bench", duration_s=seconds)
    ways, _ = run_gateway(options, _tell)
    car.terminate()
    return {
        "passed": ways.passed,
        "refused": ways.refused,
        "images": ways.images,
        "images_lost": ways.lost,
        "latency": ways.latency.figures_ms(),
        "lateness": ways.lateness.figures_ms(),
    }


def _drive() -> None:
    """Send CAR_HZ frames a second until somebody ends it; what is heard is thrown away."""
    car = Car()
    with open_bus("socketcan:vcan0", echo=False) as bus:
        began_s = time.monotonic()
        for k in itertools.count():
            time.sleep(max(0.0, began_s + k / CAR_HZ - time.monotonic()))
            other = Frame(due_ns=0, arbitration_id=0x500 + k % 64, data=k.to_bytes(8, "big"))
            bus.send(other if k % 30 else car.motion(0, 25.0, 0.0))
            if k % 100 == 0:
                bus.drain()


def _tell(text: str) -> None:
    print(text, file=sys.stderr)


if __name__ == "__main__":
    kind, *words = sys.argv[1:]
    found = (
        overlay(words[0], Path(words[1]), float(words[2])) if kind == "overlay" else gateway(float(words[0]))
    )
    print(json.dumps(found))
