"""Faults of the sensor, its lines and its image: frames follow from them and never contradict each other."""

import math

import numpy as np
import pytest

from tests.faults.runs import (
    FIRST,
    PERIOD_NS,
    TICKS,
    counters,
    faulty,
    is_valid_at_end,
    line,
    plain,
    plan,
    run,
    statuses,
    with_faults,
)
from vsensor.config import load_scenario
from vsensor.line import build_line
from vsensor.sinks.trace import rows
from vsensor.types import SIDE_NAMES, Colour, MarkingKind, SensorMode, Side

NAMES = [message.layout.name for message in line().profile.messages]


def decoded(output, of=None):
    """Return the quantities on the bus in one tick."""
    values = {}
    for frame in output.frames:
        values |= (of or line()).profile.decode(frame, check=True)
    return values


def modes(outputs):
    return [SensorMode(int(output.values["sensor.state"])).name.lower() for output in outputs]


def same(ours, theirs, but=()):
    """Return whether two sets of values are the same, but for some quantities."""
    names = [name for name in ours if name not in but]
    return np.array_equal([ours[n] for n in names], [theirs[n] for n in names], equal_nan=True)


# ---- lines -----------------------------------------------------------------------------------------


def test_a_lost_line_is_not_available_and_all_that_needs_it_follows():
    during = decoded(faulty({"kind": "line_lost", "line": "left", "times": 5})[FIRST])
    assert during["left.available"] == during["left.quality"] == during["left.measured"] == 0.0
    for name in (
        "left.offset_m",
        "left.heading",
        "left.curvature_per_m",
        "left.lane_offset_m",
        "lane.width_m",
    ):
        assert math.isnan(during[name]), name
    assert during["right.available"] == 1.0
    assert not math.isnan(during["right.lane_offset_m"])


def test_without_a_line_all_lines_are_lost():
    during = decoded(faulty({"kind": "line_lost", "times": 5})[FIRST])
    assert [during[f"{name}.available"] for name in SIDE_NAMES.values()] == [0.0] * 4


def test_a_lost_line_is_back_with_the_next_image_as_if_it_had_never_gone():
    outputs = faulty({"kind": "line_lost", "line": "left", "times": 5})
    assert [output.values["left.available"] == 0.0 for output in outputs][FIRST - 1 :] == (
        [False] + [True] * 5 + [False] * (TICKS - FIRST - 5)
    )
    assert [o.frames for o in outputs[FIRST + 5 :]] == [o.frames for o in plain()[FIRST + 5 :]]
    assert outputs[FIRST].estimate.lost == (Side.LEFT,)
    assert outputs[FIRST + 5].estimate.lost == ()


def test_a_ghost_line_stands_where_there_is_none_and_the_lane_follows():
    outputs = faulty({"kind": "line_lost"}, {"kind": "ghost_line", "line": "right", "offset_m": -1.5})
    during = decoded(outputs[FIRST])
    assert during["right.available"] == during["right.measured"] == 1.0
    assert during["right.offset_m"] == pytest.approx(-1.5, abs=2e-3)
    assert during["right.lane_offset_m"] == pytest.approx(-1.5 + 0.15 / 2, abs=6e-3)
    assert during["right.kind"] == MarkingKind.SOLID
    assert outputs[FIRST].estimate.on(Side.RIGHT).marking == -1


def test_a_ghost_takes_the_place_of_the_line_that_is_there():
    outputs = faulty({"kind": "ghost_line", "line": "left", "offset_m": 0.8, "marking": "dashed"})
    sides = [boundary.side for boundary in outputs[FIRST].estimate.boundaries]
    assert sides == sorted(set(sides))
    assert outputs[FIRST].values["left.offset_m"] == 0.8
    assert outputs[FIRST].values["left.kind"] == MarkingKind.DASHED


def test_a_ghost_counts_in_a_trace_as_a_report_without_truth():
    output = faulty({"kind": "line_lost"}, {"kind": "ghost_line", "line": "right", "offset_m": -1.5})[FIRST]
    (row,) = [row for row in rows(output, 2.8) if row[2] == Side.RIGHT and row[3]]
    assert row[8] == -1.5


@pytest.mark.parametrize(
    ("told", "name", "value"),
    [
        ({"kind": "line_kind", "marking": "botts_dots"}, "kind", MarkingKind.BOTTS_DOTS),
        ({"kind": "line_colour", "colour": "yellow"}, "colour", Colour.YELLOW),
    ],
)
def test_a_wrong_type_changes_that_and_nothing_else(told, name, value):
    ours, theirs = (
        outputs[FIRST].values for outputs in (faulty({**told, "line": "left", "times": 1}), plain())
    )
    assert ours[f"left.{name}"] == value != theirs[f"left.{name}"]
    assert same(ours, theirs, but=(f"left.{name}",))


# ---- image -----------------------------------------------------------------------------------------


def test_a_frozen_image_stands_while_alive_counters_and_crcs_run():
    outputs = faulty({"kind": "image_frozen", "times": 6})
    frozen = decoded(outputs[FIRST])
    assert frozen["image.index"] == FIRST
    for output in outputs[FIRST : FIRST + 6]:
        assert same(decoded(output), frozen)
    for name in NAMES:
        assert statuses(outputs, name) == []
        assert counters(outputs, name) == counters(plain(), name)


def test_after_a_frozen_image_the_newest_one_is_sent():
    outputs = faulty({"kind": "image_frozen", "times": 6})
    assert [o.frames for o in outputs[FIRST + 6 :]] == [o.frames for o in plain()[FIRST + 6 :]]


# ---- the sensor's state ----------------------------------------------------------------------------


def test_a_blocked_sensor_says_so_and_reports_no_line():
    outputs = faulty({"kind": "sensor_blocked", "times": 5})
    assert modes(outputs)[FIRST - 1 : FIRST + 6] == ["available"] + ["blocked"] * 5 + ["available"]
    during = decoded(outputs[FIRST + 2])
    assert [during[f"{name}.available"] for name in SIDE_NAMES.values()] == [0.0] * 4
    assert math.isnan(during["lane.width_m"])
    assert {name: statuses(outputs, name) for name in NAMES} == {name: [] for name in NAMES}


def test_lines_covered_for_longer_than_they_are_predicted_are_confirmed_anew():
    outputs = faulty({"kind": "sensor_blocked", "for_s": 3.0}, ticks=FIRST + 85)
    assert modes(outputs)[FIRST + 75] == "available"
    assert [output.values["left.available"] for output in outputs[FIRST + 75 : FIRST + 79]] == [0, 0, 1, 1]


def test_a_failed_sensor_stays_failed_until_it_is_reset():
    outputs = faulty({"kind": "sensor_failed"}, {"kind": "reset", "at_s": 1.2})
    assert modes(outputs) == ["available"] * FIRST + ["failed"] * 10 + ["available"] * (TICKS - FIRST - 10)
    assert decoded(outputs[FIRST + 3])["left.available"] == 0.0


def test_after_a_reset_the_frames_are_those_of_a_start_there():
    outputs, state = run(with_faults({"kind": "reset"}))
    for name in NAMES:
        assert counters(outputs, name)[FIRST : FIRST + 3] == [0, 1, 2]
    assert [output.values["image.index"] for output in outputs[FIRST : FIRST + 3]] == [0, 1, 2]
    assert [output.values["image.timestamp_ms"] for output in outputs[FIRST : FIRST + 3]] == [0, 40, 80]
    assert [output.values["left.available"] for output in outputs[FIRST : FIRST + 4]] == [0, 0, 1, 1]
    assert [frame.due_ns for frame in outputs[FIRST].frames] == [FIRST * PERIOD_NS] * 13
    assert state.transmit.frames == 13 * TICKS


def test_a_receiver_is_content_again_one_frame_after_a_reset():
    outputs = faulty({"kind": "reset"})
    for name in NAMES:
        assert statuses(outputs, name) in (["wrong sequence"], ["some lost"])
        assert is_valid_at_end(outputs, name)


def test_a_reset_that_takes_its_time_is_silent_until_the_start():
    outputs = faulty({"kind": "reset", "for_s": 0.2})
    assert [len(output.frames) for output in outputs][FIRST - 1 : FIRST + 6] == [13] + [0] * 5 + [13]
    assert counters(outputs, "LDS_Lane")[FIRST + 5 : FIRST + 7] == [0, 1]
    assert outputs[FIRST + 5].values["image.index"] == 0.0
    assert [output.values["left.available"] for output in outputs[FIRST : FIRST + 5]] == [0.0] * 5


def test_after_a_reset_the_start_takes_as_long_as_the_first_one():
    slow = build_line(load_scenario("highway", {"output": {"latency_ms": 65.0}}))
    outputs, _ = run(with_faults({"kind": "reset"}, of=slow))
    assert modes(outputs)[FIRST : 2 * FIRST] == modes(outputs)[:FIRST]
    for name in ("image.index", "image.timestamp_ms"):
        after = [output.values[name] for output in outputs[FIRST : 2 * FIRST]]
        assert after == [output.values[name] for output in outputs[:FIRST]]


def test_start_delays_count_from_a_reset(tmp_path):
    (tmp_path / "late.toml").write_text(
        'schema = "vsensor.profile/1"\n'
        f'database = "{line().profile.database}"\n'
        "[messages.LDS_Lane]\ncycle_ms = 40\nstart_delay_ms = 160\n"
        'e2e = { crc = "LaneCrc", counter = "LaneCounter" }\n'
        '[messages.LDS_Lane.signals]\nLaneWidth = "lane.width_m"\n'
    )
    output = {"profile": str(tmp_path / "late.toml")}
    late = build_line(load_scenario("highway", {"output": output}))
    outputs, _ = run(with_faults({"kind": "reset"}, of=late))
    sent = [len(output.frames) for output in outputs]
    assert sent == ([0] * 4 + [1] * 16) + ([0] * 4 + [1] * (TICKS - FIRST - 4))
    assert plan("LDS_Lane", late).guard.counter(outputs[FIRST + 4].frames[0].data) == 0
