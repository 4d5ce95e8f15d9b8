"""Each malformed map of the public checker: refused, warned, or runs, and why."""

import pytest

from tests.maps import MALFORMED_MAPS
from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import MapError
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map

RUNS, WARNED, REFUSED = "runs", "warned", "refused"

TABLE = {
    "bU_invalid": (
        WARNED,
        "du/dp and dv/dp are 0",
        "the heading at the cusp is its limit, and a kink is told",
    ),
    "invalid": (
        WARNED,
        "not in the order of s",
        "the records are whole, only their order in the file is wrong",
    ),
    "junctions_connection_one_link_to_incoming_invalid": (
        RUNS,
        "",
        "a second connection links the oncoming lane: never asked for by a drive that keeps its direction",
    ),
    "negative": (REFUSED, "<ODrive>: the root element must be <OpenDRIVE>", "not an OpenDRIVE file"),
    "negative18": (REFUSED, "<road>: no <planView>", "a road without geometry and lanes"),
    "performance_avoid_redundant_info_lane_offset_invalid_2": (
        WARNED,
        "its geometry ends at 36.7468 m",
        "redundant offsets harm nobody; but its road is said to be longer than its geometry",
    ),
    "road_lane_border_overlap_with_inner_lanes_invalid_1": (
        RUNS,
        "",
        "the borders cross at 99.9999 m: from there the outer lane has no width",
    ),
    "road_lane_level_true_one_side_road_invalid": (
        RUNS,
        "",
        "level changes nothing on a road without superelevation, as this one is",
    ),
    "road_lane_link_new_lane_appear_inside_junction_invalid": (
        RUNS,
        "",
        "the lane that appears is never driven: no link leads to it",
    ),
    "rule_253_road_corner_road_element_min_amount_invalid": (RUNS, "", "a rule about objects only"),
    "rule_285_road_object_border_useCompleteOutline_true_invalid": (
        RUNS,
        "",
        "a rule about objects only",
    ),
    "rule_305_road.object.attributes_obstacle_invalid": (RUNS, "", "a rule about objects only"),
    "rule_305_road.object.attributes_tree_invalid": (RUNS, "", "a rule about objects only"),
    "rule_371_general_optional_param_used_invalid": (RUNS, "", "a rule about objects only"),
}
"""File: what becomes of it, words of the message, why."""


@needs_shared
def test_every_malformed_map_is_in_the_table():
    assert {path.stem for path in MALFORMED_MAPS} == set(TABLE)


@needs_shared
@pytest.mark.parametrize("name", TABLE)
def test_a_malformed_map_is_treated_as_the_table_says(name):
    outcome, words, _ = TABLE[name]
    path = SHARED_DATA / "xodr" / "malformed" / f"{name}.xodr"
    if outcome is REFUSED:
        with pytest.raises(MapError) as refusal:
            load_map(path)
        assert words in str(refusal.value)
        return
    road_map = load_map(path)
    assert (WARNED if road_map.warnings else RUNS) == outcome
    assert words in " ".join(road_map.warnings)
    assert len(Corridor(road_map).markings_window(0.0, 20.0)) >= 2
