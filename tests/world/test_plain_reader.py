"""Borders of the real maps against a plain reader of its own: one point at a time, by adaptive quadrature."""

import math
import random
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from tests.maps import REAL_MAPS
from tests.shared import needs_shared
from vsensor.world.opendrive import load_map

EXACT = {"epsabs": 1e-11, "epsrel": 1e-12, "limit": 200}


def value(element, name):
    return float(element.get(name))


def active(elements, key, s):
    """Return the last element that starts at or before s."""
    return max((e for e in elements if value(e, key) <= s), key=lambda e: value(e, key), default=None)


def cubic(elements, key, s):
    """Return the value of a piecewise cubic, 0 where it says nothing."""
    element = active(elements, key, s)
    if element is None:
        return 0.0
    ds = s - value(element, key)
    return sum(value(element, name) * ds**power for power, name in enumerate("abcd"))


def poly(element, axis, p, order=0):
    """Return a paramPoly3 coordinate or its first derivative."""
    coefficients = [value(element, f"{name}{axis}") for name in "dcba"]
    return float(np.polyval(np.polyder(coefficients, order), p))


def local(geometry, ds):
    """Return u, v, heading of one record."""
    shape, length = geometry[0], value(geometry, "length")
    if shape.tag == "paramPoly3":
        p_max = length if shape.get("pRange") == "arcLength" else 1.0

        def speed(p):
            return math.hypot(poly(shape, "U", p, 1), poly(shape, "V", p, 1))

        wanted = ds / length * quad(speed, 0.0, p_max, **EXACT)[0]
        p = brentq(lambda p: quad(speed, 0.0, p, **EXACT)[0] - wanted, 0.0, p_max, xtol=1e-13)
        return (
            poly(shape, "U", p),
            poly(shape, "V", p),
            math.atan2(poly(shape, "V", p, 1), poly(shape, "U", p, 1)),
        )
    start = {"line": 0.0, "arc": shape.get("curvature"), "spiral": shape.get("curvStart")}[shape.tag]
    end = shape.get("curvEnd") if shape.tag == "spiral" else start
    start, end = float(start), float(end)

    def heading(s):
        return start * s + (end - start) * s * s / (2 * length)

    u = quad(lambda s: math.cos(heading(s)), 0.0, ds, **EXACT)[0]
    v = quad(lambda s: math.sin(heading(s)), 0.0, ds, **EXACT)[0]
    return u, v, heading(ds)


def border_point(road, section, lane_id, s):
    """Return the world point of the outer border of a lane at s."""
    geometry = active(road.findall("planView/geometry"), "s", s)
    u, v, turn = local(geometry, s - value(geometry, "s"))
    hdg = value(geometry, "hdg")
    x = value(geometry, "x") + u * math.cos(hdg) - v * math.sin(hdg)
    y = value(geometry, "y") + u * math.sin(hdg) + v * math.cos(hdg)
    side = int(math.copysign(1, lane_id))
    t = cubic(road.findall("lanes/laneOffset"), "s", s)
    for lane in section.iter("lane"):
        if 0 < side * int(lane.get("id")) <= side * lane_id:
            t += side * max(0.0, cubic(lane.findall("width"), "sOffset", s - value(section, "s")))
    z = cubic(road.findall("elevationProfile/elevation"), "s", s)
    tilt = cubic(road.findall("lateralProfile/superelevation"), "s", s)
    step = 1e-5
    slope = (cubic(road.findall("elevationProfile/elevation"), "s", s + step) - z) / step
    h, pitch = hdg + turn, -math.atan(slope)
    ahead = math.sin(pitch) * math.sin(tilt)
    across = (
        math.cos(h) * ahead - math.sin(h) * math.cos(tilt),
        math.sin(h) * ahead + math.cos(h) * math.cos(tilt),
        math.cos(pitch) * math.sin(tilt),
    )
    return np.array([x, y, z]) + t * np.array(across)


@needs_shared
@pytest.mark.parametrize("path", REAL_MAPS, ids=lambda path: path.stem)
def test_borders_lie_where_a_plain_reader_puts_them(path):
    road_map, rng = load_map(path), random.Random(path.stem)
    roads = ElementTree.parse(path).getroot().findall("road")
    for _ in range(25):
        road = rng.choice(roads)
        sections = road.findall("lanes/laneSection")
        s = rng.uniform(0.0, road_map.road(road.get("id")).length_m - 2e-5)
        section = active(sections, "s", s)
        lane_id = rng.choice([int(lane.get("id")) for lane in section.iter("lane")])
        if lane_id == 0:
            continue
        each = road_map.road(road.get("id"))
        ours = each.sections[sections.index(section)]
        t, _ = ours.borders(np.array([s]), (lane_id,))
        expected = border_point(road, section, lane_id, s)
        np.testing.assert_allclose(each.point(s, t[lane_id])[0], expected, atol=2e-8)
