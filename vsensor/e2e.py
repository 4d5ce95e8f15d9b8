"""End-to-end protection of frames: checksum and alive counter, by the name of the profile.

    byte        0        1             2 .. 7
    P01     | CRC-8 | x | counter |   payload      counter in the low nibble, 0 to 14, then 0

P01 is AUTOSAR E2E profile 1 in its variant A: CRC-8 SAE J1850 (0x1D) over both bytes of the data id,
then over the frame without its CRC byte; start value and final XOR cancel to 0 (AUTOSAR PRS E2E
protocol, profile 1).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from e2e.p01 import E2E_P01_DATAID_BOTH, e2e_p01_check, e2e_p01_protect
from numpy.typing import NDArray

from vsensor.types import BoolArray, CodeArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Protection:
    """One way to protect frames.

    `counter_states`: the alive counter runs from 0 to counter_states - 1. `crc_bits` and `counter_bits`
    are the sizes that the signals must have; `crc_start` and `counter_start` the bits they must start at,
    counted from the header. `protect(data, data_id, offset)` writes the CRC in place, the counter is
    there already. `check` and `check_bulk` (data (N, L)) only look.
    """

    counter_states: int
    crc_start: int
    crc_bits: int
    counter_start: int
    counter_bits: int
    protect: Callable[[bytearray, int, int], None]
    check: Callable[[bytes, int, int], bool]
    check_bulk: Callable[[CodeArray, int, int], BoolArray]


def next_counter(protection: Protection, counter: int) -> int:
    """Return the counter of the frame after one with `counter`."""
    return (counter + 1) % protection.counter_states


def _protect_p01(data: bytearray, data_id: int, offset: int) -> None:
    e2e_p01_protect(data, data_id, data_id_mode=E2E_P01_DATAID_BOTH, offset=offset, increment_counter=False)


def _check_p01(data: bytes, data_id: int, offset: int) -> bool:
    if data[offset + 1] & 0x0F > 14:
        return False
    return bool(e2e_p01_check(bytearray(data), data_id, data_id_mode=E2E_P01_DATAID_BOTH, offset=offset))


def _check_p01_bulk(data: CodeArray, data_id: int, offset: int) -> BoolArray:
    head = _J1850[_J1850[data_id & 0xFF] ^ (data_id >> 8)]
    crc = np.full(len(data), head, dtype=np.uint8)
    for column in range(data.shape[1]):
        if column != offset:
            crc = _J1850[crc ^ data[:, column]]
    intact: BoolArray = (crc == data[:, offset]) & (data[:, offset + 1] & 0x0F <= 14)
    return intact


def _table(polynomial: int) -> NDArray[np.uint8]:
    """Return the 256-entry table of an 8-bit CRC, most significant bit first."""
    crc = np.arange(256, dtype=np.int64)
    for _ in range(8):
        crc = np.where(crc & 0x80, (crc << 1) ^ polynomial, crc << 1) & 0xFF
    return crc.astype(np.uint8)


_J1850 = _table(0x1D)

PROTECTIONS: dict[str, Protection] = {
    "P01": Protection(
        counter_states=15,
        crc_start=0,
        crc_bits=8,
        counter_start=8,
        counter_bits=4,
        protect=_protect_p01,
        check=_check_p01,
        check_bulk=_check_p01_bulk,
    ),
}
"""Name in DBC attribute and profile -> how it is done."""
