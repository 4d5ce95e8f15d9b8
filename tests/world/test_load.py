"""Refusals of broken maps: one line that names file, line, element, attribute."""

import copy
import math
import random
import re

import numpy as np
import pytest
from lxml import etree

from tests.maps import REAL_MAPS, document, geometry, lane, loaded, road, section
from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import MapError
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map

ARC = geometry('<arc curvature="0.01"/>', 100.0)


def refusal(tmp_path, text):
    """Return the message with which a map text is refused."""
    path = tmp_path / "map.xodr"
    path.write_text(text)
    with pytest.raises(MapError) as caught:
        load_map(path)
    message = str(caught.value)
    assert message.startswith(f"{path}:")
    assert "\n" not in message
    return message.removeprefix(f"{path}:")


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999", "1e12", "abc", "1_0", "0x10"])
def test_a_number_that_is_none_is_refused_by_name(tmp_path, value):
    message = refusal(tmp_path, document(road(ARC.replace("0.01", value))))
    assert re.search(rf'<arc>: curvature="{re.escape(value)}": a finite number', message)


@pytest.mark.parametrize(
    ("wrong", "right", "says"),
    [
        ('hdg="0.0"', "", "<geometry>: attribute hdg is missing"),
        ('length="100.0"><arc', 'length="-1"><arc', '<geometry>: length="-1": at least 0'),
        ("<arc", "<circle", "<geometry>: no line, arc, spiral"),
        ('curvature="0.01"', 'curvature="500"', "<arc>: curvature"),
        ('id="-1"', 'id="-1.5"', '<lane>: id="-1.5": an integer'),
        ('id="-1"', 'id="1"', '<lane>: id="1" inside <right>'),
        ("planView", "plan", "<road>: no <planView>"),
        ("laneSection", "sectionLane", "<lanes>: no <laneSection>"),
        ('a="3.5"', "", "<width>: attribute a is missing"),
        ('length="100.0" junction', 'length="0" junction', "<road>: length"),
        ('junction="-1"', 'rule="MHT"', "<road>: rule"),
        ('revMajor="1"', 'revMajor="2"', "<header>: OpenDRIVE 2.7"),
        (
            "<link></link><planView>",
            '<link><successor elementId="8"/></link><planView>',
            "<road>: its successor, road 8, is not in the map",
        ),
        (
            "<link></link><planView>",
            '<link><predecessor elementType="junction" elementId="8"/></link><planView>',
            "<road>: its predecessor, junction 8, is not in the map",
        ),
        (
            "</road>",
            '</road><junction id="9"><connection incomingRoad="1" connectingRoad="7"/></junction>',
            "<connection>: names road 7, which is not in the map",
        ),
        (
            'a="3.5" b="0" c="0" d="0"/>',
            'a="3.5" b="-0.1" c="0" d="0"/>',
            "<lane>: its width is -6.5 m at s = 100",
        ),
    ],
)
def test_a_broken_element_is_refused_by_name(tmp_path, wrong, right, says):
    text = document(road(ARC))
    assert wrong in text
    assert says in refusal(tmp_path, text.replace(wrong, right))


def test_a_line_break_hidden_in_an_attribute_stays_out_of_the_message(tmp_path):
    text = document(road()).replace('<road id="1"', '<road id="a&#10;b"')
    assert 'id="a b" is used' in refusal(tmp_path, text.replace("</OpenDRIVE>", text[text.index("<road") :]))
    refusal(tmp_path, document(road()).replace("<road ", '<road rule="L&#10;HT" '))


def test_the_line_of_the_element_is_named(tmp_path):
    text = document(road(ARC)).replace("<planView>", "\n\n<planView>\n").replace("0.01", "x")
    assert refusal(tmp_path, text).startswith("4: <arc>")


def test_a_map_without_roads_is_refused(tmp_path):
    assert "no <road>" in refusal(tmp_path, document())


def test_two_roads_of_one_id_are_refused(tmp_path):
    assert 'id="1" is used by two roads' in refusal(tmp_path, document(road(), road()))


def test_a_lane_given_twice_is_refused(tmp_path):
    assert "each id once" in refusal(tmp_path, document(road(sections=section(right=[lane(-1), lane(-1)]))))


def test_a_curve_without_length_is_refused(tmp_path):
    zero = " ".join(f'{k}{axis}="0"' for axis in "UV" for k in "abcd")
    assert "no length" in refusal(tmp_path, document(road(geometry(f"<paramPoly3 {zero}/>", 100.0))))


@pytest.mark.parametrize(
    "head",
    [
        '<!DOCTYPE OpenDRIVE [<!ENTITY x "y">]>',
        '<!DOCTYPE OpenDRIVE SYSTEM "file:///etc/hostname">',
        '<!DOCTYPE a [<!ENTITY b "1234567890"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>',
    ],
)
def test_a_document_type_is_refused(tmp_path, head):
    assert "document type" in refusal(tmp_path, head + document(road()))


def test_other_files_are_refused(tmp_path):
    assert "not well-formed" in refusal(tmp_path, "schema = 1")
    assert "not well-formed" in refusal(tmp_path, "")
    assert "<html>" in refusal(tmp_path, "<html/>")
    with pytest.raises(MapError, match="no such file"):
        load_map(tmp_path / "absent.xodr")
    with pytest.raises(MapError, match="cannot be read: Is a directory"):
        load_map(tmp_path)


def test_a_name_space_makes_no_difference(tmp_path):
    path = tmp_path / "map.xodr"
    path.write_text(document(road()).replace("<OpenDRIVE>", '<OpenDRIVE xmlns="http://code.asam.net/x">'))
    assert list(load_map(path).roads) == ["1"]


def test_findings_that_a_map_survives_are_warnings_with_a_line(tmp_path):
    road_map = loaded(tmp_path, road(length=150.0, plan=geometry("<line/>", 100.0)))
    (warning,) = road_map.warnings
    assert re.search(r'map\.xodr:1: <road>: length="150", but its geometry ends at 100 m', warning)
    assert road_map.road(1).length_m == 100.0


@pytest.mark.parametrize(
    ("wrong", "right", "says"),
    [
        (
            '<width sOffset="0"',
            '<width sOffset="5"',
            "<width>: the first one starts at sOffset = 5: 0 before it",
        ),
        (
            "<elevationProfile>",
            '<elevationProfile><elevation s="9" a="1" b="0" c="0" d="0"/>',
            "s = 9: 0 before",
        ),
        ("<lateralProfile>", '<lateralProfile><crossfall side="both"/>', "<crossfall>: is ignored"),
        ('type="solid"/>', 'type="solid"><sway/></roadMark>', "<sway>: is ignored"),
        ('type="solid"/>', 'type="wavy"/>', 'type="wavy" is not known'),
        ('type="solid"/>', 'type="solid" color="pink"/>', 'color="pink" is not known'),
        ('<width sOffset="0" a="3.5" b="0" c="0" d="0"/>', "", "neither width nor border"),
        ("<header ", "<kopf ", "no <header>"),
        ('revMinor="7"', 'revMinor="1"', "OpenDRIVE 1.1 is read as"),
        ('id="1" type', 'id="3" type', "lane ids are not counted on from the centre"),
    ],
)
def test_what_is_doubtful_is_told_and_driven(tmp_path, wrong, right, says):
    text = document(road())
    assert wrong in text
    path = tmp_path / "map.xodr"
    path.write_text(text.replace(wrong, right))
    road_map = load_map(path)
    assert says in " ".join(road_map.warnings)
    assert Corridor(road_map).markings_window(0.0, 10.0)


def test_a_road_that_crosses_itself_on_one_level_is_refused_and_one_that_bridges_itself_is_not(tmp_path):
    """A full circle of 10 m and on in a straight line: it comes by its own beginning."""
    around = 2 * math.pi * 10.0
    plan = geometry("<line/>", 20.0) + geometry('<arc curvature="0.1"/>', around * 0.75, s=20.0, x=20.0)
    end = 20.0 + around * 0.75
    plan += geometry("<line/>", 30.0, s=end, x=10.0, y=10.0, hdg=1.5 * math.pi)
    said = refusal(tmp_path, document(road(plan, length=end + 30.0)))
    places = re.search(r"<road>: crosses itself on one level at s = ([\d.]+) and ([\d.]+) m", said)
    np.testing.assert_allclose([float(places[1]), float(places[2])], [10.0, end + 10.0], atol=0.3)
    hill = '<elevation s="0" a="0" b="0.1" c="0" d="0"/>'
    assert loaded(tmp_path, road(plan, length=end + 30.0, elevation=hill)).warnings == ()


def test_a_closed_circuit_does_not_cross_itself(tmp_path):
    around = 2 * math.pi * 50.0
    assert loaded(tmp_path, road(geometry('<arc curvature="0.02"/>', around), length=around)).warnings == ()


def test_a_missing_road_is_named_with_those_that_exist(tmp_path):
    with pytest.raises(MapError, match=r"road 7 not in map; roads: 1, 2"):
        loaded(tmp_path, road(), road(number=2)).road(7)


CUT = ["curve_r100", "fabriksgatan", "velodrome", "roadmarks"]


@needs_shared
@pytest.mark.parametrize("name", CUT)
def test_a_map_cut_off_anywhere_is_refused(tmp_path, name):
    whole = (SHARED_DATA / "xodr" / f"{name}.xodr").read_bytes().rstrip()
    path = tmp_path / "cut.xodr"
    for end in sorted(
        {*np.linspace(0, len(whole) - 1, 120).astype(int), *range(len(whole) - 12, len(whole))}
    ):
        path.write_bytes(whole[:end])
        with pytest.raises(MapError):
            load_map(path)


NONSENSE = ["nan", "inf", "", "abc", "-1", "0", "1e9", "-1e10", "1e-300", "99999999", "solid", None]


def mutated(text, rng):
    """Return the text with one to four attributes changed, doubled in value, or gone."""
    for _ in range(rng.randint(1, 4)):
        places = list(re.finditer(r' [a-zA-Z0-9]+="[^"]*"', text))
        place = rng.choice(places)
        name = place.group().split("=")[0]
        value = rng.choice(NONSENSE)
        text = text[: place.start()] + ("" if value is None else f'{name}="{value}"') + text[place.end() :]
    return text


@needs_shared
@pytest.mark.parametrize("name", ["curve_r100", "velodrome", "multi_lanesections", "fabriksgatan", "e6mini"])
def test_a_map_with_any_attribute_wrong_is_refused_or_driven(tmp_path, name):
    whole = (SHARED_DATA / "xodr" / f"{name}.xodr").read_text()
    path, rng, refused, driven = tmp_path / "wrong.xodr", random.Random(name), 0, 0
    for _ in range(60):
        path.write_text(mutated(whole, rng))
        try:
            corridor = Corridor(load_map(path))
            corridor.markings_window(0.0, 50.0)
            assert np.isfinite(corridor.poses(np.linspace(0.0, 50.0, 6)).position_world_m).all()
        except MapError as error:
            refused += "\n" not in str(error)
            continue
        driven += 1
    assert refused + driven == 60
    assert min(refused, driven) > 0


def rebuilt(root, rng):
    """Change the tree: one to three elements gone, doubled, moved elsewhere, or renamed."""
    for _ in range(rng.randint(1, 3)):
        everything = [each for each in root.iter() if each.getparent() is not None]
        one, other = rng.choice(everything), rng.choice(everything)
        deed = rng.choice(("gone", "doubled", "moved", "renamed"))
        if deed == "gone":
            one.getparent().remove(one)
        elif deed == "doubled":
            one.addnext(copy.deepcopy(one))
        elif deed == "moved" and one not in set(other.iterancestors()) | {other}:
            other.append(one)
        elif deed == "renamed":
            one.tag = other.tag


@needs_shared
@pytest.mark.parametrize("name", ["curve_r100", "velodrome", "multi_lanesections"])
def test_a_map_with_elements_gone_doubled_or_moved_is_refused_or_driven(tmp_path, name):
    whole = etree.parse(SHARED_DATA / "xodr" / f"{name}.xodr")
    path, rng, refused, driven = tmp_path / "wrong.xodr", random.Random(name), 0, 0
    for _ in range(25):
        tree = copy.deepcopy(whole)
        rebuilt(tree.getroot(), rng)
        path.write_bytes(etree.tostring(tree))
        try:
            corridor = Corridor(load_map(path))
            corridor.markings_window(0.0, 50.0)
            assert np.isfinite(corridor.poses(np.linspace(0.0, 50.0, 6)).position_world_m).all()
        except MapError as error:
            refused += "\n" not in str(error)
            continue
        driven += 1
    assert refused + driven == 25
    assert min(refused, driven) > 0


def test_a_billion_laughs_are_refused_before_the_first(tmp_path):
    entities = '<!ENTITY a0 "ha">' + "".join(f'<!ENTITY a{n} "{10 * f"&a{n - 1};"}">' for n in range(1, 12))
    path = tmp_path / "map.xodr"
    laughs = document(road()).replace("</OpenDRIVE>", "<userData>&a11;</userData></OpenDRIVE>")
    path.write_text(f"<!DOCTYPE OpenDRIVE [{entities}]>{laughs}")
    with pytest.raises(MapError, match=r"map\.xodr:1: has a document type definition"):
        load_map(path)


@needs_shared
@pytest.mark.parametrize("path", REAL_MAPS, ids=lambda path: path.stem)
def test_a_real_map_loads_without_a_warning(path):
    assert load_map(path).warnings == ()
