"""Elevation and superelevation of road files against closed forms."""

import math

import numpy as np
import pytest

from tests.world.road.made import STRAIGHT, built, line_of

EXACT_M = 1e-9
CREST = (
    "elevation = [{ at_m = 0, z_m = 0 }, { at_m = 150, z_m = 3, radius_m = 2000 }, { at_m = 300, z_m = 0 }]\n"
)


def test_a_crest_is_a_parabola_between_its_tangents(tmp_path):
    road = built(tmp_path, STRAIGHT + CREST).roads["1"]
    grade, radius, top = 0.02, 2000.0, 150.0
    half = radius * grade  # its length is R * 2 g
    for s in (0.0, 60.0, top - half, top - 10.0, top, top + 25.0, top + half, 299.0):
        on_curve = abs(s - top) < half
        tangent = 3.0 - grade * abs(s - top)
        apex = 3.0 - half * grade / 2.0
        expected = apex - (s - top) ** 2 / (2.0 * radius) if on_curve else tangent
        assert road.point(s, 0.0)[0, 2] == pytest.approx(expected, abs=EXACT_M)


def test_height_and_grade_have_no_step_where_parabolas_begin(tmp_path):
    road = built(tmp_path, STRAIGHT + CREST).roads["1"]
    for s in road.elevation.starts_m[1:]:
        before, after = (np.array(road.elevation.at(np.array([s + step]))[:2]) for step in (-1e-9, 1e-9))
        np.testing.assert_allclose(before, after, atol=1e-10)


def test_a_positive_superelevation_lifts_the_left_side(tmp_path):
    road = built(tmp_path, STRAIGHT + "superelevation_percent = [[100, 0], [200, 5]]\n").roads["1"]
    angle = math.atan(0.05)
    assert road.point(250.0, 3.0)[0, 2] == pytest.approx(3.0 * math.sin(angle), abs=EXACT_M)
    assert road.point(150.0, 3.0)[0, 2] == pytest.approx(3.0 * math.sin(angle / 2.0), abs=EXACT_M)
    assert road.point(99.0, 3.0)[0, 2] == 0.0


def test_a_bend_falls_to_its_inside_and_is_level_before_and_after_it(tmp_path):
    more = "left = [{ width_m = 3 }]\n"
    bend = 'kind = "bend", radius_m = 300, turn_deg = -60, clothoid_m = 80, superelevation_percent = 6'
    road = built(
        tmp_path,
        line_of('kind = "straight", length_m = 100', bend, 'kind = "straight", length_m = 100', more=more),
    ).roads["1"]
    tilt = road.superelevation.at(np.array([99.0, 180.0, 220.0, road.length_m - 180.0, road.length_m - 1.0]))[
        0
    ]
    full = math.atan(0.06)  # a bend to the right: the left side rises
    np.testing.assert_allclose(tilt, [0.0, full, full, full, 0.0], atol=1e-12)
