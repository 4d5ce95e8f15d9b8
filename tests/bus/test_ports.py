import sys
import time

import pytest

from tests.bus_frames import ALL, CLASSIC, FD, content
from vsensor.bus import Times, open_bus, to_message, wire
from vsensor.bus.ports import PythonCanPort
from vsensor.types import Frame


@pytest.mark.parametrize("frame", ALL.values(), ids=ALL)
def test_virtual_bus_gives_back_the_frame_that_was_sent(frame):
    with open_bus("virtual:round trip", fd=True) as bus:
        assert bus.send(frame)
        assert [content(heard) for heard in bus.drain()] == [content(frame)]


def test_virtual_bus_keeps_the_order_and_drains_once():
    frames = [Frame(due_ns=0, arbitration_id=number, data=b"") for number in range(500)]
    with open_bus("virtual:order") as bus:
        assert all(bus.send(frame) for frame in frames)
        assert [heard.arbitration_id for heard in bus.drain()] == list(range(500))
        assert bus.drain() == []


def test_two_virtual_buses_of_one_channel_hear_each_other():
    with (
        open_bus("virtual:shared") as one,
        open_bus("virtual:shared") as other,
        open_bus("virtual:else") as third,
    ):
        one.send(CLASSIC)
        assert [content(heard) for heard in other.drain()] == [content(CLASSIC)]
        assert third.drain() == []


def test_receive_time_is_monotonic_and_lies_between_sending_and_draining():
    with open_bus("virtual:time") as bus:
        before_ns = time.monotonic_ns()
        bus.send(CLASSIC)
        (heard,) = bus.drain()
        after_ns = time.monotonic_ns()
    tolerance_ns = (
        10_000  # a float of Unix seconds has steps of 0.24 us; two clocks are read one after the other
    )
    assert before_ns - tolerance_ns <= heard.due_ns <= after_ns + tolerance_ns


TIMES = Times(now_ns=5_000_000_000, epoch_offset_ns=1_700_000_000_000_000_000)


def test_a_stamp_that_does_not_count_from_1970_is_replaced_by_the_time_of_draining():
    assert TIMES.monotonic_ns(12_500_000_000) == TIMES.now_ns


def test_a_stamp_of_unix_time_becomes_monotonic_time_to_the_nanosecond():
    assert TIMES.monotonic_ns(1_700_000_004_250_000_001) == 4_250_000_001


@pytest.mark.parametrize("frame", ALL.values(), ids=ALL)
def test_socket_form_of_a_frame_is_that_of_python_can(frame):
    from can.interfaces.socketcan.socketcan import build_can_frame

    ours = wire.to_wire(frame)
    expected = build_can_frame(to_message(frame)).ljust(len(ours), b"\0")
    assert ours[:6] == expected[:6]  # byte 7, where python-can says 8, counts only from 9 (len8_dlc)
    assert ours[8:] == expected[8:]


@pytest.mark.parametrize("frame", ALL.values(), ids=ALL)
def test_socket_form_is_read_back_as_the_same_frame(frame):
    assert wire.from_wire(wire.to_wire(frame), frame.due_ns) == frame


@pytest.mark.parametrize("classes", [0x40, 0x1FFFFFFF])
def test_the_classes_of_an_error_frame_become_its_id(classes):
    data = (0x20000000 | classes).to_bytes(4, sys.byteorder) + b"\x08\0\0\0" + bytes(8)
    read = wire.from_wire(data, 7)
    assert (read.is_error, read.arbitration_id, read.due_ns) == (True, classes, 7)


@pytest.mark.parametrize(("is_virtual", "patience_s"), [(True, 0.0), (False, None)])
def test_sending_waits_for_nobody_on_a_virtual_bus(is_virtual, patience_s):
    class Bus:
        def send(self, message, timeout):
            self.timeout = timeout

    bus = Bus()
    PythonCanPort(bus, hears_itself=is_virtual).put(CLASSIC)
    assert bus.timeout == patience_s


@pytest.mark.parametrize(
    "frame",
    [
        Frame(due_ns=0, arbitration_id=1, data=bytes(9)),
        Frame(due_ns=0, arbitration_id=1, data=bytes(65), is_fd=True),
    ],
)
def test_socket_never_cuts_data_off(frame):
    with pytest.raises(ValueError, match="too many"):
        wire.to_wire(frame)


@pytest.mark.vcan
def test_frames_sent_on_vcan_are_received_by_a_second_socket_bit_for_bit():
    with open_bus("socketcan:vcan1", fd=True) as sender, open_bus("socketcan:vcan1", fd=True) as receiver:
        frames = list(ALL.values())
        assert all(sender.send(frame) for frame in frames)
        assert [content(heard) for heard in receiver.drain()] == [content(frame) for frame in frames]
        assert sender.drain() == []


@pytest.mark.vcan
def test_receive_time_on_vcan_is_the_kernels_not_that_of_draining():
    with open_bus("socketcan:vcan1") as sender, open_bus("socketcan:vcan1") as receiver:
        before_ns = time.monotonic_ns()
        sender.send(CLASSIC)
        after_ns = time.monotonic_ns()
        while time.monotonic_ns() < after_ns + 20_000_000:
            pass
        (heard,) = receiver.drain()
    assert before_ns - 100_000 <= heard.due_ns <= after_ns + 100_000


@pytest.mark.vcan
def test_fd_frame_on_a_bus_opened_for_classic_can_is_counted_as_refused():
    with open_bus("socketcan:vcan1") as bus:
        assert not bus.send(FD)
        assert bus.frames_refused == 1
