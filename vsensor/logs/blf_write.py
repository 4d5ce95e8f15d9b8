"""Writes Vector's BLF with integer nanoseconds; the layout is that of `blf`.

Own writer: python-can's takes float seconds, which lose 0.24 us at today's epoch. Containers are
small (16 KiB, fastest compression: 0.2 ms), so that the cycle is not disturbed; Vector's 128 KiB at
the default level take 5 ms at once.
"""

import struct
import zlib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.logs.blf import FD_DLC
from vsensor.logs.output import BLOCK_BYTES, BlockFile
from vsensor.logs.table import ERROR, EXTENDED, FD, REMOTE, TRANSMITTED, Columns, Record, records_of

CONTAINER_BYTES = BLOCK_BYTES
_BULK_BYTES = 1 << 17  # Vector's own size, where nothing waits for the next cycle
_CLASSIC_ROW = np.dtype(
    [
        ("signature", "S4"),
        ("header", "<u2"),
        ("version", "<u2"),
        ("size", "<u4"),
        ("kind", "<u4"),
        ("unit", "<u4"),
        ("client", "<u4"),
        ("ticks", "<u8"),
        ("channel", "<u2"),
        ("bits", "u1"),
        ("dlc", "u1"),
        ("id", "<u4"),
        ("data", "u1", (8,)),
    ]
)
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
        self._file = BlockFile(path)
        self._objects: list[bytes] = []
        self._waiting = 0
        self._unpacked = _FILE_HEADER_BYTES
        self._count = 0
        self._start_ns = 0
        self._stop_ns = 0
        self._file.write(self._header(_FILE_HEADER_BYTES))

    def write(self, record: Record, channel: int) -> None:
        """Write one frame on a channel that counts from 1; no time before the first frame's millisecond."""
        if self._count == 0:
            self._start(record.t_ns)
        self._stop_ns = record.t_ns
        kind, body = _body(record, channel)
        size = _OBJECT_HEADER_BYTES + len(body)
        stamp = _STAMP.pack(2, 0, 0, max(0, record.t_ns - self._start_ns))
        self._objects += (_BASE.pack(b"LOBJ", _OBJECT_HEADER_BYTES, 1, size, kind), stamp, body)
        self._waiting += size
        self._count += 1
        if self._waiting >= CONTAINER_BYTES:
            self._flush()

    def write_columns(self, columns: Columns, channels: NDArray[np.uint8]) -> None:
        """Write many frames; `channels` (N,) count from 1."""
        if not len(columns.t_ns):
            return
        if (columns.flags & (ERROR | FD)).any():
            for record, channel in zip(records_of(columns), channels.tolist(), strict=True):
                self.write(record, channel)
            return
        if self._count == 0:
            self._start(int(columns.t_ns[0]))
        self._flush()
        content = self._classic(columns, channels)
        step = _BULK_BYTES // _CLASSIC_ROW.itemsize * _CLASSIC_ROW.itemsize
        for first in range(0, len(content), step):
            self._write_container(content[first : first + step])
        self._stop_ns = int(columns.t_ns[-1])
        self._count += len(columns.t_ns)

    def _classic(self, columns: Columns, channels: NDArray[np.uint8]) -> bytes:
        rows: NDArray[Any] = np.zeros(len(columns.t_ns), dtype=_CLASSIC_ROW)
        flags = columns.flags
        rows["signature"], rows["header"], rows["version"] = b"LOBJ", _OBJECT_HEADER_BYTES, 1
        rows["size"], rows["kind"], rows["unit"] = _CLASSIC_ROW.itemsize, 1, 2
        rows["ticks"] = np.maximum(0, columns.t_ns - self._start_ns)
        rows["channel"] = channels
        rows["bits"] = np.where(flags & TRANSMITTED, 1, 0) | np.where(flags & REMOTE, 0x80, 0)
        rows["dlc"] = columns.length
        rows["id"] = columns.arbitration_id | np.where(flags & EXTENDED, np.uint32(0x8000_0000), np.uint32(0))
        rows["data"] = columns.data[:, :8]
        return rows.tobytes()

    def _start(self, t_ns: int) -> None:
        self._start_ns = t_ns // _MILLISECOND_NS * _MILLISECOND_NS if _is_date(t_ns) else 0
        self._stop_ns = t_ns
        self._file.patch(0, self._header(_FILE_HEADER_BYTES))

    def _flush(self) -> None:
        if self._objects:
            content = b"".join(self._objects)
            self._objects.clear()
            self._waiting = 0
            self._write_container(content)

    def _write_container(self, content: bytes) -> None:
        packed = zlib.compress(content, 1)
        size = _BASE.size + 16 + len(packed)
        head = _BASE.pack(b"LOBJ", _BASE.size, 1, size, 10)
        self._file.write(head + struct.pack("<H6xL4x", 2, len(content)) + packed + bytes(size % 4))
        self._unpacked += _BASE.size + 16 + len(content)

    def close(self) -> None:
        """Write what waits, then the header; the file is closed also when the disk is full."""
        try:
            self._flush()
        finally:
            try:
                self._file.patch(0, self._header(self._file.size))
            finally:
                self._file.close()

    def _header(self, size: int) -> bytes:
        version = (5, 0, 0, 0, 2, 6, 8, 1)  # application 5, BLF library 2.6.8.1, as python-can writes it
        times = (*_system_time(self._start_ns), *_system_time(self._stop_ns))
        counts = (size, self._unpacked, self._count, 0)
        header = _FILE.pack(b"LOGG", _FILE_HEADER_BYTES, *version, *counts, *times)
        return header.ljust(_FILE_HEADER_BYTES, b"\0")


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
