"""Road marks: stripes, dashes, kinds, colours, as the file's numbers say."""

import numpy as np
import pytest

from tests.maps import lane, loaded, real, road, section
from tests.shared import needs_shared
from vsensor.types import Colour, MarkingKind
from vsensor.world.opendrive.marks import marks_between

S = np.arange(0.0, 100.0, 0.1) + 0.05


def first_mark(tmp_path, mark, number=-1, **more):
    """Return the first mark of one lane of a straight road."""
    left, centre, right = [lane(1)], lane(0, marks=""), [lane(-1)]
    if number == 0:
        centre = lane(0, marks=mark)
    elif number > 0:
        left = [lane(1, marks=mark)]
    else:
        right = [lane(-1, marks=mark)]
    each = loaded(tmp_path, road(sections=section(left, centre, right), **more)).road(1)
    return each.sections[0].lanes[number].marks[0]


def test_dashes_start_at_the_offsets_of_mark_and_line(tmp_path):
    line = '<line length="3" space="9" tOffset="0" sOffset="2" width="0.15"/>'
    lines = f'<type name="broken" width="0.2">{line}</type>'
    mark = first_mark(tmp_path, f'<roadMark sOffset="7" type="broken" width="0.2">{lines}</roadMark>')
    (stripe,) = mark.stripes
    expected = (S >= 9.0) & (np.mod(S - 9.0, 12.0) < 3.0)
    np.testing.assert_array_equal(stripe.painted(S), expected)
    assert (mark.kind, stripe.width_m) == (MarkingKind.DASHED, 0.15)


@pytest.mark.parametrize(
    ("road_type", "dash", "gap"), [("motorway", 6, 12), ("rural", 4, 8), ("town", 3, 6), (None, 4, 8)]
)
def test_a_broken_mark_without_lines_takes_the_dashes_of_its_road_type(tmp_path, road_type, dash, gap):
    text = road(sections=section(right=[lane(-1, marks='<roadMark sOffset="0" type="broken"/>')]))
    if road_type:
        text = text.replace("<planView>", f'<type s="0" type="{road_type}"/><planView>')
    (stripe,) = loaded(tmp_path, text).road(1).sections[0].lanes[-1].marks[0].stripes
    np.testing.assert_array_equal(stripe.painted(S), np.mod(S, dash + gap) < dash)


@pytest.mark.parametrize(
    ("number", "kind"),
    [(-1, MarkingKind.SOLID_DASHED), (0, MarkingKind.SOLID_DASHED), (1, MarkingKind.DASHED_SOLID)],
)
def test_double_types_are_named_from_the_centre_outwards(tmp_path, number, kind):
    mark = first_mark(tmp_path, '<roadMark sOffset="0" type="solid broken" width="0.1"/>', number)
    assert mark.kind is kind
    assert [stripe.t_offset_m for stripe in mark.stripes] == [0.1, -0.1]


def test_the_other_direction_sees_left_and_right_swapped(tmp_path):
    mark = first_mark(tmp_path, '<roadMark sOffset="0" type="solid broken"/>')
    assert mark.mirrored_kind is MarkingKind.DASHED_SOLID


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("solid", MarkingKind.SOLID),
        ("broken", MarkingKind.DASHED),
        ("solid solid", MarkingKind.DOUBLE_SOLID),
        ("broken broken", MarkingKind.DOUBLE_DASHED),
        ("broken solid", MarkingKind.DASHED_SOLID),
        ("botts dots", MarkingKind.BOTTS_DOTS),
        ("curb", MarkingKind.CURB),
        ("edge", MarkingKind.ROAD_EDGE),
        ("none", MarkingKind.NONE),
    ],
)
def test_every_type_has_its_kind(tmp_path, kind, expected):
    assert first_mark(tmp_path, f'<roadMark sOffset="0" type="{kind}"/>').kind is expected


@pytest.mark.parametrize(
    ("attributes", "width"), [("", 0.12), ('weight="bold"', 0.25), ('width="0.3"', 0.3), ('width="0"', 0.12)]
)
def test_width_falls_back_on_the_weight(tmp_path, attributes, width):
    (stripe,) = first_mark(tmp_path, f'<roadMark sOffset="0" type="solid" {attributes}/>').stripes
    assert stripe.width_m == width


@pytest.mark.parametrize(
    ("colour", "expected"),
    [
        ("standard", Colour.WHITE),
        ("white", Colour.WHITE),
        ("yellow", Colour.YELLOW),
        ("violet", Colour.UNKNOWN),
    ],
)
def test_standard_colour_is_white(tmp_path, colour, expected):
    assert first_mark(tmp_path, f'<roadMark sOffset="0" type="solid" color="{colour}"/>').colour is expected


def test_an_explicit_line_is_painted_once(tmp_path):
    line = '<explicit><line length="4" sOffset="10" tOffset="0" width="0.2"/></explicit>'
    (stripe,) = first_mark(tmp_path, f'<roadMark sOffset="1" type="custom">{line}</roadMark>').stripes
    np.testing.assert_array_equal(stripe.painted(S), (S >= 11.0) & (S < 15.0))


def test_lines_side_by_side_make_stripes_from_left_to_right(tmp_path):
    lines = (
        '<type name="x" width="0.1"><line length="5" space="1" tOffset="-0.3" sOffset="0"/>'
        '<line length="0" space="0" tOffset="0.3" sOffset="0" width="0.2"/></type>'
    )
    mark = first_mark(tmp_path, f'<roadMark sOffset="0" type="broken solid">{lines}</roadMark>')
    assert [(s.t_offset_m, s.width_m, s.dashed) for s in mark.stripes] == [
        (0.3, 0.2, False),
        (-0.3, 0.1, True),
    ]
    assert mark.kind is MarkingKind.SOLID_DASHED  # by the paint, whatever the type says


def test_botts_dots_cover_a_thirteenth_of_the_line(tmp_path):
    (stripe,) = first_mark(tmp_path, '<roadMark sOffset="0" type="botts dots"/>').stripes
    fine = np.arange(0.0, 13.0, 0.001) + 0.0005
    assert stripe.painted(fine).mean() == pytest.approx(1 / 13, abs=1e-4)


def test_a_mark_ends_where_the_next_begins(tmp_path):
    marks = '<roadMark sOffset="0" type="solid"/><roadMark sOffset="30" type="none"/>'
    each = loaded(tmp_path, road(sections=section(right=[lane(-1, marks=marks)]))).road(1)
    found = marks_between(each.sections[0].lanes[-1].marks, 10.0, 50.0)
    assert [(low, high, mark.kind) for low, high, mark in found] == [
        (0.0, 30.0, MarkingKind.SOLID),
        (30.0, np.inf, MarkingKind.NONE),
    ]


@needs_shared
def test_the_marks_of_the_test_road_are_those_of_its_lines():
    lane_one = real("straight_500m_roadmarks").road(1).sections[0].lanes[1]
    found = [(mark.start_m, mark.kind) for mark in lane_one.marks]
    assert found == [
        (0.0, MarkingKind.DASHED),
        (50.0, MarkingKind.SOLID),
        (100.0, MarkingKind.DOUBLE_SOLID),
        (200.0, MarkingKind.DASHED_SOLID),  # solid inside, on the left lane the right-hand stripe
        (300.0, MarkingKind.SOLID),
        (350.0, MarkingKind.DASHED),
        (400.0, MarkingKind.SOLID_DASHED),
    ]
    outer = lane_one.marks[-1].stripes[0]
    np.testing.assert_array_equal(
        outer.painted(np.array([449.9, 450.1])), [False, True]
    )  # its sOffset of 50 m
