"""Paint of road files: kinds, dashes in step, gaps, wear, ghosts and construction lines."""

import numpy as np
import pytest

from tests.world.road.made import STRAIGHT, built
from vsensor.types import Colour, MarkingKind, Stripe
from vsensor.world.corridor import Corridor
from vsensor.world.route import CorridorConfig

SPACING_M = 0.01


def markings(folder, more, length=300.0, text=STRAIGHT):
    """Return all markings of a drive along lane -1."""
    drive = Corridor(built(folder, text + more), CorridorConfig(road="1", lane=-1, spacing_m=SPACING_M))
    return drive.markings_window(0.0, length)


def right_line(folder, more, text=STRAIGHT):
    """Return the stripes of border -1 of the straight road, left first."""
    found = [m for m in markings(folder, more, text=text) if abs(m.points_world_m[0, 1] + 3.5) < 0.5]
    return sorted(found, key=lambda marking: marking.stripe)


def edges(painted):
    """Return where paint begins and ends, m, to half a station."""
    steps = np.flatnonzero(np.diff(painted.astype(int)))
    return (steps + 0.5) * SPACING_M


@pytest.mark.parametrize(
    ("kind", "expected", "stripes"),
    [
        ("solid", MarkingKind.SOLID, [True]),
        ("dashed", MarkingKind.DASHED, [False]),
        ("double_solid", MarkingKind.DOUBLE_SOLID, [True, True]),
        ("double_dashed", MarkingKind.DOUBLE_DASHED, [False, False]),
        ("solid_dashed", MarkingKind.SOLID_DASHED, [True, False]),
        ("dashed_solid", MarkingKind.DASHED_SOLID, [False, True]),
        ("botts_dots", MarkingKind.BOTTS_DOTS, [False]),
    ],
)
@pytest.mark.parametrize("side", ["right", "left"])
def test_every_kind_comes_back_with_its_stripes_from_left_to_right(tmp_path, kind, expected, stripes, side):
    more = "right = [{}]\n" if side == "left" else ""
    more += f'{side} = [{{ paint = {{ kind = "{kind}" }} }}]\n'
    found = markings(tmp_path, more)
    y = -3.5 if side == "right" else 3.5
    lines = [m for m in found if abs(m.points_world_m[0, 1] - y) < 0.5]
    lines.sort(key=lambda line: -line.points_world_m[0, 1])
    assert {int(m.kind[0]) for m in lines} == {int(expected)}
    assert [bool(m.painted.all()) for m in lines if m.painted.any()] == stripes


def test_stripes_of_a_double_line_lie_apart_by_their_gap(tmp_path):
    paint = 'right = [{ paint = { kind = "double_solid", width_m = 0.1, double_gap_m = 0.2 } }]\n'
    left, right = right_line(tmp_path, paint)
    assert (left.stripe, right.stripe) == (Stripe.LEFT, Stripe.RIGHT)
    apart = left.points_world_m[:, 1] - right.points_world_m[:, 1]
    np.testing.assert_allclose(apart, 0.3, atol=1e-12)
    assert left.width_m[0] == 0.1


DASHED = 'right = [{ paint = { kind = "dashed", dash_m = 4, gap_m = 8 } }]\n'


@pytest.mark.parametrize("length", [5.0, 10.0, 20.0, 50.0])
def test_p3s_gaps_are_as_long_as_they_say(tmp_path, length):
    (line,) = right_line(tmp_path, f"gap = [{{ borders = [-1], at_m = 100, length_m = {length} }}]\n")
    np.testing.assert_allclose(edges(line.painted), [100.0, 100.0 + length], atol=SPACING_M)


@pytest.mark.parametrize("phase", [0, 5, -7.5])
def test_dashes_keep_step_over_a_gap_that_cuts_two_of_them(tmp_path, phase):
    dashed = DASHED.replace("gap_m = 8", f"gap_m = 8, phase_m = {phase}")
    (line,) = right_line(tmp_path, dashed + "gap = [{ borders = [-1], at_m = 98, length_m = 23 }]\n")
    (whole,) = right_line(tmp_path, dashed)
    s = line.points_world_m[:, 0]
    inside = (s >= 98.0 + 1e-6) & (s < 121.0 - 1e-6)
    assert not line.painted[inside].any()
    outside = (s < 98.0 - 1e-6) | (s > 121.0 + 1e-6)
    np.testing.assert_array_equal(line.painted[outside], whole.painted[outside])
    assert whole.painted[inside].any()


def test_dashes_keep_step_over_the_sections_of_the_map(tmp_path):
    more = DASHED.replace("right = [", "left = [{ from_m = 105.7, taper_m = 20 }]\nright = [")
    (line,), (whole,) = right_line(tmp_path, more), right_line(tmp_path, DASHED)
    differs = np.flatnonzero(line.painted != whole.painted)
    assert len(differs) <= len(edges(whole.painted))  # a station on an edge may fall to either side
    assert np.abs(edges(line.painted) - edges(whole.painted)).max() <= SPACING_M * 1.01


def test_the_phase_says_where_a_dash_begins(tmp_path):
    (line,) = right_line(tmp_path, DASHED.replace("gap_m = 8", "gap_m = 8, phase_m = 3"))
    np.testing.assert_allclose(edges(line.painted)[:3], [3.0, 7.0, 15.0], atol=SPACING_M)


def test_a_stretch_is_painted_otherwise_between_its_ends(tmp_path):
    more = 'paint = [{ border = -1, from_m = 100, to_m = 150, kind = "dashed", colour = "yellow" }]\n'
    (line,) = right_line(tmp_path, more)
    where = [5_000, 12_000, 20_000]
    assert line.kind[where].tolist() == [MarkingKind.SOLID, MarkingKind.DASHED, MarkingKind.SOLID]
    assert line.colour[where].tolist() == [Colour.WHITE, Colour.YELLOW, Colour.WHITE]


def test_contrast_and_wear_change_along_the_line_as_written(tmp_path):
    more = 'right = [{ paint = { kind = "solid", contrast = [[100, 1.0], [200, 0.2]], wear = 0.4 } }]\n'
    (line,) = right_line(tmp_path, more)
    np.testing.assert_allclose(line.contrast[[0, 10_000, 15_000, 25_000]], [1.0, 1.0, 0.6, 0.2], atol=1e-9)
    np.testing.assert_allclose(line.wear, 0.4, atol=1e-12)


def test_paint_as_new_costs_no_arrays(tmp_path):
    (line,) = right_line(tmp_path, "")
    assert (line.contrast, line.wear, line.valid) == (1.0, 0.0, True)


GHOST = "ghost = [{ border = -1, from_m = 50, to_m = 250, offset_m = 0.8, contrast = 0.2 }]\n"


def test_a_ghost_line_lies_beside_its_border_with_a_contrast_of_its_own(tmp_path):
    found = [m for m in markings(tmp_path, GHOST) if abs(m.points_world_m[0, 1] + 2.7) < 1e-9]
    (ghost,) = found
    np.testing.assert_allclose(ghost.points_world_m[[0, -1], 0], [50.0, 250.0], atol=SPACING_M)
    assert ghost.painted.all()
    assert not ghost.valid.any()
    assert ghost.contrast.max() == pytest.approx(0.2)


CONSTRUCTION = """[[road.construction]]
border = -1
from_m = 100
to_m = 200
offset_m = [[100, 0], [140, 1], [160, 1], [200, 0]]
"""


def test_a_construction_line_is_yellow_and_overrides_the_white_one_for_its_length(tmp_path):
    found = markings(tmp_path, CONSTRUCTION)
    (white,) = [m for m in found if m.points_world_m[0, 1] == -3.5 and m.points_world_m[0, 0] < 1.0]
    (yellow,) = [m for m in found if m.colour[0] == Colour.YELLOW]
    np.testing.assert_allclose(yellow.points_world_m[[0, -1], 0], [100.0, 200.0], atol=SPACING_M)
    np.testing.assert_allclose(yellow.points_world_m[[2_000, 5_000], 1], [-3.0, -2.5], atol=1e-9)
    assert yellow.painted.all()
    assert yellow.valid is True
    np.testing.assert_allclose(edges(white.valid), [100.0, 200.0], atol=SPACING_M)
    assert white.painted.all()


def test_extra_lines_keep_their_ids_over_blocks_and_laps(tmp_path):
    more = "closed = true\n" + GHOST.replace("250", "480")
    text = STRAIGHT.replace(
        'kind = "straight", length_m = 300', 'kind = "arc", radius_m = 80, turn_deg = 360'
    )
    drive = Corridor(built(tmp_path, text + more), CorridorConfig(road="1", lane=-1))
    lap = drive.lap_m
    ids = [
        {m.id for m in drive.markings_window(s, s + 20.0) if m.valid is not True and not m.valid.all()}
        for s in (60.0, 210.0, 400.0, 60.0 + lap)
    ]
    assert [len(found) for found in ids] == [1, 1, 1, 1]
    assert ids[0] == ids[1] == ids[2]
