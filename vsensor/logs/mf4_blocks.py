"""Blocks of MDF 4 (ASAM MDF 4.1): what stands where, read with every length checked.

block   "##XX" 4 bytes, u64 length, u64 number of links, links u64 (place in the file, 0 = none), data
data    DT, SD: the bytes; DZ: packed; DL: a list of them, chained; HL: what is before a list of DZ
"""

import struct
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from vsensor.logs.mf4_unzip import UnzipError, unzip

HEADER = struct.Struct("<4s4xQQ")
ZIPPED = struct.Struct("<2sBxLQQ")
_LARGEST_META = 1 << 20
_LARGEST_ZIPPED = 1 << 30


class BrokenError(Exception):
    """The file cannot be read on; the text says why."""


@dataclass(frozen=True, slots=True)
class Block:
    """A block without its header."""

    kind: str
    links: tuple[int, ...]
    data: bytes


@dataclass(frozen=True, slots=True)
class _Segment:
    start: int  # in the unpacked bytes
    size: int
    place: int  # of the block in the file
    kind: str


class Blocks:
    """A file of blocks."""

    def __init__(self, stream: BinaryIO) -> None:
        self.stream = stream
        self.size = stream.seek(0, 2)

    def at(self, place: int, *kinds: str) -> Block:
        """Return the block at `place`, which must be of one of `kinds`."""
        kind, length, links = self.header(place)
        if kind not in kinds:
            raise BrokenError(f"a block {kind!r} at {place} where {' or '.join(kinds)} was expected")
        if length > _LARGEST_META or place + length > self.size:
            raise BrokenError(f"the block {kind} at {place} of {length} bytes is not whole")
        self.stream.seek(place + HEADER.size)
        body = self.stream.read(length - HEADER.size)
        return Block(kind, struct.unpack_from(f"<{links}Q", body), body[8 * links :])

    def header(self, place: int) -> tuple[str, int, int]:
        """Return kind, length and number of links of the block at `place`."""
        self.stream.seek(min(place, self.size))
        head = self.stream.read(HEADER.size)
        if len(head) < HEADER.size:
            raise BrokenError(f"the file ends before the block at {place}")
        mark, length, links = HEADER.unpack(head)
        if mark[:2] != b"##" or length < HEADER.size + 8 * links:
            raise BrokenError(f"no block where one was expected, at {place}")
        return mark[2:].decode("ascii", "replace"), length, links

    def text(self, place: int) -> str:
        """Return the text of a TX or MD block, "" for none."""
        block = self.at(place, "TX", "MD") if place else None
        return "" if block is None else block.data.split(b"\0")[0].decode("utf-8", "replace")


class Data:
    """The bytes that data blocks hold, one after the other; unpacked where they are read."""

    def __init__(self, blocks: Blocks, place: int, *, open_end: bool = False) -> None:
        """Walk the list of blocks; `open_end`: the last one goes on to the end of the file.

        `fault` says what is missing of them.
        """
        self.fault: str | None = None
        self.size = 0
        self._blocks = blocks
        self._segments: list[_Segment] = []
        self._starts = np.zeros(0, dtype=np.int64)
        self._unpacked = (-1, b"")
        try:
            self._walk(place, open_end)
        except BrokenError as error:
            self.fault = str(error)
        self._starts = np.array([segment.start for segment in self._segments], dtype=np.int64)

    def _walk(self, place: int, open_end: bool) -> None:
        seen: set[int] = set()
        waiting = [place] if place else []
        while waiting:
            at = waiting.pop()
            if at in seen:
                raise BrokenError("the list of data blocks runs in a circle")
            seen.add(at)
            kind, length, _ = self._blocks.header(at)
            if kind == "HL":
                waiting += [link for link in self._blocks.at(at, "HL").links[:1] if link]
            elif kind == "DL":
                links = self._blocks.at(at, "DL").links
                waiting += [link for link in (*links[:1], *reversed(links[1:])) if link]
            else:
                self._add(at, kind, length, open_end and not waiting)

    def _add(self, at: int, kind: str, length: int, open_end: bool) -> None:
        if kind == "DZ":
            self._blocks.stream.seek(at + HEADER.size)
            head = self._blocks.stream.read(ZIPPED.size)
            size = ZIPPED.unpack(head)[3] if len(head) == ZIPPED.size else 0
        elif kind in ("DT", "SD", "DV"):
            size = self._blocks.size - at - HEADER.size if open_end else length - HEADER.size
        else:
            raise BrokenError(f"data in blocks {kind!r}, which are not known here")
        if size > _LARGEST_ZIPPED and kind == "DZ":
            raise BrokenError(f"a packed block of {size} bytes")
        left = self._blocks.size - at - HEADER.size
        if kind != "DZ" and size > left:
            self._segments.append(_Segment(self.size, left, at, kind))
            self.size += left
            raise BrokenError("the file is cut off in its data")
        self._segments.append(_Segment(self.size, size, at, kind))
        self.size += size

    def read(self, start: int, size: int) -> bytes:
        """Return bytes `start` to `start + size`; fewer where a block is damaged: `fault` tells."""
        parts: list[bytes] = []
        index = int(np.searchsorted(self._starts, start, side="right")) - 1
        while size > 0 and 0 <= index < len(self._segments):
            segment = self._segments[index]
            part = self._part(segment, start - segment.start, size)
            parts.append(part)
            start, size, index = start + len(part), size - len(part), index + 1
            if start < segment.start + segment.size and size > 0:
                break  # damaged: what follows would stand at the wrong place
        return b"".join(parts)

    def _part(self, segment: _Segment, start: int, size: int) -> bytes:
        if segment.kind == "DZ":
            return self._unzipped(segment)[start : start + size]
        self._blocks.stream.seek(segment.place + HEADER.size + start)
        return self._blocks.stream.read(min(size, segment.size - start))

    def _unzipped(self, segment: _Segment) -> bytes:
        if self._unpacked[0] != segment.place:
            try:
                self._unpacked = (segment.place, self._unzip(segment))
            except UnzipError as error:
                self.fault = f"the packed data at {segment.place} are damaged: {error}"
                self._unpacked = (segment.place, b"")
        return self._unpacked[1]

    def _unzip(self, segment: _Segment) -> bytes:
        self._blocks.stream.seek(segment.place + HEADER.size)
        _, method, columns, size, packed_size = ZIPPED.unpack(self._blocks.stream.read(ZIPPED.size))
        packed = self._blocks.stream.read(min(packed_size, self._blocks.size))
        return unzip(packed, method, columns, size)
