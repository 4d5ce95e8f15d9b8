import struct
import time
from dataclasses import replace

import can
import pytest

from vsensor import bus as bus_module
from vsensor.bus import FrameBus, open_bus
from vsensor.errors import BusError
from vsensor.types import Frame

CLASSIC = Frame(due_ns=1, arbitration_id=0x123, data=bytes(range(8)))
EXTENDED = Frame(due_ns=2, arbitration_id=0x18FF1234, data=b"\x01", is_extended=True)
EMPTY = Frame(due_ns=3, arbitration_id=0x7FF, data=b"")
REMOTE = Frame(due_ns=4, arbitration_id=0x321, data=bytes(5), is_remote=True)
FD = Frame(
    due_ns=5,
    arbitration_id=0x200,
    data=bytes(range(32)),
    is_fd=True,
    bitrate_switch=True,
    error_state_indicator=True,
)
ALL = {"classic": CLASSIC, "extended": EXTENDED, "empty": EMPTY, "remote": REMOTE, "fd": FD}


def content(frame):
    return replace(frame, due_ns=0)


@pytest.fixture
def no_interfaces(tmp_path, monkeypatch):
    monkeypatch.setattr(bus_module, "NETWORK_INTERFACES", tmp_path)
    return tmp_path


def add_interface(folder, name, kind=280, flags="0x1", mtu=72):
    (folder / name).mkdir()
    for file, text in (("type", kind), ("flags", flags), ("mtu", mtu)):
        (folder / name / file).write_text(f"{text}\n")


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


def test_a_stamp_that_does_not_count_from_1970_is_replaced_by_the_time_of_draining():
    now_ns, offset_ns = 5_000_000_000, 1_700_000_000_000_000_000
    assert bus_module._received_ns(can.Message(timestamp=12.5), now_ns, offset_ns) == now_ns


def test_a_stamp_of_unix_time_becomes_monotonic_time_to_the_microsecond():
    now_ns, offset_ns = 5_000_000_000, 1_700_000_000_000_000_000
    message = can.Message(timestamp=1_700_000_004.25)
    step_ns = 240  # of a float of Unix seconds
    assert bus_module._received_ns(message, now_ns, offset_ns) == pytest.approx(4_250_000_000, abs=step_ns)


def test_auto_is_a_simulated_virtual_bus_where_there_is_no_vcan0(no_interfaces):
    with open_bus("auto") as bus:
        assert (bus.name, bus.is_simulated) == ("virtual:vsensor", True)


@pytest.mark.parametrize("wrong", [{"flags": "0x0"}, {"kind": 1}], ids=["down", "no CAN interface"])
def test_auto_passes_over_a_vcan0_that_cannot_be_used(no_interfaces, wrong):
    add_interface(no_interfaces, "vcan0", **wrong)
    with open_bus("auto") as bus:
        assert bus.name == "virtual:vsensor"


def test_auto_says_why_it_did_not_take_a_vcan0_that_is_there(no_interfaces):
    add_interface(no_interfaces, "vcan0", flags="0x0")
    with open_bus("auto") as bus:
        assert bus.remark == "vcan0 is down: ip link set vcan0 up"


def test_auto_has_nothing_to_remark_where_there_is_no_vcan0(no_interfaces):
    with open_bus("auto") as bus:
        assert bus.remark == ""


def test_what_python_can_logs_of_a_missing_driver_is_part_of_the_one_line(capsys):
    with pytest.raises(BusError, match=r"kvaser:0 cannot be opened: Kvaser canlib is unavailable"):
        open_bus("kvaser:0")
    assert capsys.readouterr().err == ""


def test_missing_channel_is_named_with_what_exists(no_interfaces):
    add_interface(no_interfaces, "can3")
    add_interface(no_interfaces, "eth0", kind=1)
    with pytest.raises(BusError, match=r"socketcan:can9.*no channel 'can9'; there is socketcan:can3 \(and"):
        open_bus("socketcan:can9")


def test_machine_without_can_interfaces_says_so(no_interfaces):
    with pytest.raises(BusError, match="no CAN interface on this machine"):
        open_bus("socketcan:can0")


def test_interface_that_is_down_is_refused_with_the_command_that_raises_it(no_interfaces):
    add_interface(no_interfaces, "can0", flags="0x40080")
    with pytest.raises(BusError, match="can0 is down: ip link set can0 up"):
        open_bus("socketcan:can0")


def test_fd_on_an_interface_for_classic_can_is_refused(no_interfaces):
    add_interface(no_interfaces, "can0", mtu=16)
    with pytest.raises(BusError, match="ip link set can0 mtu 72"):
        open_bus("socketcan:can0", fd=True)


@pytest.mark.parametrize("specification", ["", "vcan0", "socketcan:", ":vcan0", "socketcan:../lo"])
def test_specification_that_is_not_interface_and_channel_is_one_line(specification):
    with pytest.raises(BusError) as caught:
        open_bus(specification)
    assert "\n" not in str(caught.value)
    assert specification in str(caught.value)


def test_unknown_interface_lists_those_of_python_can():
    with pytest.raises(BusError, match=r"nosuch:1: no interface 'nosuch'; python-can knows .*socketcan"):
        open_bus("nosuch:1")


def test_udp_multicast_is_refused():
    with pytest.raises(BusError, match="udp_multicast is not used"):
        open_bus("udp_multicast:239.0.0.1")


def test_adapter_whose_driver_is_absent_is_an_error_of_use():
    with pytest.raises(BusError, match=r"bus ixxat:0,bitrate=500000 cannot be opened: .*ixxat"):
        open_bus("ixxat:0,bitrate=500000")


def test_options_after_the_channel_reach_the_back_end_typed():
    assert bus_module._parse("vector:0,1,bitrate=500000,app_name=x,listen=true,sjw=2.5") == (
        "vector",
        "0,1",
        {"bitrate": 500000, "app_name": "x", "listen": True, "sjw": 2.5},
    )


class DeafBus(can.BusABC):
    """A bus whose interface has gone down."""

    def __init__(self, problem):
        super().__init__("deaf")
        self.problem = problem

    def send(self, msg, timeout=None):
        raise self.problem

    def _recv_internal(self, timeout):
        return None, True


def test_refused_frames_are_counted_and_reported_once_not_raised():
    full = can.CanOperationError("Failed to transmit: No buffer space available", 105)
    with FrameBus(DeafBus(full), "socketcan:can0", is_simulated=False) as bus:
        assert [bus.send(CLASSIC) for _ in range(3)] == [False] * 3
        assert bus.frames_refused == 3
        assert bus.report().count("No buffer space") == 1
        assert "3 x" in bus.report()
        assert "txqueuelen" in bus.report()


def test_a_bus_that_refused_nothing_reports_nothing():
    with open_bus("virtual:quiet") as bus:
        bus.send(CLASSIC)
        assert bus.report() == ""


class FakeSocket:
    def send(self, data, flags):
        self.data = data


@pytest.mark.parametrize("frame", ALL.values(), ids=ALL)
def test_socket_form_of_a_frame_is_that_of_python_can(frame):
    from can.interfaces.socketcan.socketcan import build_can_frame

    fake = FakeSocket()
    bus_module._socket_sender(fake)(frame)
    expected = build_can_frame(bus_module.to_message(frame)).ljust(len(fake.data), b"\0")
    assert fake.data[:6] == expected[:6]  # byte 7, where python-can says 8, counts only from 9 (len8_dlc)
    assert fake.data[8:] == expected[8:]


def test_error_frame_is_refused_like_a_frame_that_the_bus_refuses():
    with open_bus("virtual:error") as bus:
        assert not bus.send(replace(CLASSIC, is_error=True))
        assert "error frame" in bus.report()


def test_error_frames_heard_are_counted_not_returned():
    with (
        open_bus("virtual:disturbed") as bus,
        can.Bus("disturbed", "virtual", ignore_config=True) as disturber,
    ):
        disturber.send(can.Message(is_error_frame=True))
        assert bus.drain() == []
        assert bus.error_frames == 1


@pytest.mark.parametrize(
    "frame",
    [
        Frame(due_ns=0, arbitration_id=1, data=bytes(9)),
        Frame(due_ns=0, arbitration_id=1, data=bytes(65), is_fd=True),
    ],
)
def test_socket_never_cuts_data_off(frame):
    with pytest.raises(ValueError, match="too many"):
        bus_module._socket_sender(FakeSocket())(frame)


def test_netlink_attributes_are_split_at_multiples_of_four():
    data = struct.pack("=HH5s3x", 9, 1, b"abcde") + struct.pack("=HH4s", 8, 0x8002, b"wxyz")
    assert bus_module._attributes(data) == {1: b"abcde", 2: b"wxyz"}


def test_loopback_has_no_link_kind():
    assert bus_module.link_kind("lo") == ""
    assert bus_module.link_kind("nosuch") == ""


@pytest.mark.vcan
def test_auto_is_vcan0_where_it_is_up():
    with open_bus("auto", fd=True) as bus:
        assert (bus.name, bus.is_simulated) == ("socketcan:vcan0", True)


@pytest.mark.vcan
def test_kernel_calls_a_vcan_by_its_kind():
    assert bus_module.link_kind("vcan0") == "vcan"


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
