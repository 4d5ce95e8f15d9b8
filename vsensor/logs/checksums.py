"""Finds checksums: the known protections are tried at every place of a message.

A CRC over data and a data id is the CRC over the data, with zeros in place of the id, XOR a constant. So for
every place the constant between what is sent and the CRC of the rest is taken from two different messages;
only where both agree, more are looked at, and then the data id is what gives the constant:

    as many bits as the CRC has (P02, P05, P06, P22)     one data id
    16 bits in a CRC of 8 (P01)                          256 of them: known ones are tried first
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from vsensor.e2e import CHECKSUMS, Field, Guard, guard
from vsensor.errors import ConfigError
from vsensor.logs.counters import place_text
from vsensor.types import CodeArray

_SAMPLES = 24
_MANY = 512  # to see every value of a counter
_FEWEST_SAMPLES = 6
_FEWEST_VALUES = 3  # of the checksum
_SHARE = 0.98  # of all frames must be right: some may be damaged on purpose
_SUMS = ("sum8_id", "sum8_id_data", "sum8_length", "sum8", "xor8", "nibble_sum")
_CRC8 = ("crc8_j1850", "crc8_2f")
_HEADERS = {"P04": (12, 4), "P07": (20, 16)}
"""Profiles that send their data id: bytes of the header, place of the id in it."""


@dataclass(frozen=True, slots=True)
class FoundChecksum:
    """A protection that fits; `wrong` frames of all do not. `data_ids` is how many ids fit as well as its."""

    guard: Guard
    wrong: int
    data_ids: int = 1

    def text(self) -> str:
        """Return name, data id and place for people."""
        field = self.guard.checksum_field
        label = (
            self.guard.label if self.data_ids == 1 else f"{self.guard.name} ({self.data_ids} data ids fit)"
        )
        place = "" if field is None else f" in {place_text(field)}"
        return f"{label}{place}{f', {self.wrong} wrong' if self.wrong else ''}"


KnownIds = Callable[[], Iterable[int]]
"""Data ids to try where many would fit; asked only then."""


def find_checksum(data: CodeArray, arbitration_id: int, ids: KnownIds = tuple) -> FoundChecksum | None:
    """Return the protection of a message, from all its frames `data` (N, L), None if none of ours fits."""
    many = _samples(data, _MANY)
    samples = many[:: max(1, len(many) // _SAMPLES)][:_SAMPLES]
    if len(samples) < _FEWEST_SAMPLES:
        return None
    best: FoundChecksum | None = None
    for found, others in _candidates(samples, many, arbitration_id, ids):
        wrong = int(np.count_nonzero(~found.check_bulk(data)))
        if wrong <= (1.0 - _SHARE) * len(data) and (best is None or wrong < best.wrong):
            best = FoundChecksum(found, wrong, others)
        if best is not None and not best.wrong:
            break
    return best


def _samples(data: CodeArray, count: int) -> list[bytes]:
    """Return some different messages."""
    rows = np.unique(data[:: max(1, len(data) // 4096)], axis=0)
    return [row.tobytes() for row in rows[:: max(1, len(rows) // count)]][:count]


def _candidates(
    samples: list[bytes], many: list[bytes], arbitration_id: int, ids: KnownIds
) -> Iterator[tuple[Guard, int]]:
    """Yield protections that may fit, and how many data ids fit."""
    yield from ((one, 1) for one in _with_header(samples))
    yield from ((one, 1) for one in _sums(samples, arbitration_id))
    yield from _crc8(samples, many, arbitration_id, ids)
    yield from ((one, 1) for one in _crc16(samples, arbitration_id))


def _made(name: str, **settings: object) -> Guard | None:
    """Return a guard, None where its fields do not fit."""
    try:
        return guard(name, **settings)  # type: ignore[arg-type]
    except ConfigError:
        return None


def _with_header(samples: list[bytes]) -> Iterator[Guard]:
    length = len(samples[0])
    for name, (header, at) in _HEADERS.items():
        for offset in sorted({0, 8, length - header}):
            if 0 <= offset <= length - header:
                data_id = int.from_bytes(samples[0][offset + at : offset + at + 4], "big")
                found = _made(name, length=length, data_id=data_id, offset=offset)
                if found is not None and sum(map(found.check, samples)) >= 0.9 * len(samples):
                    yield found


def _sums(samples: list[bytes], arbitration_id: int) -> Iterator[Guard]:
    length = len(samples[0])
    for name in _SUMS:
        for field in _last_first(length, CHECKSUMS[name].bits):
            if (
                _varies(samples, field)
                and _is_rich(samples, field)
                and _sum_fits(name, field, samples, arbitration_id)
            ):
                found = _made(name, length=length, arbitration_id=arbitration_id, checksum=field)
                yield from [found] if found is not None else []


def _last_first(length: int, bits: int) -> Iterator[Field]:
    """Yield places from the last byte on, where most stand: an XOR fits at all. The low nibble is first."""
    for byte in range(length - 1, -1, -1):
        for low in range(0, 8, bits):
            yield Field(8 * byte + low, bits)


def _is_rich(samples: list[bytes], field: Field) -> bool:
    """Return whether two bytes beside the checksum change: of one, any copy would be its sum."""
    columns = zip(*samples, strict=True)
    return sum(len(set(column)) > 1 for k, column in enumerate(columns) if k != field.low_bit // 8) >= 2


def _sum_fits(name: str, field: Field, samples: list[bytes], arbitration_id: int) -> bool:
    byte, low = divmod(field.low_bit, 8)
    mask = (1 << field.length) - 1
    wrong = 0
    for sample in samples:
        rest = bytearray(sample)
        rest[byte] &= ~(mask << low) & 0xFF
        wrong += CHECKSUMS[name](bytes(rest), arbitration_id) != sample[byte] >> low & mask
        if wrong > 0.1 * len(samples):
            return False
    return True


def _varies(samples: list[bytes], field: Field) -> bool:
    byte, low = divmod(field.low_bit, 8)
    mask = (1 << field.length) - 1
    return len({sample[byte] >> low & mask for sample in samples}) >= _FEWEST_VALUES


def _constant(name: str, places: tuple[int, ...], samples: list[bytes], behind: int = 0) -> int | None:
    """Return the constant between the bytes at `places` (highest first) and the CRC of the rest.

    The rest, with `behind` zeros behind it. None if there is none; of the samples a tenth may be damaged.
    """
    first, last = min(places), max(places) + 1
    zeros = bytes(behind)

    def residue(sample: bytes) -> int:
        sent = int.from_bytes(bytes(sample[place] for place in places), "big")
        return sent ^ CHECKSUMS[name](sample[:first] + sample[last:] + zeros)

    if residue(samples[0]) != residue(samples[1]) and residue(samples[1]) != residue(samples[2]):
        return None
    residues = [residue(sample) for sample in samples]
    most = max(set(residues), key=residues.count)
    return most if residues.count(most) >= 0.9 * len(samples) else None


def _crc8(
    samples: list[bytes], many: list[bytes], arbitration_id: int, ids: KnownIds
) -> Iterator[tuple[Guard, int]]:
    length = len(samples[0])
    for byte in range(length):
        field = Field(8 * byte, 8)
        if not _varies(samples, field):
            continue
        for name in _CRC8:
            constant = _constant(name, (byte,), samples)
            if constant is not None and name == "crc8_j1850" and _counts_to_14(samples, byte + 1):
                yield from _profile_1(byte, constant, length, (arbitration_id, *ids()))
            if constant is not None:
                plain = _made(name, length=length, checksum=field, final_xor=0xFF ^ constant)
                yield from [(plain, 1)] if plain is not None else []
            constant = _constant(name, (byte,), samples, behind=2)
            if constant is not None:
                yield from _id_behind_crc8(name, field, constant, length, (arbitration_id, *ids()))
        yield from ((one, 1) for one in _by_counter(byte, many, length))


def _profile_1(byte: int, constant: int, length: int, known: tuple[int, ...]) -> Iterator[tuple[Guard, int]]:
    """Yield profile 1 with known data ids in every mode, else with the first of all that fit."""
    for data_id in (one for one in known if 0 <= one <= 0xFFFF):
        for mode in ("both", "low", "nibble"):
            low_only = mode == "low" and data_id > 0xFF
            if not low_only and _p01_constant(data_id, mode, length) == constant:
                found = _p01(length, byte, data_id, mode)
                yield from [(found, 1)] if found is not None else []
    first = next(i for i in range(0x10000) if _p01_constant(i, "both", length) == constant)
    found = _p01(length, byte, first, "both")
    yield from [(found, 256)] if found is not None else []


def _id_behind_crc8(
    name: str, field: Field, constant: int, length: int, known: tuple[int, ...]
) -> Iterator[tuple[Guard, int]]:
    """Yield the CRC with a data id behind the data: a known one, else the first of all that fit."""
    crc, zeros = CHECKSUMS[name], bytes(length - 1)
    base = crc(zeros + bytes(2))
    for data_id in (*(one for one in known if 0 <= one <= 0xFFFF), *range(0x10000)):
        if crc(zeros + data_id.to_bytes(2, "little")) ^ base == constant:
            found = _made(name, length=length, checksum=field, data_id=data_id)
            yield from [(found, 1 if data_id in known else 256)] if found is not None else []
            return


def _p01(length: int, byte: int, data_id: int, mode: str) -> Guard | None:
    return _made("P01", length=length, data_id=data_id, offset=byte, data_id_mode=mode)


def _p01_constant(data_id: int, mode: str, length: int) -> int:
    """Return the constant that profile 1's data id makes beside the plain CRC of as many bytes."""
    low, high = data_id & 0xFF, data_id >> 8
    head = {"both": (low, high), "low": (low,), "nibble": (low, 0)}[mode]
    zeros = bytes(length - 1)
    crc = CHECKSUMS["crc8_j1850"]
    # Start and final XOR of the plain CRC are undone: they are 0 in profile 1.
    with_id = crc(bytes(head) + zeros) ^ crc(bytes(len(head)) + zeros)
    return with_id ^ crc(zeros)


def _counts_to_14(samples: list[bytes], byte: int) -> bool:
    values = {sample[byte] & 0xF for sample in samples} if byte < len(samples[0]) else set()
    return len(values) >= _FEWEST_VALUES and 15 not in values


def _by_counter(byte: int, many: list[bytes], length: int) -> Iterator[Guard]:
    """Yield profiles whose data id changes with the counter: lists (P02, P22), alternating bytes (P01)."""
    if byte + 1 >= length:
        return
    data_id = _alternating_id(byte, many[:_SAMPLES], length)
    lists = _list_of_ids("crc8_2f", byte, many, 16)
    found = [
        _p01(length, byte, data_id, "alternating") if data_id is not None else None,
        _made("P02" if byte == 0 else "P22", length=length, data_id=lists, offset=byte) if lists else None,
    ]
    yield from (one for one in found if one is not None)


def _alternating_id(byte: int, samples: list[bytes], length: int) -> int | None:
    """Return the data id whose low byte is in the CRC at even counters, its high byte at odd ones."""
    found = []
    for parity in (0, 1):
        own = [sample for sample in samples if sample[byte + 1] & 1 == parity]
        constant = _constant("crc8_j1850", (byte,), own) if len(own) > 2 else None
        if constant is None:
            return None
        found.append(next(i for i in range(256) if _p01_constant(i, "low", length) == constant))
    low, high = found
    return high << 8 | low if low != high else None


def _list_of_ids(name: str, byte: int, many: list[bytes], states: int) -> tuple[int, ...] | None:
    """Return the byte behind the data that each counter value has; None where two messages disagree."""
    crc, ids, agreed = CHECKSUMS[name], dict[int, int](), 0
    for sample in many:
        counter = sample[byte + 1] & 0xF
        rest = sample[:byte] + sample[byte + 1 :]
        if counter not in ids:
            ids[counter] = next(i for i in range(256) if crc(rest + bytes((i,))) == sample[byte])
        elif crc(rest + bytes((ids[counter],))) != sample[byte]:
            return None
        else:
            agreed += 1
    if agreed < _FEWEST_SAMPLES or len(set(ids.values())) < 2:
        return None
    return tuple(ids.get(counter, 0) for counter in range(states))


def _crc16(samples: list[bytes], arbitration_id: int) -> Iterator[Guard]:
    length = len(samples[0])
    for byte in range(length - 1):
        if not _varies(samples, Field(8 * byte, 8)):
            continue
        for big in (False, True):
            places = (byte, byte + 1) if big else (byte + 1, byte)
            field = Field(8 * places[1], 16, big)
            constant = _constant("crc16_ccitt", places, samples, behind=2)
            if constant is not None:
                data_id = _id_behind(constant, length - 2, big)
                name = "P06" if big else "P05"
                found = [
                    _made("hyundai_canfd", length=length, arbitration_id=arbitration_id, checksum=field),
                    _made(name, length=length, data_id=data_id, offset=byte),
                ]
                yield from (one for one in found if one is not None)
            constant = _constant("crc16_ccitt", places, samples)
            if constant is not None:
                plain = _made("crc16_ccitt", length=length, checksum=field, final_xor=constant)
                yield from [plain] if plain is not None else []


def _id_behind(constant: int, count: int, big: bool) -> int:
    """Return the two bytes behind `count` bytes of data that give this constant: there is one pair."""
    crc, zeros = CHECKSUMS["crc16_ccitt"], bytes(count)
    base = crc(zeros + bytes(2))
    firsts = {crc(zeros + bytes((i, 0))) ^ base: i for i in range(256)}
    for second in range(256):
        first = firsts.get(constant ^ crc(zeros + bytes((0, second))) ^ base)
        if first is not None:
            return first << 8 | second if big else second << 8 | first
    raise AssertionError("a CRC of 16 bits is a permutation of two bytes behind the data")
