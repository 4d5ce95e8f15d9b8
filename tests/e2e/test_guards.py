"""What holds for every protection, whatever the data."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.e2e.guards import CRCS, GUARDS, PROFILES, protected
from vsensor.e2e import NAMES

every_guard = pytest.mark.parametrize("guarding", GUARDS.values(), ids=GUARDS)


def frames(guarding):
    """Payloads and counters of one guard."""
    length, states = guarding.wanted.length, guarding.counter_states
    return st.tuples(st.binary(min_size=length, max_size=length), st.integers(0, states - 1))


def rows(messages):
    return np.array([list(message) for message in messages], dtype=np.uint8)


def test_every_protection_is_among_those_tested():
    assert {guarding.name for guarding in GUARDS.values()} == set(NAMES)


@every_guard
@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_what_is_protected_is_right_and_has_its_counter(guarding, data):
    payload, counter = data.draw(frames(guarding))
    message = protected(guarding, payload, counter)
    assert guarding.check(message)
    assert guarding.counter(message) == (counter if guarding.counter_field else None)


@every_guard
@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_protecting_twice_changes_nothing(guarding, data):
    payload, counter = data.draw(frames(guarding))
    once = protected(guarding, payload, counter)
    assert protected(guarding, once, counter) == once


@every_guard
@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_protecting_leaves_all_other_bits_alone(guarding, data):
    payload, counter = data.draw(frames(guarding))
    message = protected(guarding, payload, counter)
    other = protected(guarding, bytes(255 - byte for byte in payload), counter)
    written = {}
    for field in (guarding.checksum_field, guarding.counter_field):
        for byte, mask in (field.masks() if field else {}).items():
            written[byte] = written.get(byte, 0) | mask
    for byte, (before, after, inverted) in enumerate(zip(payload, message, other, strict=True)):
        constant = 0xFF & ~(after ^ inverted)  # neither payload: counter, length or id of the header
        assert (before ^ after) & ~written.get(byte, 0) & ~constant == 0


@every_guard
@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_checking_in_bulk_equals_checking_one_by_one(guarding, data):
    right = [protected(guarding, *item) for item in data.draw(st.lists(frames(guarding), max_size=4))]
    drawn = [payload for payload, _ in data.draw(st.lists(frames(guarding), min_size=1, max_size=4))]
    near = []
    for message in right:
        wrong = bytearray(message)
        wrong[data.draw(st.integers(0, len(wrong) - 1))] ^= data.draw(st.integers(1, 255))
        near.append(bytes(wrong))
    messages = right + drawn + near
    assert guarding.check_bulk(rows(messages)).tolist() == [guarding.check(one) for one in messages]
    assert guarding.counters_bulk(rows(messages)).tolist() == [guarding.counter(one) or 0 for one in messages]


@every_guard
def test_a_message_of_another_length_is_not_right(guarding):
    message = protected(guarding, bytes(guarding.wanted.length), 0)
    assert not guarding.check(message + b"\0")
    assert not guarding.check(message[:-1])
    assert guarding.check_bulk(rows([message + b"\0"])).tolist() == [False]


@every_guard
def test_no_messages_in_bulk_are_no_answers(guarding):
    assert guarding.check_bulk(np.zeros((0, guarding.wanted.length), dtype=np.uint8)).shape == (0,)


@every_guard
def test_more_messages_than_a_block_are_all_checked(guarding):
    """7 counters in turn, so that no block begins with the same one as another."""
    length, states = guarding.wanted.length, guarding.counter_states
    turn = rows([protected(guarding, bytes(length), counter % states) for counter in range(7)])
    data = np.tile(turn, (3000, 1))
    data[12_345, length - 1] ^= 0x41
    wrong = np.flatnonzero(~guarding.check_bulk(data)).tolist()
    assert wrong == ([] if guarding.name == "counter" else [12_345])


FORBIDDING = {
    name: guarding
    for name, guarding in GUARDS.items()
    if guarding.counter_field and guarding.counter_states < 1 << guarding.counter_field.length
}


@pytest.mark.parametrize("guarding", FORBIDDING.values(), ids=FORBIDDING)
def test_a_counter_that_the_sender_never_sends_is_refused(guarding):
    """Forbidden values are those that the bits hold beyond counter_states."""
    forbidden = protected(guarding, bytes(guarding.wanted.length), guarding.counter_states)
    assert guarding.counter(forbidden) == guarding.counter_states
    assert not guarding.check(forbidden)
    assert not guarding.check_bulk(rows([forbidden])).any()


@pytest.mark.parametrize("guarding", (PROFILES | CRCS).values(), ids=PROFILES | CRCS)
def test_every_single_flipped_bit_is_detected(guarding):
    message = protected(guarding, bytes(range(7, 7 + guarding.wanted.length)), guarding.counter_states // 2)
    for bit in range(8 * len(message)):
        wrong = bytearray(message)
        wrong[bit // 8] ^= 1 << bit % 8
        assert not guarding.check(bytes(wrong)), f"bit {bit}"


def in_order_of_transmission(guarding):
    """Whether the checksum's bits follow the data's as they are sent, as the promise on bursts needs."""
    return len(guarding.checksum_field.masks()) * 8 == guarding.checksum_field.length


BURSTS = {
    name: guarding for name, guarding in (PROFILES | CRCS).items() if in_order_of_transmission(guarding)
}


@pytest.mark.parametrize("guarding", BURSTS.values(), ids=BURSTS)
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_burst_of_errors_no_wider_than_the_crc_is_detected(guarding, data):
    """In the data on one side of the checksum, bits in the order in which the CRC takes them in."""
    payload, counter = data.draw(frames(guarding))
    message = protected(guarding, payload, counter)
    width, first = guarding.checksum_field.length, min(guarding.checksum_field.masks())
    behind = first + width // 8
    if isinstance(guarding.data_id, tuple) or guarding.wanted.data_id_mode == "alternating":
        behind += 1  # another counter means another data id: errors far apart
    low, high = data.draw(
        st.sampled_from([side for side in ((0, first), (behind, len(message))) if side[1] > side[0]])
    )
    width = min(width, 8 * (high - low))
    place = data.draw(st.integers(0, 8 * (high - low) - width))
    errors = data.draw(st.integers(1, (1 << width) - 1))
    order = "little" if guarding.name in ("P04", "P07") else "big"  # P04, P07: a byte's lowest bit first
    part = int.from_bytes(message[low:high], order) ^ errors << place
    wrong = message[:low] + part.to_bytes(high - low, order) + message[high:]
    assert not guarding.check(wrong)
    assert not guarding.check_bulk(rows([wrong])).any()


@every_guard
def test_a_guard_survives_pickling(guarding):
    copy = pickle.loads(pickle.dumps(guarding))
    assert copy == guarding
    message = protected(guarding, bytes(guarding.wanted.length), 0)
    assert protected(copy, bytes(guarding.wanted.length), 0) == message
    assert copy.check(message)
