"""A live scenario on a real vcan: what another process sends moves the vehicle, and silence degrades it."""

import re
import signal
import time

import pytest

from tests.vcan.programs import Program
from tests.vehicle_frames import Gateway
from vsensor.bus import open_bus
from vsensor.config import SHIPPED
from vsensor.profile import load_profile
from vsensor.types import SensorMode

pytestmark = pytest.mark.vcan
LONGEST_S = 30.0  # some 4 s are needed; a machine under load takes longer
SPEED_MPS = 25.0
TIMEOUT_S = 0.3

SCENARIO = f"""
schema = "vsensor.scenario/1"
source = "{SHIPPED / "highway.xodr"}"
[ego]
road = "1"
lane = -3
control = "motion"
[listen]
timeout_ms = {1000 * TIMEOUT_S:.0f}
"""


class Peer:
    """The rest of the vehicle on vcan0: sends motion every 20 ms while it is told to, hears the sensor."""

    def __init__(self, bus):
        self.bus, self.gateway, self.native = bus, Gateway(), load_profile("native")
        self.modes = []
        self.sent = self.heard = 0
        self.longest_s = 0.0  # between two frames of motion, while it is to send them

    def until(self, mode, *, sending):
        """Go on until the sensor says this state; fails after LONGEST_S."""
        last = sent_s = time.monotonic()
        last += LONGEST_S
        while not self.modes or self.modes[-1] is not mode:
            assert time.monotonic() < last, f"{mode.name} never came: {self.modes}"
            if sending:
                sent_s, before_s = time.monotonic(), sent_s
                self.longest_s = max(self.longest_s, sent_s - before_s)
                self.sent += self.bus.send(self.gateway.motion(0, SPEED_MPS, 0.0))
            for frame in self.bus.drain():
                values = self.native.decode(frame, check=True) or {}
                self.heard += bool(values)
                if "sensor.state" in values:
                    now = SensorMode(int(values["sensor.state"]))
                    self.modes += [now] * (self.modes[-1:] != [now])
            time.sleep(0.02)


@pytest.fixture(scope="module")
def conversation(tmp_path_factory):
    """The peer after its conversation with a run, the run's output and its log."""
    folder = tmp_path_factory.mktemp("live")
    scenario = folder / "live.toml"
    scenario.write_text(SCENARIO)
    words = ["run", scenario, "--bus", "socketcan:vcan0"]
    with open_bus("socketcan:vcan0") as bus, Program("vsensor.cli", *words) as program:
        peer = Peer(bus)
        peer.until(SensorMode.DEGRADED, sending=False)
        for mode, sending in (("AVAILABLE", True), ("DEGRADED", False), ("AVAILABLE", True)):
            peer.until(SensorMode[mode], sending=sending)
        program.send_signal(signal.SIGINT)
        done = program.ended(LONGEST_S)
    return peer, done.stdout, done.stderr


def test_the_sensor_is_degraded_until_motion_comes_while_it_stays_away_and_no_longer(conversation):
    peer, out, err = conversation
    assert peer.modes[:3] == [SensorMode.INIT, SensorMode.DEGRADED, SensorMode.AVAILABLE], err
    assert "ego.speed_mps was missing" in out
    if peer.longest_s < TIMEOUT_S / 2:  # else this machine stood still, and motion did stay away
        assert peer.modes[3:] == [SensorMode.DEGRADED, SensorMode.AVAILABLE]
        assert "ego.speed_mps was missing once" in out


def test_every_frame_of_motion_was_heard_decoded_and_checked(conversation):
    peer, out, _ = conversation
    heard, decoded = re.search(r"frames heard (\d+), decoded and checked (\d+)", out).groups()
    assert heard == decoded
    assert 0 <= peer.sent - int(heard) < 15  # the last ones came after its end


def test_what_is_listened_to_is_said(conversation):
    _, _, err = conversation
    assert "listens to 0x100 VEH_Motion (profile vehicle): ego.speed_mps, ego.yaw_rate_radps" in err
