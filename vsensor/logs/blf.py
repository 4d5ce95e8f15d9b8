"""Reads Vector's BLF: zlib containers of objects, walked once, classic frames gathered in bulk.

Own reader: python-can's gives float seconds (0.24 us steps at today's epoch) and loops for ever on an
object of size 0. Layout of what is read (little endian):

    file    "LOGG" u32 header size ... at byte 40 start time as SYSTEMTIME (8 x u16)
    object  "LOBJ" u16 header size, u16 header version, u32 object size, u32 type
            then u32 flags (1: 10 us ticks, else ns), 4 bytes, u64 time since start
    type 10 container: u16 method (0 none, 2 zlib), 14 bytes, then objects; one may span containers
"""

import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import BinaryIO

import numpy as np

from vsensor.logs.report import Notes
from vsensor.logs.table import (
    CLASSIC_BYTES,
    FD_LENGTHS,
    MAX_EXTENDED_ID,
    Columns,
    Flag,
    Grain,
    Record,
    columns_from,
    frames_at_a_time,
    joined,
    possible,
)

_FILE_HEADER_BYTES = 72
_BASE = struct.Struct("<4sHHLL")
_STAMP = struct.Struct("<L4xQ")
_CAN_FD = struct.Struct("<HBBL5xBB5x64s")  # channel, flags, dlc, id, FD flags, valid bytes, data
_CAN_FD_64 = struct.Struct("<BxBxL4xL18xBB4x")  # channel, valid bytes, id, flags, direction, ext offset
CHUNK = 65536  # frames gathered at once, as far as a container has so many
_CONTAINER, _CAN, _CAN_2, _ERROR, _ERROR_2, _FD, _FD_64 = 10, 1, 86, 2, 73, 100, 101
_EXTENDED_BIT = 0x8000_0000
FD_DLC = {length: dlc for dlc, length in enumerate(sorted(FD_LENGTHS))}
"""Data length -> DLC."""


class _Broken(Exception):
    """The file cannot be read on; the text says why."""


def read_blf(
    stream: BinaryIO, notes: Notes, chunk: Grain = CHUNK, place: tuple[int, ...] | None = None
) -> Iterator[Columns]:
    """Yield the frames of a BLF log container by container, at most `chunk` at a time.

    From the beginning, or from a `place` of the notes on: object, where it stands in the file, bytes of its
    content that are done with. A fault ends it and is kept in `notes`.
    """
    can_go_on = stream.seekable()
    try:
        start_ns = _start_ns(stream)
        first, begin, done = place or (0, stream.tell() if can_go_on else 0, 0)
        if place is not None:
            stream.seek(begin)
        rest = b""
        for number, at, content in _contents(stream, first, begin):
            before = len(rest)  # of an object that began in the container before
            rest = rest + content if rest else content
            position, before_that = done, -1
            while position != before_that:
                before_that = position
                columns, position = _frames(rest, position, start_ns, notes, frames_at_a_time(chunk))
                is_here = can_go_on and position >= before
                notes.place = (number, at, position - before) if is_here else None
                if len(columns.t_ns):
                    yield columns
            rest, done = rest[position:], 0
    except _Broken as error:
        notes.fault = str(error)
    else:
        if len(rest) >= _BASE.size:
            notes.fault = f"the last object is cut off ({len(rest)} bytes left over)"


def _start_ns(stream: BinaryIO) -> int:
    header = stream.read(_FILE_HEADER_BYTES)
    if header[:4] != b"LOGG":
        raise _Broken('not a BLF file: it does not begin with "LOGG"')
    if len(header) < _FILE_HEADER_BYTES:
        raise _Broken(f"the file header is cut off after {len(header)} bytes")
    size: int = struct.unpack_from("<L", header, 4)[0]
    stream.read(max(0, min(size, 4096) - _FILE_HEADER_BYTES))
    year, month, _, day, hour, minute, second, millisecond = struct.unpack_from("<8H", header, 40)
    try:
        start = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
    except ValueError:
        return 0  # all zero: the times count from the start
    return int(start.timestamp()) * 10**9 + int(millisecond) * 10**6


def _contents(stream: BinaryIO, place: int, at: int) -> Iterator[tuple[int, int, bytes]]:
    """Yield the unpacked contents of the containers, and objects that stand outside of any.

    With the number of the object and where it begins; `place` and `at` are those of the first one.
    """
    while head := stream.read(_BASE.size):
        if len(head) < _BASE.size:
            raise _Broken("the file ends inside an object header")
        signature, _, _, size, kind = _BASE.unpack(head)
        if signature != b"LOBJ" or size < _BASE.size:
            raise _Broken(f"object {place} is damaged: no object header where one was expected")
        body = stream.read(size - _BASE.size)
        stream.read(size % 4)
        cut = len(body) < size - _BASE.size
        yield place, at, _unpacked(body, place) if kind == _CONTAINER else head + body
        if cut:
            raise _Broken(f"the file is cut off in object {place}")
        place, at = place + 1, at + size + size % 4


def _unpacked(body: bytes, place: int) -> bytes:
    method = struct.unpack_from("<H", body)[0] if len(body) >= 16 else 0
    if method == 0:
        return body[16:]
    if method != 2:
        raise _Broken(f"container {place}: compression method {method} is not known")
    try:
        return zlib.decompressobj().decompress(body[16:])
    except zlib.error as error:
        raise _Broken(f"container {place} is damaged: {error}") from None


def _frames(block: bytes, position: int, start_ns: int, notes: Notes, limit: int) -> tuple[Columns, int]:
    """Return frames in `block` from `position` on, at most `limit`, and the position behind them.

    What is left when that is the same belongs to the next block.
    """
    classic: list[int] = []
    stamps: list[int] = []
    order: list[int] = []
    others: list[Record] = []
    at, end = position, len(block)
    while len(classic) + len(others) < limit:
        at = block.find(b"LOBJ", position, position + 8)
        if at < 0 or at + 32 > end:
            break
        _, header, _, size, kind = _BASE.unpack_from(block, at)
        if size < 32 or header < 32 or header > size:
            raise _Broken(f"an object of size {size} with a header of {header} bytes")
        if at + size > end:
            break
        position = at + size
        flags, ticks = _STAMP.unpack_from(block, at + 16)
        t_ns = start_ns + ticks * (10_000 if flags == 1 else 1)
        if not 0 <= t_ns < 1 << 63:
            raise _Broken(f"an object with the impossible time {ticks}")
        if kind in (_CAN, _CAN_2):
            if size - header >= 16:
                order.append(len(classic) + len(others))
                classic.append(at + header)
                stamps.append(t_ns)
        elif (record := _other(block[at + header : at + size], kind, header, t_ns, notes)) is not None:
            others.append(record)
    if at < 0 and position + 8 <= end:
        raise _Broken("no object where one was expected")
    columns = _classic(block, classic, stamps, notes)
    columns = _merged(columns, order, others) if others else columns
    good = possible(columns, notes)
    if not good.all():
        columns = columns.taken(good)
    return columns, position


def _merged(classic: Columns, order: list[int], others: list[Record]) -> Columns:
    """Return both kinds in file order; `order` holds the places of the classic frames."""
    both = joined([classic, columns_from(others)])
    taken = np.zeros(len(both.t_ns), dtype=bool)
    taken[order] = True
    places = np.concatenate([np.flatnonzero(taken), np.flatnonzero(~taken)])
    turn = np.empty_like(places)
    turn[places] = np.arange(len(places))
    return both.taken(turn)


def _classic(block: bytes, bodies: list[int], stamps: list[int], notes: Notes) -> Columns:
    """Gather channel u16, flags u8 (1 sent, 0x80 remote), dlc u8, id u32, 8 data bytes of every body."""
    raw = np.frombuffer(block, dtype=np.uint8)[np.array(bodies, dtype=np.int64)[:, None] + np.arange(16)]
    identifiers = np.ascontiguousarray(raw[:, 4:8]).view("<u4")[:, 0]
    flags = (identifiers >= _EXTENDED_BIT).astype(np.uint8)
    flags |= np.where(raw[:, 2] & 1, Flag.TRANSMITTED, 0).astype(np.uint8)
    flags |= np.where(raw[:, 2] & 0x80, Flag.REMOTE, 0).astype(np.uint8)
    length = np.minimum(raw[:, 3], CLASSIC_BYTES)  # DLC 9..15 mean 8 bytes
    data = raw[:, 8:16] * (np.arange(CLASSIC_BYTES) < length[:, None]) * ((flags & Flag.REMOTE) == 0)[:, None]
    numbers = np.ascontiguousarray(raw[:, :2]).view("<u2")[:, 0]
    channel = np.zeros(len(bodies), dtype=np.uint8)
    first_seen = np.unique(numbers, return_index=True)[1]
    for number in numbers[np.sort(first_seen)].tolist():
        channel[numbers == number] = notes.channel(str(number))
    masked = identifiers & np.uint32(MAX_EXTENDED_ID)
    return Columns(np.array(stamps, dtype=np.int64), masked, channel, flags, length, data.astype(np.uint8))


def _other(body: bytes, kind: int, header: int, t_ns: int, notes: Notes) -> Record | None:
    """Return an FD or error frame; None for anything else, and for frames that no bus can carry."""
    size = len(body)
    if kind == _FD and size >= 20:
        channel, bits, _, identifier, fd_bits, valid, data = _CAN_FD.unpack(body[:84].ljust(84, b"\0"))
        flags = _fd_flags(fd_bits & 1, fd_bits & 2, fd_bits & 4, bits & 0x80, bits & 1)
        return _fd_record(t_ns, identifier, channel, flags, data[:valid], valid, notes)
    if kind == _FD_64 and size >= _CAN_FD_64.size:
        channel, valid, identifier, bits, direction, offset = _CAN_FD_64.unpack_from(body)
        stop = min(_CAN_FD_64.size + valid, offset - header if offset > header else size)
        flags = _fd_flags(bits & 0x1000, bits & 0x2000, bits & 0x4000, bits & 0x10, direction)
        data = body[_CAN_FD_64.size : stop].ljust(valid, b"\0")
        return _fd_record(t_ns, identifier, channel, flags, data, valid, notes)
    if kind in (_ERROR, _ERROR_2) and size >= 4:
        return Record(t_ns, 0, notes.channel(str(struct.unpack_from("<H", body)[0])), int(Flag.ERROR), b"")
    return None


def _fd_flags(fd: int, brs: int, esi: int, remote: int, sent: int) -> int:
    names = (Flag.FD, Flag.BITRATE_SWITCH, Flag.ERROR_STATE, Flag.REMOTE, Flag.TRANSMITTED)
    return sum(int(name) for name, bit in zip(names, (fd, brs, esi, remote, sent), strict=True) if bit)


def _fd_record(
    t_ns: int, identifier: int, channel: int, flags: int, data: bytes, valid: int, notes: Notes
) -> Record | None:
    if valid not in (FD_LENGTHS if flags & Flag.FD else range(CLASSIC_BYTES + 1)):
        notes.impossible(1, f"id 0x{identifier & MAX_EXTENDED_ID:X} with {valid} data bytes")
        return None
    extended = bool(identifier & _EXTENDED_BIT)
    payload = bytes(valid) if flags & Flag.REMOTE else data
    number = notes.channel(str(channel))
    return Record(t_ns, identifier & MAX_EXTENDED_ID, number, flags | int(extended), payload)
