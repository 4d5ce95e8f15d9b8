"""Which lane follows which, and where a drive begins."""

import math

import pytest

from tests.maps import REAL_MAPS, geometry, lane, loaded, real, road, section
from tests.shared import needs_shared
from vsensor.errors import MapError
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import Place, auto_start, following, load_map
from vsensor.world.opendrive.network import drivable, lane_end
from vsensor.world.route import CorridorConfig

AHEAD = '<successor elementType="road" elementId="2" contactPoint="{}"/>'


def places(found):
    """Return (road, lane, direction) of places."""
    return [(place.road_id, place.lane_id, place.direction) for place in found]


def test_a_road_entered_at_its_end_is_driven_against_s(tmp_path):
    first = road(sections=section(right=[lane(-1, links='<successor id="1"/>')]), link=AHEAD.format("end"))
    back = geometry("<line/>", 100.0, x=200.0, hdg=math.pi)
    second = road(back, sections=section(left=[lane(1)]), number=2)
    assert places(following(loaded(tmp_path, first, second), Place("1", 0, -1, 1))) == [("2", 1, -1)]


def test_a_lane_without_link_goes_on_where_it_meets_its_like(tmp_path):
    first = road(sections=section(right=[lane(-1, "3"), lane(-2, "3")]), link=AHEAD.format("start"))
    second = road(
        geometry("<line/>", 100.0, x=100.0), section(right=[lane(-1, "3"), lane(-2, "3")]), number=2
    )
    assert places(following(loaded(tmp_path, first, second), Place("1", 0, -2, 1))) == [("2", -2, 1)]


def test_a_link_to_a_far_road_is_a_dead_end(tmp_path):
    first = road(sections=section(right=[lane(-1, links='<successor id="-1"/>')]), link=AHEAD.format("start"))
    second = road(geometry("<line/>", 100.0, x=130.0), section(right=[lane(-1)]), number=2)
    assert following(loaded(tmp_path, first, second), Place("1", 0, -1, 1)) == ()


def test_lanes_renumbered_by_a_lane_offset_that_jumps_go_on(tmp_path):
    first = section(right=[lane(-1, "3"), lane(-2, "3", links='<successor id="-1"/>')])
    second = section(right=[lane(-1, "3", links='<predecessor id="-2"/>')], s=50.0)
    offset = '<laneOffset s="0" a="0" b="0" c="0" d="0"/><laneOffset s="50" a="-3" b="0" c="0" d="0"/>'
    road_map = loaded(tmp_path, road(sections=first + second, offset=offset))
    assert places(following(road_map, Place("1", 0, -2, 1))) == [("1", -1, 1)]
    assert places(following(road_map, Place("1", 1, -1, -1))) == [("1", -2, -1)]


def fork(tmp_path):
    """Return a map: road 1, then a junction with road 2 (bends left) and road 3 (straight on), then 4."""
    link = '<successor elementType="junction" elementId="9"/>'
    lanes = section(right=[lane(-1, links='<predecessor id="-1"/><successor id="-1"/>')])
    bend = geometry('<arc curvature="0.05"/>', 30.0, x=100.0)
    onward = '<successor elementType="road" elementId="4" contactPoint="start"/>'
    roads = [
        road(sections=lanes, link=link),
        road(bend, lanes, length=30.0, number=2),
        road(geometry("<line/>", 30.0, x=100.0), lanes, length=30.0, number=3, link=onward),
        road(geometry("<line/>", 50.0, x=130.0), lanes, length=50.0, number=4),
        road(geometry("<line/>", 100.0, y=500.0), number=5),
    ]
    connections = "".join(
        f'<connection id="{n}" incomingRoad="1" connectingRoad="{n}" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection>'
        for n in (2, 3)
    )
    return loaded(tmp_path, *roads, junctions=f'<junction id="9" name="">{connections}</junction>')


def driven(corridor):
    """Return the roads of a drive in order."""
    end = min(corridor.length_m, 1000.0)
    found = [corridor.place(s)[0].road_id for s in range(int(end))]
    return [each for i, each in enumerate(found) if i == 0 or found[i - 1] != each]


def test_a_junction_is_crossed_straight_on(tmp_path):
    assert driven(Corridor(fork(tmp_path), CorridorConfig(road="1", lane=-1))) == ["1", "3", "4"]


@pytest.mark.parametrize(("route", "roads"), [(("2",), ["1", "2"]), (("4",), ["1", "3", "4"])])
def test_a_given_route_decides_at_the_junction(tmp_path, route, roads):
    assert driven(Corridor(fork(tmp_path), CorridorConfig(road="1", lane=-1, route=route))) == roads


def test_a_route_that_does_not_follow_names_the_roads_that_do(tmp_path):
    with pytest.raises(MapError, match=r"road 5 does not follow road 1 lane -1; following roads: 3, 2"):
        Corridor(fork(tmp_path), CorridorConfig(road="1", lane=-1, route=("1", "5"))).reaches(1000.0)


def test_a_route_that_ends_too_early_names_the_road_it_misses(tmp_path):
    with pytest.raises(MapError, match=r"road 5 is not reached, the drive ends on road 4 lane -1"):
        Corridor(fork(tmp_path), CorridorConfig(road="1", lane=-1, route=("3", "5"))).reaches(1000.0)


@pytest.mark.parametrize(
    ("config", "says"),
    [
        (CorridorConfig(road="7"), "road 7 not in map; roads: 1"),
        (CorridorConfig(road="1", lane=-4), r"road 1 has no lane -4 at s = 0 m; lanes: 1, -1"),
        (CorridorConfig(road="1", lane=0), "has no lane 0"),
        (CorridorConfig(road="1", lane=-1, s_m=101.0), r"road 1 has no s = 101 m: 0 to 100.000 m"),
        (CorridorConfig(road="1", lane=-1, s_m=100.0), "nothing to drive on"),
        (CorridorConfig(road="1", lane_type="tram"), "no lane of type tram at s = 0 m; types: driving"),
        (CorridorConfig(lane_type="tram"), "no lane of type tram; types: driving"),
        (CorridorConfig(route=("8",)), "road 8 not in map"),
    ],
)
def test_a_start_that_is_not_there_is_refused_by_naming_what_is(tmp_path, config, says):
    with pytest.raises(MapError, match=says):
        Corridor(loaded(tmp_path, road()), config)


def test_the_drive_begins_on_the_outermost_lane_of_the_longest_way(tmp_path):
    short = road(number=1, length=50.0)
    long = road(
        geometry("<line/>", 80.0, y=50.0),
        section(right=[lane(-1), lane(-2), lane(-3, kind="sidewalk")]),
        number=2,
        length=80.0,
    )
    assert auto_start(loaded(tmp_path, short, long)) == Place("2", 0, -2, 1)


def test_other_lane_types_can_be_chosen(tmp_path):
    road_map = loaded(tmp_path, road(sections=section(right=[lane(-1), lane(-2, kind="biking")])))
    assert Corridor(road_map, CorridorConfig(lane_type="biking")).start.lane_id == -2


@needs_shared
@pytest.mark.parametrize("name", ["circle_300m", "velodrome", "Town01"])
def test_a_closed_circuit_goes_on_for_ever(name):
    corridor = Corridor(real(name))
    assert corridor.length_m == math.inf
    assert corridor.reaches(5000.0)


@needs_shared
@pytest.mark.parametrize("path", REAL_MAPS, ids=lambda path: path.stem)
def test_every_lane_of_a_real_map_goes_on_where_it_ends(path):
    road_map = load_map(path)
    for place in drivable(road_map):
        end, heading = lane_end(road_map, place, leaving=True)
        for way in following(road_map, place):
            start, next_heading = lane_end(road_map, way, leaving=False)
            assert math.dist(start, end) < 2e-3  # Town04's own numbers gape by 1.5 mm
            assert abs(math.remainder(next_heading - heading, 2 * math.pi)) < 0.02


@needs_shared
def test_a_direct_junction_is_open_both_ways():
    soderleden = real("soderleden")
    assert places(following(soderleden, Place("2", 1, -1, 1))) == [("0", -1, 1)]
    assert places(following(soderleden, Place("0", 0, 1, -1))) == [("2", 1, -1)]
    assert places(following(soderleden, Place("0", 0, -3, -1))) == [("5", -1, -1)]


@needs_shared
def test_traffic_keeps_to_the_side_that_the_rule_says():
    for name, sign in (("e6mini", -1), ("e6mini-lht", 1)):
        corridor = Corridor(real(name))
        assert (corridor.start.lane_id * sign > 0, corridor.start.direction) == (True, 1)
