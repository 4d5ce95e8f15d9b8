import struct

import pytest

from vsensor.bus import interfaces, link, open_bus, opening
from vsensor.errors import BusError


@pytest.fixture
def no_interfaces(tmp_path, monkeypatch):
    monkeypatch.setattr(interfaces, "NETWORK_INTERFACES", tmp_path)
    return tmp_path


def add_interface(folder, name, kind=280, flags="0x1", mtu=72):
    (folder / name).mkdir()
    for file, text in (("type", kind), ("flags", flags), ("mtu", mtu)):
        (folder / name / file).write_text(f"{text}\n")


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
    assert opening.parse("vector:0,1,bitrate=500000,app_name=x,listen=true,sjw=2.5") == (
        "vector",
        "0,1",
        {"bitrate": 500000, "app_name": "x", "listen": True, "sjw": 2.5},
    )


def test_netlink_attributes_are_split_at_multiples_of_four():
    data = struct.pack("=HH5s3x", 9, 1, b"abcde") + struct.pack("=HH4s", 8, 0x8002, b"wxyz")
    assert link.attributes(data) == {1: b"abcde", 2: b"wxyz"}


def test_loopback_has_no_link_kind():
    assert link.link_kind("lo") == ""
    assert link.link_kind("nosuch") == ""


@pytest.mark.vcan
def test_auto_is_vcan0_where_it_is_up():
    with open_bus("auto", fd=True) as bus:
        assert (bus.name, bus.is_simulated) == ("socketcan:vcan0", True)


@pytest.mark.vcan
def test_kernel_calls_a_vcan_by_its_kind():
    assert link.link_kind("vcan0") == "vcan"
