"""Reads a gzip file up to the place where it is cut off or damaged, and says so.

Python's GzipFile raises there and with the error goes what it had unpacked before.
"""

import io
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

PACKED_BYTES = 1 << 12  # what is lost at most before a damaged place


class GzipStream(io.RawIOBase):
    """The unpacked bytes of a gzip file of one or more members; `fault` is None if it was whole."""

    def __init__(self, path: Path) -> None:
        """Open the file; raises OSError."""
        super().__init__()
        self._file = path.open("rb")
        self._unpacker = zlib.decompressobj(wbits=31)
        self._packed = b""
        self._begun = False
        self.fault: str | None = None

    @property
    def place(self) -> int:
        """How many bytes of the packed file have been read."""
        return self._file.tell()

    def readable(self) -> bool:
        """Return True."""
        return True

    def readinto(self, buffer: "WriteableBuffer") -> int:
        """Fill `buffer` with what comes next, 0 at the end."""
        view = memoryview(buffer).cast("B")
        piece = self._next(len(view))
        view[: len(piece)] = piece
        return len(piece)

    def _next(self, size: int) -> bytes:
        while self.fault is None:
            if self._unpacker.eof:
                self._packed = self._unpacker.unused_data
                self._unpacker = zlib.decompressobj(wbits=31)
                self._begun = False
            self._packed = self._packed or self._file.read(PACKED_BYTES)
            if not self._packed:
                if self._begun:
                    self.fault = "the gzip file is cut off"
                break
            self._begun = True
            try:
                piece = self._unpacker.decompress(self._packed, size)
            except zlib.error as error:
                self.fault = f"the gzip file is damaged: {error}"
                break
            self._packed = self._unpacker.unconsumed_tail
            if piece:
                return piece
        return b""

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()
