"""When messages leave: against a literal simulation, millisecond by millisecond."""

from itertools import pairwise
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.transmit.event_simulation import Message, send_times
from vsensor.profile.sending import Condition, SendPlan
from vsensor.transmit import Happening, MessageState, common_ns, slot_period_ns, step
from vsensor.types import Tick

MS = 1_000_000
IMAGE_MS = 40
ALWAYS = Condition(subject="lane.change", is_signal=False, word="!=", bound=0.0)


def plan_of(message):
    return SendPlan(
        cycle_ns=message.cycle * MS,
        offset_ns=message.offset * MS,
        fast_cycle_ns=message.fast * MS,
        on_change=message.on_change,
        on_write=message.on_write,
        active=(ALWAYS,) if message.fast else (),
        repetitions=message.repetitions,
        repetition_ns=message.gap * MS,
        min_delay_ns=message.delay * MS,
    )


def ours(message, images, slots=None):
    """Return the ms at which frames leave, slot by slot; `slots` given: only those are not dropped."""
    plan = plan_of(message)
    slot_ns = slot_period_ns(common_ns([SimpleNamespace(sending=plan)]), IMAGE_MS * MS)
    state, sent = MessageState(), []
    for index in range(len(images) * IMAGE_MS * MS // slot_ns):
        image = index * slot_ns // (IMAGE_MS * MS)
        if slots is not None and image not in slots:
            continue
        value, active = images[image]
        slot = Tick(index=index, t_ns=index * slot_ns, period_ns=slot_ns)
        state, leaves = step(plan, state, Happening(watched=value, written=image, active=active), slot)
        sent += [index * slot_ns // MS] * leaves
    return sent


times = st.integers(1, 120)
messages = st.builds(
    Message,
    cycle=st.one_of(st.just(0), times),
    offset=st.one_of(st.just(0), times),
    on_change=st.booleans(),
    on_write=st.booleans(),
    repetitions=st.integers(0, 3),
    gap=times,
    delay=st.one_of(st.just(0), times),
)
images_without_activity = st.lists(st.tuples(st.integers(0, 2), st.just(False)), min_size=1, max_size=25)
images_with_activity = st.lists(st.tuples(st.integers(0, 2), st.booleans()), min_size=1, max_size=25)


@settings(max_examples=200, deadline=None)
@given(messages, images_without_activity)
def test_frames_leave_when_a_literal_simulation_says(message, images):
    assert ours(message, images) == send_times(message, images, IMAGE_MS)


@settings(max_examples=200, deadline=None)
@given(messages, times, images_with_activity)
def test_fast_cycles_begin_and_end_when_a_literal_simulation_says(message, fast, images):
    message.fast = fast
    assert ours(message, images) == send_times(message, images, IMAGE_MS)


STEADY = [(0, False)] * 6
CHANGING = [(0, False), (0, False), (1, False), (1, False), (1, False), (1, False)]
BRIEFLY_ACTIVE = [(0, False), (0, True), (0, True), (0, False), (0, False), (0, False)]


@pytest.mark.parametrize(
    ("message", "images", "expected"),
    [
        (Message(cycle=40), STEADY, [0, 40, 80, 120, 160, 200]),
        (Message(cycle=100, offset=30), STEADY, [30, 130, 230]),
        (Message(on_change=True), CHANGING, [0, 80]),
        (Message(cycle=100, on_change=True), CHANGING, [0, 80, 100, 200]),
        (Message(on_change=True, repetitions=2, gap=10), CHANGING, [0, 10, 20, 80, 90, 100]),
        (Message(cycle=100, on_change=True, delay=30), CHANGING, [0, 80, 110, 200]),
        (Message(fast=20), BRIEFLY_ACTIVE, [40, 60, 80, 100, 120]),
        (Message(cycle=100, fast=20), BRIEFLY_ACTIVE, [0, 40, 60, 80, 100, 120, 200]),
        (Message(on_write=True), STEADY, [0, 40, 80, 120, 160, 200]),
    ],
)
def test_send_times_by_hand(message, images, expected):
    assert ours(message, images) == expected
    assert send_times(message, images, IMAGE_MS) == expected


@settings(max_examples=100, deadline=None)
@given(messages, images_with_activity)
def test_two_frames_of_a_message_are_never_closer_than_its_minimum_delay(message, images):
    message.fast = 7
    sent = ours(message, images)
    assert all(b - a >= message.delay for a, b in pairwise(sent))


def test_a_change_in_a_dropped_slot_is_sent_in_the_next_one():
    assert ours(Message(on_change=True), CHANGING, slots={0, 1, 3, 4, 5}) == [0, 120]


@pytest.mark.parametrize(
    ("cycles_ms", "image_ms", "expected_ms"),
    [
        ([40], 40, 40),
        ([40, 100], 40, 20),
        ([20], 40, 20),
        ([40], 30, 10),
        ([80, 120], 40, 40),
        ([1], 1000, 1),
    ],
)
def test_the_slot_divides_the_image_and_all_cycles(cycles_ms, image_ms, expected_ms):
    plans = tuple(SimpleNamespace(sending=SendPlan(cycle_ns=cycle * MS)) for cycle in cycles_ms)
    assert slot_period_ns(common_ns(plans), image_ms * MS) == expected_ms * MS


def test_times_that_only_slots_below_a_millisecond_would_meet_leave_the_slot_at_the_image():
    plans = (SimpleNamespace(sending=SendPlan(cycle_ns=33_333_333)),)
    assert slot_period_ns(common_ns(plans), 40 * MS) == 40 * MS
