"""What is sent on a real vcan is what candump, a program of others, sees there."""

import subprocess

import pytest

from tests.vcan.listening import candump
from vsensor.bus import open_bus
from vsensor.types import Frame

pytestmark = pytest.mark.vcan


@pytest.fixture
def heard_on_vcan1():
    with candump("vcan1") as process:
        yield process


def seen(process, count):
    """The next `count` frames as candump writes them; it waits for them, a lost one ends in the timeout."""
    return [process.stdout.readline().split()[2] for _ in range(count)]


def test_candump_sees_every_frame_in_order_and_bit_for_bit(heard_on_vcan1):
    with open_bus("socketcan:vcan1", fd=True) as bus:
        bus.send(Frame(due_ns=0, arbitration_id=0x12B, data=bytes.fromhex("0011223344556677")))
        bus.send(Frame(due_ns=0, arbitration_id=0x1FFFFFFF, data=b"\xab", is_extended=True))
        bus.send(Frame(due_ns=0, arbitration_id=0x7FF, data=b""))
        bus.send(Frame(due_ns=0, arbitration_id=0x300, data=bytes(12), is_fd=True, bitrate_switch=True))
    assert seen(heard_on_vcan1, 4) == ["12B#0011223344556677", "1FFFFFFF#AB", "7FF#", "300##5" + "00" * 12]


def test_no_frame_of_a_thousand_is_lost_when_candump_reads_along(heard_on_vcan1):
    with open_bus("socketcan:vcan1") as bus:
        for number in range(1000):
            assert bus.send(Frame(due_ns=0, arbitration_id=number, data=number.to_bytes(2, "big")))
            if number % 100 == 99:  # a socket holds some 270 frames
                sent = range(number - 99, number + 1)
                assert seen(heard_on_vcan1, 100) == [f"{n:03X}#{n:04X}" for n in sent]


def test_frames_of_cansend_are_heard():
    with open_bus("socketcan:vcan1", fd=True) as bus:
        subprocess.run(["cansend", "vcan1", "123#DEADBEEF"], check=True)
        subprocess.run(["cansend", "vcan1", "12345678##1AABB"], check=True)
        heard = [(frame.arbitration_id, frame.data, frame.is_extended, frame.is_fd) for frame in bus.drain()]
    assert heard == [
        (0x123, bytes.fromhex("DEADBEEF"), False, False),
        (0x12345678, bytes.fromhex("AABB"), True, True),
    ]
