"""Faults of frames, counters and signals: what is on the bus, what a receiver says, and afterwards."""

import pytest

from tests.faults.runs import (
    FIRST,
    PERIOD_NS,
    TICKS,
    counters,
    data_of,
    faulty,
    frames_of,
    is_valid_at_end,
    judged,
    line,
    others,
    plain,
    plan,
    run,
    statuses,
    with_faults,
)
from vsensor.codec import to_physical, unpack

LANE = "LDS_Lane"


def raws(data, name=LANE):
    return unpack(plan(name).layout, data)


def changed_ticks(outputs, name=LANE):
    """Return the ticks in which the message's frames are not those of a run without faults."""
    pairs = zip(frames_of(outputs, name), frames_of(plain(), name), strict=True)
    return [index for index, (ours, theirs) in enumerate(pairs) if ours != theirs]


def test_a_lost_frame_is_missing_and_the_counter_runs_on_so_that_the_gap_shows():
    outputs = faulty({"kind": "frame_lost", "message": LANE, "times": 2})
    assert [len(frames) for frames in frames_of(outputs, LANE)][FIRST - 1 : FIRST + 3] == [1, 0, 0, 1]
    assert changed_ticks(outputs) == [FIRST, FIRST + 1]
    assert statuses(outputs, LANE) == ["no new data", "no new data", "some lost"]
    assert is_valid_at_end(outputs, LANE)


def test_frames_of_one_message_alone_are_spoiled():
    outputs = faulty({"kind": "frame_lost", "message": LANE, "times": 2})
    assert others(outputs, LANE) == others(plain(), LANE)


def test_a_fault_without_a_message_has_each_message_as_often():
    outputs = faulty({"kind": "frame_lost", "times": 2})
    assert [len(output.frames) for output in outputs][FIRST - 1 : FIRST + 3] == [13, 0, 0, 13]


def test_a_fault_for_a_time_ends_with_it():
    outputs = faulty({"kind": "frame_lost", "message": LANE, "for_s": 0.2})
    assert changed_ticks(outputs) == list(range(FIRST, FIRST + 5))


def test_a_fault_with_neither_lasts_until_it_is_cleared():
    outputs = faulty({"kind": "frame_lost", "message": LANE})
    assert changed_ticks(outputs) == list(range(FIRST, TICKS))


def test_a_delayed_frame_leaves_later_with_the_same_bytes():
    outputs = faulty({"kind": "frame_delayed", "message": LANE, "delay_ms": 15, "times": 1})
    (late,) = frames_of(outputs, LANE)[FIRST]
    (due,) = frames_of(plain(), LANE)[FIRST]
    assert (late.due_ns, late.data) == (due.due_ns + 15_000_000, due.data)
    assert outputs[FIRST].frames[-1] is late
    assert changed_ticks(outputs) == [FIRST]


def test_a_delay_beyond_the_cycle_lets_frames_overtake_and_none_is_lost():
    outputs = faulty({"kind": "frame_delayed", "message": LANE, "delay_ms": 90, "times": 1})
    assert [len(frames) for frames in frames_of(outputs, LANE)][FIRST : FIRST + 4] == [0, 1, 2, 1]
    assert [frame.due_ns for frame in frames_of(outputs, LANE)[FIRST + 2]] == [
        (FIRST + 2) * PERIOD_NS,
        FIRST * PERIOD_NS + 90_000_000,
    ]
    # Two cycles late it has a counter below the latest one: out of sequence, and so is the step after it.
    assert statuses(outputs, LANE) == ["no new data", "some lost", "ok", "wrong sequence", "some lost"]


@pytest.mark.parametrize("name", ["frame_lost", "frame_delayed", "bus_off"])
def test_frames_always_leave_in_order(name):
    more = {"delay_ms": 90} if name == "frame_delayed" else {}
    due_ns = [frame.due_ns for output in faulty({"kind": name, **more}) for frame in output.frames]
    assert due_ns == sorted(due_ns)


def test_a_doubled_frame_is_there_twice_and_said_to_be_repeated():
    outputs = faulty({"kind": "frame_doubled", "message": LANE, "times": 1})
    first, second = frames_of(outputs, LANE)[FIRST]
    assert first == second == frames_of(plain(), LANE)[FIRST][0]
    assert statuses(outputs, LANE) == ["ok", "repeated"]
    assert is_valid_at_end(outputs, LANE)


@pytest.mark.parametrize(("told", "length"), [({"length": 3}, 3), ({}, 4), ({"length": 0}, 0)])
def test_a_truncated_frame_is_shorter_and_fails_its_check(told, length):
    outputs = faulty({"kind": "frame_truncated", "message": LANE, "times": 1, **told})
    assert data_of(outputs, LANE)[FIRST] == data_of(plain(), LANE)[FIRST][:length]
    assert statuses(outputs, LANE) == ["wrong CRC", "some lost"]
    assert is_valid_at_end(outputs, LANE)


def test_a_wrong_crc_changes_nothing_but_the_checksum():
    outputs = faulty({"kind": "crc_wrong", "message": LANE, "times": 3})
    field = plan(LANE).guard.checksum_field
    for index in range(FIRST, FIRST + 3):
        ours, theirs = data_of(outputs, LANE)[index], data_of(plain(), LANE)[index]
        wrong = bytes(a ^ b for a, b in zip(ours, theirs, strict=True))
        assert wrong == bytes(field.masks().get(place, 0) for place in range(8))
    assert statuses(outputs, LANE) == ["wrong CRC"] * 3 + ["wrong sequence"]
    assert [check.reception.value for check in judged(outputs, LANE)][FIRST + 2] == "invalid"
    assert is_valid_at_end(outputs, LANE)


def test_a_frozen_counter_repeats_the_last_one_under_a_right_crc_and_then_counts_on():
    outputs = faulty({"kind": "counter_frozen", "message": LANE, "for_s": 0.12})
    found, last = counters(outputs, LANE), counters(plain(), LANE)[FIRST - 1]
    assert found[FIRST - 1 : FIRST + 5] == [last, last, last, last, (last + 1) % 15, (last + 2) % 15]
    assert statuses(outputs, LANE) == ["repeated"] * 3
    assert is_valid_at_end(outputs, LANE)
    assert raws(data_of(outputs, LANE)[FIRST + 1])["LaneBurst"] == (FIRST + 1) % 16  # the rest lives on


def test_a_counter_frozen_from_the_first_frame_on_stays_at_0():
    outputs = faulty({"kind": "counter_frozen", "message": LANE, "at_s": 0, "times": 3})
    assert counters(outputs, LANE)[:5] == [0, 0, 0, 1, 2]


def test_two_faults_that_freeze_one_counter_freeze_it_once():
    outputs = faulty(
        {"kind": "counter_frozen", "message": LANE, "times": 2}, {"kind": "counter_frozen", "times": 2}
    )
    last = counters(plain(), LANE)[FIRST - 1]
    assert counters(outputs, LANE)[FIRST : FIRST + 3] == [last, last, (last + 1) % 15]


def test_a_counter_that_jumps_goes_on_from_there():
    outputs = faulty({"kind": "counter_jumped", "message": LANE, "by": 6})
    found, without = counters(outputs, LANE), counters(plain(), LANE)
    assert found[:FIRST] == without[:FIRST]
    assert found[FIRST:] == [(counter + 6) % 15 for counter in without[FIRST:]]
    assert statuses(outputs, LANE) == ["wrong sequence"]
    assert is_valid_at_end(outputs, LANE)


def test_an_offset_counter_is_off_while_it_lasts():
    outputs = faulty({"kind": "counter_offset", "message": LANE, "by": -4, "times": 3})
    found, without = counters(outputs, LANE), counters(plain(), LANE)
    assert found[FIRST : FIRST + 3] == [(counter - 4) % 15 for counter in without[FIRST : FIRST + 3]]
    assert found[FIRST + 3 :] == without[FIRST + 3 :]
    assert statuses(outputs, LANE) == ["wrong sequence", "ok", "ok", "wrong sequence"]


def test_a_stuck_signal_holds_the_bits_it_had_under_a_right_crc():
    outputs = faulty({"kind": "signal_stuck", "signal": "LaneWidth", "for_s": 0.4})
    held = raws(data_of(plain(), LANE)[FIRST])["LaneWidth"]
    for index in range(FIRST, FIRST + 10):
        ours, theirs = raws(data_of(outputs, LANE)[index]), raws(data_of(plain(), LANE)[index])
        assert ours["LaneWidth"] == held
        assert {**ours, "LaneWidth": 0, "LaneCrc": 0} == {**theirs, "LaneWidth": 0, "LaneCrc": 0}
    assert any(raws(data_of(plain(), LANE)[index])["LaneWidth"] != held for index in range(FIRST, FIRST + 10))
    assert statuses(outputs, LANE) == []
    assert changed_ticks(outputs)[-1] < FIRST + 10


def test_a_signal_at_sna_has_its_value_for_not_available():
    outputs = faulty({"kind": "signal_sna", "signal": "LDS_Lane.LaneWidth", "times": 2})
    sna = plan(LANE).layout.signals["LaneWidth"].sna_raw
    found = [raws(data)["LaneWidth"] == sna for data in data_of(outputs, LANE)]
    assert found[FIRST - 1 : FIRST + 3] == [False, True, True, False]
    assert statuses(outputs, LANE) == []


def test_a_raw_value_that_no_table_has_goes_out_under_a_right_crc():
    signal = plan("LDS_Status").layout.signals["SensorState"]
    assert 7 not in signal.choices
    outputs = faulty({"kind": "signal_raw", "signal": "SensorState", "raw": 7, "times": 2})
    found = [raws(data, "LDS_Status")["SensorState"] for data in data_of(outputs, "LDS_Status")]
    assert found[FIRST - 1 : FIRST + 3] == [2, 7, 7, 2]
    assert statuses(outputs, "LDS_Status") == []


def test_a_signal_is_overridden_in_the_unit_of_the_bus_within_half_a_step():
    outputs = faulty({"kind": "signal_value", "signal": "LaneWidth", "value": 3.21, "times": 1})
    signal = plan(LANE).layout.signals["LaneWidth"]
    assert to_physical(signal, raws(data_of(outputs, LANE)[FIRST])["LaneWidth"]) == pytest.approx(
        3.21, abs=signal.scale / 2
    )


def test_an_overridden_quantity_is_sent_instead_of_the_sensors():
    outputs = faulty({"kind": "override", "quantity": "left.offset_m", "value": 1.2, "times": 3})
    assert [output.values["left.offset_m"] == 1.2 for output in outputs] == [
        FIRST <= index < FIRST + 3 for index in range(TICKS)
    ]
    signal = plan("LDS_LeftLine").layout.signals["LeftOffset"]
    raw = raws(data_of(outputs, "LDS_LeftLine")[FIRST], "LDS_LeftLine")["LeftOffset"]
    assert to_physical(signal, raw) == pytest.approx(1.2, abs=signal.scale / 2)


def test_the_bus_is_silent_while_the_controller_is_off_and_counters_run_on():
    outputs = faulty({"kind": "bus_off", "for_s": 0.08})
    assert [len(output.frames) for output in outputs][FIRST - 1 : FIRST + 3] == [13, 0, 0, 13]
    assert outputs[FIRST + 2].frames == plain()[FIRST + 2].frames
    assert statuses(outputs, LANE) == ["no new data", "no new data", "some lost"]


def test_a_frame_that_was_delayed_into_a_bus_off_never_leaves():
    outputs = faulty(
        {"kind": "frame_delayed", "message": LANE, "delay_ms": 50, "times": 1},
        {"kind": "bus_off", "at_s": 0.84, "for_s": 0.04},
    )
    assert sum(map(len, frames_of(outputs, LANE))) == TICKS - 2


def test_frames_that_a_fault_took_away_are_not_counted_as_sent():
    told = {"kind": "frame_lost", "times": 2}
    _, state = run(with_faults(told))
    assert state.transmit.frames == 13 * (TICKS - 2)


def test_after_a_fault_nothing_of_it_is_remembered():
    _, state = run(with_faults({"kind": "frame_delayed", "delay_ms": 70, "times": 2}))
    _, without = run(line())
    assert state.transmit == without.transmit
    assert state.faults.is_quiet
