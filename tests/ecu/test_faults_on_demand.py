"""Faults injected into the sensor, judged by the ECU: each under its name, and nothing of it afterwards."""

from collections import Counter

import pytest
from msgspec.structs import replace

from tests.ecu.building import found, report_on
from tests.ecu.streams import BETWEEN_NS, START_NS
from tests.faults.runs import run, with_faults
from vsensor.faults import KINDS

TICKS = 70  # the faults begin with tick 20
LEFT = "LDS_LeftLine"
AT_START = {"left_not_available": 1, "right_not_available": 1}
"""Lines are confirmed after some images."""

CASES = [
    ({"kind": "frame_lost", "message": LEFT, "times": 1}, {"counter_lost": 1, "burst_incomplete": 1}),
    (
        {"kind": "frame_lost", "message": LEFT, "times": 3},
        {"counter_lost": 3, "burst_incomplete": 3, "timeout": 1},
    ),
    (
        {"kind": "frame_delayed", "message": LEFT, "delay_ms": 50, "times": 1},
        {"counter_lost": 2, "counter_wrong_sequence": 1, "burst_incomplete": 2},
    ),
    ({"kind": "frame_delayed", "message": LEFT, "delay_ms": 30, "times": 1}, {}),
    ({"kind": "frame_doubled", "message": LEFT, "times": 1}, {"counter_repeated": 1}),
    (
        {"kind": "frame_truncated", "message": LEFT, "times": 1},
        {"length": 1, "counter_lost": 1, "burst_incomplete": 1},
    ),
    (
        {"kind": "crc_wrong", "message": LEFT, "times": 1},
        {"crc": 1, "counter_lost": 1, "burst_incomplete": 1},
    ),
    (
        {"kind": "counter_frozen", "message": LEFT, "times": 3},
        {"counter_repeated": 3, "e2e_invalid": 1, "burst_incomplete": 7},
    ),
    (
        {"kind": "counter_jumped", "message": LEFT, "by": 5},
        {"counter_wrong_sequence": 1, "burst_incomplete": 2},
    ),
    (
        {"kind": "counter_offset", "message": LEFT, "by": 5, "times": 3},
        {"counter_wrong_sequence": 2, "burst_incomplete": 4},
    ),
    ({"kind": "signal_stuck", "signal": "LeftOffset", "for_s": 1.6}, {"signal_stuck": 1}),
    ({"kind": "signal_sna", "signal": "LeftOffset", "times": 3}, {"contradiction": 3}),
    (
        {"kind": "signal_raw", "signal": "SensorState", "raw": 7, "times": 3},
        {"contradiction": 3, "sensor_not_ready": 1},
    ),
    (
        {"kind": "signal_value", "signal": "LeftAvailable", "value": 0, "times": 3},
        {"contradiction": 3, "left_not_available": 1},
    ),
    ({"kind": "override", "quantity": "left.quality", "value": 0, "times": 4}, {"contradiction": 4}),
    ({"kind": "line_lost", "line": "left", "times": 10}, {"left_not_available": 1}),
    (
        {"kind": "ghost_line", "line": "left", "offset_m": -4.0, "times": 5},
        {"contradiction": 5, "implausible_jump": 2},  # there and back
    ),
    ({"kind": "line_kind", "line": "left", "marking": "curb", "times": 5}, {}),  # nobody could tell
    ({"kind": "line_colour", "line": "left", "colour": "blue", "times": 5}, {}),
    ({"kind": "image_frozen", "times": 5}, {"image_frozen": 4}),
    ({"kind": "sensor_blocked", "times": 10}, {"sensor_not_ready": 1}),
    ({"kind": "sensor_failed"}, {"sensor_not_ready": 1}),
    ({"kind": "reset"}, {"image_backwards": 1, "counter_wrong_sequence": 13}),
    (
        {"kind": "reset", "for_s": 0.4},
        {"image_backwards": 1, "counter_lost": 130, "timeout": 13} | AT_START,
    ),
    ({"kind": "bus_off", "for_s": 0.4}, {"counter_lost": 130, "timeout": 13}),
]


def stream(outputs):
    """Return the frames at their times, those of a burst one after another."""
    frames = []
    for output in outputs:
        places = Counter()
        for frame in output.frames:
            due_ns = START_NS + frame.due_ns + places[frame.due_ns] * BETWEEN_NS
            places[frame.due_ns] += 1
            frames.append(replace(frame, due_ns=due_ns))
    return frames


def test_every_kind_is_judged():
    assert {told["kind"] for told, _ in CASES} == set(KINDS)


@pytest.mark.parametrize(("told", "expected"), CASES, ids=lambda value: value.get("kind"))
def test_the_ecu_finds_a_fault_on_demand_under_its_name_and_nothing_else(told, expected, tmp_path):
    outputs, _ = run(with_faults(told), TICKS)
    assert found(report_on(stream(outputs), tmp_path)) == dict(Counter(expected) + Counter(AT_START))


def test_without_a_fault_nothing_is_found_after_the_start(tmp_path):
    outputs, _ = run(with_faults(), TICKS)
    assert found(report_on(stream(outputs), tmp_path)) == AT_START
