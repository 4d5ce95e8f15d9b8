"""The receiver: what it says about a stream, and how AUTOSAR's state machine moves."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.e2e.guards import protected
from vsensor.e2e import Check, Field, ReceiverConfig, ReceiverState, Reception, Status, guard, receive
from vsensor.errors import ConfigError
from vsensor.schema import convert

GUARD = guard("P01", length=8, data_id=0x123)
STATES = GUARD.counter_states
CONFIG = ReceiverConfig()
START = ReceiverState()

configs = st.builds(
    lambda ok, errors, size, extra, delta, clear: ReceiverConfig(
        max_delta_counter=delta,
        window_size_init=size,
        window_size_valid=size + extra,
        window_size_invalid=size,
        min_ok_valid=ok[0],
        min_ok_init=min(ok[1], size),
        min_ok_invalid=min(ok[2], size),
        max_error_invalid=errors[0],
        max_error_init=errors[1],
        max_error_valid=errors[2],
        clear_to_invalid=clear,
    ),
    st.lists(st.integers(1, 4), min_size=3, max_size=3).map(sorted),
    st.lists(st.integers(0, 4), min_size=3, max_size=3).map(sorted),
    st.integers(4, 8),
    st.integers(0, 3),
    st.integers(1, 6),
    st.booleans(),
)


def frame(counter):
    return protected(GUARD, bytes(8), counter % STATES)


def broken(counter):
    wrong = bytearray(frame(counter))
    wrong[5] ^= 1
    return bytes(wrong)


def checks(config, stream, state=START, guarding=GUARD):
    """Return what is concluded from each entry of a stream, and the last state."""
    found = []
    for data in stream:
        state, check = receive(config, state, guarding, data)
        found.append(check)
    return found, state


def statuses(config, stream):
    return [check.status for check in checks(config, stream)[0]]


def settled(config):
    """Return the state after a long stream without faults, whose last counter is 0."""
    found, state = checks(config, [frame(counter) for counter in range(STATES * 2 + 1)])
    assert found[-1].reception is Reception.VALID
    return state


@given(config=configs, start=st.integers(0, STATES - 1))
def test_a_stream_without_faults_is_ok_and_becomes_and_stays_valid(config, start):
    found, _ = checks(config, [frame(start + k) for k in range(40)])
    assert {check.status for check in found} == {Status.OK}
    receptions = [check.reception for check in found]
    begin = 1 + config.min_ok_init
    # The first frame leads to INIT and is not counted there.
    assert receptions[: begin - 1] == [Reception.INIT] * config.min_ok_init
    assert set(receptions[begin - 1 :]) == {Reception.VALID}


@given(config=configs, step=st.integers(0, STATES - 1))
def test_the_step_of_the_counter_decides(config, step):
    _, check = receive(config, settled(config), GUARD, frame(step))
    expected = Status.SOME_LOST if step <= config.max_delta_counter else Status.WRONG_SEQUENCE
    expected = {0: Status.REPEATED, 1: Status.OK}.get(step, expected)
    assert check.status is expected
    assert check.lost == (step - 1 if expected is Status.SOME_LOST else 0)


@given(config=configs, lost=st.integers(1, STATES - 2))
def test_lost_frames_are_tolerated_up_to_max_delta_counter(config, lost):
    state, check = receive(config, settled(config), GUARD, frame(1 + lost))
    assert check.status.is_fresh == (lost < config.max_delta_counter)
    _, following = receive(config, state, GUARD, frame(2 + lost))
    assert following.status is Status.OK


def test_a_frame_received_twice_is_repeated():
    assert statuses(CONFIG, [frame(3), frame(3), frame(4)]) == [Status.OK, Status.REPEATED, Status.OK]


def test_a_wrong_frame_leaves_the_counter_where_it_was():
    """The frame after it is two steps from the last right one."""
    found = statuses(CONFIG, [frame(3), broken(4), frame(5)])
    assert found == [Status.OK, Status.WRONG_CRC, Status.SOME_LOST]


def test_cycles_without_a_frame_count_as_lost_ones():
    found = statuses(CONFIG, [frame(3), None, None, frame(6), None, None, None, frame(10)])
    silence = Status.NO_NEW_DATA
    expected = [
        Status.OK,
        silence,
        silence,
        Status.SOME_LOST,
        silence,
        silence,
        silence,
        Status.WRONG_SEQUENCE,
    ]
    assert found == expected


@given(start=st.integers(0, STATES - 1))
def test_a_reset_of_the_sender_costs_at_most_one_frame(start):
    _, state = checks(CONFIG, [frame(k) for k in range(start + 10)])
    found, _ = checks(CONFIG, [frame(k) for k in range(10)], state)
    assert {check.status for check in found[1:]} == {Status.OK}
    assert {check.reception for check in found} == {Reception.VALID}


@given(config=configs)
def test_one_bad_frame_in_a_window_keeps_a_tolerant_stream_valid(config):
    found, _ = checks(config, [broken(1), *(frame(k) for k in range(2, 12))], settled(config))
    tolerant = config.max_error_valid >= 1 and config.window_size_valid - 1 >= config.min_ok_valid
    assert (found[0].reception is Reception.VALID) == tolerant


@given(config=configs)
def test_more_errors_than_tolerated_make_the_stream_invalid_with_the_first_too_many(config):
    stream = [broken(k) for k in range(config.window_size_valid)]
    found, _ = checks(config, stream, settled(config))
    good = sum(check.reception is Reception.VALID for check in found)
    assert good == min(config.max_error_valid, config.window_size_valid - config.min_ok_valid)


@given(config=configs)
def test_a_stream_that_falls_silent_becomes_invalid_when_too_few_are_ok(config):
    found, _ = checks(config, [None] * 20, settled(config))
    good = sum(check.reception is Reception.VALID for check in found)
    assert good == config.window_size_valid - config.min_ok_valid
    assert found[-1].reception is Reception.INVALID


@given(config=configs)
def test_an_invalid_stream_recovers_within_its_window_once_frames_are_right_again(config):
    _, state = checks(config, [broken(k) for k in range(12)], settled(config))
    assert state.reception is Reception.INVALID
    found, _ = checks(config, [frame(7 + k) for k in range(20)], state)
    needed = next(k for k, check in enumerate(found) if check.reception is Reception.VALID)
    assert needed <= config.window_size_invalid
    assert {check.reception for check in found[needed:]} == {Reception.VALID}


def test_clearing_forgets_the_errors_that_made_the_stream_invalid():
    """With errors forgotten, as many right frames as INVALID asks for are enough."""
    forgetful = ReceiverConfig(clear_to_invalid=True)
    needed = {}
    for config in (CONFIG, forgetful):
        _, state = checks(config, [broken(k) for k in range(3)], settled(config))
        found, _ = checks(config, [frame(3 + k) for k in range(12)], state)
        needed[config.clear_to_invalid] = [check.reception for check in found].index(Reception.VALID) + 1
    assert needed == {True: 3, False: 4}


@given(stream=st.lists(st.sampled_from([None, broken(0)]), max_size=20))
def test_without_one_right_frame_there_is_no_data(stream):
    assert {check.reception for check in checks(CONFIG, stream)[0]} <= {Reception.NODATA}


def test_errors_during_init_make_the_stream_invalid_before_it_was_ever_valid():
    found, _ = checks(CONFIG, [frame(0), broken(1), broken(2)])
    assert [check.reception for check in found] == [Reception.INIT, Reception.INIT, Reception.INVALID]


@given(
    config=configs,
    stream=st.lists(st.one_of(st.none(), st.builds(frame, st.integers(0, 14)), st.just(broken(1)))),
)
def test_no_stream_is_valid_with_too_few_ok_or_too_many_errors_in_its_window(config, stream):
    state = ReceiverState()
    for data in stream:
        state, check = receive(config, state, GUARD, data)
        assert check.reception is state.reception
        if check.reception is Reception.VALID:
            assert sum(status.is_fresh for status in state.window) >= config.min_ok_valid
            assert state.window.count(Status.WRONG_CRC) <= config.max_error_valid
        assert len(state.window) <= config.window_size_valid


@given(
    stream=st.lists(st.one_of(st.none(), st.builds(frame, st.integers(0, 14)), st.just(broken(1)))),
    cut=st.integers(0, 20),
)
def test_a_receiver_goes_on_from_a_state_that_was_kept(stream, cut):
    whole, _ = checks(CONFIG, stream)
    first, state = checks(CONFIG, stream[:cut])
    second, _ = checks(CONFIG, stream[cut:], state)
    assert first + second == whole


def test_a_message_without_a_counter_is_never_repeated_nor_lost():
    guarding = guard("sum8", length=8, checksum=Field(0, 8))
    message = protected(guarding, bytes(8), 0)
    found, _ = checks(CONFIG, [message] * 3, guarding=guarding)
    assert found[-1] == Check(status=Status.OK, reception=Reception.VALID)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"window_size_init": 6}, "window_size_valid must not be smaller"),
        ({"min_ok_valid": 3}, "min_ok_valid <= min_ok_init <= min_ok_invalid"),
        ({"max_error_init": 3}, "max_error_invalid <= max_error_init <= max_error_valid"),
        ({"window_size_invalid": 2}, "each min_ok must fit"),
        ({"max_delta_counter": 0}, "max_delta_counter"),
    ],
)
def test_tolerances_that_contradict_each_other_are_refused(settings, said):
    with pytest.raises(ConfigError, match=said):
        convert(settings, ReceiverConfig, "limits.toml")
