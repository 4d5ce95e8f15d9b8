"""The ECU on a real vcan: what it finds there in the kernel's time, and what it sends."""

import json
import re
import signal
import subprocess
import time
from contextlib import contextmanager

import numpy as np
import pytest
from msgspec.structs import replace

from tests.ecu.building import built_ecu, found
from tests.ecu.streams import IDS, START_NS, changed, crc_wrong, doubled, lane, lost, stream, truncated
from tests.vcan.listening import recorded
from vsensor.bus import open_bus
from vsensor.types import SensorMode

pytestmark = pytest.mark.vcan

IMAGES, AT = 22, 8
"""Images of a stream, and the one at which something happens: the ECU has heard enough to judge by."""
LEFT = "LDS_LeftLine"
LISTENING = "ecu: listening on vcan1\n"


@contextmanager
def ecu(*options):
    """Run the ECU on vcan1 while the block runs; its socket is open inside."""
    command = [built_ecu() / "ecu", "--bus", "vcan1", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr.readline() == LISTENING
            yield process
        finally:
            process.kill()


def send(frames):
    """Send frames at the times that they bear; returns the longest time in ms between two of one message.

    Of the messages that have no fault, that is. On a machine that is too busy it is longer than it should
    be, and a timeout is then right.
    """
    offset_ns = time.monotonic_ns() + 100_000_000 - START_NS
    sent_ns, longest_ns = {}, 0
    with open_bus("socketcan:vcan1") as bus:
        for frame in sorted(frames, key=lambda frame: frame.due_ns):
            wait_ns = frame.due_ns + offset_ns - time.monotonic_ns()
            if wait_ns > 0:
                time.sleep(wait_ns / 1e9)
            bus.drain()
            assert bus.send(frame)
            now_ns = time.monotonic_ns()
            if frame.arbitration_id != IDS[LEFT]:
                longest_ns = max(longest_ns, now_ns - sent_ns.get(frame.arbitration_id, now_ns))
            sent_ns[frame.arbitration_id] = now_ns
    return longest_ns / 1e6


def ended(process):
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=20)
    assert (process.returncode, err) == (0, "")
    return json.loads(out)


def heard(frames):
    """Return the report on frames sent in real time, as soon as the last one is over.

    Where this machine stood still for as long as the ECU waits, they are sent again, some times.
    """
    for _ in range(5):
        with ecu() as process:
            longest_ms = send(frames)
            report = ended(process)
        report["paused"] = longest_ms > 130  # it waits for three cycles and a half, 140 ms
        if not report["paused"]:
            break
    return report


def blocked(index):
    return lane(index, mode=SensorMode.BLOCKED if index in range(AT, AT + 5) else SensorMode.AVAILABLE)


GOOD = stream(IMAGES)
CASES = {
    "good": (GOOD, {}),
    "frame lost": (changed(GOOD, LEFT, {AT}, lost), {"counter_lost": 1, "burst_incomplete": 1}),
    "frame doubled": (changed(GOOD, LEFT, {AT}, doubled), {"counter_repeated": 1}),
    "frame truncated": (
        changed(GOOD, LEFT, {AT}, truncated),
        {"length": 1, "counter_lost": 1, "burst_incomplete": 1},
    ),
    "CRC wrong": (
        changed(GOOD, LEFT, {AT}, crc_wrong),
        {"crc": 1, "counter_lost": 1, "burst_incomplete": 1},
    ),
    "message silent": (
        changed(GOOD, LEFT, range(AT, AT + 6), lost),
        {"counter_lost": 6, "burst_incomplete": 6, "timeout": 1},
    ),
    "image frozen": (
        stream(IMAGES, lambda index: lane(AT - 1 if AT <= index < AT + 3 else index)),
        {"image_frozen": 3},
    ),
    "sensor blocked": (stream(IMAGES, blocked), {"sensor_not_ready": 1}),
}


@pytest.mark.parametrize("case", CASES)
def test_the_ecu_finds_on_the_bus_what_happened_and_nothing_else(case):
    frames, expected = CASES[case]
    report = heard(frames)
    errors = found(report)
    if report["paused"]:  # this machine stood still for longer than the ECU waits
        errors["timeout"] = expected.get("timeout", 0)
        errors = {name: count for name, count in errors.items() if count}
    assert errors == expected
    assert report["frames"] == len(frames)
    assert report["frames_overrun"] == 0


def test_its_requests_are_on_the_bus_every_20_ms(tmp_path):
    with recorded("vcan1", tmp_path / "seen.log"), ecu("--duration", "1") as process:
        send(GOOD)
        report = json.loads(process.communicate(timeout=20)[0])
    lines = [line for line in (tmp_path / "seen.log").read_text().splitlines() if " 200#" in line]
    assert report["seconds"] >= 1.0
    assert len(lines) == report["requests"]
    times = [float(re.match(r"\(([\d.]+)\)", line)[1]) for line in lines]
    assert np.median(np.diff(times)) == pytest.approx(0.02, abs=0.002)
    assert len(times) - 1 < 51 * (times[-1] - times[0])  # a machine that stalls makes no bursts afterwards


def test_an_interface_that_is_not_there_is_named():
    done = subprocess.run(
        [built_ecu() / "ecu", "--bus", "vcan77"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr == "ecu: vcan77: no such interface: No such device\n"


def test_frames_of_29_bit_identifiers_are_not_taken_for_the_sensors():
    foreign = [replace(frame, is_extended=True, data=bytes(8)) for frame in GOOD[13:26]]
    report = heard([*GOOD, *foreign])
    assert report["errors"]["crc"] == 0
    assert report["frames"] == len(GOOD)
