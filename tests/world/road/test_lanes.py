"""Lanes of road files: widths, widening and merging, the offset of the middle, closed circuits."""

import math

import numpy as np
import pytest

from tests.world.road.made import HEAD, STRAIGHT, built
from vsensor.types import MarkingKind
from vsensor.world.corridor import Corridor
from vsensor.world.route import CorridorConfig

WIDENING = STRAIGHT + (
    "right = [{ width_m = 3.5 }, { width_m = 3.25, from_m = 100, to_m = 250, taper_m = 50 }]\n"
)


def widths(road, s):
    """Return the width of each lane at s by its number in the map."""
    section = next(one for one in road.sections if one.start_m <= s < one.end_m)
    return {i: float(section.centre(np.array([s]), i)[2][0]) for i in section.ids if i}


def test_a_lane_changes_its_width_smoothly_between_points(tmp_path):
    road = built(tmp_path, STRAIGHT + "right = [{ width_m = [[100, 3.0], [200, 4.0]] }]\n").roads["1"]
    u = 0.3
    assert widths(road, 130.0)[-1] == pytest.approx(3.0 + 3 * u**2 - 2 * u**3, abs=1e-12)
    assert widths(road, 50.0)[-1] == 3.0
    assert widths(road, 250.0)[-1] == pytest.approx(4.0, abs=1e-12)


def test_a_second_lane_opens_and_merges_over_its_tapers(tmp_path):
    road = built(tmp_path, WIDENING).roads["1"]
    assert [set(section.ids) for section in road.sections] == [{0, -1}, {0, -1, -2}, {0, -1}]
    found = [widths(road, s).get(-2) for s in (99.0, 125.0, 160.0, 225.0, 260.0)]
    assert found[0] is found[4] is None
    np.testing.assert_allclose(found[1:4], [3.25 / 2, 3.25, 3.25 / 2], atol=1e-12)


def test_the_edge_of_a_lane_becomes_dashed_where_another_opens_beside_it(tmp_path):
    # P1, figure 2.23: the single lane becomes two, and what was the edge is a lane line then
    drive = Corridor(built(tmp_path, WIDENING), CorridorConfig(road="1", lane=-1))
    right = next(m for m in drive.markings_window(0.0, 300.0) if m.group == drive.own_groups(0.0)[1])
    assert [right.kind[k] for k in (500, 1500, 2800)] == [
        MarkingKind.SOLID,
        MarkingKind.DASHED,
        MarkingKind.SOLID,
    ]


def test_the_drive_goes_on_over_the_sections_of_a_widening(tmp_path):
    assert Corridor(built(tmp_path, WIDENING)).length_m == pytest.approx(300.0, abs=1e-6)


def test_a_lane_keeps_its_links_where_an_inner_one_opens(tmp_path):
    text = STRAIGHT + "right = [{ from_m = 100, taper_m = 50 }, { width_m = 3 }]\n"
    first, second = built(tmp_path, text).roads["1"].sections
    assert first.lanes[-1].successors == (-2,)
    assert second.lanes[-2].predecessors == (-1,)
    assert second.lanes[-1].predecessors == ()


def test_the_middle_shifts_by_the_offset_and_all_lanes_with_it(tmp_path):
    road = built(tmp_path, STRAIGHT + "offset_m = [[100, 0], [200, 1.5]]\n").roads["1"]
    t = road.sections[0].borders(np.array([50.0, 150.0, 250.0]), (-1,))[0]
    np.testing.assert_allclose(t[0], [0.0, 0.75, 1.5], atol=1e-12)
    np.testing.assert_allclose(t[-1], t[0] - 3.5, atol=1e-12)


def test_a_road_of_left_hand_traffic_is_driven_on_its_left_lanes(tmp_path):
    road = built(tmp_path, STRAIGHT + 'traffic = "left"\nleft = [{}]\nright = [{}]\n').roads["1"]
    assert (road.direction(1), road.direction(-1)) == (1, -1)


def test_a_closed_circuit_is_driven_for_ever_with_lines_that_go_on(tmp_path):
    text = HEAD + (
        'closed = true\nline = [{ kind = "arc", radius_m = 80, turn_deg = 360 }]\nright = [{}, {}]\n'
    )
    drive = Corridor(built(tmp_path, text), CorridorConfig(road="1", lane=-1))
    assert drive.length_m == math.inf
    lap = 2 * math.pi * (80 + 1.75)
    before, after = (drive.own_groups(s) for s in (lap - 5.0, lap + 5.0))
    assert before == after
    np.testing.assert_allclose(
        drive.pose(10.0).position_world_m, drive.pose(10.0 + lap).position_world_m, atol=1e-6
    )
