"""Unpacks the data of a DZ block of MDF 4: deflate, and since 4.3 Zstandard and LZ4 (extra `mf4`).

method    0 deflate, 2 Zstandard, 4 LZ4; one more: stored column by column before it was packed
"""

import io
import zlib
from collections.abc import Callable

import numpy as np

from vsensor.errors import MissingExtraError


class UnzipError(Exception):
    """The packed bytes are damaged, or packed in a way that is not known; the text says which."""


def unzip(packed: bytes, method: int, columns: int, size: int) -> bytes:
    """Return the `size` bytes that were packed, never more memory than that; raises UnzipError.

    Raises MissingExtraError where the library of the method is not installed.
    """
    if method // 2 >= len(METHODS):
        raise UnzipError(f"packing method {method} is not known")
    content = METHODS[method // 2](packed, size)
    if len(content) < size:
        raise UnzipError(f"{len(content)} of {size} bytes")
    if method % 2 and 1 < columns <= size:  # the last bytes, which fill no row, stand as they are
        rows = size // columns
        table = np.frombuffer(content[: rows * columns], dtype=np.uint8).reshape(columns, rows)
        content = table.T.tobytes() + content[rows * columns :]
    return content


def _deflate(packed: bytes, size: int) -> bytes:
    try:
        return zlib.decompressobj().decompress(packed, max(size, 1))
    except zlib.error as error:
        raise UnzipError(str(error)) from None


def _zstandard(packed: bytes, size: int) -> bytes:
    try:
        import zstandard
    except ImportError:
        raise MissingExtraError("zstandard", "mf4", "MDF packed with Zstandard") from None
    try:
        with zstandard.ZstdDecompressor().stream_reader(io.BytesIO(packed)) as reader:
            return reader.read(size)
    except zstandard.ZstdError as error:
        raise UnzipError(str(error)) from None


def _lz4(packed: bytes, size: int) -> bytes:
    try:
        from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
    except ImportError:
        raise MissingExtraError("lz4", "mf4", "MDF packed with LZ4") from None
    try:
        content: bytes = LZ4FrameDecompressor().decompress(packed, max_length=size)
    except (RuntimeError, EOFError) as error:
        raise UnzipError(str(error)) from None
    return content


METHODS: tuple[Callable[[bytes, int], bytes], ...] = (_deflate, _zstandard, _lz4)
