"""Finds alive counters: bits of a message that count by one from frame to frame.

The lowest bit of a counter changes with almost every frame; from there upwards, as many as still count. It
may run through fewer values than it holds (0 to 14 in AUTOSAR's profile 1), and some frames may be missing.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vsensor.e2e import Field
from vsensor.types import Array, CodeArray, IntArray

FEWEST_FRAMES = 16
_SHARE = 0.9  # of the steps must be by one: frames get lost
_CHANGES = 0.6  # of the steps change the lowest bit: all but one of an odd number of values, 0 1 2 0
_MOST_FRAMES = 1 << 13
_WIDEST_BITS = 32


@dataclass(frozen=True, slots=True)
class FoundCounter:
    """Where a counter lies and how many values it runs through; `states` None: it never began again."""

    field: Field
    states: int | None

    def text(self) -> str:
        """Return place and modulus for people."""
        return f"counter {place_text(self.field)}{'' if self.states is None else f' mod {self.states}'}"


def find_counters(data: CodeArray) -> tuple[FoundCounter, ...]:
    """Return the counters of a message, from all its frames `data` (N, L) in order of time."""
    data = data[:_MOST_FRAMES]
    if len(data) < FEWEST_FRAMES:
        return ()
    bits = np.unpackbits(data, axis=1, bitorder="little")
    changes = (bits[1:] != bits[:-1]).mean(axis=0)
    found: list[FoundCounter] = []
    taken: set[int] = set()
    for low_bit in np.flatnonzero(changes >= _CHANGES).tolist():
        counter = None if low_bit in taken else _counter_from(data, low_bit, changes)
        if counter is not None:
            found.append(counter)
            taken |= {8 * byte + low + k for byte, low, n, _ in counter.field.pieces() for k in range(n)}
    return tuple(found)


def _counter_from(data: CodeArray, low_bit: int, changes: Array) -> FoundCounter | None:
    """Return the widest of the fields from this bit upwards that count with the fewest wrong steps.

    Its highest bit must change. What counts only because it hardly changes has more wrong steps.
    """
    best: FoundCounter | None = None
    fewest = len(data)
    for field in _fields(low_bit, data.shape[1]):
        top_byte, top_low, top_bits, _ = field.pieces()[-1]
        if not changes[8 * top_byte + top_low + top_bits - 1]:
            continue
        values = _values(field, data)
        least, most = int(values.min()), int(values.max())
        begins = (values[:-1] == most) & (values[1:] == least)
        wrong = int(np.count_nonzero(~((np.diff(values) == 1) | begins)))
        if most - least >= 2 and wrong <= min(fewest, (1.0 - _SHARE) * len(values)):
            fewest = wrong
            best = FoundCounter(field, most - least + 1 if begins.any() else None)
    return best


def _fields(low_bit: int, length: int) -> Iterator[Field]:
    """Yield the fields of 2 to 32 bits that begin here, in both byte orders."""
    for width in range(2, _WIDEST_BITS + 1):
        for big in (False, True):
            field = Field(low_bit, width, big)
            inside = all(0 <= byte < length for byte, *_ in field.pieces())
            if inside and (not big or len(field.pieces()) > 1):
                yield field


def _values(field: Field, data: CodeArray) -> IntArray:
    values = np.zeros(len(data), dtype=np.int64)
    for byte, low, bits, place in field.pieces():
        values |= (data[:, byte].astype(np.int64) >> low & (1 << bits) - 1) << place
    return values


def place_text(field: Field) -> str:
    """Return where a field lies: byte and bits, or bytes, lowest first."""
    pieces = field.pieces()
    if len(pieces) == 1:
        byte, low, bits, _ = pieces[0]
        return f"byte {byte}" if bits == 8 else f"byte {byte} bits {low}-{low + bits - 1}"
    order = "big-endian" if field.big_endian else "little-endian"
    return f"{field.length} bits from byte {pieces[0][0]} bit {pieces[0][1]}, {order}"
