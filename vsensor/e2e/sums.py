"""A checksum compiled for one message: every byte's share is looked up, the shares are XORed or added."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsensor.types import CodeArray, IntArray

_BLOCK_ROWS = 8192  # a block's columns stay in the cache: twice as fast as whole columns of a long log
_TYPES = ((8, np.uint8), (16, np.uint16), (32, np.uint32), (64, np.uint64))


@dataclass(frozen=True, slots=True, kw_only=True)
class ByteSum:
    """`rest` + shares[0, byte 0] + shares[1, byte 1] ..., in `bits` bits, then XOR `final_xor`.

    + is XOR for CRCs (`xor`), addition modulo 2^bits for sums. `shares` (L, 256). `rest` is the share of
    all that is not data; one number, or one for each value of the counter.
    """

    bits: int
    xor: bool
    shares: NDArray[np.uint64]
    rest: tuple[int, ...]
    final_xor: int = 0

    def single(self) -> Callable[[bytes | bytearray, int], int]:
        """Return the function (data, counter) -> checksum of one message."""
        rows = tuple((k, tuple(row.tolist())) for k, row in enumerate(self.shares) if row.any())
        rest, states, mask, final_xor = self.rest, len(self.rest), (1 << self.bits) - 1, self.final_xor

        def xored(data: bytes | bytearray, counter: int) -> int:
            value = rest[counter % states]
            for k, row in rows:
                value ^= row[data[k]]
            return value & mask ^ final_xor

        def added(data: bytes | bytearray, counter: int) -> int:
            value = rest[counter % states]
            for k, row in rows:
                value += row[data[k]]
            return value & mask ^ final_xor

        return xored if self.xor else added

    def bulk(self) -> Callable[[CodeArray, IntArray], NDArray[np.uint64]]:
        """Return the function (data (N, L), counters (N,)) -> checksums (N,)."""
        kind = next(kind for bits, kind in _TYPES if bits >= self.bits)
        add = np.bitwise_xor if self.xor else np.add
        mask, final_xor = np.uint64((1 << self.bits) - 1), np.uint64(self.final_xor)
        shares = (self.shares & mask).astype(kind)
        rest = (np.array(self.rest, dtype=np.uint64) & mask).astype(kind)
        used = [k for k in range(len(shares)) if shares[k].any()]

        def block(data: CodeArray, counters: IntArray) -> NDArray[np.uint64]:
            value = rest[counters % len(rest)] if len(rest) > 1 else np.full(len(data), rest[0])
            for k in used:
                add(value, shares[k][data[:, k]], out=value)
            return value.astype(np.uint64) & mask ^ final_xor

        def whole(data: CodeArray, counters: IntArray) -> NDArray[np.uint64]:
            sums = np.empty(len(data), dtype=np.uint64)
            for row in range(0, len(data), _BLOCK_ROWS):
                rows = slice(row, row + _BLOCK_ROWS)
                sums[rows] = block(data[rows], counters[rows])
            return sums

        return whole
