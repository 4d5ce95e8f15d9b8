"""Faults on other layouts: members of a burst, pages that rotate, messages sent on change, CAN FD."""

from dataclasses import replace

import pytest

from tests.bus_values import slot
from tests.made_profiles import VEHICLE, profile_of, raws, values
from tests.profile.test_bursts import DBC, TEXT, images_of
from tests.profile.test_pages import LINES, PAGES
from vsensor.errors import ConfigError
from vsensor.faults import Running, fault_of
from vsensor.profile import load_profile
from vsensor.transmit import Transmitter, initial_state, transmit_image


def sent(profile, found, *told, first=2):
    """Return the frames of each slot for a list of values; the faults begin with slot `first`."""
    transmitter = Transmitter(profile, VEHICLE)
    faults = [
        Running(number=n, fault=fault_of(one, profile), from_ns=slot(first).t_ns, until_ns=None)
        for n, one in enumerate(told)
    ]
    state, slots = initial_state(transmitter), []
    for index, one in enumerate(found):
        state, frames = transmit_image(transmitter, state, one, slot(index), faults)
        slots.append(frames)
    return slots


def moving(count):
    """Return the values of so many images, the left line a step of the bus farther in each."""
    return [{**values(), "image.index": float(k), "left.offset_m": 1.0 + 0.02 * k} for k in range(count)]


# ---- bursts ----------------------------------------------------------------------------------------


@pytest.fixture
def burst(tmp_path):
    return profile_of(tmp_path, DBC, TEXT)


def faults_of_images(profile, slots):
    return [image.fault for frames in slots for image in images_of(profile, frames)]


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"kind": "frame_lost", "message": "C"}, "1 of 8 frames missing: C"),
        ({"kind": "frame_lost", "message": "Seal"}, "1 of 8 frames missing: Seal"),
        ({"kind": "frame_truncated", "message": "C"}, "1 of 8 frames missing: C"),
    ],
)
def test_a_member_of_a_burst_that_is_lost_is_missed(burst, told, said):
    slots = sent(burst, moving(4), {**told, "times": 1})
    assert faults_of_images(burst, slots) == ["", "", said, ""]


def test_a_wrong_crc_of_the_frame_with_the_seal_is_the_frames_own(burst):
    slots = sent(burst, moving(4), {"kind": "crc_wrong", "message": "Seal", "times": 1})
    assert "Seal: wrong CRC" in faults_of_images(burst, slots)


def test_without_a_crc_of_its_own_the_checksum_of_the_burst_is_wrong(tmp_path):
    profile = profile_of(
        tmp_path, DBC, TEXT.replace(', profile = "crc8_2f"', "").replace('crc = "Crc", ', "")
    )
    slots = sent(profile, moving(4), {"kind": "crc_wrong", "times": 1})
    assert faults_of_images(profile, slots) == ["", "", "wrong checksum over the burst", ""]


def test_a_wrong_signal_in_a_member_is_under_the_checksum_of_the_burst(burst):
    slots = sent(burst, moving(4), {"kind": "signal_raw", "signal": "C.Off", "raw": 100, "times": 1})
    assert [raws(burst, frames)[2]["Off"] == 100 for frames in slots] == [False, False, True, False]
    assert faults_of_images(burst, slots) == [""] * 4


def test_a_wrong_burst_id_in_one_member_tears_the_burst(burst):
    slots = sent(burst, moving(4), {"kind": "signal_raw", "signal": "C.Id", "raw": 7, "times": 1})
    found = faults_of_images(burst, slots)
    assert (found[:2], found[-1]) == (["", ""], "")
    assert any(found[2:-1])


def test_a_signal_that_several_messages_have_wants_its_message(burst):
    with pytest.raises(ConfigError, match=r"signal = 'Off': is in A and B; say which, as MESSAGE\.Off"):
        fault_of({"kind": "signal_stuck", "signal": "Off"}, burst)


# ---- pages -----------------------------------------------------------------------------------------


def test_a_signal_of_one_page_is_spoiled_where_it_is_and_counted_there_alone(tmp_path):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux="rotate"))
    plain = sent(profile, moving(12))
    (plan,) = profile.messages
    muxed = next(s for s in plan.layout.signals.values() if s.mux_signal is not None and s.raw_max > 3)
    told = {"kind": "signal_raw", "signal": muxed.name, "raw": 3, "times": 2}
    slots = sent(profile, moving(12), told)
    wrong = [k for k, (ours, theirs) in enumerate(zip(slots, plain, strict=True)) if ours != theirs]
    here = [k for k, frames in enumerate(slots) if muxed.name in raws(profile, frames)[0]]
    assert wrong == [k for k in here if k >= 2][:2]
    assert [raws(profile, slots[k])[0][muxed.name] for k in wrong] == [3, 3]


def test_a_frozen_counter_does_not_stop_the_pages(tmp_path):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux="rotate"))
    (plan,) = profile.messages
    muxer = next(iter(plan.layout.muxers))
    slots = sent(profile, moving(8), {"kind": "counter_frozen"})
    turns = [raws(profile, frames)[0][muxer] for frames in slots]
    assert turns == [raws(profile, frames)[0][muxer] for frames in sent(profile, moving(8))]
    assert len({plan.guard.counter(frames[0].data) for frames in slots[1:]}) == 1


# ---- messages that are sent on change --------------------------------------------------------------

ON_CHANGE = '[messages.A]\nsend = { type = "on_change" }\nsignals = { Off = "left.offset_m" }\n'


@pytest.fixture
def changing(tmp_path):
    return profile_of(tmp_path, DBC, ON_CHANGE)


def test_a_wrong_signal_is_a_change(changing):
    still = [moving(1)[0]] * 6
    assert [len(frames) for frames in sent(changing, still)] == [1, 0, 0, 0, 0, 0]
    slots = sent(changing, still, {"kind": "signal_raw", "signal": "Off", "raw": 5})
    assert [len(frames) for frames in slots] == [1, 0, 1, 0, 0, 0]
    assert raws(changing, slots[2])[0]["Off"] == 5


def test_a_stuck_signal_changes_no_more(changing):
    slots = sent(changing, moving(6), {"kind": "signal_stuck", "signal": "Off"})
    assert [len(frames) for frames in slots] == [1, 1, 1, 0, 0, 0]


# ---- CAN FD, several slots in an image -------------------------------------------------------------


@pytest.mark.parametrize(("length", "left"), [(47, 32), (31, 24), (9, 8), (8, 8), (5, 5)])
def test_a_truncated_can_fd_frame_has_a_length_that_can_fd_has(length, left):
    profile = load_profile("native_fd")
    told = {"kind": "frame_truncated", "message": "LDS_FdLines", "length": length}
    slots = sent(profile, [values()] * 3, told)
    number = next(p.layout.arbitration_id for p in profile.messages if p.layout.name == "LDS_FdLines")
    assert [len(f.data) for f in slots[2] if f.arbitration_id == number] == [left]


def test_a_fault_begins_and_ends_with_the_slot_and_not_with_the_image(tmp_path):
    profile = profile_of(tmp_path, DBC, '[messages.A]\ncycle_ms = 10\nsignals = { Off = "left.offset_m" }\n')
    transmitter = Transmitter(profile, VEHICLE)
    running = Running(
        number=0, fault=fault_of({"kind": "frame_lost"}, profile), from_ns=10_000_000, until_ns=30_000_000
    )
    _, frames = transmit_image(transmitter, initial_state(transmitter), values(), slot(0), [running])
    assert [frame.due_ns for frame in frames] == [0, 30_000_000]


def test_a_delayed_frame_may_arrive_between_the_slots_of_an_image(tmp_path):
    profile = profile_of(tmp_path, DBC, '[messages.A]\ncycle_ms = 10\nsignals = { Off = "left.offset_m" }\n')
    transmitter = Transmitter(profile, VEHICLE)
    fault = fault_of({"kind": "frame_delayed", "delay_ms": 13, "times": 1}, profile)
    running = Running(number=0, fault=replace(fault), from_ns=0, until_ns=None)
    _, frames = transmit_image(transmitter, initial_state(transmitter), values(), slot(0), [running])
    assert [frame.due_ns // 1_000_000 for frame in frames] == [10, 13, 20, 30]


def test_a_signal_of_a_page_that_is_never_sent_cannot_be_spoiled(tmp_path):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux="rotate"))
    with pytest.raises(ConfigError, match=r"signal = M\.Rest: is in no frame that is sent"):
        fault_of({"kind": "signal_stuck", "signal": "Rest"}, profile)
