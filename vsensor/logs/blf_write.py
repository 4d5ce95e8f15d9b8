"""Writes Vector's BLF with integer nanoseconds; the layout is that of `blf`.

Own writer: python-can's takes float seconds, which lose 0.24 us at today's epoch. Containers are
small (16 KiB, fastest compression: 0.2 ms), so that the cycle is not disturbed; Vector's 128 KiB at
the default level take 5 ms at once.
"""

import struct
import zlib
from datetime import UTC, datetime
from pathlib import Path

from vsensor.logs.blf import FD_DLC
from vsensor.logs.table import ERROR, EXTENDED, FD, REMOTE, TRANSMITTED, Record

CONTAINER_BYTES = 1 << 14
_FILE_HEADER_BYTES = 144
_FILE = struct.Struct("<4sL8BQQLL8H8H")
_BASE = struct.Struct("<4sHHLL")
_STAMP = struct.Struct("<LHHQ")
_CAN = struct.Struct("<HBBL8s")
_CAN_FD = struct.Struct("<HBBLLBBB5x64s")
_ERROR_EXT = struct.Struct("<HHLBBBxLLH2x8s")
_OBJECT_HEADER_BYTES = _BASE.size + _STAMP.size
_MILLISECOND_NS = 1_000_000


class BlfOutput:
    """An open BLF file; `close` fills in the header's counts, without it the frames can still be read."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._objects: list[bytes] = []
        self._waiting = 0
        self._unpacked = _FILE_HEADER_BYTES
        self._count = 0
        self._start_ns = 0
        self._stop_ns = 0
        self._write_header(_FILE_HEADER_BYTES)

    def write(self, record: Record, channel: int) -> None:
        """Write one frame on a channel that counts from 1; no time before the first frame's millisecond."""
        if self._count == 0:
            self._start_ns = record.t_ns // _MILLISECOND_NS * _MILLISECOND_NS if _is_date(record.t_ns) else 0
            self._write_header(_FILE_HEADER_BYTES)
        self._stop_ns = record.t_ns
        kind, body = _body(record, channel)
        size = _OBJECT_HEADER_BYTES + len(body)
        stamp = _STAMP.pack(2, 0, 0, max(0, record.t_ns - self._start_ns))
        self._objects += (_BASE.pack(b"LOBJ", _OBJECT_HEADER_BYTES, 1, size, kind), stamp, body)
        self._waiting += size
        self._count += 1
        if self._waiting >= CONTAINER_BYTES:
            self._flush()

    def _flush(self) -> None:
        content = b"".join(self._objects)
        packed = zlib.compress(content, 1)
        size = _BASE.size + 16 + len(packed)
        self._file.write(_BASE.pack(b"LOBJ", _BASE.size, 1, size, 10))
        self._file.write(struct.pack("<H6xL4x", 2, len(content)) + packed + bytes(size % 4))
        self._unpacked += _BASE.size + 16 + len(content)
        self._objects.clear()
        self._waiting = 0

    def close(self) -> None:
        """Write what waits, then the header; the file is closed also when the disk is full."""
        with self._file:
            if self._objects:
                self._flush()
            self._write_header(self._file.tell())

    def _write_header(self, size: int) -> None:
        version = (5, 0, 0, 0, 2, 6, 8, 1)  # application 5, BLF library 2.6.8.1, as python-can writes it
        times = (*_system_time(self._start_ns), *_system_time(self._stop_ns))
        counts = (size, self._unpacked, self._count, 0)
        header = _FILE.pack(b"LOGG", _FILE_HEADER_BYTES, *version, *counts, *times)
        self._file.seek(0)
        self._file.write(header.ljust(_FILE_HEADER_BYTES, b"\0"))


def _body(record: Record, channel: int) -> tuple[int, bytes]:
    """Return object type and body."""
    flags, data = record.flags, record.data
    identifier = record.arbitration_id | (0x8000_0000 if flags & EXTENDED else 0)
    bits = (1 if flags & TRANSMITTED else 0) | (0x80 if flags & REMOTE else 0)
    if flags & ERROR:
        return 73, _ERROR_EXT.pack(channel, 0, 0, 0, 0, FD_DLC[len(data)], 0, identifier, 0, data[:8])
    if flags & FD:
        fd_bits = flags >> 1 & 7  # FD, bit rate switch, error state: here as there
        head = (channel, bits, FD_DLC[len(data)], identifier, 0, 0, fd_bits, len(data))
        return 100, _CAN_FD.pack(*head, data)
    return 1, _CAN.pack(channel, bits, len(data), identifier, b"" if flags & REMOTE else data)


def _system_time(t_ns: int) -> tuple[int, ...]:
    """Return year, month, weekday (0 Sunday), day, hour, minute, second, millisecond; zeros for no date."""
    if not _is_date(t_ns):
        return (0,) * 8
    moment = datetime.fromtimestamp(t_ns // 10**9, UTC)
    clock = (moment.hour, moment.minute, moment.second, t_ns // _MILLISECOND_NS % 1000)
    return (moment.year, moment.month, moment.isoweekday() % 7, moment.day, *clock)


def _is_date(t_ns: int) -> bool:
    """Return whether a time can be a date; before 1980 it is a time since the start of something."""
    return t_ns >= 315_532_800 * 10**9
