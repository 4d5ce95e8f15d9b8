"""Guards of AUTOSAR's E2E profiles.

What is sent is made by the package autosar-e2e (all but P22); what is received is checked by our own tables.
"""

from functools import partial
from typing import Any

import numpy as np
from e2e import p01, p11

from vsensor.e2e.checksums import crc_sum
from vsensor.e2e.field import Field, writer
from vsensor.e2e.guard import Guard, Protect, Wanted, build
from vsensor.e2e.layouts import DATA_ID_MODES, LAYOUTS, Profile
from vsensor.errors import ConfigError

_LIST_LENGTH = 16
_LONGEST_MESSAGE = 4096  # bytes; CAN FD has 64
_P01_MODES = {
    "both": p01.E2E_P01_DATAID_BOTH,
    "alternating": p01.E2E_P01_DATAID_ALT,
    "low": p01.E2E_P01_DATAID_LOW,
    "nibble": p01.E2E_P01_DATAID_NIBBLE,
}
_P11_MODES = {"both": p11.E2E_P11_DATAID_BOTH, "nibble": p11.E2E_P11_DATAID_NIBBLE}


def profile_guard(wanted: Wanted) -> Guard:
    """Return the guard of an AUTOSAR profile."""
    wanted.refuse("start", "final_xor", "skip", "counter_states")
    profile, mode = LAYOUTS[wanted.name], _mode(wanted)
    offset = _offset(wanted, profile)
    checksum, counter = profile.field(offset, profile.checksum), profile.field(offset, profile.counter)
    _require_place(wanted, "checksum", wanted.checksum, checksum)
    _require_place(wanted, "counter", wanted.counter, counter)
    ids = _data_ids(wanted, profile, mode)
    around = _around(wanted.name, profile, mode, ids)
    own = frozenset(checksum.masks())
    kept = np.full(wanted.length, 0xFF, dtype=np.uint8)
    return build(
        wanted,
        checksum=checksum,
        counter=counter,
        counter_states=profile.states,
        total=crc_sum(profile.crc, wanted, own, kept, around=around),
        constants=_constants(wanted, profile, mode, offset, ids[0]),
        protect=_library(wanted, profile, mode, offset, counter),
    )


def _mode(wanted: Wanted) -> str:
    modes = DATA_ID_MODES.get(wanted.name)
    if modes is None:
        wanted.refuse("data_id_mode")
        return ""
    mode = wanted.data_id_mode or "both"
    if mode not in modes:
        raise ConfigError(f"e2e {wanted.name}: data_id_mode {mode!r}, {', '.join(modes)} were expected")
    return mode


def _offset(wanted: Wanted, profile: Profile) -> int:
    """Return the header's first byte: as said, or so that the checksum lies where it is said to be."""
    offset = wanted.offset
    if offset is None:
        own = wanted.checksum.masks() if wanted.checksum is not None else {}
        offset = max(0, min(own, default=0) - profile.checksum[0]) if own else 0
    if not 1 <= wanted.length <= _LONGEST_MESSAGE or not 0 <= offset <= wanted.length - profile.bytes:
        raise ConfigError(
            f"e2e {wanted.name}: {profile.bytes} bytes of header from byte {offset} on "
            f"do not fit into {wanted.length} bytes"
        )
    if wanted.name == "P02" and offset:
        raise ConfigError(f"e2e P02: the header lies at byte 0, not {offset}; P22 has an offset")
    return offset


def _require_place(wanted: Wanted, what: str, found: Field | None, own: Field) -> None:
    if found is None or found.pieces() == own.pieces():
        return
    order = "" if own.length <= 8 else ", big-endian" if own.big_endian else ", little-endian"
    raise ConfigError(
        f"{what} has {found.length} bits at {found.low_bit}, "
        f"e2e {wanted.name} puts {own.length} bits at {own.low_bit}{order}"
    )


def _data_ids(wanted: Wanted, profile: Profile, mode: str) -> tuple[int, ...]:
    """Return the data id, or the list of 16 of them."""
    given = wanted.data_id
    if given is None:
        raise ConfigError(f"e2e {wanted.name} needs a data id")
    if profile.id_bits == 0:
        if not isinstance(given, tuple) or len(given) != _LIST_LENGTH:
            raise ConfigError(f"e2e {wanted.name}: data_id: a list of {_LIST_LENGTH} was expected")
        ids, most = given, 0xFF
    else:
        if isinstance(given, tuple):
            raise ConfigError(f"e2e {wanted.name}: data_id is a list, one number was expected")
        ids, most = (given,), 0xFFF if mode == "nibble" else (1 << profile.id_bits) - 1
    for number in ids:
        if isinstance(number, bool) or not 0 <= number <= most:
            raise ConfigError(f"e2e {wanted.name}: data_id = {number}, 0 to {most} were expected")
    return ids


def _around(name: str, profile: Profile, mode: str, ids: tuple[int, ...]) -> tuple[tuple[bytes, bytes], ...]:
    """Return what the CRC takes in before and after the data, for each value of the counter if it matters."""
    if len(ids) > 1:
        return tuple((b"", bytes([number])) for number in ids)
    if name not in DATA_ID_MODES:
        order = profile.id_order
        after = b"" if not order else ids[0].to_bytes(2, "little" if order == "little" else "big")
        return ((b"", after),)
    low, high = bytes([ids[0] & 0xFF]), bytes([ids[0] >> 8])
    before = {"both": [low + high], "alternating": [low, high], "low": [low], "nibble": [low + b"\0"]}
    return tuple((head, b"") for head in before[mode])


def _constants(
    wanted: Wanted, profile: Profile, mode: str, offset: int, data_id: int
) -> tuple[tuple[Field, int], ...]:
    constants = []
    if mode == "nibble":
        constants.append((Field(8 * (offset + 1) + 4, 4), data_id >> 8))
    if profile.length is not None:
        constants.append((profile.field(offset, profile.length), wanted.length))
    if profile.data_id is not None:
        constants.append((profile.field(offset, profile.data_id), data_id))
    return tuple(constants)


def _library(wanted: Wanted, profile: Profile, mode: str, offset: int, counter: Field) -> Protect | None:
    """Return autosar-e2e's way to protect; None if it has none. It counts up only if asked to: we count."""
    if profile.protect is None:
        return None
    settings: dict[str, Any] = {"increment_counter": False}
    data_id: Any = wanted.data_id
    if wanted.name in DATA_ID_MODES and mode != "both":
        settings["data_id_mode"] = (_P01_MODES if wanted.name == "P01" else _P11_MODES)[mode]
    if offset:
        settings["offset"] = offset
    if profile.id_bits == 0:
        data_id = bytes(data_id)
    library, write = partial(profile.protect, **settings), writer(counter)
    byte = counter.low_bit // 8

    def protect(data: bytearray, count: int) -> None:
        write(data, count)
        library(data, data_id)

    def protect_nibble(data: bytearray, count: int) -> None:
        data[byte] = data[byte] & 0xF0 | count  # a call of `write` costs a tenth of the whole
        library(data, data_id)

    return protect_nibble if counter == Field(8 * byte, 4) else protect
