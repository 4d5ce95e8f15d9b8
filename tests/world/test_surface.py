"""Points on the road against closed forms: elevation, superelevation, shape, borders."""

import math

import numpy as np
import pytest

from tests.maps import geometry, lane, loaded, real, road, section
from tests.shared import needs_shared

S = np.linspace(0.0, 100.0, 11)


def test_elevation_lifts_the_reference_line(tmp_path):
    each = loaded(tmp_path, road(elevation='<elevation s="0" a="1" b="0.1" c="0.01" d="-0.0001"/>')).road(1)
    z = 1 + 0.1 * S + 0.01 * S**2 - 0.0001 * S**3
    np.testing.assert_allclose(each.point(S, 0.0), np.column_stack([S, 0 * S, z]), atol=1e-12)


def test_positive_superelevation_lifts_the_left_side(tmp_path):
    each = loaded(tmp_path, road(lateral='<superelevation s="0" a="0.1" b="0" c="0" d="0"/>')).road(1)
    expected = [50.0, 3.0 * math.cos(0.1), 3.0 * math.sin(0.1)]
    np.testing.assert_allclose(each.point(50.0, 3.0)[0], expected, atol=1e-14)


def test_height_is_measured_along_the_tilted_normal(tmp_path):
    each = loaded(tmp_path, road(lateral='<superelevation s="0" a="0.1" b="0" c="0" d="0"/>')).road(1)
    np.testing.assert_allclose(
        each.point(50.0, 0.0, 2.0)[0], [50.0, -2.0 * math.sin(0.1), 2.0 * math.cos(0.1)], atol=1e-14
    )


def test_a_shape_is_linear_between_its_stations(tmp_path):
    lateral = (
        '<shape s="0" t="-5" a="0" b="0" c="0" d="0"/><shape s="100" t="-5" a="1" b="0.1" c="0" d="0"/>'
        '<shape s="100" t="0" a="1.5" b="0" c="0" d="0"/>'
    )
    each = loaded(tmp_path, road(lateral=lateral)).road(1)
    z = [each.point(s, t)[0, 2] for s, t in ((0.0, 2.0), (100.0, 2.0), (50.0, 2.0), (100.0, -3.0))]
    np.testing.assert_allclose(z, [0.0, 1.5, 0.75, 1.2], atol=1e-12)


@pytest.mark.parametrize("tilt", ["", '<superelevation s="0" a="0.3" b="-0.01" c="0.0002" d="0"/>'])
def test_the_frames_derivatives_are_those_of_its_points(tmp_path, tilt):
    plan = geometry('<spiral curvStart="0.01" curvEnd="-0.02"/>', 100.0)
    elevation = '<elevation s="0" a="0" b="0.05" c="-0.001" d="0.00001"/>'
    each = loaded(tmp_path, road(plan, elevation=elevation, lateral=tilt)).road(1)
    s, h = np.linspace(5.0, 95.0, 19), 1e-4
    frame, low, high = each.cross(s), each.cross(s - h), each.cross(s + h)
    for name in ("line", "e_t", "e_h"):
        central = (getattr(high, name) - getattr(low, name)) / (2 * h)
        np.testing.assert_allclose(getattr(frame, f"d_{name}"), central, atol=1e-7)


def test_borders_add_up_the_widths_from_the_lane_offset(tmp_path):
    lanes = section(left=[lane(2, "2"), lane(1, "3")], right=[lane(-1, "3.5"), lane(-2, "1.5")])
    offset = '<laneOffset s="0" a="0.5" b="0.01" c="0" d="0"/>'
    cross_section = loaded(tmp_path, road(sections=lanes, offset=offset)).road(1).sections[0]
    t, slope = cross_section.borders(np.array([10.0]), cross_section.ids)
    assert {i: float(t[i][0]) for i in cross_section.ids} == pytest.approx(
        {2: 5.6, 1: 3.6, 0: 0.6, -1: -2.9, -2: -4.4}
    )
    assert {float(value[0]) for value in slope.values()} == {0.01}


def test_border_polynomials_stand_for_widths(tmp_path):
    def bordered(number, a):
        return f'<lane id="{number}" type="driving"><border sOffset="0" a="{a}" b="0" c="0" d="0"/></lane>'

    lanes = section(left=[bordered(1, 4)], right=[bordered(-1, -4), bordered(-2, -6)])
    cross_section = loaded(tmp_path, road(sections=lanes)).road(1).sections[0]
    t, _ = cross_section.borders(np.array([10.0]), cross_section.ids)
    assert [float(t[i][0]) for i in cross_section.ids] == [4.0, 0.0, -4.0, -6.0]


def test_a_width_that_is_below_zero_by_rounding_counts_as_zero(tmp_path):
    lanes = section(right=[lane(-1, "-0.0009"), lane(-2, "3")])
    cross_section = loaded(tmp_path, road(sections=lanes)).road(1).sections[0]
    t, _ = cross_section.borders(np.array([10.0]), cross_section.ids)
    assert [float(t[i][0]) for i in cross_section.ids] == [0.0, 0.0, -3.0]


def test_a_single_sided_section_changes_its_side_only(tmp_path):
    first = section(left=[lane(1, "3")], right=[lane(-1, "3")])
    second = (
        '<laneSection s="40" singleSide="true"><right>'
        + lane(-1, "4")
        + lane(-2, "2")
        + "</right></laneSection>"
    )
    each = loaded(tmp_path, road(sections=first + second)).road(1)
    assert [cross_section.ids for cross_section in each.sections] == [(1, 0, -1), (1, 0, -1, -2)]
    t, _ = each.sections[1].borders(np.array([50.0]), (1, -1))
    assert (float(t[1][0]), float(t[-1][0])) == (3.0, -4.0)


@needs_shared
def test_the_crest_has_the_height_that_its_polynomial_says():
    s = np.array([200.0, 235.0, 270.0, 305.0, 340.0])
    climbed = 0.00367346938776 * (s[:3] - 200) ** 2 - 0.0000349854227405 * (s[:3] - 200) ** 3
    z = real("crest-curve").road(0).point(s, 0.0)[:, 2]
    np.testing.assert_allclose(z[:2], climbed[:2], atol=1e-12)
    np.testing.assert_allclose(z[2:], [6.0, 3.0, 0.0], atol=1e-9)


@needs_shared
def test_the_velodrome_is_banked_by_60_degrees_in_its_bends():
    each = real("velodrome").road(1)
    inner, outer = each.point(750.0, 0.0)[0], each.point(750.0, -9.0)[0]
    assert outer[2] - inner[2] == pytest.approx(9.0 * math.sin(math.pi / 3), abs=1e-9)
    assert math.hypot(*(outer - inner)[:2]) == pytest.approx(9.0 * math.cos(math.pi / 3), abs=1e-9)


@needs_shared
def test_borders_of_the_bend_of_100_m_lie_on_circles():
    each = real("curve_r100").road(0)
    s = np.linspace(500.0, 657.0, 40)
    for t, radius in ((3.07, 96.93), (-3.07, 103.07)):
        points = each.point(s, t)
        np.testing.assert_allclose(np.hypot(points[:, 0] - 500.0, points[:, 1] - 100.0), radius, atol=1e-8)
