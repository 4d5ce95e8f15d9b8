r"""Text logs of `candump -L`, read in blocks by one pattern and turned into columns in bulk.

    (1533224087.000013) can0 2C1#0014DF14BBCA3A91        classic, 11-bit
    (1533224087.000013) can0 18EBFF00#01A0               29-bit: eight digits
    (1533224087.000013) can0 123##3112233 R              FD: flags digit (1 = BRS, 2 = ESI), received
    (1533224087.000013) can0 123#R4                      remote frame asking for 4 bytes
    (1533224087.000013) can0 20000080#0000000000000000   error frame
    (1533224087.000013) can0 123#11   # a comment        with ; # or //

Times become integer nanoseconds from the digits, never through a float.
"""

import re
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from vsensor.logs.report import Notes
from vsensor.logs.table import (
    CLASSIC_BYTES,
    FD_BYTES,
    FD_LENGTHS,
    MAX_EXTENDED_ID,
    MAX_STANDARD_ID,
    Columns,
    Flag,
    Grain,
    frames_at_a_time,
)
from vsensor.types import IntArray

CHUNK = 65536  # frames decoded at once
LINE_BYTES = 48  # of a classic frame; 64 bytes of CAN FD have three times as many
ERROR_BIT = 0x2000_0000  # CAN_ERR_FLAG of the Linux kernel

_LINE = re.compile(
    rb"^[ \t]*\((\d{1,9}|[1-8]\d{9})\.(\d{1,9})\)[ \t]+(\S+)[ \t]+"
    rb"([0-9A-Fa-f]+)#(#[0-9A-Fa-f]|[Rr]|)([0-9A-Fa-f]*)(?:_[0-9A-Fa-f])?(?:[ \t]+([RrTt]))?"
    rb"(?:[ \t]+(?:[;#]|//).*)?[ \t]*\r?$",
    re.MULTILINE,
)
"""Seconds, fraction, channel, id, mark (FD with its flags, remote), data digits, direction."""
_Row = tuple[bytes, bytes, bytes, bytes, bytes, bytes, bytes]


def read_candump(
    stream: BinaryIO, notes: Notes, chunk: Grain = CHUNK, place: tuple[int, ...] | None = None
) -> Iterator[Columns]:
    """Yield the frames of a candump log, some `chunk` at a time; garbage lines are counted in `notes`.

    From the beginning, or from a `place` of the notes on.
    """
    at, lines_before = place or (0, 0)
    if place is not None:
        stream.seek(at)
    can_go_on = stream.seekable()
    for block in _blocks(stream, chunk):
        rows: list[_Row] = _LINE.findall(block)
        lines = block.count(b"\n") + (not block.endswith(b"\n"))
        good = [row for row in rows if _is_valid(row[3], row[4], row[5])]
        if len(good) != lines:
            _note_garbage(block, lines_before, notes)
        lines_before += lines
        at += len(block)
        notes.place = (at, lines_before) if can_go_on else None
        if good:
            yield _columns(good, notes)


def _blocks(stream: BinaryIO, chunk: Grain) -> Iterator[bytes]:
    """Yield blocks that end at the end of a line."""
    rest = b""
    while block := stream.read(frames_at_a_time(chunk) * LINE_BYTES):
        cut = block.rfind(b"\n") + 1
        if cut:
            yield rest + block[:cut]
            rest = block[cut:]
        else:
            rest += block
    if rest:
        yield rest


def _is_valid(identifier: bytes, mark: bytes, digits: bytes) -> bool:
    if len(identifier) == 3:
        if identifier[0] > 55 and int(identifier, 16) > MAX_STANDARD_ID:  # 55 is "7"
            return False
    elif len(identifier) != 8 or (identifier[0] > 49 and not int(identifier, 16) & ERROR_BIT):
        return False  # neither form, or beyond 29 bits (49 is "1")
    if not mark:
        return len(digits) <= 2 * CLASSIC_BYTES and not len(digits) & 1
    if mark in b"Rr":
        return len(digits) <= 1 and digits <= b"8"
    return not len(digits) & 1 and len(digits) >> 1 in FD_LENGTHS


def _note_garbage(block: bytes, lines_before: int, notes: Notes) -> None:
    for number, line in enumerate(block.split(b"\n"), start=lines_before + 1):
        match = _LINE.match(line)
        if line.strip() and (match is None or not _is_valid(match[4], match[5], match[6])):
            notes.garbage(number, line.decode("utf-8", "replace"))


def _columns(rows: list[_Row], notes: Notes) -> Columns:
    seconds, fractions, channels, ids, marks, digits, directions = zip(*rows, strict=True)
    identifiers = np.array([int(text, 16) for text in ids], dtype=np.uint32)
    flags = np.array([len(text) == 8 for text in ids], dtype=np.uint8)  # Flag.EXTENDED = 1
    flags[(identifiers & ERROR_BIT != 0) & (flags != 0)] = Flag.ERROR
    number = {name: notes.channel(name.decode("utf-8", "replace")) for name in dict.fromkeys(channels)}
    if any(directions):
        flags |= np.array([64 * (text in b"Tt" and text != b"") for text in directions], dtype=np.uint8)
    if any(marks):
        flags |= np.array([_MARK_FLAGS[mark] for mark in marks], dtype=np.uint8)
        digits = tuple(_data_digits(*pair) for pair in zip(marks, digits, strict=True))
    lengths = np.array([len(text) >> 1 for text in digits], dtype=np.uint8)
    width = CLASSIC_BYTES if lengths.max() <= CLASSIC_BYTES else FD_BYTES
    padded = b"".join([text.ljust(2 * width, b"0") for text in digits]).decode("ascii")
    return Columns(
        _times_ns(seconds, fractions),
        identifiers & np.uint32(MAX_EXTENDED_ID),
        np.array([number[name] for name in channels], dtype=np.uint8),
        flags,
        lengths,
        np.frombuffer(bytes.fromhex(padded), dtype=np.uint8).reshape(-1, width),
    )


_MARK_FLAGS = {b"": 0, b"R": int(Flag.REMOTE), b"r": int(Flag.REMOTE)} | {
    b"#" + digit.encode(): int(
        Flag.FD | Flag.BITRATE_SWITCH * (int(digit, 16) & 1) | Flag.ERROR_STATE * (int(digit, 16) >> 1 & 1)
    )
    for digit in "0123456789ABCDEFabcdef"
}


def _data_digits(mark: bytes, digits: bytes) -> bytes:
    """Return the data; a remote frame's digit is the number of bytes that it asks for."""
    return b"00" * int(digits or b"0") if mark in (b"R", b"r") else digits


def _times_ns(seconds: tuple[bytes, ...], fractions: tuple[bytes, ...]) -> IntArray:
    whole = np.array([int(digits) for digits in seconds], dtype=np.int64)
    digits = len(fractions[0])
    if any(len(fraction) != digits for fraction in fractions):
        fractions, digits = tuple(fraction.ljust(9, b"0") for fraction in fractions), 9
    part = np.array([int(fraction) for fraction in fractions], dtype=np.int64)
    times: IntArray = whole * 1_000_000_000 + part * 10 ** (9 - digits)
    return times
