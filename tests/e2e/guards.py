"""One guard of every protection, in places that differ, for tests over all of them."""

from vsensor.e2e import Field, guard

IDS = tuple(range(3, 51, 3))

PROFILES = {
    "P01": guard("P01", length=8, data_id=0x123),
    "P01 at byte 3": guard("P01", length=8, data_id=0xBEEF, offset=3),
    "P01 alternating": guard("P01", length=8, data_id=0x1234, data_id_mode="alternating"),
    "P01 low": guard("P01", length=6, data_id=0x1234, data_id_mode="low"),
    "P01 nibble": guard("P01", length=8, data_id=0xABC, data_id_mode="nibble"),
    "P02": guard("P02", length=8, data_id=IDS),
    "P04": guard("P04", length=16, data_id=0x0A0B0C0D),
    "P04 at byte 20": guard("P04", length=64, data_id=0xFFFFFFFF, offset=20),
    "P05": guard("P05", length=8, data_id=0x1234),
    "P05 at byte 5": guard("P05", length=32, data_id=0xFEDC, offset=5),
    "P06": guard("P06", length=8, data_id=0x1234),
    "P06 at byte 3": guard("P06", length=24, data_id=0xABCD, offset=3),
    "P07": guard("P07", length=24, data_id=0x0A0B0C0D),
    "P07 at byte 9": guard("P07", length=48, data_id=0x01020304, offset=9),
    "P11": guard("P11", length=8, data_id=0x123),
    "P11 nibble at byte 2": guard("P11", length=8, data_id=0xF23, data_id_mode="nibble", offset=2),
    "P22": guard("P22", length=8, data_id=IDS),
    "P22 at byte 4": guard("P22", length=12, data_id=IDS, offset=4),
}

CRCS = {
    "crc8_j1850": guard("crc8_j1850", length=8, checksum=Field(56, 8), counter=Field(52, 4)),
    "crc8_j1850 of 5 bytes with an id": guard(
        "crc8_j1850", length=5, data_id=0x777, checksum=Field(16, 8), counter=Field(0, 2), counter_states=3
    ),
    "crc8_2f across bytes": guard("crc8_2f", length=8, checksum=Field(20, 8), counter=Field(3, 5)),
    "crc16_ccitt": guard("crc16_ccitt", length=8, checksum=Field(56, 16, True), counter=Field(0, 8)),
    "crc16_ccitt from 0": guard("crc16_ccitt", length=8, checksum=Field(0, 16), start=0, final_xor=0x1234),
    "hyundai_canfd": guard(
        "hyundai_canfd", length=32, arbitration_id=0x12A, checksum=Field(0, 16), counter=Field(16, 8)
    ),
}

SUMS = {
    "xor8": guard("xor8", length=8, checksum=Field(56, 8), counter=Field(48, 4), counter_states=10),
    "sum8": guard("sum8", length=3, checksum=Field(8, 8), counter=Field(20, 4)),
    "sum8 across bytes": guard("sum8", length=8, checksum=Field(9, 8, True), counter=Field(44, 12, True)),
    "sum8 inverted": guard("sum8", length=8, checksum=Field(0, 8), final_xor=0xFF, start=7, skip=(3, 5)),
    "sum8_length": guard("sum8_length", length=8, checksum=Field(56, 8)),
    "sum8_id_data": guard("sum8_id_data", length=8, arbitration_id=0x220, checksum=Field(0, 8)),
    "sum8_id": guard("sum8_id", length=5, arbitration_id=0x1D2, checksum=Field(32, 8)),
    "nibble_sum": guard(
        "nibble_sum", length=8, arbitration_id=0x1DF, checksum=Field(56, 4), counter=Field(60, 2)
    ),
    "nibble_sum extended": guard(
        "nibble_sum", length=8, arbitration_id=0x18DAB0F1, checksum=Field(56, 4), counter=Field(60, 2)
    ),
}

COUNTERS = {"counter": guard("counter", length=4, counter=Field(9, 9), counter_states=500)}

GUARDS = PROFILES | CRCS | SUMS | COUNTERS


def protected(guarding, payload, counter):
    """Return the payload with counter and checksum."""
    data = bytearray(payload)
    guarding.protect(data, counter)
    return bytes(data)
