"""Plain checksums that cars use, by name: CRCs and sums, at any place in a message.

    name            over                                           seen in public descriptions of
    crc8_j1850      data [, data id low byte, high byte]           many: 0x1D, start and final XOR 0xFF
    crc8_2f         the same                                       0x2F, start and final XOR 0xFF
    crc16_ccitt     the same                                       0x1021, start 0xFFFF
    hyundai_canfd   data, id low byte, high byte                   Hyundai, Kia: 0x1021, final XOR 0x6E17
    xor8            data
    sum8            data
    sum8_length     length + data
    sum8_id_data    bytes of id + data                             Subaru, Tesla
    sum8_id         bytes of id + length + data                    Toyota
    nibble_sum      8 - nibbles of id and data (3 more, if the id  Honda
                    is extended), in 4 bits

The bits of the checksum itself count as 0 in sums; its own whole bytes are left out of CRCs. `start` and
`final_xor` replace those of a CRC; in sums, `start` is added and `final_xor` applied at the end.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsensor.e2e.crc import CRC8_2F, CRC8_J1850, CRC16_CCITT, Crc
from vsensor.e2e.field import Field
from vsensor.e2e.guard import Guard, Wanted, build
from vsensor.e2e.sums import ByteSum
from vsensor.errors import ConfigError

_LARGEST_STANDARD_ID = 0x7FF


@dataclass(frozen=True, slots=True, kw_only=True)
class CrcChecksum:
    """A CRC over the data and, if `with_id` or a data id is given, over the id's low and high byte."""

    crc: Crc
    with_id: bool = False

    @property
    def bits(self) -> int:
        """Bits that the checksum fills."""
        return self.crc.bits

    def __call__(self, data: bytes, arbitration_id: int = 0) -> int:
        """Return the checksum of any bytes, from which its own are left out already."""
        return self.crc(data + (_low_high(arbitration_id) if self.with_id else b""))

    def compiled(self, wanted: Wanted, left_out: frozenset[int], kept: NDArray[np.uint8]) -> ByteSum:
        """Return the checksum of messages without the bytes `left_out`, of which the bits `kept` count."""
        data_id = wanted.data_id
        if data_id is None and self.with_id:
            data_id = wanted.arbitration_id
        after = b"" if data_id is None else _low_high(_number(wanted, data_id))
        return crc_sum(self.crc, wanted, left_out, kept, around=((b"", after),))


@dataclass(frozen=True, slots=True, kw_only=True)
class SumChecksum:
    """Bytes or nibbles of the data and, if said, of the id and the length, added or XORed."""

    bits: int = 8
    xor: bool = False
    with_id: bool = False
    with_length: bool = False

    def __call__(self, data: bytes, arbitration_id: int = 0) -> int:
        """Return the checksum of any bytes, in which its own bits are 0."""
        value = self._rest(arbitration_id, len(data))
        for byte in data:
            value = value ^ byte if self.xor else value + self._share(byte)
        return value & (1 << self.bits) - 1

    def compiled(self, wanted: Wanted, left_out: frozenset[int], kept: NDArray[np.uint8]) -> ByteSum:
        """Return the checksum of messages without the bytes `left_out`, of which the bits `kept` count."""
        wanted.refuse("data_id")
        shares = np.array([self._share(byte) for byte in range(256)]).astype(np.uint64)
        rows = np.stack([shares[np.arange(256) & int(keep)] for keep in kept])
        rows[list(left_out)] = 0
        start = wanted.start or 0
        return ByteSum(
            bits=self.bits,
            xor=self.xor,
            shares=rows & np.uint64((1 << self.bits) - 1),
            rest=(self._rest(wanted.arbitration_id, wanted.length) + start & (1 << self.bits) - 1,),
            final_xor=wanted.final_xor or 0,
        )

    def _share(self, byte: int) -> int:
        return byte if self.bits == 8 else -((byte >> 4) + (byte & 0xF))

    def _rest(self, arbitration_id: int, length: int) -> int:
        value = 0 if self.bits == 8 else 8 + 3 * (arbitration_id > _LARGEST_STANDARD_ID)
        if self.with_id:
            value += sum(self._share(byte) for byte in arbitration_id.to_bytes(4, "little"))
        return value + (length if self.with_length else 0)


Checksum = CrcChecksum | SumChecksum

CHECKSUMS: Mapping[str, Checksum] = {
    "crc8_j1850": CrcChecksum(crc=CRC8_J1850),
    "crc8_2f": CrcChecksum(crc=CRC8_2F),
    "crc16_ccitt": CrcChecksum(crc=CRC16_CCITT),
    # Public descriptions have start value 0 and a constant for each length; this is all of them in one.
    "hyundai_canfd": CrcChecksum(
        crc=Crc(bits=16, polynomial=0x1021, start=0xFFFF, final_xor=0x6E17), with_id=True
    ),
    "xor8": SumChecksum(xor=True),
    "sum8": SumChecksum(),
    "sum8_length": SumChecksum(with_length=True),
    "sum8_id_data": SumChecksum(with_id=True),
    "sum8_id": SumChecksum(with_id=True, with_length=True),
    "nibble_sum": SumChecksum(bits=4, with_id=True),
}
"""Name -> checksum; each can be called on any bytes."""


def plain_guard(wanted: Wanted) -> Guard:
    """Return the guard of a plain checksum, or, under the name "counter", of a counter alone."""
    wanted.refuse("offset", "data_id_mode")
    states = _states(wanted)
    if wanted.name == "counter":
        wanted.refuse("checksum", "data_id", "start", "final_xor", "skip")
        if wanted.counter is None:
            raise ConfigError("e2e counter: the place of the counter was expected")
        return build(wanted, checksum=None, counter=wanted.counter, counter_states=states, total=None)
    checksum, place = CHECKSUMS[wanted.name], wanted.checksum
    if place is None:
        raise ConfigError(f"e2e {wanted.name}: the place of the checksum was expected")
    place.require_within(wanted.length, "checksum")
    _require_fitting(wanted, checksum, place)
    masks = place.masks()
    kept = np.array([0xFF & ~masks.get(byte, 0) for byte in range(wanted.length)], dtype=np.uint8)
    own = {byte for byte, mask in masks.items() if mask == 0xFF}
    total = checksum.compiled(wanted, frozenset(own | set(wanted.skip)), kept)
    return build(wanted, checksum=place, counter=wanted.counter, counter_states=states, total=total)


def crc_sum(
    crc: Crc,
    wanted: Wanted,
    left_out: frozenset[int],
    kept: NDArray[np.uint8],
    *,
    around: tuple[tuple[bytes, bytes], ...],
) -> ByteSum:
    """Return a CRC over bytes before, the bytes of a message that are not left out, and bytes after it.

    `around`: what comes before and after, one pair, or one for each counter (of them in turn), all of the
    same lengths. Bits that are not `kept` count as 0.
    """
    places = [byte for byte in range(wanted.length) if byte not in left_out]
    rows = np.zeros((wanted.length, 256), dtype=np.uint64)
    for byte, row in zip(places, crc.shares(len(places), len(around[0][1])), strict=True):
        rows[byte] = row[np.arange(256) & int(kept[byte])]
    zeros = bytes(len(places))
    rest = [crc(head + zeros + end, start=wanted.start, final_xor=wanted.final_xor) for head, end in around]
    return ByteSum(bits=crc.bits, xor=True, shares=rows, rest=tuple(rest))


def _states(wanted: Wanted) -> int:
    if wanted.counter is None:
        wanted.refuse("counter_states")
        return 1
    wanted.counter.require_within(wanted.length, "counter")
    if wanted.counter.length > 32:
        raise ConfigError(f"counter has {wanted.counter.length} bits, at most 32 were expected")
    most = 1 << wanted.counter.length
    states = most if wanted.counter_states is None else wanted.counter_states
    if not 2 <= states <= most:
        raise ConfigError(f"counter_states = {states}, 2 to {most} fit into {wanted.counter.length} bits")
    return states


def _require_fitting(wanted: Wanted, checksum: Checksum, place: Field) -> None:
    if place.length != checksum.bits:
        raise ConfigError(
            f"checksum has {place.length} bits at {place.low_bit}, e2e {wanted.name} has {checksum.bits}"
        )
    if wanted.counter is not None:
        counter = wanted.counter.masks()
        if any(mask & counter.get(byte, 0) for byte, mask in place.masks().items()):
            raise ConfigError("checksum and counter share bits")
    for name, value in (("start", wanted.start), ("final_xor", wanted.final_xor)):
        if value is not None and not 0 <= value < 1 << checksum.bits:
            raise ConfigError(f"{name} = {value}, 0 to {(1 << checksum.bits) - 1} were expected")
    if not all(0 <= byte < wanted.length for byte in wanted.skip):
        raise ConfigError(f"skip = {list(wanted.skip)}: bytes 0 to {wanted.length - 1} were expected")
    if not 0 <= wanted.arbitration_id < 1 << 29:
        raise ConfigError(f"arbitration id {wanted.arbitration_id}, 0 to {(1 << 29) - 1} were expected")


def _number(wanted: Wanted, data_id: int | tuple[int, ...]) -> int:
    if isinstance(data_id, tuple):
        raise ConfigError(f"e2e {wanted.name}: data_id is a list, one number was expected")
    if wanted.data_id is not None and not 0 <= data_id <= 0xFFFF:
        raise ConfigError(f"e2e {wanted.name}: data_id = {data_id}, 0 to 65535 were expected")
    return data_id


def _low_high(number: int) -> bytes:
    return bytes((number & 0xFF, number >> 8 & 0xFF))
