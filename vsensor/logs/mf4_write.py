"""Writes CAN bus logging in MDF 4.1 (.mf4), block by block: after every block the file is whole.

Own writer: asammdf writes at the end, in one go, from memory, and what it had is lost where the disk is
full. Here times are integer nanoseconds with a factor of 1e-9, and the data of a group grow like this:

    DG ─ HL ─ DL ─► DL ─► DL        each DL names one DZ (packed records) and the next DL;
               └DZ    └DZ    └DZ    links and the number of records are set when the block is on the disk
"""

import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.logs.blf import FD_DLC
from vsensor.logs.mf4 import BITS
from vsensor.logs.mf4_blocks import HEADER, ZIPPED
from vsensor.logs.mf4_parts import block, channel, file_mark, text_bytes
from vsensor.logs.output import BLOCK_BYTES, BlockFile
from vsensor.logs.table import (
    BITRATE_SWITCH,
    CLASSIC_BYTES,
    ERROR,
    ERROR_STATE,
    EXTENDED,
    FD,
    FD_BYTES,
    REMOTE,
    TRANSMITTED,
    Columns,
    Record,
)

_SECOND_NS = 10**9
_BULK_ROWS = 1 << 15
_FIELDS = (
    ("BusChannel", "u1"),
    ("ID", "<u4"),
    ("IDE", "u1"),
    ("DLC", "u1"),
    ("DataLength", "u1"),
    *((name, "u1") for name in BITS),
)
_ROW = struct.Struct("<qBL7B")
_UNSIGNED, _SIGNED, _BYTES = 0, 2, 10  # data types of channels, little-endian
_BUS_EVENT = 1 << 10  # flag of a channel
_TOOL = (
    "<FHcomment><TX>CAN log</TX><tool_id>vsensor</tool_id><tool_vendor>vsensor</tool_vendor>"
    "<tool_version>1</tool_version></FHcomment>"
)


@dataclass(slots=True)
class _Group:
    """A channel group of the file: records that wait, and where its counts and links stand."""

    width: int
    count_at: int
    list_at: int  # the link to the first or next DL
    waiting: bytearray = field(default_factory=bytearray)
    records: int = 0
    written: int = 0  # bytes of records on the disk

    @property
    def row_bytes(self) -> int:
        return _ROW.size + self.width


class Mf4Output:
    """An open MF4 file; every method raises OSError."""

    def __init__(self, path: Path) -> None:
        self._file = BlockFile(path)
        self._groups: dict[tuple[str, int], _Group] = {}
        self._start_ns: int | None = None
        self._next_dg_at = 0
        self._begin()

    def write(self, record: Record, channel: int) -> None:
        """Write one frame on a channel that counts from 1."""
        flags, length = record.flags, len(record.data)
        if self._start_ns is None:
            self._start(record.t_ns)
        group = self._group(flags, length)
        bits = (flags & FD, flags & BITRATE_SWITCH, flags & ERROR_STATE, flags & TRANSMITTED)
        group.waiting += _ROW.pack(
            record.t_ns - (self._start_ns or 0),
            channel,
            record.arbitration_id,
            flags & EXTENDED,
            FD_DLC[length],
            length,
            *map(bool, bits),
        ) + record.data.ljust(group.width, b"\0")
        if len(group.waiting) >= BLOCK_BYTES:
            self._flush(group)

    def write_columns(self, columns: Columns, channels: NDArray[np.uint8]) -> None:
        """Write many frames; `channels` (N,) count from 1."""
        if not len(columns.t_ns):
            return
        if self._start_ns is None:
            self._start(int(columns.t_ns[0]))
        wide = columns.length > CLASSIC_BYTES
        kind = columns.flags & (ERROR | REMOTE) | wide
        for value in np.unique(kind).tolist():
            rows = np.flatnonzero(kind == value)
            group = self._group(value, FD_BYTES if value & 1 else 0)
            for first in range(0, len(rows), _BULK_ROWS):
                some = rows[first : first + _BULK_ROWS]
                group.waiting += self._rows(columns.taken(some), channels[some], group.width)
                self._flush(group)

    def _rows(self, columns: Columns, channels: NDArray[np.uint8], width: int) -> bytes:
        layout = [("t", "<i8"), *_FIELDS, ("data", "u1", (width,))]
        rows: NDArray[Any] = np.zeros(len(columns.t_ns), dtype=layout)
        rows["t"] = columns.t_ns - (self._start_ns or 0)
        rows["BusChannel"] = channels
        rows["ID"] = columns.arbitration_id
        rows["IDE"] = columns.flags & EXTENDED
        rows["DLC"] = np.searchsorted(np.array(sorted(FD_DLC)), columns.length)
        rows["DataLength"] = columns.length
        for name, bit in BITS.items():
            rows[name] = columns.flags & bit != 0
        there = min(width, columns.data.shape[1])
        rows["data"][:, :there] = columns.data[:, :there]
        return rows.tobytes()

    def _flush(self, group: _Group) -> None:
        content = bytes(group.waiting)
        packed = zlib.compress(content, 1)
        body = ZIPPED.pack(b"DT", 0, 0, len(content), len(packed)) + packed
        zipped_at = self._file.size
        zipped = block("DZ", (), body)
        listed = block("DL", (0, zipped_at), struct.pack("<B3xLQ", 0, 1, group.written))
        self._file.write(zipped + listed)
        group.waiting.clear()
        self._file.patch(group.list_at, struct.pack("<Q", zipped_at + len(zipped)))
        group.list_at = zipped_at + len(zipped) + HEADER.size
        group.written += len(content)
        group.records += len(content) // group.row_bytes
        self._file.patch(group.count_at, struct.pack("<Q", group.records))

    def close(self) -> None:
        """Write what waits and close the file, also when the disk is full."""
        try:
            for group in self._groups.values():
                if group.waiting:
                    self._flush(group)
        finally:
            self._file.close()

    def _begin(self) -> None:
        """Write identification, header and history; the times count from 1970 until there is a frame."""
        mark = file_mark()
        header = block("HD", (0,) * 6, struct.pack("<QhhBBBxdd", 0, 0, 0, 0, 0, 0, 0.0, 0.0))
        comment_at = len(mark) + len(header)
        comment = block("MD", (), text_bytes(_TOOL))
        history = block("FH", (0, comment_at), struct.pack("<QhhB3x", 0, 0, 0, 0))
        self._file.write(mark + header + comment + history)
        self._file.patch(64 + HEADER.size + 8, struct.pack("<Q", comment_at + len(comment)))
        self._next_dg_at = 64 + HEADER.size

    def _start(self, t_ns: int) -> None:
        """Set the file's start, a full second: asammdf keeps microseconds of it."""
        self._start_ns = max(0, t_ns // _SECOND_NS * _SECOND_NS)
        self._file.patch(64 + HEADER.size + 8 * 6, struct.pack("<Q", self._start_ns))

    def _group(self, flags: int, length: int) -> _Group:
        prefix = "Error" if flags & ERROR else "Remote" if flags & REMOTE else "Data"
        width = CLASSIC_BYTES if length <= CLASSIC_BYTES else FD_BYTES
        group = self._groups.get((prefix, width))
        if group is None:
            group = self._groups[prefix, width] = self._new_group(f"CAN_{prefix}Frame", width)
        return group

    def _new_group(self, prefix: str, width: int) -> _Group:
        """Write the description of a group and link it to the one before."""
        parts, start = bytearray(), self._file.size

        def put(block: bytes) -> int:
            parts.extend(block)
            return start + len(parts) - len(block)

        can = put(block("TX", (), text_bytes("CAN")))
        source = put(block("SI", (can, can, 0), struct.pack("<BBB5x", 2, 2, 0)))  # bus, CAN
        below, at = 0, _ROW.size + width
        places = [("DataBytes", _BYTES, width)]
        places += [(name, _UNSIGNED, np.dtype(kind).itemsize) for name, kind in reversed(_FIELDS)]
        for name, data_type, size in places:
            at -= size
            text = put(block("TX", (), text_bytes(f"{prefix}.{name}")))
            below = put(channel((below, 0, text), 0, data_type, at, 8 * size, _BUS_EVENT))
        text = put(block("TX", (), text_bytes(prefix)))
        frame = put(channel((0, below, text, source), 0, _BYTES, 8, 8 * (at - 8 + width), _BUS_EVENT))
        factor = put(block("CC", (0,) * 4, struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0.0, 0.0, 0.0, 1e-9)))
        text = put(block("TX", (), text_bytes("Timestamp")))
        unit = put(block("TX", (), text_bytes("s")))
        time = put(channel((frame, 0, text, 0, factor, 0, unit), 2, _SIGNED, 0, 64, 0, sync=1))
        label = put(block("TX", (), text_bytes(prefix)))
        counts = struct.pack("<QQHH4xLL", 0, 0, 2 | 4, ord("."), _ROW.size + width, 0)  # plain bus event
        group = put(block("CG", (0, time, label, source, 0, 0), counts))
        lists = put(block("HL", (0,), struct.pack("<HB5x", 0, 0)))
        entry = put(block("DG", (0, group, lists, 0), bytes(8)))
        self._file.write(bytes(parts))
        self._file.patch(self._next_dg_at, struct.pack("<Q", entry))
        self._next_dg_at = entry + HEADER.size
        return _Group(width, group + HEADER.size + 8 * 6 + 8, lists + HEADER.size)
