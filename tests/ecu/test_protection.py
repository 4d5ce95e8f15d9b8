"""The ECU's own check code against the standard's published values and AUTOSAR's other implementation."""

import ctypes
from functools import cache

import e2e
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ecu.building import built_ecu


@cache
def library():
    loaded = ctypes.CDLL(str(built_ecu() / "libecu.so"))
    loaded.e2e_crc8.argtypes = [ctypes.c_uint8, ctypes.c_char_p, ctypes.c_size_t]
    loaded.e2e_crc8.restype = ctypes.c_uint8
    return loaded


# AUTOSAR SWS CRC, CRC8 SAE J1850: data and check value (initial 0xFF, final XOR 0xFF).
PUBLISHED = [
    ("00000000", 0x59),
    ("F20183", 0x37),
    ("0FAA0055", 0x79),
    ("00FF5511", 0xB8),
    ("332255AABBCCDDEEFF", 0xCB),
    ("926B55", 0x8C),
    ("FFFFFFFF", 0x74),
    ("313233343536373839", 0x4B),
]


@pytest.mark.parametrize(("data", "value"), PUBLISHED)
def test_the_crc_gives_the_published_check_values(data, value):
    octets = bytes.fromhex(data)
    assert library().e2e_crc8(0xFF, octets, len(octets)) ^ 0xFF == value


@given(data_id=st.integers(0, 0xFFFF), counter=st.integers(0, 14), payload=st.binary(min_size=8, max_size=8))
def test_a_frame_is_protected_as_autosar_e2e_does(data_id, counter, payload):
    ours = ctypes.create_string_buffer(payload, 8)
    library().e2e_p01_protect(ctypes.c_uint16(data_id), ctypes.c_uint8(counter), ours, ctypes.c_size_t(8))
    theirs = bytearray(payload)
    theirs[1] = theirs[1] & 0xF0 | counter
    e2e.p01.e2e_p01_protect(theirs, data_id, increment_counter=False)
    assert ours.raw == bytes(theirs)
