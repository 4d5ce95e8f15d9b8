"""AUTOSAR's profiles against the examples that the protocol specification publishes, and their rules."""

import numpy as np
import pytest

from vsensor.e2e import Field, guard
from vsensor.e2e.crc import CRC16_CCITT, CRC32_P4, CRC64_XZ
from vsensor.errors import ConfigError

ONE_TO_SIXTEEN = tuple(range(1, 17))

# Profile, settings, counter, message: chapters "protocol examples" of AUTOSAR PRS E2EProtocol (all data 0),
# the same as in the tests of the package autosar-e2e where it has the profile.
PUBLISHED = [
    ("P01", {"data_id": 0x123}, 0, "cc00000000000000"),
    ("P01", {"data_id": 0x123}, 1, "9101000000000000"),
    ("P01", {"data_id": 0x123, "data_id_mode": "alternating"}, 0, "ce00000000000000"),
    ("P01", {"data_id": 0x123, "data_id_mode": "alternating"}, 1, "0201000000000000"),
    ("P01", {"data_id": 0x123, "data_id_mode": "low"}, 0, "ce00000000000000"),
    ("P01", {"data_id": 0x123, "data_id_mode": "low"}, 1, "9301000000000000"),
    ("P01", {"data_id": 0x123, "data_id_mode": "nibble"}, 0, "2a10000000000000"),
    ("P01", {"data_id": 0x123, "data_id_mode": "nibble"}, 1, "7711000000000000"),
    ("P02", {"data_id": (0,) * 16}, 1, "4501000000000000"),
    ("P02", {"data_id": ONE_TO_SIXTEEN}, 1, "1b01000000000000"),
    ("P02", {"data_id": ONE_TO_SIXTEEN}, 15, "cd0f000000000000"),
    ("P04", {"data_id": 0x0A0B0C0D}, 0, "001000000a0b0c0d862b055600000000"),
    ("P04", {"data_id": 0x0A0B0C0D}, 1, "001000010a0b0c0da58e680700000000"),
    ("P04", {"data_id": 0x0A0B0C0D, "offset": 8}, 0, "0000000000000000001800000a0b0c0d69d7502e00000000"),
    ("P04", {"data_id": 0x0A0B0C0D, "offset": 8}, 1, "0000000000000000001800010a0b0c0d4a723d7f00000000"),
    ("P05", {"data_id": 0x1234}, 0, "1cca000000000000"),
    ("P05", {"data_id": 0x1234}, 1, "cf8d010000000000"),
    ("P05", {"data_id": 0x1234, "offset": 8}, 0, "00000000000000002891000000000000"),
    ("P05", {"data_id": 0x1234, "offset": 8}, 1, "0000000000000000fbd6010000000000"),
    ("P06", {"data_id": 0x1234}, 0, "b155000800000000"),
    ("P06", {"data_id": 0x1234}, 1, "f4f5000801000000"),
    ("P06", {"data_id": 0x1234, "offset": 8}, 0, "00000000000000004eb7001000000000"),
    ("P06", {"data_id": 0x1234, "offset": 8}, 1, "00000000000000000b17001001000000"),
    ("P07", {"data_id": 0x0A0B0C0D}, 0, "1fb2e737fcedbcd900000018000000000a0b0c0d00000000"),
    ("P07", {"data_id": 0x0A0B0C0D}, 1, "7bde7268b8e9bc2700000018000000010a0b0c0d00000000"),
    (
        "P07",
        {"data_id": 0x0A0B0C0D, "offset": 8},
        1,
        "0000000000000000739b5d48763c655600000020000000010a0b0c0d00000000",
    ),
    ("P11", {"data_id": 0x123}, 0, "cc00000000000000"),
    ("P11", {"data_id": 0x123}, 1, "9101000000000000"),
    ("P11", {"data_id": 0x123, "data_id_mode": "nibble"}, 0, "2a10000000000000"),
    ("P11", {"data_id": 0x123, "data_id_mode": "nibble"}, 1, "7711000000000000"),
    *(
        ("P22", {"data_id": ONE_TO_SIXTEEN}, counter, f"{crc:02x}{counter:02x}000000000000")
        for counter, crc in enumerate(
            bytes.fromhex("0e1b98310d189b65081d9e370b1e9dcd"),
        )
    ),
    ("P22", {"data_id": ONE_TO_SIXTEEN, "offset": 8}, 1, "00000000000000001401000000000000"),
]


@pytest.mark.parametrize(("name", "settings", "counter", "message"), PUBLISHED)
def test_a_published_example_comes_out_byte_by_byte(name, settings, counter, message):
    length = len(message) // 2
    data = bytearray(length)
    guard(name, length=length, **settings).protect(data, counter)
    assert data.hex() == message


@pytest.mark.parametrize(("name", "settings", "counter", "message"), PUBLISHED)
def test_a_published_example_is_right_and_tells_its_counter(name, settings, counter, message):
    data = bytes.fromhex(message)
    guarding = guard(name, length=len(data), **settings)
    assert guarding.check(data)
    assert guarding.counter(data) == counter


@pytest.mark.parametrize(
    ("name", "states"),
    {
        "P01": 15,
        "P02": 16,
        "P04": 1 << 16,
        "P05": 256,
        "P06": 256,
        "P07": 1 << 32,
        "P11": 15,
        "P22": 16,
    }.items(),
)
def test_the_counter_has_the_states_of_the_specification(name, states):
    data_id = ONE_TO_SIXTEEN if name in ("P02", "P22") else 1
    assert guard(name, length=32, data_id=data_id).counter_states == states


@pytest.mark.parametrize(("name", "byte"), [("P04", 1), ("P04", 7), ("P06", 3), ("P07", 11), ("P07", 19)])
def test_a_wrong_length_or_id_in_the_header_is_refused_though_the_crc_is_right(name, byte):
    first, size, crc, after = {
        "P04": (8, 4, CRC32_P4, b""),
        "P06": (0, 2, CRC16_CCITT, b"\x01\x02"),
        "P07": (0, 8, CRC64_XZ, b""),
    }[name]
    data, right = bytearray(32), guard(name, length=32, data_id=0x0102)
    right.protect(data, 5)
    assert right.check(bytes(data))
    data[byte] ^= 1
    data[first : first + size] = crc(bytes(data[:first] + data[first + size :]) + after).to_bytes(size, "big")
    assert not right.check(bytes(data))
    assert not right.check_bulk(np.frombuffer(bytes(data), dtype=np.uint8)[None]).any()


@pytest.mark.parametrize("name", ["P01", "P11"])
def test_another_nibble_of_the_data_id_is_refused_though_the_crc_is_right(name):
    data = bytearray(8)
    guard(name, length=8, data_id=0x223, data_id_mode="nibble").protect(data, 4)
    other = guard(name, length=8, data_id=0x123, data_id_mode="nibble")
    assert data[1] == 0x24
    assert not other.check(bytes(data))
    assert not other.check_bulk(np.frombuffer(bytes(data), dtype=np.uint8)[None]).any()


@pytest.mark.parametrize(
    ("name", "checksum", "counter", "said"),
    [
        ("P01", Field(16, 8), Field(28, 4), "counter has 4 bits at 28, e2e P01 puts 4 bits at 24"),
        ("P01", Field(20, 8), Field(24, 4), "checksum has 8 bits at 20, e2e P01 puts 8 bits at 16"),
        ("P05", Field(8, 16, True), None, "e2e P05 puts 16 bits at 0, little-endian"),
        ("P06", Field(0, 16), None, "e2e P06 puts 16 bits at 8, big-endian"),
        ("P06", None, Field(32, 4), "counter has 4 bits at 32, e2e P06 puts 8 bits at 32"),
    ],
)
def test_signals_must_lie_where_the_profile_puts_them(name, checksum, counter, said):
    with pytest.raises(ConfigError, match=said):
        guard(name, length=16, data_id=1, checksum=checksum, counter=counter)


@pytest.mark.parametrize(
    ("name", "length", "checksum", "counter", "offset"),
    [
        ("P01", 8, Field(24, 8, True), Field(32, 4, True), 3),
        ("P04", 24, Field(8 * 15, 32, True), Field(8 * 7, 16, True), 4),
        ("P05", 16, Field(16, 16), Field(32, 8), 2),
        ("P07", 32, Field(8 * 9, 64, True), Field(8 * 17, 32, True), 2),
    ],
)
def test_the_header_lies_where_the_checksums_signal_says(name, length, checksum, counter, offset):
    found = guard(name, length=length, data_id=1, checksum=checksum, counter=counter)
    said = guard(name, length=length, data_id=1, offset=offset)
    data, same = bytearray(length), bytearray(length)
    found.protect(data, 9)
    said.protect(same, 9)
    assert data == same


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        ("P01", {}, "e2e P01 needs a data id"),
        ("P01", {"data_id": 0x10000}, "data_id = 65536, 0 to 65535"),
        ("P01", {"data_id": -1}, "data_id = -1, 0 to 65535"),
        ("P01", {"data_id": (1, 2)}, "data_id is a list, one number"),
        ("P01", {"data_id": 1, "data_id_mode": "nibbel"}, "both, alternating, low, nibble were expected"),
        ("P01", {"data_id": 0x1000, "data_id_mode": "nibble"}, "data_id = 4096, 0 to 4095"),
        ("P11", {"data_id": 1, "data_id_mode": "low"}, "'low', both, nibble were expected"),
        ("P05", {"data_id": 1, "data_id_mode": "both"}, "e2e P05 has no data_id_mode"),
        ("P02", {"data_id": 1}, "a list of 16 was expected"),
        ("P22", {"data_id": (1,) * 15}, "a list of 16 was expected"),
        ("P22", {"data_id": (256,) * 16}, "data_id = 256, 0 to 255"),
        ("P02", {"data_id": (1,) * 16, "offset": 1}, "the header lies at byte 0"),
        ("P01", {"data_id": 1, "offset": 7}, "2 bytes of header from byte 7 on do not fit into 8 bytes"),
        ("P04", {"data_id": 1}, "12 bytes of header from byte 0 on do not fit into 8 bytes"),
        ("P01", {"data_id": 1, "start": 0}, "e2e P01 has no start"),
        ("P01", {"data_id": 1, "counter_states": 16}, "e2e P01 has no counter_states"),
        ("P01", {"data_id": 1, "skip": (3,)}, "e2e P01 has no skip"),
        ("P1", {"data_id": 1}, "e2e profile 'P1' is not known; did you mean"),
    ],
)
def test_wrong_settings_are_one_line_that_says_what_was_expected(name, settings, said):
    with pytest.raises(ConfigError) as caught:
        guard(name, length=8, **settings)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
