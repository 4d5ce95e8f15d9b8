"""The way onto a bus: any python-can interface, or one inside the process where there is none."""

from vsensor.bus.frame_bus import FrameBus
from vsensor.bus.interfaces import NETWORK_INTERFACES, can_interfaces
from vsensor.bus.link import link_kind
from vsensor.bus.opening import open_bus
from vsensor.bus.ports import Port, Times, from_message, to_message

__all__ = [
    "NETWORK_INTERFACES",
    "FrameBus",
    "Port",
    "Times",
    "can_interfaces",
    "from_message",
    "link_kind",
    "open_bus",
    "to_message",
]
