"""What kind of link an interface is, asked over rtnetlink."""

import socket
import struct


def link_kind(interface: str) -> str:
    """Return what the kernel calls an interface's kind ("vcan", "vxcan", "can", "slcan"), "" if unknown.

    RTM_GETLINK, attribute IFLA_LINKINFO / IFLA_INFO_KIND (linux/if_link.h).
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
    nested = attributes(answer[32:]).get(linkinfo, b"")
    return attributes(nested).get(info_kind, b"").rstrip(b"\0").decode()


def attributes(data: bytes) -> dict[int, bytes]:
    """Split a sequence of netlink attributes: length and type (2 bytes each), value, padding to 4."""
    found = {}
    while len(data) >= 4:
        length, kind = struct.unpack_from("=HH", data)
        if length < 4:
            break
        found[kind & 0x3FFF] = data[4:length]
        data = data[(length + 3) & ~3 :]
    return found
