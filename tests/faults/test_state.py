"""Faults as values: same commands, same frames; a run restarts in the middle of them; clearing ends them."""

import pickle
from dataclasses import replace

import pytest

from tests.faults.runs import FIRST, TICKS, counters, faulty, frames_of, line, plain, run, tick, with_faults
from vsensor.faults import KINDS, Clear, Inject, fault_of

TOLD = {
    "frame_lost": {"message": "LDS_Lane"},
    "frame_delayed": {"delay_ms": 55.0},
    "frame_doubled": {},
    "frame_truncated": {},
    "crc_wrong": {},
    "counter_frozen": {},
    "counter_jumped": {"by": 3},
    "counter_offset": {"by": -2},
    "signal_stuck": {"signal": "LaneWidth"},
    "signal_sna": {"signal": "LaneWidth"},
    "signal_raw": {"signal": "SensorState", "raw": 7},
    "signal_value": {"signal": "LaneWidth", "value": 2.0},
    "override": {"quantity": "lane.width_m", "value": 4.0},
    "line_lost": {"line": "left"},
    "ghost_line": {"line": "left", "offset_m": 1.0},
    "line_kind": {"marking": "curb"},
    "line_colour": {"colour": "red"},
    "image_frozen": {},
    "sensor_blocked": {},
    "sensor_failed": {},
    "reset": {},
    "bus_off": {},
}
"""One fault of each kind that shows on the bus."""

EVERY_KIND = pytest.mark.parametrize("kind", sorted(KINDS))


def told(kind, **more):
    return {"kind": kind, **TOLD[kind], **more}


def frames(outputs):
    return [output.frames for output in outputs]


def inject(kind, **more):
    return Inject(fault_of(told(kind, **more), line().profile))


@EVERY_KIND
def test_every_kind_shows_on_the_bus_and_not_before_its_time(kind):
    ours, theirs = frames(faulty(told(kind))), frames(plain())
    assert ours[:FIRST] == theirs[:FIRST]
    assert ours[FIRST:] != theirs[FIRST:]


@EVERY_KIND
def test_a_run_restarted_in_the_middle_of_a_fault_goes_on_bit_for_bit(kind):
    of = with_faults(told(kind))
    whole, _ = run(of)
    _, state = run(of, ticks=FIRST + 2)
    rest, _ = run(of, state=pickle.loads(pickle.dumps(state)), first=FIRST + 2)
    assert frames(rest) == frames(whole[FIRST + 2 :])


@EVERY_KIND
def test_an_injected_fault_does_what_one_of_the_timeline_does(kind):
    injected, _ = run(line(), commands={FIRST: [inject(kind)]})
    assert frames(injected) == frames(faulty(told(kind)))


@EVERY_KIND
def test_a_fault_that_is_cleared_before_it_begins_never_happens(kind):
    injected, _ = run(line(), commands={3: [inject(kind, at_s=0.8)], 9: [Clear(number=0)]})
    assert frames(injected) == frames(plain())


@EVERY_KIND
def test_a_fault_planned_for_later_changes_nothing_meanwhile(kind):
    assert frames(faulty(told(kind, at_s=100.0))) == frames(plain())


LASTING = {"counter_jumped", "sensor_failed", "reset"}  # what they did stays
DRAWN_ANEW = {"sensor_blocked"}  # the errors of lines that were away are


@pytest.mark.parametrize("kind", sorted(set(KINDS) - LASTING - DRAWN_ANEW))
def test_a_fault_that_is_cleared_ends_at_once(kind):
    """Only the counters may have stood meanwhile."""
    outputs, state = run(line(), commands={FIRST: [inject(kind)], FIRST + 5: [Clear()]})
    after, without = outputs[FIRST + 7 :], plain()[FIRST + 7 :]
    if kind == "counter_frozen":
        assert counters(outputs, "LDS_Lane")[FIRST + 5] == counters(plain(), "LDS_Lane")[FIRST]
    elif kind != "frame_delayed":  # two delayed ones are still on their way
        assert frames(after) == frames(without)
    assert state.faults.is_quiet


def test_clearing_leaves_what_is_still_to_come():
    commands = {FIRST: [inject("frame_lost"), inject("crc_wrong", at_s=1.2)], FIRST + 2: [Clear()]}
    outputs, _ = run(line(), commands=commands)
    lost = [index for index, found in enumerate(frames_of(outputs, "LDS_Lane")) if not found]
    assert lost == [FIRST, FIRST + 1]
    assert frames(outputs)[FIRST + 2 : FIRST + 10] == frames(plain())[FIRST + 2 : FIRST + 10]
    assert frames(outputs)[FIRST + 10] != frames(plain())[FIRST + 10]


def test_clearing_by_number_ends_that_one_alone():
    commands = {FIRST: [inject("frame_lost"), inject("crc_wrong")], FIRST + 2: [Clear(number=0)]}
    _, state = run(line(), ticks=FIRST + 4, commands=commands)
    assert [running.number for running in state.faults.running] == [1]


def test_a_time_that_has_passed_means_now():
    outputs, _ = run(line(), commands={FIRST: [inject("frame_lost", at_s=0.1, for_s=0.08)]})
    lost = [index for index, found in enumerate(frames_of(outputs, "LDS_Lane")) if not found]
    assert lost == [FIRST, FIRST + 1]


def test_a_slot_that_was_dropped_uses_up_no_fault_of_frames():
    of = with_faults({"kind": "frame_lost", "message": "LDS_Lane", "times": 2})
    _, state = run(of, ticks=FIRST)
    state = of.compute(state, tick(FIRST)).state_if_dropped
    outputs, _ = run(of, state=state, first=FIRST + 1)
    assert [len(found) for found in frames_of(outputs, "LDS_Lane")][:3] == [0, 0, 1]


def test_frames_that_were_to_leave_in_a_dropped_slot_do_not_leave_later():
    of = with_faults({"kind": "frame_delayed", "message": "LDS_Lane", "delay_ms": 50, "times": 1})
    _, state = run(of, ticks=FIRST + 1)
    state = of.compute(state, tick(FIRST + 1)).state_if_dropped
    outputs, _ = run(of, state=state, first=FIRST + 2)
    assert [len(found) for found in frames_of(outputs, "LDS_Lane")] == [1] * (TICKS - FIRST - 2)


def test_nothing_is_heard_while_the_controller_is_off():
    heard = []
    of = with_faults({"kind": "bus_off", "for_s": 0.08})

    class Ears:
        def initial_state(self):
            return None

        def advance(self, state, tick, inputs):
            heard.append(len(inputs))
            return of.source.advance(None, tick, ())

    frame, ears = plain()[0].frames[0], replace(of, source=Ears())
    state = ears.initial_state()
    for index in range(FIRST + 4):
        state = ears.compute(state, tick(index), (frame,)).state_if_sent
    assert heard == [1] * FIRST + [0, 0, 1, 1]
