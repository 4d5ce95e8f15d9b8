"""AUTOSAR's E2E profiles (PRS E2E protocol, R20-11): headers at a fixed place from byte `offset` on.

    P01, P11  | CRC-8 | id nibble, counter |              0x1D over the data id's bytes, then the data
    P02, P22  | CRC-8 | x, counter |                      0x2F over the data, then data_id[counter]
    P05       | CRC-16 low, high | counter |              0x1021 over the data, then the id, low byte first
    P06       | CRC-16 high, low | length 2 | counter |   the same, high byte first
    P04       | length 2 | counter 2 | id 4 | CRC-32 |    big-endian, 0xF4ACFB13
    P07       | CRC-64 | length 4 | counter 4 | id 4 |    big-endian, 0x42F0E1EBA9EA3693

Every CRC is over the whole message without its own bytes. P01 and P11 take the data id in one of these
modes: "both" bytes; "alternating" the low byte at even counters, the high byte at odd ones; "low"; "nibble":
the low byte and 0, and the lowest 4 bits of the high byte are sent beside the counter (P01 variant C).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from e2e import p01, p02, p04, p05, p06, p07, p11

from vsensor.e2e.crc import CRC8_2F, CRC8_J1850, CRC16_CCITT, CRC32_P4, CRC64_XZ, Crc
from vsensor.e2e.field import Field

DATA_ID_MODES: Mapping[str, tuple[str, ...]] = {
    "P01": ("both", "alternating", "low", "nibble"),
    "P11": ("both", "nibble"),
}
"""Modes of the profiles that have them; "both" if none is given."""

Place = tuple[int, int]
"""First byte, counted from the header's, and bits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """A header's layout and its CRC; `id_bits` of the data id, 0 = a list of 16 bytes.

    `states` of the counter; `id_order`: the data id's bytes are put after the data in this order, "" if it
    is sent in the header or, in P01 and P11, put before the data.
    """

    crc: Crc
    bytes: int
    checksum: Place
    counter: Place
    states: int
    id_bits: int
    big_endian: bool = False
    length: Place | None = None
    data_id: Place | None = None
    id_order: str = ""
    protect: Callable[..., None] | None = None

    def field(self, offset: int, place: Place) -> Field:
        """Return where a part of the header lies in a message."""
        byte, bits = place
        if bits <= 8 or not self.big_endian:
            return Field(8 * (offset + byte), bits)
        return Field(8 * (offset + byte + bits // 8 - 1), bits, True)


# Start value and final XOR of profiles 1 and 11 cancel to 0: the first is undone by the CRC's own.
_CRC8_FROM_0 = Crc(bits=8, polynomial=CRC8_J1850.polynomial, start=0, final_xor=0)
_P01 = Profile(
    crc=_CRC8_FROM_0,
    bytes=2,
    checksum=(0, 8),
    counter=(1, 4),
    states=15,
    id_bits=16,
    protect=p01.e2e_p01_protect,
)

LAYOUTS: Mapping[str, Profile] = {
    "P01": _P01,
    "P02": Profile(
        crc=CRC8_2F,
        bytes=2,
        checksum=(0, 8),
        counter=(1, 4),
        states=16,
        id_bits=0,
        protect=p02.e2e_p02_protect,
    ),
    "P04": Profile(
        crc=CRC32_P4,
        bytes=12,
        checksum=(8, 32),
        counter=(2, 16),
        states=1 << 16,
        id_bits=32,
        big_endian=True,
        length=(0, 16),
        data_id=(4, 32),
        protect=p04.e2e_p04_protect,
    ),
    "P05": Profile(
        crc=CRC16_CCITT,
        bytes=3,
        checksum=(0, 16),
        counter=(2, 8),
        states=1 << 8,
        id_bits=16,
        id_order="little",
        protect=p05.e2e_p05_protect,
    ),
    "P06": Profile(
        crc=CRC16_CCITT,
        bytes=5,
        checksum=(0, 16),
        counter=(4, 8),
        states=1 << 8,
        id_bits=16,
        big_endian=True,
        length=(2, 16),
        id_order="big",
        protect=p06.e2e_p06_protect,
    ),
    "P07": Profile(
        crc=CRC64_XZ,
        bytes=20,
        checksum=(0, 64),
        counter=(12, 32),
        states=1 << 32,
        id_bits=32,
        big_endian=True,
        length=(8, 32),
        data_id=(16, 32),
        protect=p07.e2e_p07_protect,
    ),
    "P11": Profile(
        crc=_CRC8_FROM_0,
        bytes=2,
        checksum=(0, 8),
        counter=(1, 4),
        states=15,
        id_bits=16,
        protect=p11.e2e_p11_protect,
    ),
    "P22": Profile(crc=CRC8_2F, bytes=2, checksum=(0, 8), counter=(1, 4), states=16, id_bits=0),
}
"""Name in DBC attribute and vsensor's profile -> layout."""
