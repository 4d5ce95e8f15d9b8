"""How the frames of a message seem to be protected."""

from collections.abc import Sequence

from vsensor.codec import Layout, SignalLayout

_BY_WIDTH = {4: "nibble_sum", 8: "crc8_j1850", 16: "crc16_ccitt"}
_HEADERS = {"P01": ((0, 8), (8, 4)), "P05": ((0, 16), (16, 8))}
"""AUTOSAR profile -> first bit and length of CRC and alive counter, little-endian."""
_FOUND = "`vsensor log` finds it in a recording; see Protection in the README"


def protection_of(
    layout: Layout, checksums: Sequence[SignalLayout], counters: Sequence[SignalLayout]
) -> tuple[dict[str, object], str]:
    """Return the keys of `e2e`, and why they are uncertain: the database says it, else place and width."""
    said: dict[str, object] = {"counter": counters[0].name} if counters else {}
    if not checksums:
        return said, ""
    crc = checksums[0]
    if layout.e2e_profile:
        return {"crc": crc.name, **said}, ""
    for profile, places in _HEADERS.items():
        if tuple(_place(layout, signal) for signal in (crc, *counters[:1])) == places:
            said = {"crc": crc.name, **said, "profile": profile, "data_id": 0}
            return said, f"by the places of its header; which checksum, which data_id? {_FOUND}"
    name = _BY_WIDTH.get(crc.length)
    if name is None:
        return said, f"which checksum of {crc.length} bits is {crc.name}? give crc and profile"
    if name == "crc16_ccitt" and layout.is_fd and "0x1021" in crc.comment:
        name = "hyundai_canfd"
    return {"crc": crc.name, **said, "profile": name}, f"which checksum? {_FOUND}"


def _place(layout: Layout, signal: SignalLayout) -> tuple[int, int]:
    return layout.low_bit(signal), signal.length
