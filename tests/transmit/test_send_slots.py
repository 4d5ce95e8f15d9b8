"""Frames of a profile with every send type, slot by slot and image by image, and through the whole line."""

import numpy as np
import pytest

from tests.bus_values import boundary, ego, estimate
from vsensor.config import load_scenario
from vsensor.line import build_line
from vsensor.profile import load_profile
from vsensor.signals import VehicleConfig, values_from
from vsensor.transmit import Transmitter, initial_state, transmit, transmit_image
from vsensor.types import SensorMode, Side, Tick

MS = 1_000_000
IMAGE_MS = 40
VEHICLE = VehicleConfig()
DATABASE = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 1 First: 4 A
 SG_ Off : 7|16@0- (0.01,0) [0|0] "m" B
 SG_ Burst : 19|4@0+ (1,0) [0|15] "" B
 SG_ Cnt : 31|8@0+ (1,0) [0|255] "" B
BO_ 2 Late: 2 A
 SG_ LateOff : 0|16@1- (0.01,0) [0|0] "m" B
BO_ 3 Mode: 2 A
 SG_ State : 0|8@1+ (1,0) [0|0] "" B
 SG_ Index : 8|8@1+ (1,0) [0|0] "" B
BO_ 4 Alarm: 2 A
 SG_ Change : 0|8@1- (1,0) [0|0] "" B
BO_ 5 Last: 1 A
 SG_ Quality : 0|8@1+ (1,0) [0|0] "" B
"""
PROFILE = """schema = "vsensor.profile/1"
database = "own.dbc"
[groups.second]
messages = ["Late"]
phase_ms = 15
[messages.First]
cycle_ms = 40
[messages.First.signals]
Off = "left.offset_m"
Burst = { quantity = "image.index", wrap = true }
[messages.Late]
cycle_ms = 40
[messages.Late.signals]
LateOff = "left.offset_m"
[messages.Mode]
send = { type = "cyclic_and_on_change", cycle_ms = 100, repetitions = 1, repetition_ms = 5 }
[messages.Mode.signals]
State = "sensor.state"
Index = { quantity = "image.index", wrap = true }
[messages.Alarm]
send = { type = "if_active", fast_cycle_ms = 10, active = "left.offset_m > 2" }
[messages.Alarm.signals]
Change = "lane.change"
[messages.Last]
cycle_ms = 40
[messages.Last.signals]
Quality = "left.quality"
"""


@pytest.fixture
def transmitter(tmp_path):
    (tmp_path / "own.dbc").write_text(DATABASE)
    (tmp_path / "own.toml").write_text(PROFILE)
    return Transmitter(load_profile(tmp_path / "own.toml"), VEHICLE)


def values(index, offset_m=1.8, mode=SensorMode.AVAILABLE):
    return values_from(VEHICLE, estimate(boundary(Side.LEFT, [offset_m]), index=index), ego(), mode)


def image_tick(index):
    return Tick(index=index, t_ns=index * IMAGE_MS * MS, period_ns=IMAGE_MS * MS)


def sent(transmitter, story):
    """Return (ms, id) of all frames of a story of values, image by image."""
    state, frames = initial_state(transmitter), []
    for index, found in enumerate(story):
        state, more = transmit_image(transmitter, state, found, image_tick(index))
        frames += more
    return state, frames


def when(frames, arbitration_id):
    return [frame.due_ns // MS for frame in frames if frame.arbitration_id == arbitration_id]


def test_image_by_image_gives_the_frames_of_slot_by_slot(transmitter):
    rng = np.random.default_rng(5)
    story = [values(k, rng.choice([1.8, 2.5]), SensorMode(int(rng.integers(2, 4)))) for k in range(30)]
    period_ns = transmitter.slot_period_ns(IMAGE_MS * MS)
    state, frames, slots = initial_state(transmitter), [], IMAGE_MS * MS // period_ns
    for k in range(slots * len(story)):
        slot = Tick(index=k, t_ns=k * period_ns, period_ns=period_ns)
        state, more = transmit(transmitter, state, story[k // slots], slot)
        frames += more
    at_once, together = sent(transmitter, story)
    assert (slots, together) == (8, frames)
    assert (at_once.counters, at_once.messages) == (state.counters, state.messages)


def test_the_frames_of_an_image_leave_together_and_in_order_and_the_other_group_at_its_phase(transmitter):
    _, frames = sent(transmitter, [values(k) for k in range(3)])
    assert when(frames, 1) == when(frames, 5) == [0, 40, 80]
    assert when(frames, 2) == [15, 55, 95]
    assert [frame.arbitration_id for frame in frames if frame.due_ns == 0] == [1, 3, 5]


def test_a_change_is_sent_and_repeated_beside_the_cycle_but_a_new_image_is_no_change(transmitter):
    modes = [SensorMode.AVAILABLE] * 3 + [SensorMode.DEGRADED] * 3
    _, frames = sent(transmitter, [values(k, mode=mode) for k, mode in enumerate(modes)])
    assert when(frames, 3) == [0, 5, 100, 120, 125, 200]


def test_while_active_frames_leave_at_the_fast_cycle_and_once_when_it_ends(transmitter):
    _, frames = sent(transmitter, [values(k, 2.5 if k in (1, 2) else 1.8) for k in range(5)])
    assert when(frames, 4) == [40, 50, 60, 70, 80, 90, 100, 110, 120]


def test_all_frames_until_the_next_image_carry_the_same_values(transmitter):
    _, frames = sent(transmitter, [values(0, 1.8), values(1, 2.5)])
    read = transmitter.profile.decode
    assert [read(f)["left.offset_m"] for f in frames if f.arbitration_id in (1, 2)] == [1.8, 1.8, 2.5, 2.5]


def test_a_change_that_waits_for_the_minimum_delay_is_sent_though_it_was_taken_back(tmp_path):
    (tmp_path / "own.dbc").write_text(DATABASE)
    alone = """schema = "vsensor.profile/1"
    database = "own.dbc"
    messages.Late.send = { type = "on_change", min_delay_ms = 100 }
    messages.Late.signals = { LateOff = "left.offset_m" }
    """
    (tmp_path / "own.toml").write_text(alone)
    alone = Transmitter(load_profile(tmp_path / "own.toml"), VEHICLE)
    _, frames = sent(alone, [values(k, 2.5 if k == 1 else 1.8) for k in range(5)])
    assert when(frames, 2) == [0, 100]


def test_saturation_counts_images_not_slots(transmitter):
    state, _ = sent(transmitter, [values(0, 1000.0), values(1, 1000.0)])
    assert state.saturated == {"Off": 2, "LateOff": 2}


# ---- the whole line ----------------------------------------------------------------------------------


def line_with(**output):
    overrides = {"duration_s": 1, "output": output, "state": {"init_s": 0.0}, "seed": 3}
    return build_line(load_scenario("highway", overrides))


def run(line, ticks):
    """Return what each tick gave, every tick sent."""
    state, computed = line.initial_state(), []
    for index in range(ticks):
        computed.append(line.compute(state, image_tick(index)))
        state = computed[-1].state_if_sent
    return computed


def read(line, output):
    found = {}
    for frame in output.frames:
        found |= line.profile.decode(frame, check=True)
    return found


def test_with_a_latency_of_whole_ticks_the_same_frames_leave_that_much_later():
    plain, late = line_with(), line_with(latency_ms=80)
    before = [read(plain, computed.output) for computed in run(plain, 8)]
    after = [read(late, computed.output) for computed in run(late, 10)]
    assert [found["sensor.state"] for found in after[:2]] == [SensorMode.INIT] * 2
    assert after[2:] == before


def test_a_latency_stands_in_the_time_stamp_to_the_millisecond():
    line = line_with(latency_ms=50)
    found = [read(line, computed.output) for computed in run(line, 5)]
    assert [values["image.timestamp_ms"] for values in found[2:]] == [30, 70, 110]
    assert [values["image.index"] for values in found[2:]] == [1, 2, 3]


def test_a_dropped_slot_keeps_the_images_on_their_way():
    line = line_with(latency_ms=80)
    computed = line.compute(line.initial_state(), image_tick(0))
    assert len(computed.state_if_dropped.images) == 1
    assert computed.state_if_dropped.transmit == line.initial_state().transmit
