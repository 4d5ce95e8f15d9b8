"""Repaired streams in front of a strict receiver: seams, seeks, speeds, lost and changed frames."""

import numpy as np
import pytest
from msgspec.structs import replace

from tests.accept.streams import found
from tests.ecu.streams import IDS, stream
from tests.replay.repairing import NATIVE, faster, later, looped, repaired, told, values_of

IMAGES = 28
GOOD = stream(IMAGES)


def without(frames, message, images):
    """The frames without those of a message in some images."""
    kept, seen = [], -1
    for frame in frames:
        mine = frame.arbitration_id == IDS[message]
        seen += mine
        if not (mine and seen in images):
            kept.append(frame)
    return kept


def steps(frames, quantity, states):
    return (np.diff(values_of(NATIVE, frames, quantity)) % states).tolist()


def test_a_good_log_is_sent_bit_by_bit_as_it_is():
    assert repaired(GOOD) == GOOD


def test_a_loop_is_refused_by_a_strict_receiver_as_it_is_and_accepted_when_repaired():
    frames = looped(GOOD, 3, IMAGES)
    assert {kind for kind, _ in found(frames)} >= {"counter_jumped", "image_backwards"}
    assert found(repaired(frames)) == {}


def test_index_and_milliseconds_go_on_over_a_seam_without_a_jump_or_a_repeat():
    sent = repaired(looped(GOOD, 3, IMAGES))
    assert set(steps(sent, "image.index", 1 << 16)) == {1}
    assert set(steps(sent, "image.timestamp_ms", 1 << 32)) == {40}


@pytest.mark.parametrize("images", [16, 17, 18, 31])
def test_a_seam_at_which_the_narrow_index_happens_to_fit_is_none_the_less_one_step(images):
    """The burst id has 4 bits: after 16 images it is the same again, after 18 it is two further."""
    sent = repaired(looped(stream(images), 3, images))
    assert set(steps(sent, "image.index", 1 << 16)) == {1}
    assert found(sent) == {}


@pytest.mark.parametrize("place", [4, 11, 22, 26])
def test_a_seek_ahead_and_one_back_are_accepted(place):
    ahead = [*GOOD[: 13 * 8], *later(GOOD[13 * place :], 40 * (8 - place))]
    assert found(repaired(ahead)) == {}


@pytest.mark.parametrize("speed", [0.1, 0.5, 2.0, 10.0])
def test_milliseconds_follow_the_replays_own_time(speed):
    sent = repaired(faster(looped(GOOD, 2, IMAGES), speed), speed=speed)
    took_ms = np.diff(values_of(NATIVE, sent, "image.timestamp_ms")).sum()
    assert took_ms == pytest.approx(40 * (2 * IMAGES - 1) / speed, abs=21)
    assert set(steps(sent, "image.index", 1 << 16)) == {1}
    assert found(faster(sent, 1 / speed)) == {}  # its cycle apart, which is the speed's


def test_the_counter_of_a_message_goes_on_when_a_frame_of_it_is_left_out():
    sent = repaired(without(GOOD, "LDS_Lane", (7, 8, 20)))
    mine = [f for f in sent if f.arbitration_id == IDS["LDS_Lane"]]
    guard = next(plan.guard for plan in NATIVE.messages if plan.layout.name == "LDS_Lane")
    counters = [guard.counter(frame.data) for frame in mine]
    assert set((np.diff(counters) % guard.counter_states).tolist()) == {1}
    assert all(guard.check(frame.data) for frame in mine)


def test_an_image_that_is_left_out_altogether_is_left_out_of_the_index():
    kept = [f for k, f in enumerate(GOOD) if k // 13 not in (7, 8)]
    assert steps(repaired(kept), "image.index", 1 << 16) == [1] * 6 + [3] + [1] * (IMAGES - 10)


def test_all_frames_of_an_image_share_its_index_whichever_of_them_comes_first():
    order = [GOOD[13 * k + (place + 5) % 13] for k in range(IMAGES) for place in range(13)]
    swapped = [replace(f, due_ns=g.due_ns) for f, g in zip(order, GOOD, strict=True)]
    sent = repaired(looped(swapped, 2, IMAGES))
    bursts = [int.from_bytes(frame.data, "little") for frame in sent]
    assert len(sent) == len(bursts) == 2 * len(GOOD)
    for k in range(2 * IMAGES):
        ties = {tie_of(frame) for frame in sent[13 * k : 13 * k + 13]}
        assert ties == {k % 16}


def tie_of(frame):
    plan = NATIVE.by_id[frame.arbitration_id, False]
    name = next(b.signal.name for b in plan.bindings if b.quantity == "image.index" and b.wrap == 16)
    signal = plan.layout.signals[name]
    return int.from_bytes(frame.data, "little") >> signal.shift & 15


def test_a_changed_frame_is_right_again_and_told():
    changed = [replace(f, data=f.data[:-1] + b"\x55") if k == 13 * 5 + 2 else f for k, f in enumerate(GOOD)]
    assert ("wrong_crc", "LDS_Lane") in found(changed)
    assert ("wrong_crc", "LDS_Lane") not in found(repaired(changed))
    assert any("1 frames had a wrong checksum" in line and "LDS_Lane 1" in line for line in told(changed))


def test_a_frame_that_is_wrong_in_the_log_can_stay_so():
    changed = [replace(f, data=f.data[:-1] + b"\x55") if k == 13 * 5 + 2 else f for k, f in enumerate(GOOD)]
    sent = repaired(changed, keep_wrong=True)
    assert sent == changed


def test_a_sensor_seen_on_two_channels_has_two_sets_of_counters():
    frames = [g for f in GOOD for g in (f, replace(f, channel=1))]
    assert repaired(frames) == frames


def test_what_is_not_repaired_is_listed_with_its_reason():
    short = replace(GOOD[3], data=GOOD[3].data[:5])
    long = replace(GOOD[13], data=GOOD[13].data + b"\x00")
    foreign = replace(GOOD[0], arbitration_id=0x7AB)
    remote = replace(GOOD[0], is_remote=True, data=b"")
    lines = "\n".join(told([short, long, foreign, foreign, remote]))
    assert "2 frames of 1 ids that no profile has: 0x7AB 2" in lines
    assert "1 frames shorter than their message" in lines
    assert "LDS_LeftLine 1" in lines
    assert "LDS_Image" in lines
    assert "not in the log" in lines


def test_what_a_frame_measures_is_the_logs():
    """Only counters, checksums, index and milliseconds are written."""
    before = values_of(NATIVE, GOOD, "left.offset_m")
    assert values_of(NATIVE, repaired(looped(GOOD, 2, IMAGES)), "left.offset_m") == before * 2
