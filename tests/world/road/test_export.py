"""The OpenDRIVE text of a road file: what others read, what we read back, in TOML or in Python."""

import math

import numpy as np
import pytest
from lxml import etree

from tests.maps import document, lane, loaded, road, section
from tests.world.road.made import STRAIGHT, built, line_of, written
from vsensor.cli import main
from vsensor.config import load_scenario, shipped_scenarios
from vsensor.line import build_source
from vsensor.world.opendrive import load_map
from vsensor.world.road import (
    Arc,
    Bend,
    LaneConfig,
    PaintConfig,
    RoadConfig,
    RoadFile,
    Straight,
    build_map,
    load_road,
    opendrive_of,
    opendrive_text,
)

EVERYTHING = line_of(
    'kind = "straight", length_m = 120.1',
    'kind = "bend", radius_m = 333.3, turn_deg = 31, clothoid_m = 70, superelevation_percent = 5',
    more="""
elevation = [{ at_m = 0, z_m = 0 }, { at_m = 150, z_m = 2, radius_m = 3000 }, { at_m = 280, z_m = 0 }]
left = [{}]
right = [{ width_m = [[0, 3.5], [90, 3.1]] }, { from_m = 30, taper_m = 40 }, { kind = "shoulder" }]
centre = { kind = "double_solid", contrast = [[0, 1], [99, 0.3]], wear = 0.2 }
gap = [{ borders = [-1], at_m = 101, length_m = 10 }]
ghost = [{ border = -1, from_m = 10, to_m = 90, offset_m = 0.5 }]
construction = [{ border = -1, from_m = 150, to_m = 200, kind = "dashed" }]
crosswalk = [{ at_m = 50 }]
stop_line = [{ at_m = 48 }]
bump = [{ at_m = 80, length_m = 3, height_m = 0.08 }]
rough = [{ from_m = 100, to_m = 120, grade = "D" }]
""",
)
ORDER = {
    "road": (
        "link",
        "type",
        "planView",
        "elevationProfile",
        "lateralProfile",
        "lanes",
        "objects",
        "userData",
    ),
    "lanes": ("laneOffset", "laneSection"),
    "laneSection": ("left", "center", "right"),
    "lane": ("link", "width", "roadMark"),
    "roadMark": ("type", "explicit", "userData"),
    "object": ("outlines", "userData"),
}
NEEDED = {
    "road": {"id", "length", "junction"},
    "geometry": {"s", "x", "y", "hdg", "length"},
    "elevation": {"s", "a", "b", "c", "d"},
    "superelevation": {"s", "a", "b", "c", "d"},
    "laneOffset": {"s", "a", "b", "c", "d"},
    "width": {"sOffset", "a", "b", "c", "d"},
    "lane": {"id", "type"},
    "roadMark": {"sOffset", "type", "color"},
    "object": {"id", "s", "t", "zOffset"},
    "cornerRoad": {"s", "t", "dz", "height"},
    "userData": {"code"},
}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """The elements of a road with everything in it."""
    return etree.fromstring(opendrive_of(written(tmp_path_factory.mktemp("export"), EVERYTHING)))


def test_elements_stand_in_the_order_of_the_schema(exported):
    for name, order in ORDER.items():
        for element in exported.iter(name):
            if element.getparent().tag != "line":
                places = [order.index(child.tag) for child in element]
                assert places == sorted(places), name


def test_elements_have_the_attributes_that_the_schema_needs(exported):
    for name, needed in NEEDED.items():
        found = [set(element.keys()) for element in exported.iter(name)]
        assert found, name
        assert all(keys >= needed for keys in found), name


def test_lanes_of_a_section_are_counted_on_from_the_middle(exported):
    for group in exported.iter("left", "right"):
        ids = [int(lane.get("id")) for lane in group]
        assert ids == sorted(ids, reverse=True)
        assert sorted(map(abs, ids)) == list(range(1, len(ids) + 1))


def test_every_number_reads_back_bit_for_bit(tmp_path):
    third = 100.0 / 3.0
    text = opendrive_text(RoadFile(road=(RoadConfig(line=(Straight(length_m=third),)),)))
    assert float(etree.fromstring(text).find("road").get("length")) == third


def test_the_written_map_is_the_road_itself(tmp_path, capsys):
    path, out = written(tmp_path, EVERYTHING), tmp_path / "out.xodr"
    assert main(["road", str(path), "--out", str(out)]) == 0
    there, back = load_map(path).roads["1"], load_map(out).roads["1"]
    s = np.linspace(0.0, there.length_m, 97)
    for t in (-6.0, 0.0, 3.5):
        np.testing.assert_array_equal(there.point(s, t), back.point(s, t))
    assert "radii m        left 333.3" in capsys.readouterr().out


def test_the_summary_says_length_radii_lanes_and_paint(tmp_path, capsys):
    assert main(["road", str(written(tmp_path, EVERYTHING))]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == f"road 1: {120.1 + 333.3 * math.radians(31) + 70:.3f} m, turns by 31 deg"
    assert "lanes          0.0 to 30.0 m: 1 driving 3.5 m | -1 driving 3.396-3.5 m" in "\n".join(lines)
    assert any("construction   150.0 to 200.0 m: dashed, yellow" in line for line in lines)


def test_a_picture_of_the_road_is_drawn(tmp_path):
    path, plot = written(tmp_path, STRAIGHT.replace("300", "30")), tmp_path / "road.svg"
    assert main(["road", str(path), "--plot", str(plot)]) == 0
    assert plot.stat().st_size > 10_000


def test_user_data_of_others_is_passed_over(tmp_path):
    other = '<userData code="maker" value="3"><line sStart="0" sEnd="9"/><paint valid="false"/></userData>'
    marks = f'<roadMark sOffset="0" type="solid" color="white">{other}</roadMark>'
    text = road(sections=section(right=[lane(-1, marks=marks)])).replace("</road>", f"{other}</road>")
    found = loaded(tmp_path, text).roads["1"]
    assert found.lines == found.swells == ()
    assert found.sections[0].lanes[-1].marks[0].valid


def test_python_builds_what_the_file_says(tmp_path):
    file = RoadFile(
        name="road",
        road=(
            RoadConfig(
                line=(Straight(length_m=50.0), Arc(radius_m=-80.0, turn_deg=45.0)),
                right=(LaneConfig(width_m=3.2, paint=PaintConfig(kind="dashed")),),
            ),
        ),
    )
    text = line_of(
        'kind = "straight", length_m = 50',
        'kind = "arc", radius_m = -80, turn_deg = 45',
        more='right = [{ width_m = 3.2, paint = { kind = "dashed" } }]',
    )
    assert load_road(written(tmp_path, text)) == file
    assert build_map(file).roads["1"].length_m == built(tmp_path, text).roads["1"].length_m


def test_a_mistake_in_python_names_the_key():
    line = (Bend(radius_m=100.0, turn_deg=5.0, clothoid_m=60.0),)
    with pytest.raises(Exception, match=r"road\[0\].line\[0\].turn_deg = 5"):
        build_map(RoadFile(road=(RoadConfig(line=line),)))


def test_a_road_file_is_a_source_like_any_map(tmp_path):
    written(tmp_path, STRAIGHT)
    scenario = written(tmp_path, 'schema = "vsensor.scenario/1"\nsource = "road.toml"\n', "drive.toml")
    source = build_source(load_scenario(str(scenario)))
    assert source.duration_s == pytest.approx(300.0 / (100.0 / 3.6))
    assert build_source(load_scenario(str(tmp_path / "road.toml"))).duration_s == source.duration_s


def test_a_scenario_whose_road_file_is_missing_says_so(tmp_path):
    scenario = written(tmp_path, 'schema = "vsensor.scenario/1"\nsource = "gone.toml"\n', "drive.toml")
    with pytest.raises(Exception, match=r"gone\.toml': no such file"):
        load_scenario(str(scenario))


def test_p3s_track_has_all_its_radii_with_clothoids_and_all_its_gaps():
    file = load_road(load_scenario("p3_track").source)
    (track,) = file.road
    bends = [piece for piece in track.line if isinstance(piece, Bend)]
    assert sorted(bend.radius_m for bend in bends) == [250, 400, 600, 800, 1000, 1500]
    assert all(bend.clothoid_m > 0 for bend in bends)
    assert {gap.length_m for gap in track.gap} == {5, 10, 20, 50}
    assert "p3_track" not in shipped_scenarios()
    assert build_source(load_scenario("p3_track")).duration_s == math.inf


def test_documents_of_both_kinds_share_one_reader(tmp_path):
    path = tmp_path / "map.xodr"
    path.write_text(document(road()))
    assert load_map(path).roads["1"].length_m == 100.0


def test_the_type_of_a_double_line_names_its_stripes_from_the_middle_outwards(tmp_path):
    paint = '[{ paint = { kind = "solid_dashed" } }]\n'
    text = opendrive_of(written(tmp_path, STRAIGHT + f"left = {paint}right = {paint}"))
    lanes = {one.get("id"): one for one in etree.fromstring(text).iter("lane")}
    assert lanes["-1"].find("roadMark").get("type") == "solid broken"
    assert lanes["1"].find("roadMark").get("type") == "broken solid"  # its left stripe is the outer one
