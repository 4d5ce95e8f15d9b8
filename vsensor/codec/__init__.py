"""Bus descriptions compiled into our own layouts, and bytes from numbers; the only importer of cantools.

A message of L bytes is one integer of 8 L bits, read twice: little-endian signals are runs of bits of
the little-endian integer, big-endian (Motorola) signals of the big-endian one, so every signal is a
shift and a mask wherever it starts:

    little: start bit 12, length 9      shift = 12
    big:    start bit 2 (MSB), length 5 shift = 8 L - 8 * (2 // 8) - (7 - 2 % 8) - 5

Physical = raw * scale + offset. Encoding rounds (physical - offset) / scale half to even, as cantools
does, and saturates to what the bits hold (never wraps; a declared range narrower than the bits does not
clip: many are placeholders). SNA is the raw value that says "signal not available".
"""

from vsensor.codec.audit import audit, excess_range, is_placeholder, overlaps, shared_ids, wrong_raws
from vsensor.codec.bulk import BulkReader, decode_bulk
from vsensor.codec.frame import (
    decode,
    encode,
    float_bits,
    number_range,
    pack,
    quantise,
    to_physical,
    unpack,
)
from vsensor.codec.layout import Database, Layout, SignalLayout, load_database

__all__ = [
    "BulkReader",
    "Database",
    "Layout",
    "SignalLayout",
    "audit",
    "decode",
    "decode_bulk",
    "encode",
    "excess_range",
    "float_bits",
    "is_placeholder",
    "load_database",
    "number_range",
    "overlaps",
    "pack",
    "quantise",
    "shared_ids",
    "to_physical",
    "unpack",
    "wrong_raws",
]
