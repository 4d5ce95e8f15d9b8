"""A file that grows by whole blocks: what a full disk leaves is everything up to the last whole block."""

import os
import zlib
from contextlib import suppress
from pathlib import Path

BLOCK_BYTES = 1 << 14
"""What the writers gather before it goes to the disk: little is lost by a kill, little time taken at once."""


class BlockFile:
    """A file open for writing without a buffer; every method raises OSError."""

    def __init__(self, path: Path) -> None:
        """Create or empty the file."""
        self._file = path.open("wb", buffering=0)
        self.size = 0

    def write(self, block: bytes) -> None:
        """Append all of `block`, or nothing: after an error the file ends where it ended before."""
        rest = memoryview(block)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            with suppress(OSError):  # a device cannot be cut
                self._file.truncate(self.size)
                self._file.seek(self.size)
            raise
        self.size += len(block)

    def patch(self, at: int, block: bytes) -> None:
        """Replace bytes that were written before."""
        os.pwrite(self._file.fileno(), block, at)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class GzipFile:
    """The same for text: every block is packed so far that it can be unpacked if nothing follows it."""

    def __init__(self, path: Path) -> None:
        """Create or empty the file."""
        self._file = BlockFile(path)
        self._packer = zlib.compressobj(6, wbits=31)

    def write(self, block: bytes) -> None:
        """Append `block`."""
        self._file.write(self._packer.compress(block) + self._packer.flush(zlib.Z_SYNC_FLUSH))

    def close(self) -> None:
        """Write the end mark and close the file, also when the disk is full."""
        try:
            self._file.write(self._packer.flush())
        finally:
            self._file.close()
