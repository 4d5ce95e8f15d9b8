"""Events in long logs, by P2's criteria."""

import numpy as np
import pytest

from tests.video.series import can
from vsensor.errors import LogError
from vsensor.video.events import EventCriteria, find_events

WIDTH_M = 1.85
NEAR_M = 0.5 * WIDTH_M + 0.6  # 0.6 m from the wheel to the marking: less than P2's 0.7 m
FAR_M = 0.5 * WIDTH_M + 0.8


def found(log, **criteria):
    return find_events(log, EventCriteria(**criteria), WIDTH_M)


def near_for(begin_s, end_s, seconds=100.0):
    """Return a log whose vehicle is near to the left marking from one time to another."""
    t = np.arange(round(seconds / 0.1) + 1) * 0.1
    near = (t > begin_s - 1e-6) & (t < end_s + 1e-6)
    left = np.where(near, NEAR_M, FAR_M)
    return can(seconds, left__lane_offset_m=left, right__lane_offset_m=-FAR_M, ego__indicator=0.0)


def test_an_event_is_its_second_with_fifteen_before_and_after():
    (event,) = found(near_for(40.0, 41.0)).events
    assert (event.begins_s, event.core_begins_s, event.core_ends_s, event.ends_s) == pytest.approx(
        (25.0, 40.0, 41.0, 56.0)
    )


def test_what_lasts_less_than_a_second_is_no_event():
    assert found(near_for(40.0, 40.9)).events == ()


def test_a_long_stretch_gives_events_one_after_the_other_that_do_not_overlap():
    events = found(near_for(0.0, 100.0)).events
    assert [event.begins_s for event in events] == pytest.approx([0.0, 31.0, 62.0])
    assert [event.ends_s - event.begins_s for event in events] == pytest.approx([31.0] * 3)


def test_an_event_whose_fifteen_seconds_are_not_in_the_log_is_none():
    assert found(near_for(90.0, 100.0)).events == ()
    (late,) = found(near_for(2.0, 20.0)).events
    assert late.core_begins_s == pytest.approx(15.0)


def test_a_pause_of_the_lane_messages_parts_the_log():
    log = near_for(0.0, 100.0)
    t, _ = log.series["left.lane_offset_m"]
    kept = (t < 20.0) | (t > 30.0)
    series = {name: (t[kept], values[kept]) for name, (t, values) in log.series.items()}
    paused = type(log)(path=log.path, seconds=log.seconds, series=series)
    events = found(paused).events
    assert [event.begins_s for event in events] == pytest.approx([30.1, 61.1])


@pytest.mark.parametrize(
    ("name", "column", "value"),
    [
        ("lane width", "lane__width_m", 4.1),
        ("lateral speed", "lane__lateral_speed_mps", -2.6),
        ("near to a marking", "left__lane_offset_m", FAR_M),
        ("yaw rate", "ego__yaw_rate_radps", np.radians(-10.1)),
        ("no indicator", "ego__indicator", 1.0),
    ],
)
def test_each_criterion_alone_forbids_an_event(name, column, value):
    columns = {"left__lane_offset_m": NEAR_M, "right__lane_offset_m": -FAR_M, "ego__indicator": 0.0}
    assert len(found(can(40.0, **columns)).events) == 1
    refused = found(can(40.0, **{**columns, column: value}))
    assert refused.events == ()
    assert refused.held_s[name] == 0.0
    others = set(refused.held_s) - {name}
    assert all(refused.held_s[other] == pytest.approx(40.0) for other in others)


def test_a_wheel_beyond_the_marking_is_near_to_it():
    assert len(found(can(40.0, left__lane_offset_m=0.5)).events) == 1


def test_a_line_that_jumps_is_a_lateral_speed():
    t = np.arange(401) * 0.1
    left = np.where(t < 15.5, NEAR_M, NEAR_M - 0.3)  # 0.3 m in 0.1 s
    log = can(40.0, left__lane_offset_m=left)
    assert found(log).held_s["lateral speed"] == pytest.approx(39.9)
    (event,) = found(log).events
    assert event.core_begins_s == pytest.approx(15.6)


def test_a_log_without_indicator_is_told_and_one_without_offsets_refused():
    log = can(40.0)
    assert "no indicator" not in found(log).held_s
    (note,) = found(log).notes
    assert "indicator" in note
    series = {name: value for name, value in log.series.items() if "lane_offset" not in name}
    with pytest.raises(LogError, match=r"made\.blf: tells no lane offsets"):
        found(type(log)(path=log.path, seconds=log.seconds, series=series))


def test_where_an_offset_is_not_available_there_is_no_event():
    t = np.arange(401) * 0.1
    gone = np.where((t > 10.0) & (t < 25.0), np.nan, NEAR_M)
    log = can(40.0, left__lane_offset_m=gone, right__lane_offset_m=-FAR_M, lane__width_m=gone + FAR_M)
    assert found(log).events == ()
