"""The way onto a bus: any python-can interface, or one inside the process where there is none."""

import contextlib
import errno
import logging
import socket
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
from can.interfaces import BACKENDS
from can.interfaces.socketcan import SocketcanBus

from vsensor.errors import BusError
from vsensor.types import Frame

NETWORK_INTERFACES = Path("/sys/class/net")
ARPHRD_CAN = 280  # /sys/class/net/X/type of a CAN interface (linux/if_arp.h)
IFF_UP = 1
CANFD_MTU = 72  # sizeof(struct canfd_frame); classic CAN has 16
CAN_EFF_FLAG = 0x80000000  # 29-bit identifier (linux/can.h)
CAN_RTR_FLAG = 0x40000000
CANFD_BRS, CANFD_ESI, CANFD_FDF = 0x01, 0x02, 0x04  # flags of struct canfd_frame
SIMULATED_KINDS = ("vcan", "vxcan")
REFUSED = {"udp_multicast": "it drops bursts silently and sends them beyond this machine"}
OTHER_CLOCK_NS = 10_000_000_000  # a receive time this far from now does not count from 1970


class FrameBus:
    """An open bus. Frames that it refuses are counted, the cycle goes on; `report` says what happened."""

    def __init__(self, bus: can.BusABC, name: str, *, is_simulated: bool, remark: str = "") -> None:
        self._bus = bus
        self._put = _socket_sender(bus.socket) if isinstance(bus, SocketcanBus) else _message_sender(bus)
        self.name = name
        self.is_simulated = is_simulated
        self.remark = remark  # why "auto" did not take a vcan0 that is there
        self.frames_refused = 0
        self.error_frames = 0
        self._problems: dict[str, int] = {}

    def __enter__(self) -> "FrameBus":
        """Return this bus; leaving the block closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def send(self, frame: Frame) -> bool:
        """Send now, ignoring `frame.due_ns`; False if the bus refused the frame."""
        try:
            if frame.is_error:
                raise ValueError("an error frame cannot be sent")
            self._put(frame)
        except (can.CanError, OSError, ValueError) as problem:
            self.frames_refused += 1
            self._note(problem)
            return False
        return True

    def drain(self) -> list[Frame]:
        """Return what has arrived since the last call, in order; `due_ns` is the receive time.

        Receive times are CLOCK_MONOTONIC (as `MonotonicClock`), from the kernel's or adapter's stamp
        where that counts from 1970, else the time of this call. A socket holds some 270 frames: call
        this often. Error and remote frames are counted in `frames_ignored`.
        """
        now_ns = time.monotonic_ns()
        offset_ns = time.time_ns() - now_ns
        return [
            from_message(message, _received_ns(message, now_ns, offset_ns)) for message in self._waiting()
        ]

    def report(self) -> str:
        """Return one line on what went wrong and how often; empty if nothing did."""
        reasons = "; ".join(f"{count} x {text}" for text, count in self._problems.items())
        return f"{self.name} refused {self.frames_refused} frames: {reasons}" if reasons else ""

    def _note(self, problem: Exception) -> None:
        text = _advice(problem)
        self._problems[text] = self._problems.get(text, 0) + 1

    def close(self) -> None:
        """Release the interface; closing twice does no harm."""
        self._bus.shutdown()

    def _waiting(self) -> Iterator[can.Message]:
        while True:
            try:
                message = self._bus.recv(timeout=0)
            except (can.CanError, OSError) as problem:  # interface went down: the next send tells too
                self._note(problem)
                return
            if message is None:
                return
            if message.is_error_frame:
                self.error_frames += 1
            else:
                yield message


def open_bus(specification: str, fd: bool = False) -> FrameBus:
    """Open "interface:channel[,option=value...]" of python-can, or "auto".

    "auto" is socketcan:vcan0 if that is there and up (and, with `fd`, carries CAN FD), otherwise a
    virtual bus in this process that hears what it sends. Raises BusError naming interface and channel.
    """
    remark = ""
    if specification == "auto":
        problem_of_vcan0 = _problem_of("vcan0", fd)
        specification = "virtual:vsensor" if problem_of_vcan0 else "socketcan:vcan0"
        remark = problem_of_vcan0 if "vcan0" in can_interfaces() else ""
    interface, channel, options = _parse(specification)
    if interface == "socketcan" and (problem := _problem_of(channel, fd)):
        raise BusError(f"bus {specification}: {problem}")
    if interface == "virtual":
        options["receive_own_messages"] = True
    if fd and interface != "virtual":
        options["fd"] = True
    number = int(channel) if channel.isdecimal() and interface not in ("socketcan", "virtual") else channel
    try:
        with _complaints() as complaints:
            bus = can.Bus(number, interface, ignore_config=True, **options)
    except Exception as problem:  # each of python-can's 23 back ends raises its own
        told = "; ".join([*complaints, str(problem)])
        raise BusError(f"bus {specification} cannot be opened: {told}; {_what_exists()}") from problem
    simulated = interface == "virtual" or (interface == "socketcan" and link_kind(channel) in SIMULATED_KINDS)
    return FrameBus(bus, f"{interface}:{channel}", is_simulated=simulated, remark=remark)


@contextlib.contextmanager
def _complaints() -> Iterator[list[str]]:
    """Collect what python-can logs: a back end without its driver says there what it misses."""
    heard: list[str] = []
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda record: heard.append(record.getMessage())  # type: ignore[method-assign]
    logger = logging.getLogger("can")
    logger.addHandler(handler)
    try:
        yield heard
    finally:
        logger.removeHandler(handler)


def can_interfaces() -> list[str]:
    """Return the names of this machine's CAN network interfaces, up or down."""
    return [
        folder.name
        for folder in sorted(NETWORK_INTERFACES.glob("*"))
        if _number(folder / "type") == ARPHRD_CAN
    ]


def _message_sender(bus: can.BusABC) -> Callable[[Frame], None]:
    return lambda frame: bus.send(to_message(frame))


def _socket_sender(can_socket: socket.socket) -> Callable[[Frame], None]:
    """Return a sender with one system call a frame: python-can's takes two and builds a Message.

    In a user-mode kernel, where system calls are dear, that is 130 instead of 430 us a frame.
    """
    send, pack = can_socket.send, struct.pack

    def put(frame: Frame) -> None:
        can_id = frame.arbitration_id | (CAN_EFF_FLAG if frame.is_extended else 0)
        can_id |= CAN_RTR_FLAG if frame.is_remote else 0
        length = len(frame.data)
        if length > (64 if frame.is_fd else 8):
            raise ValueError(f"frame {frame.arbitration_id:#x} has {length} bytes of data, too many")
        if frame.is_fd:
            flags = CANFD_FDF | (CANFD_BRS if frame.bitrate_switch else 0)
            flags |= CANFD_ESI if frame.error_state_indicator else 0
            send(pack("=IBBxx64s", can_id, length, flags, frame.data), socket.MSG_DONTWAIT)
        else:
            send(pack("=IBxxx8s", can_id, length, frame.data), socket.MSG_DONTWAIT)

    return put


def to_message(frame: Frame) -> can.Message:
    """Return the python-can form of a frame, without its due time."""
    return can.Message(
        arbitration_id=frame.arbitration_id,
        is_extended_id=frame.is_extended,
        is_fd=frame.is_fd,
        bitrate_switch=frame.bitrate_switch,
        error_state_indicator=frame.error_state_indicator,
        is_remote_frame=frame.is_remote,
        dlc=len(frame.data),
        data=None if frame.is_remote else frame.data,
    )


def from_message(message: can.Message, t_ns: int) -> Frame:
    """Return a received message as a frame of time `t_ns`."""
    return Frame(
        due_ns=t_ns,
        arbitration_id=message.arbitration_id,
        data=bytes(message.dlc) if message.is_remote_frame else bytes(message.data),
        is_extended=message.is_extended_id,
        is_fd=message.is_fd,
        bitrate_switch=message.bitrate_switch,
        error_state_indicator=message.error_state_indicator,
        is_remote=message.is_remote_frame,
    )


def link_kind(interface: str) -> str:
    """Return what the kernel calls an interface's kind ("vcan", "vxcan", "can", "slcan"), "" if unknown.

    Asked over rtnetlink: RTM_GETLINK, attribute IFLA_LINKINFO / IFLA_INFO_KIND (linux/if_link.h).
    """
    get_link, request, ifname, linkinfo, info_kind = 18, 1, 3, 18, 1
    name = interface.encode() + b"\0"
    attribute = struct.pack("=HH", 4 + len(name), ifname) + name.ljust(-(-len(name) // 4) * 4, b"\0")
    body = struct.pack("=BxHiII", 0, 0, 0, 0, 0) + attribute
    try:
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as link:
            link.settimeout(1.0)
            link.send(struct.pack("=IHHII", 16 + len(body), get_link, request, 1, 0) + body)
            answer = link.recv(65536)
    except OSError:
        return ""
    nested = _attributes(answer[32:]).get(linkinfo, b"")
    return _attributes(nested).get(info_kind, b"").rstrip(b"\0").decode()


def _attributes(data: bytes) -> dict[int, bytes]:
    """Split a sequence of netlink attributes: length and type (2 bytes each), value, padding to 4."""
    found = {}
    while len(data) >= 4:
        length, kind = struct.unpack_from("=HH", data)
        if length < 4:
            break
        found[kind & 0x3FFF] = data[4:length]
        data = data[(length + 3) & ~3 :]
    return found


def _parse(specification: str) -> tuple[str, str, dict[str, Any]]:
    interface, _, rest = specification.partition(":")
    words = rest.split(",")
    channel = ",".join(word for word in words if "=" not in word)  # vector's channel may be "0,1"
    if not interface or not channel:
        raise BusError(
            f"bus {specification!r}: expected INTERFACE:CHANNEL, such as socketcan:can0; {_what_exists()}"
        )
    if interface in REFUSED:
        raise BusError(f"bus {specification}: {interface} is not used, {REFUSED[interface]}")
    if interface not in BACKENDS:
        known = ", ".join(sorted(set(BACKENDS) - set(REFUSED)))
        raise BusError(f"bus {specification}: no interface {interface!r}; python-can knows {known}")
    pairs = (word.partition("=") for word in words if "=" in word)
    return interface, channel, {key.strip(): _value(text.strip()) for key, _, text in pairs}


def _value(text: str) -> int | float | bool | str:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _problem_of(channel: str, fd: bool) -> str:
    """Return why a SocketCAN interface cannot be used, with the command that mends it; "" if it can."""
    if not hasattr(socket, "AF_CAN"):
        return "this system has no SocketCAN"
    folder = NETWORK_INTERFACES / channel
    if "/" in channel or _number(folder / "type") != ARPHRD_CAN:
        return f"socketcan has no channel {channel!r}; {_what_exists()}"
    if not _number(folder / "flags") & IFF_UP:
        return f"{channel} is down: ip link set {channel} up"
    if fd and _number(folder / "mtu") < CANFD_MTU:
        return (
            f"{channel} carries classic CAN only, CAN FD was asked for: ip link set {channel} mtu {CANFD_MTU}"
        )
    return ""


def _what_exists() -> str:
    names = ", ".join(f"socketcan:{name}" for name in can_interfaces())
    return f"there is {names or 'no CAN interface on this machine'} (and virtual:NAME everywhere)"


def _number(path: Path) -> int:
    try:
        return int(path.read_text(), 0)
    except OSError:
        return 0


def _received_ns(message: can.Message, now_ns: int, offset_ns: int) -> int:
    stamp_ns = round(message.timestamp * 1e9) - offset_ns
    return stamp_ns if abs(stamp_ns - now_ns) < OTHER_CLOCK_NS else now_ns


def _advice(problem: Exception) -> str:
    text = str(problem)
    if getattr(problem, "error_code", None) == errno.ENOBUFS or getattr(problem, "errno", 0) == errno.ENOBUFS:
        text += " (raise the interface's queue: ip link set ... txqueuelen 1000)"
    return text
