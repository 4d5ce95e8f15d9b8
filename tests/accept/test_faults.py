"""Each fault is found under its name, with its count, and nothing else is."""

import pytest
from msgspec.structs import replace

from tests.accept.streams import CYCLE_NS, bits, found, spoiled, verdict
from tests.ecu.streams import (
    IDS,
    PLACES_M,
    burst_behind,
    counter_ahead,
    counter_at,
    crc_wrong,
    delayed,
    doubled,
    lane,
    lost,
    stream,
    truncated,
)
from vsensor.types import SensorMode, Side

LINE = "LDS_LeftLine"


def test_our_own_stream_is_accepted():
    assert found(stream(200)) == {}


def test_a_stream_that_is_heard_from_the_middle_of_one_burst_to_the_middle_of_another_is_accepted():
    assert found(stream(60)[5:-6]) == {}


# --- frames -------------------------------------------------------------------------------------------


def test_a_lost_frame_is_missing_and_leaves_its_image_incomplete():
    assert found(spoiled(lost)) == {("missing", LINE): 1, ("burst_incomplete", LINE): 1}


def test_every_lost_frame_is_counted():
    images = (10, 20, 21, 22, 40)
    assert found(spoiled(lost, images=images)) == {("missing", LINE): 5, ("burst_incomplete", LINE): 5}


def test_half_of_the_frames_lost_is_no_other_cycle():
    counts = found(spoiled(lost, images=range(1, 61, 2), of=80))
    assert counts == {("missing", LINE): 30, ("burst_incomplete", LINE): 30}


def test_lost_frames_are_told_with_the_time_of_the_silence_and_how_long_it_was():
    missing = next(f for f in verdict(spoiled(lost, images=(30, 31))).findings if f.kind == "missing")
    assert missing.first_ns == spoiled(lost, images=())[32 * 13 + 3].due_ns
    assert missing.worst == pytest.approx(120.0)
    assert missing.limit == pytest.approx(49.0)


def test_a_receiver_of_a_message_that_was_lost_for_long_does_not_trust_it():
    counts = found(spoiled(lost, images=range(20, 32)))
    assert counts.pop(("e2e_invalid", LINE)) == 1
    assert counts == {("missing", LINE): 12, ("burst_incomplete", LINE): 12}


def test_a_message_that_ends_in_the_middle_is_missing_to_the_end():
    counts = found(spoiled(lost, images=range(40, 60)))
    assert counts.pop(("e2e_invalid", LINE)) == 1
    assert counts.pop(("burst_incomplete", LINE)) == 19  # the last image may be cut
    assert counts == {("missing", LINE): 20}


def test_a_message_that_begins_late_is_missing_until_then():
    counts = found(spoiled(lost, images=range(20)))
    assert counts == {("missing", LINE): 20, ("burst_incomplete", LINE): 19}


def test_a_message_that_never_comes_is_told_once():
    assert found(spoiled(lost, images=range(60))) == {("never_heard", LINE): 1}


def test_nothing_on_the_bus_is_every_message_unheard():
    assert found([]) == {("never_heard", name): 1 for name in IDS}


def test_dropped_slots_are_missing_frames_of_all_messages_and_no_jump_of_their_counters():
    assert found(stream(60, skipped=(20, 21))) == {("missing", name): 2 for name in IDS}


def test_a_delayed_frame_is_late_and_out_of_order_but_not_missing():
    assert found(spoiled(delayed(20))) == {("late", LINE): 1, ("burst_order", LINE): 1}


def test_a_frame_that_is_late_at_the_very_end_is_not_missing():
    frames = spoiled(delayed(20), message="LDS_NextMarkings", images=(59,))
    assert found(frames) == {("late", "LDS_NextMarkings"): 1}


def test_a_doubled_frame_is_one_too_many():
    assert found(spoiled(doubled, images=(10, 30))) == {("extra", LINE): 2}


def test_a_truncated_frame_has_a_wrong_length():
    assert found(spoiled(truncated)) == {("wrong_length", LINE): 1}


def test_a_cycle_that_is_off_is_told_once_instead_of_every_late_frame():
    frames = stream(60)
    stretched = [replace(f, due_ns=f.due_ns + (f.due_ns - frames[0].due_ns) // 3) for f in frames]
    assert found(stretched) == {("wrong_cycle", name): 60 for name in IDS}


# --- protection ---------------------------------------------------------------------------------------


def test_a_wrong_crc_is_found_as_that():
    assert found(spoiled(crc_wrong)) == {("wrong_crc", LINE): 1}


def test_wrong_crcs_in_a_row_cost_the_receivers_trust_once():
    counts = found(spoiled(crc_wrong, images=range(20, 30)))
    assert counts == {("wrong_crc", LINE): 10, ("e2e_invalid", LINE): 1}


def test_a_counter_that_stands_is_repeated_frame_by_frame():
    # The counter of image 20 is 5. It stands at 5 for three more images and goes on with 9.
    counts = found(spoiled(counter_at(5), images=(21, 22, 23)))
    assert counts == {("counter_repeated", LINE): 3, ("counter_jumped", LINE): 1}


def test_a_counter_that_jumps_once_jumps_back_too():
    assert found(spoiled(counter_ahead(5))) == {("counter_jumped", LINE): 2}


def test_a_counter_with_an_offset_jumped_once():
    assert found(spoiled(counter_ahead(4), images=range(30, 60))) == {("counter_jumped", LINE): 1}


def test_a_lost_frame_does_not_hide_a_counter_that_jumps_further():
    def then(frame):
        return lost(frame) if frame.due_ns < 1_000_000_000_000 + 30.5 * CYCLE_NS else counter_ahead(4)(frame)

    counts = found(spoiled(then, images=range(30, 60)))
    assert counts[("counter_jumped", LINE)] == 1
    assert counts[("missing", LINE)] == 1


# --- images -------------------------------------------------------------------------------------------


def test_a_frame_of_another_image_mixes_the_burst():
    assert found(spoiled(burst_behind(1))) == {("burst_mixed", LINE): 1}


def test_frames_in_another_order_are_told():
    frames = stream(60)
    place = 30 * 13 + 3
    a, b = frames[place], frames[place + 1]
    frames[place : place + 2] = [replace(b, due_ns=a.due_ns), replace(a, due_ns=b.due_ns)]
    assert found(frames) == {("burst_order", LINE): 1}


def test_an_image_that_stands_while_the_counters_run_is_frozen():
    frozen = stream(60, lambda index: lane(min(index, 29) if index < 45 else index))
    counts = found(frozen)
    assert counts == {("image_frozen", "LDS_Image"): 2}  # index and timestamp


def test_an_image_that_stands_for_less_than_the_limit_is_not_frozen():
    held = stream(60, lambda index: lane(29 if 29 <= index < 34 else index))
    assert found(held) == {}
    assert found(held, frozen_ms=150.0) == {("image_frozen", "LDS_Image"): 2}


def test_an_image_index_that_falls_back_is_a_restart():
    restarted = stream(60, lambda index: lane(index % 40 + 100))
    assert found(restarted) == {("image_backwards", "LDS_Image"): 1}


# --- lines --------------------------------------------------------------------------------------------


def with_values(images, of=60, **changes):
    """Return a stream whose values differ in some images; `left__offset_m` is left.offset_m."""
    told = {name.replace("__", "."): value for name, value in changes.items()}
    return stream(of, lambda index: {**lane(index), **(told if index in images else {})})


def test_a_step_of_the_offset_is_a_jump_there_and_back():
    counts = found(with_values((30,), left__offset_m=2.75))
    assert counts == {("jump", LINE): 2}


def test_a_line_that_drifts_as_far_in_many_images_does_not_jump():
    drift = stream(60, lambda index: {**lane(index), "left.offset_m": 1.75 + 0.05 * index})
    assert found(drift) == {}


def test_a_lane_change_is_no_jump():
    def values(index):
        word = {"lane.change": 1.0} if index == 30 else {}
        return {**lane(index, centre_m=-1.7 if index < 30 else 1.8), **word}

    assert found(stream(60, values)) == {}
    assert ("jump", LINE) in found(stream(60, lambda index: {**values(index), "lane.change": 0.0}))


def test_a_signal_that_stands_while_its_line_moves_is_stuck():
    assert found(with_values(range(20, 50), left__heading=0.01)) == {("stuck", LINE): 1}


def test_a_signal_that_stands_for_fewer_images_is_not_stuck():
    assert found(with_values(range(20, 45), left__heading=0.01)) == {}


def test_a_line_that_stands_altogether_is_not_stuck():
    def still(index):
        return {**lane(7), "image.index": index, "image.timestamp_ms": 40 * index}

    assert found(stream(60, still)) == {}


def test_a_line_that_is_available_without_a_number_contradicts_itself():
    assert found(spoiled(bits(16, 16, 0x8000))) == {("contradiction", LINE): 1}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"left.available": 0.0}, "left not available, but left.offset_m is a number"),
        ({"left.quality": 0.0}, "left available, but its quality is 0"),
        ({"left.x_min_m": 99.0, "left.x_max_m": 50.0}, "left begins behind its end"),
        ({"left.offset_m": -1.9}, "left line is right of the right line"),
        ({"lane.width_m": 3.6}, "lane width is not left minus right lane offset"),
        ({"sensor.state": 4.0}, "left reported while the sensor sees nothing"),
    ],
)
def test_a_contradiction_is_told_as_a_sentence(changes, text):
    frames = stream(60, lambda index: {**lane(index), **changes} if index == 30 else lane(index))
    subjects = {f.subject: f.count for f in verdict(frames, offset_step_m=10.0).findings}
    assert subjects[text] == 1


@pytest.mark.parametrize(("name", "text"), [("measured", "measured"), ("quality", "has a quality")])
def test_what_a_line_that_is_not_there_still_says_contradicts_it(name, text):
    def gone(index):
        return lane(index, sides=[side for side in PLACES_M if side is not Side.LEFT])

    assert found(stream(60, gone)) == {}
    frames = stream(60, lambda index: {**gone(index), **({f"left.{name}": 1.0} if index == 30 else {})})
    (finding,) = verdict(frames).findings
    assert finding.kind == "contradiction"
    assert text in finding.subject


def test_a_sensor_that_is_blocked_and_says_so_is_accepted():
    def blocked(index):
        return lane(index, SensorMode.BLOCKED if 20 <= index < 40 else SensorMode.AVAILABLE)

    judgement = verdict(stream(60, blocked))
    assert judgement.is_accepted
    assert "images by the sensor's state: available 40, blocked 20" in judgement.remarks


def test_a_code_that_nobody_knows_is_out_of_range():
    assert found(spoiled(bits(16, 3, 7), message="LDS_Status")) == {("out_of_range", "LDS_Status"): 1}


def test_a_number_at_its_last_bit_is_a_remark():
    judgement = verdict(with_values((30,), lane__lateral_speed_mps=20.0))
    assert judgement.is_accepted
    assert any("LateralSpeed 1 times" in remark for remark in judgement.remarks)
