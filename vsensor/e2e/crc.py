"""Cyclic redundancy checks by their parameters, and what each byte of a message adds to one.

A CRC is linear over GF(2): that of a message is that of zeros, XOR what each byte adds, which depends only on
the byte and on how many bytes come after it. So many messages are checked by one look-up and one XOR per
column, whatever the width. Parameters and check values: the CRC RevEng catalogue; AUTOSAR SWS CRC library.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Shares = NDArray[np.uint64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Crc:
    """One algorithm: `start` is the register before the first byte; `reflected`: bits go in lowest first."""

    bits: int
    polynomial: int
    start: int
    final_xor: int
    reflected: bool = False

    def __call__(self, data: bytes, *, start: int | None = None, final_xor: int | None = None) -> int:
        """Return the CRC of `data`; another start value or final XOR may be given."""
        table, crc = (
            _table(self.bits, self.polynomial, self.reflected),
            self.start if start is None else start,
        )
        if self.reflected:
            crc = _mirrored(crc, self.bits)
            for byte in data:
                crc = crc >> 8 ^ table[(crc ^ byte) & 0xFF]
        else:
            mask, high = (1 << self.bits) - 1, self.bits - 8
            for byte in data:
                crc = crc << 8 & mask ^ table[crc >> high ^ byte]
        return crc ^ (self.final_xor if final_xor is None else final_xor)

    def shares(self, count: int, after: int) -> Shares:
        """Return what each value of each of `count` bytes adds, (count, 256); `after` bytes follow them."""
        table = np.array(_table(self.bits, self.polynomial, self.reflected), dtype=np.uint64)
        rows = np.empty((count, 256), dtype=np.uint64)
        row = table
        for place in range(count + after - 1, -1, -1):
            if place < count:
                rows[place] = row
            row = self._followed_by_zero(row, table)
        return rows

    def _followed_by_zero(self, crc: Shares, table: Shares) -> Shares:
        if self.reflected:
            return crc >> np.uint64(8) ^ table[(crc & np.uint64(0xFF)).astype(np.intp)]
        mask, high = np.uint64((1 << self.bits) - 1), np.uint64(self.bits - 8)
        return crc << np.uint64(8) & mask ^ table[(crc >> high).astype(np.intp)]


def _mirrored(value: int, bits: int) -> int:
    return int(f"{value:0{bits}b}"[::-1], 2)


@cache
def _table(bits: int, polynomial: int, reflected: bool) -> Sequence[int]:
    """Return the CRC of each single byte, start value 0."""
    return tuple(_of_byte(byte, bits, polynomial, reflected) for byte in range(256))


def _of_byte(byte: int, bits: int, polynomial: int, reflected: bool) -> int:
    if reflected:
        return _mirrored(_of_byte(_mirrored(byte, 8), bits, polynomial, False), bits)
    crc = byte << bits - 8
    for _ in range(8):
        crc = crc << 1 ^ (polynomial if crc >> bits - 1 else 0)
        crc &= (1 << bits) - 1
    return crc


CRC8_J1850 = Crc(bits=8, polynomial=0x1D, start=0xFF, final_xor=0xFF)
CRC8_2F = Crc(bits=8, polynomial=0x2F, start=0xFF, final_xor=0xFF)
CRC16_CCITT = Crc(bits=16, polynomial=0x1021, start=0xFFFF, final_xor=0)
CRC16_ARC = Crc(bits=16, polynomial=0x8005, start=0, final_xor=0, reflected=True)
CRC32_P4 = Crc(bits=32, polynomial=0xF4ACFB13, start=0xFFFFFFFF, final_xor=0xFFFFFFFF, reflected=True)
CRC64_XZ = Crc(bits=64, polynomial=0x42F0E1EBA9EA3693, start=2**64 - 1, final_xor=2**64 - 1, reflected=True)
