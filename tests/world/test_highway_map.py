"""The shipped demo map, integrated here by adaptive quadrature: nothing of the generator's arithmetic."""

import importlib.util
import itertools
import math
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from vsensor.world.opendrive import following, load_map
from vsensor.world.opendrive.network import place_at

ROOT = Path(__file__).parents[2]
MAP = ROOT / "vsensor" / "scenarios" / "highway.xodr"
JOINT_M = 1e-9


def number(element, name):
    return float(element.get(name))


def curvatures(geometry):
    """Return the curvature at the start and at the end of a geometry element, 1/m."""
    shape = geometry[0]
    if shape.tag == "spiral":
        return number(shape, "curvStart"), number(shape, "curvEnd")
    k = number(shape, "curvature") if shape.tag == "arc" else 0.0
    return k, k


def end_of(geometry):
    """Return x, y, heading at the end of a geometry element by adaptive quadrature."""
    length = number(geometry, "length")
    k0, k1 = curvatures(geometry)

    def heading(s):
        return number(geometry, "hdg") + k0 * s + (k1 - k0) / length * s * s / 2

    x = quad(lambda s: math.cos(heading(s)), 0, length, epsabs=1e-11, epsrel=1e-13, limit=200)[0]
    y = quad(lambda s: math.sin(heading(s)), 0, length, epsabs=1e-11, epsrel=1e-13, limit=200)[0]
    return number(geometry, "x") + x, number(geometry, "y") + y, heading(length)


def sampled(geometry):
    """Return x + iy along a geometry element about every 10 m, by trapezoids."""
    length = number(geometry, "length")
    s = np.linspace(0.0, length, 1 + 10 * round(length / 10))
    k0, k1 = curvatures(geometry)
    step = np.exp(1j * (number(geometry, "hdg") + k0 * s + (k1 - k0) / length * s * s / 2))
    path = np.concatenate([[0], np.cumsum((step[1:] + step[:-1]) / 2)]) * (s[1] - s[0])
    return (complex(number(geometry, "x"), number(geometry, "y")) + path)[:-1:10]


def value(polynomials, s, order=0):
    """Return a piecewise cubic of OpenDRIVE (a list of elements with s, a, b, c, d), or its slope, at s."""
    piece = [p for p in polynomials if number(p, "s") <= s + 1e-9][-1]
    d = s - number(piece, "s")
    a, b, c, e = (number(piece, k) for k in "abcd")
    return (a + b * d + c * d * d + e * d**3, b + 2 * c * d + 3 * e * d * d)[order]


@pytest.fixture(scope="module")
def roads():
    return ET.parse(MAP).getroot().findall("road")


@pytest.fixture(scope="module")
def ring(roads):
    return [g for road in roads for g in road.findall("planView/geometry")]


def test_the_shipped_map_is_what_its_generator_writes():
    path = ROOT / "tools" / "make_highway_map.py"
    spec = importlib.util.spec_from_file_location("make_highway_map", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    assert module.render() == MAP.read_text(encoding="utf-8")


def test_every_element_ends_where_the_next_begins_all_around_the_ring(ring):
    for here, after in zip(ring, [*ring[1:], ring[0]], strict=True):
        x, y, heading = end_of(here)
        assert math.hypot(x - number(after, "x"), y - number(after, "y")) < JOINT_M
        turn = math.remainder(heading - number(after, "hdg"), 2 * math.pi)
        assert abs(turn) < 1e-12


def test_curvature_has_no_step_anywhere(ring):
    for here, after in zip(ring, [*ring[1:], ring[0]], strict=True):
        assert curvatures(here)[1] == curvatures(after)[0]


def test_the_ring_turns_once_to_the_left_and_never_crosses_itself(ring):
    total = sum(number(g, "length") * sum(curvatures(g)) / 2 for g in ring)
    assert total == pytest.approx(2 * math.pi, abs=1e-12)
    points = np.concatenate([sampled(g) for g in ring])  # about 10 m apart
    gap = np.abs(points[:, None] - points)
    apart = np.abs(np.subtract.outer(np.arange(points.size), np.arange(points.size)))
    far = np.minimum(apart, points.size - apart) > 60
    assert gap[far].min() > 200.0


def test_geometries_fill_each_road_without_gap(roads):
    for road in roads:
        s = 0.0
        for g in road.findall("planView/geometry"):
            assert number(g, "s") == pytest.approx(s, abs=JOINT_M)
            s += number(g, "length")
        assert number(road, "length") == pytest.approx(s, abs=JOINT_M)


def test_it_lasts_three_minutes_at_130_kmh_per_lap_and_has_every_kind_of_geometry(ring):
    assert sum(number(g, "length") for g in ring) > 180 * 130 / 3.6
    assert {g[0].tag for g in ring} == {"line", "arc", "spiral"}
    radii = {round(1 / abs(k)) for g in ring for k in curvatures(g) if k}
    assert min(radii) >= 600
    assert max(radii) <= 2000


@pytest.mark.parametrize("profile", ["elevationProfile/elevation", "lateralProfile/superelevation"])
def test_height_and_crossfall_are_smooth_within_and_across_roads(roads, profile):
    for road, after in zip(roads, [*roads[1:], roads[0]], strict=True):
        pieces, following = road.findall(profile), after.findall(profile)
        for before, piece in itertools.pairwise(pieces):
            s = number(piece, "s")
            for order in (0, 1):
                assert value([before], s, order) == pytest.approx(value([piece], s, order), abs=JOINT_M)
        for order in (0, 1):
            end = value(pieces, number(road, "length"), order)
            assert end == pytest.approx(value(following, 0.0, order), abs=JOINT_M)


def test_a_crest_is_a_parabola_of_nine_kilometres_radius(roads):
    radii = [
        1 / (2 * number(p, "c"))
        for r in roads
        for p in r.findall("elevationProfile/elevation")
        if number(p, "c")
    ]
    assert sorted({round(r, 6) for r in radii}) == [-9000.0, 8000.0]


def test_bends_are_banked_towards_their_inside(roads):
    for road in roads:
        s = 0.0
        for g in road.findall("planView/geometry"):
            if g[0].tag == "arc":
                bank = value(road.findall("lateralProfile/superelevation"), s + number(g, "length") / 2)
                assert bank * curvatures(g)[0] < 0  # a left bend has its left side down
                assert 0.02 < abs(bank) < 0.06
            s += number(g, "length")


def test_roads_and_lanes_are_linked_all_around(roads):
    ids = [r.get("id") for r in roads]
    for k, road in enumerate(roads):
        assert road.find("link/successor").get("elementId") == ids[(k + 1) % len(ids)]
        assert road.find("link/predecessor").get("elementId") == ids[k - 1]
        for lane in road.findall("lanes/laneSection/*/lane"):
            if lane.get("id") != "0":
                assert lane.find("link/predecessor").get("id") == lane.get("id")
                assert lane.find("link/successor").get("id") == lane.get("id")


def test_marks_include_dashes_of_six_and_twelve_metres_a_double_line_and_missing_paint(roads):
    marks = [m for r in roads for m in r.findall("lanes/laneSection/*/lane/roadMark")]
    assert {m.get("type") for m in marks} == {"solid", "broken", "solid solid", "none"}
    dashes = {
        (number(x, "length"), number(x, "space"))
        for x in ET.parse(MAP).findall(".//type[@name='broken']/line")
    }
    assert dashes == {(6.0, 12.0)}


def test_marks_begin_inside_their_lane_section(roads):
    for road in roads:
        sections = road.findall("lanes/laneSection")
        ends = [*(number(s, "s") for s in sections[1:]), number(road, "length")]
        for section, end in zip(sections, ends, strict=True):
            length = end - number(section, "s")
            assert all(number(m, "sOffset") < length for m in section.findall("*/lane/roadMark"))


@pytest.fixture(scope="module")
def loaded():
    return load_map(MAP)


def test_our_reader_loads_it_without_a_warning(loaded):
    assert loaded.warnings == ()


def test_our_reader_places_the_reference_line_where_quadrature_does(loaded, roads):
    for road in roads:
        for g in road.findall("planView/geometry"):
            s = number(g, "s") + number(g, "length") * (1 - 1e-12)
            x, y, heading = end_of(g)
            plan = loaded.road(road.get("id")).plan.at(np.array([s]))
            assert math.hypot(float(plan[0][0]) - x, float(plan[1][0]) - y) < 1e-8
            assert float(plan[2][0]) == pytest.approx(heading, abs=1e-11)


@pytest.mark.parametrize("t", [-15.25, -9.0, 0.0, 9.0])
def test_surface_and_lanes_join_in_space_all_around(loaded, roads, t):
    names = [road.get("id") for road in roads]
    for name, after in zip(names, [*names[1:], names[0]], strict=True):
        end = loaded.road(name).point(np.array([loaded.road(name).length_m]), t)[0]
        start = loaded.road(after).point(np.array([0.0]), t)[0]
        assert np.linalg.norm(end - start) < 1e-8


@pytest.mark.parametrize(("lane", "direction"), [(-2, 1), (-3, 1), (-4, 1), (3, -1)])
def test_a_lane_can_be_followed_around_the_ring_back_to_where_it_began(loaded, lane, direction):
    here = first = place_at(loaded, "1", lane, 1.0 if direction > 0 else 890.0)
    roads_seen = []
    for _ in range(60):
        (here,) = following(loaded, here)
        roads_seen.append(here.road_id)
        if here == first:
            break
    assert here == first
    assert set(roads_seen) == {"1", "2", "3", "4", "5", "6"}
