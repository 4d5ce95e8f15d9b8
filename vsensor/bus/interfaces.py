"""CAN interfaces of this machine, as the kernel lists them."""

import socket
from pathlib import Path

NETWORK_INTERFACES = Path("/sys/class/net")
ARPHRD_CAN = 280  # /sys/class/net/X/type of a CAN interface (linux/if_arp.h)
IFF_UP = 1
CANFD_MTU = 72  # sizeof(struct canfd_frame); classic CAN has 16


def can_interfaces() -> list[str]:
    """Return the names of this machine's CAN network interfaces, up or down."""
    return [
        folder.name
        for folder in sorted(NETWORK_INTERFACES.glob("*"))
        if _number(folder / "type") == ARPHRD_CAN
    ]


def problem_of(channel: str, fd: bool) -> str:
    """Return why a SocketCAN interface cannot be used, with the command that mends it; "" if it can."""
    if not hasattr(socket, "AF_CAN"):
        return "this system has no SocketCAN"
    folder = NETWORK_INTERFACES / channel
    if "/" in channel or _number(folder / "type") != ARPHRD_CAN:
        return f"socketcan has no channel {channel!r}; {what_exists()}"
    if not _number(folder / "flags") & IFF_UP:
        return f"{channel} is down: ip link set {channel} up"
    if fd and _number(folder / "mtu") < CANFD_MTU:
        return (
            f"{channel} carries classic CAN only, CAN FD was asked for: ip link set {channel} mtu {CANFD_MTU}"
        )
    return ""


def what_exists() -> str:
    """Return which buses there are, as a part of a sentence."""
    names = ", ".join(f"socketcan:{name}" for name in can_interfaces())
    return f"there is {names or 'no CAN interface on this machine'} (and virtual:NAME everywhere)"


def _number(path: Path) -> int:
    try:
        return int(path.read_text(), 0)
    except OSError:
        return 0
