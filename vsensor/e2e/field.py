"""Where a checksum or counter lies in a message, and how it is read and written there.

    Field(low_bit=12, length=12, big_endian=False)      Field(low_bit=12, length=12, big_endian=True)

    byte     0        1        2                        byte     0        1
         |........|3..0....|11...4|                          |11....4|3..0....|

The lowest bit is bit 4 of byte 1 in both; from bit 7 of a byte, a little-endian field goes on in the next
byte, a big-endian one in the byte before.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsensor.errors import ConfigError
from vsensor.types import CodeArray

WIDEST_BITS = 64


@dataclass(frozen=True, slots=True)
class Field:
    """Bits of a message; `low_bit` is the place of the lowest one, counted from bit 0 of byte 0 upwards."""

    low_bit: int
    length: int
    big_endian: bool = False

    def pieces(self) -> tuple[tuple[int, int, int, int], ...]:
        """Return (byte, lowest bit in the byte, bits, place in the value) from the value's lowest bits."""
        byte, bit = divmod(self.low_bit, 8)
        found, done = [], 0
        while done < self.length:
            bits = min(8 - bit, self.length - done)
            found.append((byte, bit, bits, done))
            byte, bit, done = byte + (-1 if self.big_endian else 1), 0, done + bits
        return tuple(found)

    def masks(self) -> dict[int, int]:
        """Return the bits of each byte that belong to the field."""
        return {byte: ((1 << bits) - 1) << low for byte, low, bits, _ in self.pieces()}

    def require_within(self, length: int, what: str) -> None:
        """Raise ConfigError if the field does not lie in a message of `length` bytes."""
        if not 1 <= self.length <= WIDEST_BITS:
            raise ConfigError(f"{what} has {self.length} bits, 1 to {WIDEST_BITS} were expected")
        if self.low_bit < 0 or not all(0 <= byte < length for byte in self.masks()):
            raise ConfigError(f"{what}: {self.length} bits at {self.low_bit} do not fit into {length} bytes")


def reader(field: Field) -> Callable[[bytes], int]:
    """Return the function that reads the field of one message."""
    pieces = [(byte, low, (1 << bits) - 1, place) for byte, low, bits, place in field.pieces()]
    if len(pieces) == 1:
        byte, low, mask, _ = pieces[0]
        return lambda data: data[byte] >> low & mask

    def read(data: bytes) -> int:
        value = 0
        for byte, low, mask, place in pieces:
            value |= (data[byte] >> low & mask) << place
        return value

    return read


def writer(field: Field) -> Callable[[bytearray, int], None]:
    """Return the function that writes the field of one message; the value must fit."""
    pieces = [
        (byte, low, 0xFF & ~(((1 << bits) - 1) << low), (1 << bits) - 1, place)
        for byte, low, bits, place in field.pieces()
    ]

    if len(pieces) == 1:
        byte, low, others, *_ = pieces[0]

        def write_one(data: bytearray, value: int) -> None:
            data[byte] = data[byte] & others | value << low

        return write_one

    def write(data: bytearray, value: int) -> None:
        for byte, low, others, mask, place in pieces:
            data[byte] = data[byte] & others | (value >> place & mask) << low

    return write


def read_bulk(field: Field, data: CodeArray) -> NDArray[np.uint64]:
    """Return the field of each message of `data` (N, L), (N,)."""
    value = np.zeros(len(data), dtype=np.uint64)
    for byte, low, bits, place in field.pieces():
        part = data[:, byte] >> np.uint8(low) & np.uint8((1 << bits) - 1)
        value |= part.astype(np.uint64) << np.uint64(place)
    return value
