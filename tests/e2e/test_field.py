"""Fields in bytes: against the integers that a message is, in either byte order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.e2e import Field
from vsensor.e2e.field import read_bulk, reader, writer
from vsensor.errors import ConfigError

LENGTH = 12


@st.composite
def fields(draw):
    """A field within LENGTH bytes, and the shift of its lowest bit in the integer of its byte order."""
    bits = draw(st.integers(1, 64))
    shift = draw(st.integers(0, 8 * LENGTH - bits))
    if draw(st.booleans()):
        return Field(8 * (LENGTH - 1 - shift // 8) + shift % 8, bits, True), shift, "big"
    return Field(shift, bits, False), shift, "little"


messages = st.binary(min_size=LENGTH, max_size=LENGTH)


@given(place=fields(), message=messages)
def test_reading_is_a_shift_of_the_messages_integer(place, message):
    field, shift, order = place
    expected = int.from_bytes(message, order) >> shift & (1 << field.length) - 1
    assert reader(field)(message) == expected
    assert read_bulk(field, np.frombuffer(message, dtype=np.uint8)[None]).tolist() == [expected]


@given(place=fields(), message=messages, drawn=st.integers(0, 2**64 - 1))
def test_writing_replaces_the_field_and_nothing_else(place, message, drawn):
    field, shift, order = place
    value, mask = drawn & (1 << field.length) - 1, (1 << field.length) - 1 << shift
    data = bytearray(message)
    writer(field)(data, value)
    assert int.from_bytes(data, order) == int.from_bytes(message, order) & ~mask | value << shift


@pytest.mark.parametrize(
    ("field", "said"),
    [
        (Field(0, 0), "0 bits, 1 to 64"),
        (Field(0, 65), "65 bits, 1 to 64"),
        (Field(-1, 4), "4 bits at -1 do not fit into 8 bytes"),
        (Field(60, 5), "5 bits at 60 do not fit into 8 bytes"),
        (Field(4, 5, True), "5 bits at 4 do not fit into 8 bytes"),
        (Field(64, 1), "1 bits at 64 do not fit into 8 bytes"),
    ],
)
def test_a_field_beyond_the_message_is_refused(field, said):
    with pytest.raises(ConfigError, match=said):
        field.require_within(8, "counter")
