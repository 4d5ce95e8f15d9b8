"""Sensor, vehicle and ECU in one loop without a bus and without a clock: bit-identical every time.

line.compute --frames--> pipe --> ecu --log (a process) --requests--> pipe --> next compute
"""

import json
import math
import os
import subprocess
from dataclasses import dataclass

import numpy as np

from tests.ecu.building import built_ecu
from vsensor.config import load_scenario
from vsensor.line import build_line
from vsensor.types import Frame, Side, Tick
from vsensor.world.truth import line_truths

PERIOD_NS = 40_000_000
STEPS_PER_IMAGE = 2  # a request every 20 ms
START_S = 1000


@dataclass(frozen=True)
class Drive:
    """What a closed loop did: arrays (ticks,), and the ECU's report.

    `offsets_m` by side is the true lane offset at the front axle, left positive, NaN without a line.
    """

    offsets_m: dict
    speed_mps: np.ndarray
    yaw_rate_radps: np.ndarray
    report: dict


def closed_loop(scenario, ticks, *, overrides=None, options=(), frames_of=lambda frames, index: frames):
    """Run `ticks` images; `frames_of(frames, index)` may spoil what the ECU hears. Returns the Drive."""
    line = build_line(load_scenario(scenario, overrides or {}))
    answers, gives = os.pipe()
    command = [built_ecu() / "ecu", "--log", "/dev/stdin", "--requests", f"/dev/fd/{gives}", *options]
    pipe = subprocess.PIPE
    rows, heard, state = [], (), line.initial_state()
    with (
        subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, pass_fds=[gives]) as ecu,
        os.fdopen(answers) as requests,
    ):
        os.close(gives)
        for index in range(ticks):
            tick = Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)
            computed = line.compute(state, tick, heard)
            assert computed is not None, "the road has ended"
            state = computed.state_if_sent
            rows.append(_row(line, computed.output))
            tell(ecu.stdin, frames_of(computed.output.frames, index), tick.t_ns)
            heard = asked(requests, tick.t_ns) if index else ()
        ecu.stdin.close()
        report = json.loads(ecu.stdout.read())
    left, right, speed_mps, yaw_rate_radps = np.array(rows).T
    return Drive({Side.LEFT: left, Side.RIGHT: right}, speed_mps, yaw_rate_radps, report)


def tell(pipe, frames, t_ns):
    """Write a burst; its frames have one time, so that requests fall between bursts only."""
    seconds, rest = divmod(START_S * 10**9 + t_ns, 10**9)
    for frame in frames:
        pipe.write(
            f"({seconds}.{rest // 1000:06d}) c {frame.arbitration_id:03X}#{frame.data.hex().upper()}\n"
        )
    pipe.flush()


def asked(requests, t_ns):
    """Return the requests that left since the image before, as the sensor hears them."""
    heard = []
    for number in range(STEPS_PER_IMAGE):
        identifier, data = requests.readline().split()[2].split("#")
        heard.append(
            Frame(
                due_ns=t_ns - (STEPS_PER_IMAGE - number) * PERIOD_NS // STEPS_PER_IMAGE,
                arbitration_id=int(identifier, 16),
                data=bytes.fromhex(data),
            )
        )
    return heard


def _row(line, output):
    truths = line_truths(output, line.vehicle.wheelbase_m)
    offsets = [truths[side].lane_offset_m if side in truths else math.nan for side in (Side.LEFT, Side.RIGHT)]
    return *offsets, output.snapshot.ego.speed_mps, output.snapshot.ego.yaw_rate_radps
