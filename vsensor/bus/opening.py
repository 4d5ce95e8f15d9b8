"""From "interface:channel" to an open bus."""

import contextlib
import logging
from collections.abc import Iterator
from typing import Any

import can
from can.interfaces import BACKENDS
from can.interfaces.socketcan import SocketcanBus

from vsensor.bus.frame_bus import FrameBus
from vsensor.bus.interfaces import can_interfaces, problem_of, what_exists
from vsensor.bus.link import link_kind
from vsensor.bus.ports import Port, PythonCanPort
from vsensor.bus.socketcan import SocketcanPort
from vsensor.errors import BusError

SIMULATED_KINDS = ("vcan", "vxcan")
REFUSED = {"udp_multicast": "it drops bursts silently and sends them beyond this machine"}


def open_bus(specification: str, fd: bool = False, echo: bool = True) -> FrameBus:
    """Open "interface:channel[,option=value...]" of python-can, or "auto".

    "auto" is socketcan:vcan0 if that is there and up (and, with `fd`, carries CAN FD), otherwise a
    virtual bus in this process that hears what it sends. Without `echo` own frames do not come back: when
    they were on the bus is not known, and no time is spent on reading them. Raises BusError naming interface
    and channel.
    """
    remark = ""
    if specification == "auto":
        problem_of_vcan0 = problem_of("vcan0", fd)
        specification = "virtual:vsensor" if problem_of_vcan0 else "socketcan:vcan0"
        remark = problem_of_vcan0 if "vcan0" in can_interfaces() else ""
    interface, channel, options = parse(specification)
    if interface == "socketcan" and (problem := problem_of(channel, fd)):
        raise BusError(f"bus {specification}: {problem}")
    if interface in ("virtual", "socketcan"):
        options["receive_own_messages"] = echo
    if fd and interface != "virtual":
        options["fd"] = True
    number = int(channel) if channel.isdecimal() and interface not in ("socketcan", "virtual") else channel
    try:
        with _complaints() as complaints:
            port = _port(interface, number, options)
    except Exception as problem:  # each of python-can's 23 back ends raises its own
        told = "; ".join([*complaints, str(problem)])
        raise BusError(f"bus {specification} cannot be opened: {told}; {what_exists()}") from problem
    simulated = interface == "virtual" or (interface == "socketcan" and link_kind(channel) in SIMULATED_KINDS)
    return FrameBus(port, f"{interface}:{channel}", is_simulated=simulated, remark=remark)


def _port(interface: str, channel: int | str, options: dict[str, Any]) -> Port:
    if interface == "socketcan":
        return SocketcanPort(str(channel), lambda: SocketcanBus(str(channel), **options))
    bus = can.Bus(channel, interface, ignore_config=True, **options)
    return PythonCanPort(bus, hears_itself=interface == "virtual")


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


def parse(specification: str) -> tuple[str, str, dict[str, Any]]:
    """Return interface, channel and typed options of "interface:channel,option=value"; raises BusError."""
    interface, _, rest = specification.partition(":")
    words = rest.split(",")
    channel = ",".join(word for word in words if "=" not in word)  # vector's channel may be "0,1"
    if not interface or not channel:
        raise BusError(
            f"bus {specification!r}: expected INTERFACE:CHANNEL, such as socketcan:can0; {what_exists()}"
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
