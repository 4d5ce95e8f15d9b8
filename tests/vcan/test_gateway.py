"""`vsensor gateway` between two real vcans: a car's frames arrive, its camera's are replaced."""

import signal
import subprocess
import sys
import time

import pytest

from tests.bus_frames import content
from tests.ecu.building import found
from tests.vcan.listening import wait_for
from tests.vcan.test_ecu import ecu, ended
from tests.vehicle_frames import Gateway
from vsensor.bus import open_bus
from vsensor.profile import load_profile
from vsensor.types import Frame, SensorMode

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(300)]

SECONDS = 4.0
NATIVE = load_profile("native")
SAID = {"sensor_not_ready", "left_not_available", "right_not_available"}


@pytest.fixture(scope="module")
def gateway(tmp_path_factory):
    """4 s of a car that has another camera: what it sent, what came, what ECU and gateway say."""
    command = [sys.executable, "-m", "vsensor.cli", "gateway", "--in", "vcan0", "--out", "vcan1"]
    command += ["--overlay", "live_bench"]
    pipe = subprocess.PIPE
    with (
        ecu() as listener,
        open_bus("socketcan:vcan0", echo=False) as car,
        open_bus("socketcan:vcan1", echo=False) as far,
        subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process,
    ):
        try:
            while "passing" not in (line := process.stderr.readline()):
                assert line, "the gateway ended"
            sent, came = drive(car, far)
            judged = ended(listener)  # before the gateway is: it would miss its frames
            there = len(sensors(came))
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=30)
            assert process.returncode == 130, err
            came += far.drain()
            assert there <= judged["frames"] <= len(sensors(came))
        finally:
            process.kill()
    return sent, came, judged, out


def sensors(frames):
    return [frame for frame in frames if 0x320 <= frame.arbitration_id <= 0x32C]


def drive(car, far):
    """Send motion every 20 ms, and 2 ms after it a frame of the car's own camera and one of somebody else."""
    frames, sent, came = Gateway(), [], []
    began = time.monotonic()
    for k in range(round(SECONDS / 0.02)):
        time.sleep(max(0.0, began + 0.02 * k - time.monotonic()))
        now = frames.motion(0, 20.0, 0.0)
        for frame in (now, other(0x320, k), other(0x555, k)):
            assert car.send(frame)
            sent.append(frame)
        car.drain()
        came += far.drain()
    wait_for(
        lambda: came.extend(far.drain()) or content(sent[-1]) in [content(frame) for frame in came[-50:]]
    )
    return sent, came


def other(number, k):
    return Frame(due_ns=0, arbitration_id=number, data=k.to_bytes(8, "big"))


def test_the_cars_frames_are_passed_on_bit_for_bit_in_their_order(gateway):
    sent, came, _, _ = gateway
    wanted = [content(frame) for frame in sent if frame.arbitration_id != 0x320]
    passed = [content(frame) for frame in came if frame.arbitration_id in (0x100, 0x555)]
    assert passed == wanted


def test_of_the_cameras_frames_none_is_and_an_ecu_accepts_the_sensors(gateway):
    _, _, judged, out = gateway
    assert judged["bursts"] >= 10  # of 100; a machine that is busy makes fewer, and says so
    errors = {name for name, count in found(judged).items() if count and name not in SAID}
    lost = int(out.split(" images sent, ")[1].split()[0])
    assert not errors or (lost and errors == {"timeout"}), judged["log"]


def test_the_motion_that_is_passed_on_reaches_the_sensor_which_lacks_nothing(gateway):
    _, came, _, _ = gateway
    states = [NATIVE.decode(frame)["sensor.state"] for frame in came if frame.arbitration_id == 0x321]
    assert SensorMode.AVAILABLE in states  # without motion it is degraded all the time


def test_the_summary_tells_the_latency_from_the_kernels_time_on(gateway):
    _, _, _, out = gateway
    line = next(line for line in out.splitlines() if line.startswith("latency, receive time to sent"))
    print(out)
    assert 0.0 < float(line.split("p50 ")[1].split(",")[0]) < 1000.0
