"""Plain checksums against the CRC catalogue's check values and literal forms of what cars do."""

import pytest
from crccheck import crc as crccheck
from hypothesis import given
from hypothesis import strategies as st

from tests.e2e.guards import protected
from vsensor.e2e import CHECKSUMS, Field, guard
from vsensor.e2e.crc import CRC8_2F, CRC8_J1850, CRC16_ARC, CRC16_CCITT, CRC32_P4, CRC64_XZ, Crc
from vsensor.errors import ConfigError

# Check values: the CRC over the digits 1 to 9 (CRC RevEng catalogue; AUTOSAR SWS CRC library, 7.2).
CATALOGUE = [
    (CRC8_J1850, 0x4B, crccheck.Crc8SaeJ1850),
    (CRC8_2F, 0xDF, crccheck.Crc8Autosar),
    (CRC16_CCITT, 0x29B1, crccheck.Crc16Ibm3740),
    (CRC16_ARC, 0xBB3D, crccheck.Crc16Arc),
    (CRC32_P4, 0x1697D06A, crccheck.Crc32Autosar),
    (CRC64_XZ, 0x995DC9BBDF1939FA, crccheck.Crc64Xz),
]


@pytest.mark.parametrize(("crc", "check", "reference"), CATALOGUE)
def test_a_crc_has_the_check_value_of_the_catalogue(crc, check, reference):
    assert crc(b"123456789") == check


@pytest.mark.parametrize(("crc", "check", "reference"), CATALOGUE)
@given(data=st.binary(max_size=80))
def test_a_crc_equals_another_library(crc, check, reference, data):
    assert crc(data) == reference.calc(data)


@given(data=st.binary(max_size=40), start=st.integers(0, 0xFFFF))
def test_a_reflected_start_value_is_that_of_the_catalogues_model(data, start):
    """CRC-16/ARC with another start value, as crccheck takes it."""
    assert CRC16_ARC(data, start=start) == crccheck.Crc16Arc.calc(data, initvalue=start)


@pytest.mark.parametrize(
    ("name", "reference"),
    [
        ("crc8_j1850", crccheck.Crc8SaeJ1850),
        ("crc8_2f", crccheck.Crc8Autosar),
        ("crc16_ccitt", crccheck.Crc16Ibm3740),
    ],
)
@given(data=st.binary(max_size=56))
def test_a_checksum_can_be_called_on_the_bytes_of_a_whole_burst(name, reference, data):
    assert CHECKSUMS[name](data) == reference.calc(data)


@given(data=st.binary(max_size=56))
def test_sums_over_any_bytes_are_what_they_say(data):
    xored = 0
    for byte in data:
        xored ^= byte
    assert CHECKSUMS["xor8"](data) == xored
    assert CHECKSUMS["sum8"](data) == sum(data) % 256
    assert CHECKSUMS["sum8_length"](data) == (sum(data) + len(data)) % 256
    assert CHECKSUMS["sum8_id_data"](data, 0x1D2) == (sum(data) + 0x01 + 0xD2) % 256
    assert CHECKSUMS["sum8_id"](data, 0x1D2) == (sum(data) + 0x01 + 0xD2 + len(data)) % 256


@given(payload=st.binary(min_size=8, max_size=8), arbitration_id=st.integers(0, (1 << 29) - 1))
def test_nibble_sum_is_the_one_of_public_descriptions_of_honda(payload, arbitration_id):
    guarding = guard("nibble_sum", length=8, arbitration_id=arbitration_id, checksum=Field(56, 4))
    message = protected(guarding, payload, 0)
    nibbles = [int(digit, 16) for digit in f"{arbitration_id:x}" + message.hex()[:15]]
    extended = 3 if arbitration_id > 0x7FF else 0
    assert message[7] & 0xF == (8 - sum(nibbles) + extended) & 0xF


# Public descriptions of Hyundai's CAN FD: CRC-16/XMODEM over the bytes from 2 on, then over the id's low and
# high byte, then XOR a constant for each length.
HYUNDAI_XOR = {8: 0x5F29, 16: 0x041D, 24: 0x819D, 32: 0x9F5B}


@pytest.mark.parametrize("length", HYUNDAI_XOR)
@given(data=st.data(), arbitration_id=st.integers(0, 0x7FF))
def test_hyundai_canfd_is_the_one_of_public_descriptions(length, data, arbitration_id):
    payload = data.draw(st.binary(min_size=length, max_size=length))
    guarding = guard("hyundai_canfd", length=length, arbitration_id=arbitration_id, checksum=Field(0, 16))
    message = protected(guarding, payload, 0)
    over = payload[2:] + arbitration_id.to_bytes(2, "little")
    expected = crccheck.Crc16Xmodem.calc(over) ^ HYUNDAI_XOR[length]
    assert int.from_bytes(message[:2], "little") == expected


@given(payload=st.binary(min_size=8, max_size=8), place=st.integers(0, 7))
def test_a_crc_leaves_its_own_byte_out_wherever_it_lies(payload, place):
    message = protected(guard("crc8_2f", length=8, checksum=Field(8 * place, 8)), payload, 0)
    assert message[place] == crccheck.Crc8Autosar.calc(payload[:place] + payload[place + 1 :])


@given(payload=st.binary(min_size=8, max_size=8))
def test_a_data_id_follows_the_data_low_byte_first(payload):
    message = protected(guard("crc8_j1850", length=8, data_id=0xABCD, checksum=Field(0, 8)), payload, 0)
    assert message[0] == crccheck.Crc8SaeJ1850.calc(payload[1:] + b"\xcd\xab")


@given(payload=st.binary(min_size=8, max_size=8))
def test_skipped_bytes_do_not_count(payload):
    guarding = guard("crc8_j1850", length=8, checksum=Field(0, 8), skip=(2, 7))
    message = protected(guarding, payload, 0)
    assert message[0] == crccheck.Crc8SaeJ1850.calc(payload[1:2] + payload[3:7])
    changed = bytearray(message)
    changed[7] ^= 0xFF
    assert guarding.check(bytes(changed))
    summed = protected(guard("sum8", length=8, checksum=Field(0, 8), skip=(2, 7)), payload, 0)
    assert summed[0] == (sum(payload[1:2]) + sum(payload[3:7])) % 256


@given(payload=st.binary(min_size=8, max_size=8), start=st.integers(0, 255), final=st.integers(0, 255))
def test_start_value_and_final_xor_can_be_others(payload, start, final):
    settings = {"length": 8, "checksum": Field(0, 8), "start": start, "final_xor": final}
    expected = Crc(bits=8, polynomial=0x1D, start=start, final_xor=final)(payload[1:])
    assert protected(guard("crc8_j1850", **settings), payload, 0)[0] == expected
    assert protected(guard("sum8", **settings), payload, 0)[0] == (sum(payload[1:]) + start) % 256 ^ final


@given(payload=st.binary(min_size=8, max_size=8))
def test_bits_beside_a_checksum_inside_a_byte_count(payload):
    """A sum at bits 4 to 11: the lower half of byte 0 and the upper half of byte 1 are data."""
    message = protected(guard("sum8", length=8, checksum=Field(4, 8)), payload, 0)
    rest = (payload[0] & 0x0F) + (payload[1] & 0xF0) + sum(payload[2:])
    assert (message[0] >> 4) | (message[1] & 0x0F) << 4 == rest % 256


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        ("sum8", {}, "e2e sum8: the place of the checksum was expected"),
        ("counter", {}, "e2e counter: the place of the counter was expected"),
        ("counter", {"counter": Field(0, 4), "checksum": Field(8, 8)}, "e2e counter has no checksum"),
        ("sum8", {"checksum": Field(0, 4)}, "checksum has 4 bits at 0, e2e sum8 has 8"),
        ("nibble_sum", {"checksum": Field(0, 8)}, "checksum has 8 bits at 0, e2e nibble_sum has 4"),
        ("sum8", {"checksum": Field(60, 8)}, "checksum: 8 bits at 60 do not fit into 8 bytes"),
        ("sum8", {"checksum": Field(0, 8), "counter": Field(6, 4)}, "checksum and counter share bits"),
        ("sum8", {"checksum": Field(0, 8), "counter": Field(62, 4)}, "counter: 4 bits at 62 do not fit"),
        ("sum8", {"checksum": Field(0, 8), "counter": Field(8, 40)}, "at most 32 were expected"),
        (
            "sum8",
            {"checksum": Field(0, 8), "counter": Field(8, 4), "counter_states": 17},
            "counter_states = 17, 2 to 16 fit into 4 bits",
        ),
        (
            "sum8",
            {"checksum": Field(0, 8), "counter": Field(8, 4), "counter_states": 1},
            "counter_states = 1, 2 to 16",
        ),
        ("sum8", {"checksum": Field(0, 8), "counter_states": 4}, "e2e sum8 has no counter_states"),
        ("sum8", {"checksum": Field(0, 8), "data_id": 1}, "e2e sum8 has no data_id"),
        ("sum8", {"checksum": Field(0, 8), "offset": 1}, "e2e sum8 has no offset"),
        ("crc8_2f", {"checksum": Field(0, 8), "data_id": (1, 2)}, "data_id is a list, one number"),
        ("crc8_2f", {"checksum": Field(0, 8), "data_id": 65536}, "data_id = 65536, 0 to 65535"),
        ("crc8_2f", {"checksum": Field(0, 8), "start": 256}, "start = 256, 0 to 255 were expected"),
        ("crc8_2f", {"checksum": Field(0, 8), "final_xor": -1}, "final_xor = -1, 0 to 255 were expected"),
        ("crc8_2f", {"checksum": Field(0, 8), "skip": (8,)}, r"skip = \[8\]: bytes 0 to 7 were expected"),
        ("sum8", {"checksum": Field(0, 8), "arbitration_id": 1 << 29}, "arbitration id 536870912"),
        ("crc8_j185", {}, "e2e profile 'crc8_j185' is not known; did you mean 'crc8_j1850'"),
        ("zzz", {}, "e2e profile 'zzz' is not known; known: P01, P02"),
    ],
)
def test_wrong_settings_are_one_line_that_says_what_was_expected(name, settings, said):
    with pytest.raises(ConfigError, match=said) as caught:
        guard(name, length=8, **settings)
    assert "\n" not in str(caught.value)
