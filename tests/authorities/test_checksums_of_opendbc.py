"""Checksums of car makers as opendbc computes them, against the protection that profiles name."""

import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.e2e import Field, guard

pytestmark = pytest.mark.skipif(
    sys.version_info >= (3, 13), reason="opendbc has no release for Python 3.13 and later"
)

IDENTIFIERS = st.integers(1, 0x7FF)


def protected(name, payload, identifier, checksum):
    data = bytearray(payload)
    guard(
        name,
        length=len(data),
        arbitration_id=identifier,
        data_id=None,
        checksum=checksum,
        counter=None,
    ).protect(data, 0)
    return data


@given(payload=st.binary(min_size=2, max_size=8), identifier=IDENTIFIERS)
def test_sum8_id_is_toyotas_checksum(payload, identifier):
    from opendbc.car.toyota.toyotacan import toyota_checksum

    last = Field(low_bit=8 * (len(payload) - 1), length=8, big_endian=True)
    data = protected("sum8_id", payload, identifier, last)
    assert data[-1] == toyota_checksum(identifier, None, data)


@given(payload=st.binary(min_size=2, max_size=8), identifier=IDENTIFIERS)
def test_nibble_sum_is_hondas_checksum(payload, identifier):
    from opendbc.car.honda.hondacan import honda_checksum

    low_nibble = Field(low_bit=8 * (len(payload) - 1), length=4, big_endian=True)
    data = protected("nibble_sum", payload, identifier, low_nibble)
    assert data[-1] & 15 == honda_checksum(identifier, None, data)


@given(payload=st.binary(min_size=8, max_size=8), identifier=IDENTIFIERS, place=st.integers(0, 7))
def test_sum8_id_data_is_teslas_checksum_wherever_it_lies(payload, identifier, place):
    from opendbc.can.dbc import Signal
    from opendbc.car.tesla.teslacan import tesla_checksum

    data = protected(
        "sum8_id_data", payload, identifier, Field(low_bit=8 * place, length=8, big_endian=False)
    )
    signal = Signal("Checksum", 8 * place, 8 * place + 7, 8 * place, 8, False, 1, 0, True)
    assert data[place] == tesla_checksum(identifier, signal, data)


@pytest.mark.parametrize("length", [8, 16, 24, 32])
@given(body=st.binary(min_size=32, max_size=32), identifier=IDENTIFIERS)
def test_hyundai_canfd_is_hyundais_crc_over_data_and_identifier(length, body, identifier):
    from opendbc.car.hyundai.hyundaicanfd import hkg_can_fd_checksum

    first = Field(low_bit=0, length=16, big_endian=False)
    data = protected("hyundai_canfd", body[:length], identifier, first)
    assert int.from_bytes(data[:2], "little") == hkg_can_fd_checksum(identifier, None, data)
