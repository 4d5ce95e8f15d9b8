"""The receiver over a long stream is AUTOSAR's, frame by frame."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.accept.streams import NATIVE
from vsensor.accept.book import Book
from vsensor.accept.reception import Listener
from vsensor.e2e import ReceiverConfig, ReceiverState, Reception, receive

PLAN = next(plan for plan in NATIVE.messages if plan.layout.name == "LDS_Lane")
CYCLE_NS = 40_000_000
STRICT = ReceiverConfig(max_delta_counter=1, max_error_valid=0, max_error_init=0, max_error_invalid=0)


def protected(counter):
    data = bytearray(8)
    PLAN.guard.protect(data, counter)
    return bytes(data)


@st.composite
def receptions(draw):
    """Frames (bytes or None) in cycles: runs that are right, lost, wrong or repeated."""
    counter, cycles = 0, []
    kinds = st.sampled_from(["right", "right", "lost", "wrong", "repeated"])
    for kind, length in draw(st.lists(st.tuples(kinds, st.integers(1, 30)), min_size=1, max_size=8)):
        for _ in range(length):
            counter = (counter + (kind != "repeated")) % 15
            data = protected(counter)
            cycles.append({"lost": None, "wrong": bytes([data[0] ^ 1]) + data[1:]}.get(kind, data))
    return cycles


def one_by_one(config, cycles):
    """Return how often VALID was left, frame by frame."""
    state, left = ReceiverState(), 0
    for data in cycles:
        before = state.reception
        state, _ = receive(config, state, PLAN.guard, data)
        left += before is Reception.VALID and state.reception is Reception.INVALID
    return left, state.reception


@given(cycles=receptions(), config=st.sampled_from([ReceiverConfig(), STRICT]))
@settings(max_examples=60)
def test_trust_is_lost_as_often_as_frame_by_frame(cycles, config):
    heard = [(k, data) for k, data in enumerate(cycles) if data is not None]
    places = np.array([k for k, _ in heard], dtype=np.int64)
    data = np.frombuffer(b"".join(d for _, d in heard), dtype=np.uint8).reshape(-1, 8)
    right = PLAN.guard.check_bulk(data)
    missing = np.diff(places, prepend=-1) - 1
    steps = np.diff(PLAN.guard.counters_bulk(data), prepend=0) % 15
    fine = right & (steps == 1) & (missing == 0) & np.concatenate([[False], right[:-1]])
    book = Book()
    listener = Listener("LDS_Lane", PLAN.guard, config, book)
    listener.take(places * CYCLE_NS, data, missing, fine)
    last = int(places[-1]) if len(places) else -1
    listener.silence(len(cycles) - 1 - last, len(cycles) * CYCLE_NS)
    left, reception = one_by_one(config, cycles)
    listener.end(len(cycles) * CYCLE_NS)
    count = sum(finding.count for finding in book.findings())
    never = left == 0 and reception is Reception.INVALID
    assert count == left + never
