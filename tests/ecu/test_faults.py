"""What an ECU that is not ours finds: nothing in a good stream, each fault under its own name."""

import math
import subprocess

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.ecu import streams
from tests.ecu.building import built_ecu, found, report_on
from tests.ecu.streams import changed, lane, stream
from vsensor.types import SensorMode, Side

IMAGES = 60
GOOD = stream(IMAGES)
LEFT = "LDS_LeftLine"


def overridden(images, **quantities):
    """Return values in which some images have other quantities (dots written as two underscores)."""
    names = {name.replace("__", "."): value for name, value in quantities.items()}
    return lambda index: lane(index) | (names if index in images else {})


def blocked(index):
    return lane(index, mode=SensorMode.BLOCKED if index in range(30, 40) else SensorMode.AVAILABLE)


def without_left(index):
    return lane(index, sides=(Side.RIGHT, Side.NEXT_RIGHT) if 30 <= index < 40 else tuple(streams.PLACES_M))


def reset():
    """Return a stream in which the sensor starts again after image 33: counters and index from 0."""
    before = [frame for frame in GOOD if streams.image_of(frame) < 34]
    return before + streams.later(stream(30), 34)


CASES = {
    "good": (GOOD, {}),
    "two slots dropped by the sensor": (stream(IMAGES, skipped=(30, 31)), {}),
    "late within its cycle": (changed(GOOD, LEFT, {30}, streams.delayed(30)), {}),
    "frame lost": (changed(GOOD, LEFT, {30}, streams.lost), {"counter_lost": 1, "burst_incomplete": 1}),
    "two lost, within the timeout": (
        changed(GOOD, LEFT, {30, 31}, streams.lost),
        {"counter_lost": 2, "burst_incomplete": 2},
    ),
    "three lost": (
        changed(GOOD, LEFT, {30, 31, 32}, streams.lost),
        {"counter_lost": 3, "burst_incomplete": 3, "timeout": 1},
    ),
    "all silent for ten cycles": (
        changed(GOOD, None, range(30, 40), streams.lost),
        {"counter_lost": 130, "timeout": 13},
    ),
    "ten slots dropped by the sensor": (stream(IMAGES, skipped=range(30, 40)), {"timeout": 13}),
    "frame overtaken by the next one": (
        changed(GOOD, LEFT, {30}, streams.delayed(50)),
        {"counter_lost": 2, "counter_wrong_sequence": 1, "burst_incomplete": 2},
    ),
    "frame doubled": (changed(GOOD, LEFT, {30}, streams.doubled), {"counter_repeated": 1}),
    "frame truncated": (
        changed(GOOD, LEFT, {30}, streams.truncated),
        {"length": 1, "counter_lost": 1, "burst_incomplete": 1},
    ),
    "CRC wrong": (
        changed(GOOD, LEFT, {30}, streams.crc_wrong),
        {"crc": 1, "counter_lost": 1, "burst_incomplete": 1},
    ),
    "CRC wrong four times: invalid until five good ones have come": (
        changed(GOOD, LEFT, range(30, 34), streams.crc_wrong),
        {"crc": 4, "counter_lost": 4, "e2e_invalid": 1, "burst_incomplete": 8},
    ),
    "counter frozen": (
        changed(GOOD, LEFT, range(31, 34), streams.counter_at(30 % 15)),
        {"counter_repeated": 3, "counter_wrong_sequence": 1, "e2e_invalid": 1, "burst_incomplete": 8},
    ),
    "counter jumped ahead by five, for good": (
        changed(GOOD, LEFT, range(30, IMAGES), streams.counter_ahead(5)),
        {"counter_wrong_sequence": 1, "burst_incomplete": 2},
    ),
    "counter at its forbidden value": (
        changed(GOOD, LEFT, {30}, streams.counter_at(15)),
        {"counter_wrong_sequence": 1, "counter_lost": 1, "burst_incomplete": 1},
    ),
    "frame of another image in the burst": (
        changed(GOOD, LEFT, {30}, streams.burst_behind(1)),
        {"burst_mismatch": 1, "burst_incomplete": 1},
    ),
    "image frozen while counters run": (
        stream(IMAGES, lambda index: lane(min(index, 29) if index < 35 else index)),
        {"image_frozen": 5},
    ),
    "only the index of the image frozen": (
        stream(IMAGES, overridden(range(30, 35), image__index=29)),
        {"image_frozen": 5},
    ),
    "only the time of the image frozen": (
        stream(IMAGES, overridden(range(31, 35), image__timestamp_ms=30 * 40.0)),
        {"image_frozen": 4},
    ),
    "sensor starts again": (
        reset(),
        {"image_backwards": 1, "counter_wrong_sequence": 13},
    ),
    "signal stuck": (stream(IMAGES, overridden(range(20, 50), left__offset_m=1.75)), {"signal_stuck": 1}),
    "line jumps aside and back": (
        stream(IMAGES, overridden(range(30, 40), left__offset_m=2.6)),
        {"implausible_jump": 2},
    ),
    "available line without a number": (
        stream(IMAGES, overridden(range(30, 33), left__offset_m=math.nan)),
        {"contradiction": 3},
    ),
    "lines crossed": (
        stream(IMAGES, overridden({30}, left__offset_m=-1.75, right__offset_m=1.75)),
        {"contradiction": 1, "implausible_jump": 4},
    ),
    "lines while the sensor says blocked": (
        stream(IMAGES, overridden(range(30, 33), sensor__state=float(SensorMode.BLOCKED))),
        {"contradiction": 3, "sensor_not_ready": 1},
    ),
    "line lost": (stream(IMAGES, without_left), {"left_not_available": 1}),
    "sensor blocked": (stream(IMAGES, blocked), {"sensor_not_ready": 1}),
}


@pytest.mark.parametrize("case", CASES)
def test_each_fault_is_found_under_its_name_and_nothing_else_is(case, tmp_path):
    frames, expected = CASES[case]
    assert found(report_on(frames, tmp_path)) == expected


@pytest.mark.parametrize("name", streams.IDS)
def test_a_lost_frame_of_any_message_is_counted_for_that_message(name, tmp_path):
    report = report_on(changed(GOOD, name, {30}, streams.lost), tmp_path)
    assert report["by_message"] == {name: {"counter_lost": 1}}
    assert report["errors"]["burst_incomplete"] == 1


@settings(max_examples=40, deadline=None)
@given(number=st.integers(0, len(GOOD) - 14), bit=st.integers(0, 63))
def test_no_flipped_bit_goes_unnoticed(number, bit, tmp_path_factory):
    frame = GOOD[number]
    data = bytearray(frame.data)
    data[bit // 8] ^= 1 << bit % 8
    spoiled = [*GOOD[:number], streams.replace(frame, data=bytes(data)), *GOOD[number + 1 :]]
    report = report_on(spoiled, tmp_path_factory.mktemp("bit"))
    assert report["errors"]["crc"] == 1


def test_the_log_of_errors_names_time_message_and_value(tmp_path):
    report = report_on(changed(GOOD, LEFT, {30, 31}, streams.lost), tmp_path)
    first = report["log"][0]
    assert first["error"] == "burst_incomplete"
    lost = next(entry for entry in report["log"] if entry["error"] == "counter_lost")
    assert lost.pop("t_s") == pytest.approx(32 * 0.04 + 3 * 0.00025, abs=5e-4)  # written to the millisecond
    assert lost == {"error": "counter_lost", "message": LEFT, "value": 2}


def test_the_log_of_errors_is_bounded_and_says_what_it_left_out(tmp_path):
    report = report_on(changed(stream(300), None, range(10, 290), streams.crc_wrong), tmp_path)
    assert len(report["log"]) == 200
    assert report["log_left_out"] > 3000
    assert report["errors"]["crc"] == 280 * 13


def test_frames_of_others_are_left_alone(tmp_path):
    foreign = streams.replace(GOOD[100], arbitration_id=0x123, data=bytes(8))
    report = report_on([*GOOD, foreign], tmp_path)
    assert report["frames_of_others"] == 1
    assert found(report) == {}


def test_a_line_that_is_no_frame_is_refused_by_its_number(tmp_path):
    log = tmp_path / "bad.log"
    log.write_text("(1.000000) vcan0 320#0011223344556677\nnonsense\n")
    done = subprocess.run([built_ecu() / "ecu", "--log", log], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == f"ecu: {log}: line 2 is no frame as candump -L writes it\n"
