"""The shared esmini scenarios: what happens when, in closed form and as esmini's own tests record it."""

from functools import cache
from math import acos, ceil, pi, remainder, sqrt

import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from tests.stories import (
    by_value,
    catalog_reference,
    drive,
    event,
    events,
    group,
    lane_change,
    lane_position,
    pose,
    private,
    speed,
    story,
    teleport,
    text,
    trigger,
)
from vsensor.sources.storyboard import StoryboardConfig, StoryDrive
from vsensor.types import Environment

FOLDER = SHARED_DATA / "xosc"
STEP_S = 0.01
WHITE_FRONT_M, RED_REAR_M = 1.4 + 5.04 / 2, 1.45 - 5.04 / 2
"""From the origin to the end of the box, of the vehicles in the catalog."""


@cache
def source(name):
    return StoryDrive.load(FOLDER / f"{name}.xosc", StoryboardConfig(), Environment())


def first_step_after(seconds):
    """The first time on the storyboard's grid that is later."""
    return (ceil(seconds / STEP_S - 1e-9) + (abs(seconds / STEP_S - round(seconds / STEP_S)) < 1e-9)) * STEP_S


def s_after(road, start_m, t_m, way_m):
    """s of the road after a way beside its line: in a bend the way differs from s by t times the turn."""
    s_m = start_m + way_m
    for _ in range(20):
        before, now = road.heading(np.array([start_m, s_m]))
        s_m = start_m + way_m + t_m * (now - before)
    return s_m


@needs_shared
def test_the_cut_in_begins_when_the_headway_passes_the_parameter():
    # The other starts with the act, at 0.01 s, 25 m behind, at 1.2 times 30 m/s; 0.4 s of headway are 12 m.
    board = source("cut-in")
    road = board.machine.tracks.road_map.roads["0"]
    ego_t, other_t = (float(road.sections[0].centre(np.array([50.0]), lane)[0][0]) for lane in (-3, -2))

    def gap(step):
        t_s = step * STEP_S
        other = s_after(road, 25.0, other_t, 36.0 * (t_s - 0.01))
        return other - s_after(road, 50.0, ego_t, 30.0 * t_s)

    expected = next(step for step in range(500, 800) if gap(step) > 12.0) * STEP_S
    assert events(board)[("CutInEvent", "starts")] == pytest.approx(expected, abs=1e-9)


@needs_shared
def test_the_cut_in_keeps_the_times_that_esmini_records():
    """esmini test/smoke_test.py (commit 0039c5b6), fixed step 0.01 s: act 0.010, brake 7.740, end 16.740,
    stop 21.740."""
    found = events(source("cut-in"))
    assert found[("OverTakerStartSpeedEvent", "starts")] == pytest.approx(0.01, abs=1e-9)
    assert found[("OvertakerBrakeEvent", "starts")] == pytest.approx(7.74, abs=1e-9)
    assert found[("OvertakerBrakeEvent", "ends")] == pytest.approx(16.74, abs=1e-9)
    assert source("cut-in").duration_s == pytest.approx(21.74, abs=1e-9)


@needs_shared
def test_the_lane_change_of_the_cut_in_takes_its_three_seconds():
    found = events(source("cut-in"))
    took = found[("CutInEvent", "ends")] - found[("CutInEvent", "starts")]
    assert took == pytest.approx(3.0, abs=1e-9)


@needs_shared
def test_the_alks_cut_in_begins_when_the_free_gap_is_closed_too_soon():
    gap = 20.0 - WHITE_FRONT_M + RED_REAR_M  # closing at 3 m/s; 2.85 s before it is closed
    expected = first_step_after((gap - 3.0 * 2.85) / 3.0)
    assert events(source("alks_cut-in"))[("CutInEvent", "starts")] == pytest.approx(expected, abs=1e-9)


@needs_shared
def test_the_alks_cut_out_begins_a_metre_before_its_place():
    found = events(source("alks_cut-out"))
    assert found[("CutOutEvent", "starts")] == pytest.approx((96.0 - 1.0 - 50.0) / 20.0, abs=1e-9)
    assert source("alks_cut-out").duration_s == pytest.approx(10.01, abs=1e-9)


@needs_shared
def test_the_ego_brakes_for_the_slow_lead_at_its_time_to_collision_and_stands_after_five_seconds():
    found = events(source("slow-lead-vehicle"))
    expected = first_step_after((150.0 - 2.7 * 29.0) / 29.0)
    assert found[("brake_Event", "starts")] == pytest.approx(expected, abs=1e-9)
    assert found[("brake_Event", "ends")] == pytest.approx(expected + 30.0 / 6.0, abs=1e-9)


@needs_shared
def test_the_slow_lead_scenario_stops_four_seconds_after_the_ego_is_the_slower_one():
    start = events(source("slow-lead-vehicle"))[("brake_Event", "starts")]
    slower = first_step_after(start + 29.0 / 6.0)
    assert source("slow-lead-vehicle").duration_s == pytest.approx(slower + 4.0, abs=1e-9)


@needs_shared
def test_the_lane_change_scenario_follows_parameter_state_and_offroad_triggers():
    found = events(source("lane_change"))
    assert found[("Dummy parameter event", "starts")] == pytest.approx(3.01, abs=1e-9)
    assert found[("Lane change Target event", "starts")] == pytest.approx(3.01, abs=1e-9)
    assert found[("Lane change Ego event", "ends")] == pytest.approx(6.01, abs=1e-9)
    assert found[("EgoGoOffRoadEvent", "starts")] == pytest.approx(7.01, abs=1e-9)
    took = pi * sqrt(8.0 / (2.0 * 3.5))  # 8 m at no more than 3.5 m/s2
    off = found[("EgoGoOffRoadEvent", "ends")]
    assert off == pytest.approx(first_step_after(7.01 + took), abs=1e-9)
    back = found[("EgoGoOnRoadEvent", "starts")]
    assert back - 2.5 < off  # it was off the road before its way was done
    assert source("lane_change").duration_s == pytest.approx(back + 3.0 + 3.0, abs=1e-9)


@needs_shared
def test_the_ego_comes_off_the_road_where_its_offset_leaves_the_border_lane():
    board = source("lane_change")
    road = board.machine.tracks.road_map.roads["1"].sections[0]
    back = events(board)[("EgoGoOnRoadEvent", "starts")]
    borders, _ = road.borders(np.array([200.0]), (2,))
    centre = float(road.centre(np.array([200.0]), 1)[0][0])
    share = (float(borders[2][0]) - centre) / 8.0
    took = pi * sqrt(8.0 / 7.0)
    left = 7.01 + took * acos(1.0 - 2.0 * share) / pi
    assert back == pytest.approx(left + 2.5, abs=2 * STEP_S)  # the border's width may vary along the road


@needs_shared
def test_the_merging_ego_reaches_its_place_over_the_junction_and_changes_lane():
    board = source("highway_merge")
    found = events(board)
    start = found[("EgoLaneChangeEvent", "starts")]
    roads = board.machine.tracks.road_map.roads
    way = roads["1"].length_m - 10.0 + roads["5"].length_m + 20.0 - 1.0
    assert start == pytest.approx(way / 25.0, abs=0.05)  # lanes beside the line are a bit longer or shorter
    assert found[("EgoLaneChangeEvent", "ends")] == pytest.approx(start + 2.8, abs=1e-9)


@needs_shared
def test_the_empty_scenario_ends_where_the_road_does():
    assert source("straight_500m").duration_s == pytest.approx(
        first_step_after((500.0 - 50.0) / 20.0), abs=1e-9
    )


ESMINI_TRUCK = [
    (0.5, "Truck", 55.800, -47.582, 6.170),
    (4.0, "Truck", 125.472, -53.480, 0.036),
    (4.0, "Truck+", 119.471, -53.503, 0.008),
    (7.0, "Truck", 185.009, -59.267, 6.050),
]
"""esmini test/smoke_test.py (commit 0039c5b6), test_variables: x, y, heading at a time, printed to 0.001.

Its truck changes lanes when a variable is set, at 3.01 s and back at 6.01 s. The change begins one step
later there, since esmini looks at each event once a step in the file's order; here at once. So this truck
is told to change at 3.02 s and 6.02 s.
"""


@cache
def esmini_truck(folder):
    def changes(name, seconds, lanes):
        start = by_value(f'<SimulationTimeCondition value="{seconds}" rule="greaterOrEqual"/>', "none")
        target = f'<RelativeTargetLane entityRef="Truck" value="{lanes}"/>'
        return event(name, trigger(start), lane_change(target, "sinusoidal", "time", 2))

    scenario = text(
        init=private("Truck", teleport(lane_position(300, 1)), speed(20)),
        stories=story(group(changes("there", 3.02, 1), changes("back", 6.02, -1), actors=("Truck",))),
        entities=("Truck",),
        bodies={"Truck": catalog_reference("VehicleCatalog", "semi_truck_with_extra_trailer")},
        more=f'<CatalogLocations><VehicleCatalog><Directory path="{FOLDER / "Catalogs" / "Vehicles"}"/>'
        "</VehicleCatalog></CatalogLocations>",
        road_file=str(SHARED_DATA / "xodr" / "jolengatan.xodr"),
    )
    return drive(folder, scenario, ego="Truck")


@needs_shared
@pytest.mark.parametrize(("seconds", "name", "x_m", "y_m", "heading_rad"), ESMINI_TRUCK)
def test_truck_and_trailer_are_where_esmini_records_them(
    tmp_path_factory, seconds, name, x_m, y_m, heading_rad
):
    x, y, heading = pose(esmini_truck(tmp_path_factory.getbasetemp()), seconds, name)
    assert (x, y) == pytest.approx((x_m, y_m), abs=0.01)
    assert abs(remainder(heading - heading_rad, 2 * pi)) < 0.002
