"""AUTOSAR's E2E profiles: headers at a fixed place, by the package autosar-e2e where it has them."""

from collections.abc import Callable, Mapping

import numpy as np
from e2e.p01 import e2e_p01_check, e2e_p01_protect

from vsensor.e2e.checksums import crc_sum
from vsensor.e2e.crc import CRC8_J1850
from vsensor.e2e.field import Field
from vsensor.e2e.guard import Guard, Wanted, build
from vsensor.errors import ConfigError


def _p01(wanted: Wanted) -> Guard:
    data_id, offset = wanted.data_id, wanted.offset
    if offset is None:
        offset = 0 if wanted.checksum is None else wanted.checksum.low_bit // 8
    checksum, counter = Field(8 * offset, 8), Field(8 * offset + 8, 4)
    for what, found, own in (("checksum", wanted.checksum, checksum), ("counter", wanted.counter, counter)):
        if found is not None and (found.low_bit, found.length) != (own.low_bit, own.length):
            raise ConfigError(
                f"{what} has {found.length} bits at {found.low_bit}, "
                f"e2e {wanted.name} puts {own.length} bits at {own.low_bit}"
            )
    if data_id is None:
        raise ConfigError(f"e2e {wanted.name} needs a data id")
    if not isinstance(data_id, int) or not 0 <= data_id <= 0xFFFF:
        raise ConfigError(f"e2e {wanted.name}: data_id = {data_id}, 0 to 65535 was expected")
    length, header = wanted.length, offset + 1

    def protect(data: bytearray, count: int) -> None:
        data[header] = data[header] & 0xF0 | count
        e2e_p01_protect(data, data_id, offset=offset, increment_counter=False)

    def check(data: bytes) -> bool:
        if len(data) != length or data[header] & 0x0F > 14:
            return False
        return bool(e2e_p01_check(bytearray(data), data_id, offset=offset))

    total = crc_sum(
        CRC8_J1850,
        Wanted(name="", length=length, start=0, final_xor=0),
        frozenset([offset]),
        np.full(length, 0xFF, dtype=np.uint8),
        before=data_id.to_bytes(2, "little"),
    )
    return build(
        wanted,
        checksum=checksum,
        counter=counter,
        counter_states=15,
        total=total,
        protect=protect,
        check=check,
    )


PROFILES: Mapping[str, Callable[[Wanted], Guard]] = {"P01": _p01}
