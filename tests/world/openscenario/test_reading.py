"""Reading OpenSCENARIO: parameters, catalogs, and every refusal in one line with file, element, line."""

import re

import pytest

from tests.stories import (
    CAR,
    after,
    by_entity,
    catalog_reference,
    drive,
    element,
    event,
    group,
    lane_change,
    lane_position,
    private,
    speed,
    story,
    teleport,
    text,
    trigger,
    written,
)
from vsensor.errors import StoryError, VsensorError
from vsensor.world.openscenario import load_story
from vsensor.world.openscenario.expressions import ExpressionError, evaluated

SCOPE = {"A": "2", "B": "3.5", "Word": "car_white", "Neg": "-4"}


@pytest.mark.parametrize(
    ("raw", "value"),
    [
        ("plain", "plain"),
        ("$Word", "car_white"),
        ("${$A + $B}", "5.5"),
        ("${$A - $Neg}", "6"),
        ("${-$Neg * ($A + 1)}", "12"),
        ("${108 / 3.6}", "30"),
        ("${7 % 4}", "3"),
        ("${pow($A, 3)}", "8"),
        ("${round(2.5)}", "3"),
        ("${floor(-0.5)}", "-1"),
        ("${sqrt(16) + abs($Neg)}", "8"),
        ("${not true or $A}", "true"),
        ("${Brake + _ + $B}", "Brake_3.5"),
    ],
)
def test_an_attribute_stands_for_its_value(raw, value):
    assert evaluated(raw, SCOPE) == value


@pytest.mark.parametrize(
    "raw",
    [
        "$Missing",
        "${$Missing + 1}",
        "${1 / 0}",
        "${pow(10, 400)}",
        "${__import__('os')}",
        "${(1).real}",
        "${[1 for x in (1,)]}",
        "${9**9**9}",
        "${" + "1+" * 300 + "1}",
        "${sqrt(-1)}",
        "${1 if true else 2}",
        "${}",
    ],
)
def test_an_expression_that_has_no_value_is_refused(raw):
    with pytest.raises(ExpressionError):
        evaluated(raw, SCOPE)


CATALOG = (
    '<?xml version="1.0"?>\n<OpenSCENARIO><FileHeader revMajor="1" revMinor="1"/>\n'
    '<Catalog name="Cars">{}</Catalog></OpenSCENARIO>'
)
WIDE = (
    CAR.replace('name="car"', 'name="wide"')
    .replace('width="2"', 'width="$Width"')
    .replace(
        "<BoundingBox>",
        '<ParameterDeclarations><ParameterDeclaration name="Width" parameterType="double" value="2.2"/>'
        "</ParameterDeclarations>\n<BoundingBox>",
    )
)
LOCATION = '<CatalogLocations><VehicleCatalog><Directory path="{}"/></VehicleCatalog></CatalogLocations>'


def with_catalog(folder, body, *entries, place="cars"):
    (folder / "cars").mkdir(exist_ok=True)
    (folder / "cars" / "cars.xosc").write_text(CATALOG.format("\n".join(entries)))
    return written(folder, text(bodies={"Other": body}, more=LOCATION.format(place)))


def test_a_catalog_entry_takes_the_values_that_the_reference_gives(tmp_path):
    path = with_catalog(tmp_path, catalog_reference("Cars", "wide", Width="2.8"), WIDE)
    assert load_story(path).entities[1].box.size_m[1] == 2.8


def test_a_catalog_entry_keeps_its_own_values_otherwise(tmp_path):
    path = with_catalog(tmp_path, catalog_reference("Cars", "wide"), WIDE)
    assert load_story(path).entities[1].box.size_m[1] == 2.2


def test_a_catalog_folder_is_found_by_its_last_name(tmp_path):
    path = with_catalog(tmp_path, catalog_reference("Cars", "wide"), WIDE, place="../else/cars")
    assert load_story(path).entities[1].kind == "Vehicle"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (catalog_reference("Cars", "narrow"), "catalog Cars has no entry narrow; it has: wide"),
        (catalog_reference("Trucks", "wide"), "no catalog Trucks"),
        (catalog_reference("Cars", "wide", Colour="red"), "entry wide declares no parameter Colour"),
        (catalog_reference("Cars", "wide", Width="nan"), "width"),
    ],
)
def test_a_wrong_reference_is_refused_with_what_there_is(tmp_path, body, said):
    path = with_catalog(tmp_path, body, WIDE)
    with pytest.raises(StoryError, match=re.escape(said)):
        load_story(path)


def test_a_mistake_in_a_catalog_names_the_file_of_the_catalog_and_the_line(tmp_path):
    path = with_catalog(
        tmp_path, catalog_reference("Cars", "wide"), WIDE.replace('height="1.5"', 'height="tall"')
    )
    with pytest.raises(StoryError, match=r"cars\.xosc:4: <Dimensions>: height=\"tall\""):
        load_story(path)


def test_catalog_entries_that_ask_for_each_other_are_refused(tmp_path):
    loop = '<Vehicle name="{}">' + catalog_reference("Cars", "{}") + "</Vehicle>"
    path = with_catalog(
        tmp_path, catalog_reference("Cars", "a"), loop.format("a", "b"), loop.format("b", "a")
    )
    with pytest.raises(StoryError, match="in a circle: a -> b -> a"):
        load_story(path)


def test_catalog_entries_that_multiply_are_refused_within_bounds(tmp_path, monkeypatch):
    monkeypatch.setattr("vsensor.world.openscenario.reader.MOST_ELEMENTS", 3000)
    entries = [
        f'<Vehicle name="v{k}">' + catalog_reference("Cars", f"v{k + 1}") * 10 + "</Vehicle>"
        for k in range(9)
    ]
    path = with_catalog(tmp_path, catalog_reference("Cars", "v0"), *entries, '<Vehicle name="v9"/>')
    with pytest.raises(StoryError, match="more than 3000 elements"):
        load_story(path)


LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "ha">'
    + "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True))
    + "]><OpenSCENARIO>&i;</OpenSCENARIO>"
)
EXTERNAL = '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><OpenSCENARIO>&e;</OpenSCENARIO>'


@pytest.mark.parametrize("document", [LAUGHS, EXTERNAL], ids=["billion laughs", "external entity"])
def test_entities_of_xml_are_refused_in_one_line(tmp_path, document):
    path = tmp_path / "x.xosc"
    path.write_text(document)
    with pytest.raises(StoryError, match=r"x\.xosc:\d+: ") as caught:
        load_story(path)
    assert "\n" not in str(caught.value)


def changed(old, new):
    scenario = text(
        stories=story(group(event("e", trigger(after(1)), lane_change(-2)), actors=("Other",))),
        parameters='<ParameterDeclaration name="P" parameterType="double" value="1"/>',
    )
    assert old in scenario
    return scenario.replace(old, new)


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ("", "not well-formed"),
        (text()[:700], "not well-formed"),
        ("<OpenDRIVE/>", "the root element must be <OpenSCENARIO>"),
        ('<OpenSCENARIO><FileHeader revMajor="2" revMinor="0"/></OpenSCENARIO>', "1.0 to 1.3 are played"),
        (changed('name="Other">', 'name="It">'), 'entityRef="Other": no such entity; there are: Ego, It'),
        (changed('s="50"', 's="nan"'), "a finite number"),
        (changed('s="50"', 's="inf"'), "a finite number"),
        (changed('s="50"', 's="1e999"'), "a finite number"),
        (changed('s="50"', 's="$Q"'), "no such parameter; declared: P"),
        (changed('s="50"', 's="5000"'), "off road 1: 0 to 2000.000 m"),
        (
            changed('roadId="1" laneId="-1" s="50"', 'roadId="9" laneId="-1" s="50"'),
            "road 9 is not in the map",
        ),
        (changed('laneId="-1" s="50"', 'laneId="-7" s="50"'), "no lane -7"),
        (
            changed('laneId="-1" s="50" offset="0.0"', 'laneId="-1" s="50" offset="-12"'),
            "Ego starts off the road",
        ),
        (
            changed('dynamicsDimension="time" value="3"', 'dynamicsDimension="time" value="-3"'),
            "a time of at least 0 was expected",
        ),
        (
            changed(lane_position(100), '<RelativeLanePosition entityRef="Ego" dLane="0" ds="2e5"/>'),
            "200000 m: at most 100000 m were expected",
        ),
        (changed('dynamicsShape="cubic"', 'dynamicsShape="round"'), "linear or cubic or sinusoidal or step"),
        (
            changed('<AbsoluteTargetSpeed value="20"/>', '<AbsoluteTargetSpeed value="-3"/>'),
            "do not drive backwards",
        ),
        (changed('filepath="map.xodr"', 'filepath="gone.xodr"'), "no such map gone.xodr"),
        (changed("<Entities>", "<Entity>").replace("</Entities>", "</Entity>"), "<Entities> is missing"),
        (changed('parameterType="double" value="1"', 'parameterType="double" value="x"'), 'value="x"'),
        (changed('length="5"', 'length="-5"'), "at least 0 was expected"),
        (changed('conditionEdge="rising"', 'conditionEdge="up"'), 'conditionEdge="up"'),
        (changed('delay="0"', 'delay="-1"'), "at least 0"),
    ],
)
def test_a_broken_scenario_is_refused_in_one_line(tmp_path, document, said):
    with pytest.raises(VsensorError) as caught:
        drive(tmp_path, document)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "story.xosc" in str(caught.value)


def test_a_file_that_is_not_there_or_too_large_is_refused(tmp_path):
    with pytest.raises(StoryError, match="no such file"):
        load_story(tmp_path / "gone.xosc")
    big = tmp_path / "big.xosc"
    with big.open("wb") as file:
        file.truncate(17 * 1024 * 1024)
    with pytest.raises(StoryError, match="at most 16 MB"):
        load_story(big)


def test_the_carrier_must_be_somebody(tmp_path):
    with pytest.raises(StoryError, match=r"no entity is named Nobody: .* Ego, Other"):
        drive(tmp_path, ego="Nobody")


def test_a_parameter_that_is_not_declared_cannot_be_set(tmp_path):
    with pytest.raises(StoryError, match="no parameter V to set; declared: none"):
        drive(tmp_path, V=1.0)


def test_a_carrier_without_a_place_is_refused(tmp_path):
    with pytest.raises(StoryError, match="Ego is placed nowhere"):
        drive(tmp_path, text(init=private("Ego", speed(20))))


SYNCHRONIZE = '<PrivateAction><SynchronizeAction masterEntityRef="Other"/></PrivateAction>'
VISIBILITY = '<PrivateAction><VisibilityAction graphics="false"/></PrivateAction>'


def with_action(action, actor):
    return text(stories=story(group(event("e", trigger(after(1)), action), actors=(actor,))))


def test_an_action_that_is_not_played_is_named_with_its_line(tmp_path):
    source = drive(tmp_path, with_action(SYNCHRONIZE, "Other"))
    assert any(re.search(r"story\.xosc:\d+: <SynchronizeAction>: has no effect", f) for f in source.findings)


def test_an_action_that_would_move_the_carrier_and_is_not_played_is_refused(tmp_path):
    with pytest.raises(StoryError, match="<SynchronizeAction>: not played, and it would move Ego"):
        drive(tmp_path, with_action(SYNCHRONIZE, "Ego"))


def test_an_action_without_effect_on_what_is_seen_is_a_finding_for_the_carrier_too(tmp_path):
    source = drive(tmp_path, with_action(VISIBILITY, "Ego"))
    assert any("<VisibilityAction>: has no effect: everybody is seen" in found for found in source.findings)


def test_a_condition_that_is_not_played_is_named_and_never_true(tmp_path):
    odd = by_entity('<AngleCondition angle="0"/>', edge="none")
    source = drive(tmp_path, text(stop=trigger(odd, after(2), tag="StopTrigger")))
    assert any("<AngleCondition>" in found for found in source.findings)
    assert source.duration_s == pytest.approx(2.01)


def test_an_element_that_does_not_exist_is_refused_with_those_that_do(tmp_path):
    ask = element("event", "f", "completeState")
    with pytest.raises(StoryError, match='storyboardElementRef="f": no such element; there are: e'):
        drive(
            tmp_path, text(stories=story(group(event("e", trigger(ask), lane_change(-2)), actors=("Other",))))
        )


def test_positions_relative_to_somebody_who_has_no_place_are_refused(tmp_path):
    ego = private("Ego", teleport('<RelativeLanePosition entityRef="Other" dLane="0" ds="5"/>'))
    with pytest.raises(StoryError, match="Other has no place yet"):
        drive(tmp_path, text(init=ego))


def test_a_trailer_that_draws_itself_is_refused(tmp_path):
    body = CAR.replace(
        "</Vehicle>", '<TrailerCoupler dx="3"/><Trailer><TrailerRef entityRef="Other"/></Trailer></Vehicle>'
    )
    with pytest.raises(StoryError, match="drawn by two vehicles, or by itself"):
        drive(tmp_path, text(bodies={"Other": body}))


def test_placing_order_in_the_file_does_not_matter(tmp_path):
    init = private("Ego", teleport('<RelativeLanePosition entityRef="Other" dLane="0" ds="-30"/>')) + private(
        "Other", teleport(lane_position(100))
    )
    source = drive(tmp_path, text(init=init))
    assert source.machine.initial_state().bodies[0].s_m == pytest.approx(
        20.0
    )  # its own track begins 20 m behind
