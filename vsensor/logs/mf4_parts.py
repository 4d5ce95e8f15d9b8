"""Blocks of MDF 4.1 as bytes, for the writers."""

import struct

from vsensor.logs.mf4_blocks import HEADER

MARK_BYTES = 64


def file_mark() -> bytes:
    """Return the identification with which a file begins."""
    return struct.pack("<8s8s8s4xH30xHH", b"MDF     ", b"4.11    ", b"vsensor ", 411, 0, 0)


def block(kind: str, links: tuple[int, ...], data: bytes) -> bytes:
    """Return a block of whole 8 bytes; links are places in the file, 0 = none."""
    length = HEADER.size + 8 * len(links) + len(data)
    head = HEADER.pack(b"##" + kind.encode(), length, len(links)) + struct.pack(f"<{len(links)}Q", *links)
    return head + data + bytes(-length % 8)


def text_bytes(text: str) -> bytes:
    """Return what a TX or MD block holds."""
    return text.encode() + b"\0"


def channel(
    links: tuple[int, ...], kind: int, data_type: int, byte: int, bits: int, flags: int, *, sync: int = 0
) -> bytes:
    """Return a CN block; links: next, below, name, source, conversion, data, unit, comment."""
    head = struct.pack("<4B4LBBH6d", kind, sync, data_type, 0, byte, bits, flags, 0, 0, 0, 0, *[0.0] * 6)
    return block("CN", (*links, *[0] * (8 - len(links))), head)
