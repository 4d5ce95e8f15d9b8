"""Several roads in one file: one after the other, a split, a merge."""

import numpy as np
import pytest

from tests.world.road.made import built
from vsensor.world.corridor import Corridor
from vsensor.world.route import CorridorConfig

NETWORK = """schema = "vsensor.road/1"
[[road]]
name = "before"
line = [{ kind = "straight", length_m = 100 }, { kind = "arc", radius_m = 400, length_m = 100 }]
right = [{}, {}, {}]
[[road]]
name = "on"
after = { road = "before" }
line = [{ kind = "straight", length_m = 100 }]
right = [{}, {}]
[[road]]
name = "exit"
after = { road = "before", shift_m = -7.0 }
line = [{ kind = "clothoid", length_m = 60, to_radius_m = -300 }]
[[road]]
name = "ramp"
before = { road = "end", shift_m = -7.0 }
line = [{ kind = "clothoid", from_radius_m = 300, length_m = 60 }]
[[road]]
name = "mid"
after = { road = "on" }
before = { road = "end" }
line = [{ kind = "straight", length_m = 50 }]
right = [{}, {}]
[[road]]
name = "end"
line = [{ kind = "straight", length_m = 100 }]
right = [{}, {}, {}]
"""


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    """A carriageway of three lanes, of which the outer one leaves and another joins."""
    return built(tmp_path_factory.mktemp("roads"), NETWORK)


@pytest.mark.parametrize(("a", "b", "shift"), [(1, 2, 0.0), (1, 3, -7.0), (2, 5, 0.0), (5, 6, 0.0)])
def test_a_road_begins_where_the_one_before_it_ends_to_a_nanometre(network, a, b, shift):
    end, start = network.road(a), network.road(b)
    gap = end.point(end.length_m, shift)[0] - start.point(0.0, 0.0)[0]
    assert np.linalg.norm(gap) < 1e-9


def test_a_ramp_ends_where_the_road_before_which_it_is_begins(network):
    ramp, end = network.road(4), network.road(6)
    assert np.linalg.norm(ramp.point(ramp.length_m, 0.0)[0] - end.point(0.0, -7.0)[0]) < 1e-9
    assert ramp.heading(ramp.length_m)[0] == pytest.approx(end.heading(0.0)[0], abs=1e-12)


def test_a_split_leads_each_lane_to_its_own_road(network):
    ways = [Corridor(network, CorridorConfig(road="1", lane=lane, s_m=0.0)) for lane in (-1, -2, -3)]
    assert [drive.place(260.0)[0].road_id for drive in ways] == ["2", "2", "3"]


def test_a_merge_leads_both_roads_into_one(network):
    ramp = Corridor(network, CorridorConfig(road="4", lane=-1))
    middle = Corridor(network, CorridorConfig(road="5", lane=-2))
    assert [(p.road_id, p.lane_id) for p in (ramp.place(80.0)[0], middle.place(80.0)[0])] == [
        ("6", -3),
        ("6", -2),
    ]


def test_nothing_is_found_fault_with_in_a_network(network):
    assert network.warnings == ()


def test_lanes_are_joined_as_they_are_paired(tmp_path):
    text = NETWORK.replace(
        'after = { road = "before", shift_m = -7.0 }',
        'after = { road = "before", shift_m = -7.0, lanes = [[-3, -1]] }',
    )
    assert built(tmp_path, text).connections["7"][1].lanes == ((-3, -1),)
