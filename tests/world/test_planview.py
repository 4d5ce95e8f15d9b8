"""The reference line against closed forms and against an independent integration of its curvature."""

import itertools
import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from tests.maps import REAL_MAPS, geometry, loaded, road
from tests.shared import needs_shared
from vsensor.world.opendrive import load_map
from vsensor.world.opendrive.planview import Arc, ParamPoly3, Spiral


def clothoid_end(start, end, length):
    """Return u, v of a clothoid's end in 30 digits: the integral of the heading's cosine and sine."""
    with mpmath.workdps(30):
        k0, rate = mpmath.mpf(start), (mpmath.mpf(end) - mpmath.mpf(start)) / mpmath.mpf(length)

        def turn(s):
            return mpmath.expj(s * (k0 + s * rate / 2))

        z = mpmath.quad(turn, mpmath.linspace(0, mpmath.mpf(length), 21))
        return float(z.real), float(z.imag)


@pytest.mark.parametrize("curvature", [0.01, -0.2, 1e-9, 0.0])
def test_an_arc_lies_on_its_circle(curvature):
    s = np.array([0.0, 10.0, 50.0])
    u, v, heading, _ = Arc(curvature).local(s)
    np.testing.assert_allclose(heading, curvature * s, atol=1e-15)
    if abs(curvature) > 1e-6:
        expected_u, expected_v = np.sin(s * curvature) / curvature, (1 - np.cos(s * curvature)) / curvature
    else:  # series, next term below 1e-20
        expected_u, expected_v = s, curvature * s**2 / 2
    np.testing.assert_allclose(np.array([u, v]), [expected_u, expected_v], atol=1e-12)


@pytest.mark.parametrize(
    ("start", "end", "length"),
    [
        (0.0, 0.01, 100.0),
        (-0.004, 1e-05, 100.0),
        (0.1, -0.2, 60.0),
        (0.01, 0.01, 80.0),  # constant curvature
        (0.0, 0.0, 80.0),  # a line
        (0.01, 0.01 + 1e-13, 80.0),
        (0.0, 1e-15, 500.0),
        (0.02, 0.02000001, 300.0),
        (1.0, 0.001, 200.0),
    ],
)
def test_a_spiral_ends_where_30_digits_say(start, end, length):
    u, v, heading, curvature = Spiral(start, end, length).local(np.array([length]))
    np.testing.assert_allclose([u[0], v[0]], clothoid_end(start, end, length), atol=1e-11)
    assert heading[0] == pytest.approx((start + end) * length / 2, abs=1e-12)
    assert curvature[0] == pytest.approx(end, abs=1e-15)


def test_a_spiral_is_smooth_over_its_inner_knots():
    s = np.linspace(0.0, 100.0, 100_001)
    u, v, heading, _ = Spiral(0.05, -0.1, 100.0).local(s)
    step = np.hypot(np.diff(u), np.diff(v))
    np.testing.assert_allclose(step, 1e-3, atol=1e-12)  # chord of 1 mm: sag below 1e-12
    direction = np.unwrap(np.arctan2(np.diff(v), np.diff(u)))
    np.testing.assert_allclose(direction, (heading[1:] + heading[:-1]) / 2, atol=1e-9)


PARABOLA = (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.005, 0.0)


def parabola_length(p):
    """Return the arc length of v = 0.005 u^2 up to u = p, in closed form."""
    slope = 0.01 * p
    return (slope * math.sqrt(1 + slope * slope) + math.asinh(slope)) / 0.02


def test_s_on_a_cubic_is_the_true_arc_length():
    curve = ParamPoly3(*PARABOLA, p_max=80.0, length_m=parabola_length(80.0))
    for p in (0.0, 17.0, 55.5, 80.0):
        u, v, heading, curvature = curve.local(np.array([parabola_length(p)]))
        np.testing.assert_allclose([u[0], v[0]], [p, 0.005 * p * p], atol=1e-10)
        assert heading[0] == pytest.approx(math.atan(0.01 * p), abs=1e-12)
        assert curvature[0] == pytest.approx(0.01 / (1 + (0.01 * p) ** 2) ** 1.5, abs=1e-13)


def test_normalized_and_arc_length_parameters_describe_the_same_curve():
    length, places = parabola_length(80.0), np.linspace(0.0, parabola_length(80.0), 7)
    by_length = ParamPoly3(*PARABOLA, p_max=80.0, length_m=length).local(places)
    scaled = (0.0, 80.0, 0.0, 0.0), (0.0, 0.0, 0.005 * 6400, 0.0)
    normalized = ParamPoly3(*scaled, p_max=1.0, length_m=length).local(places)
    np.testing.assert_allclose(by_length, normalized, atol=1e-9)


def test_a_param_poly_without_p_range_is_normalized(tmp_path):
    coefficients = 'aU="0" bU="100" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"'
    plans = [geometry(f"<paramPoly3 {coefficients} {span}/>", 100.0) for span in ("", 'pRange="normalized"')]
    ends = [loaded(tmp_path, road(plan)).road(1).point(100.0, 0.0)[0] for plan in plans]
    np.testing.assert_allclose(ends, [[100.0, 0.0, 0.0]] * 2, atol=1e-9)


def test_a_poly3_runs_as_far_as_its_length(tmp_path):
    plan = geometry('<poly3 a="0" b="0" c="0.005" d="0"/>', parabola_length(60.0))
    end = loaded(tmp_path, road(plan, length=parabola_length(60.0))).road(1).point(parabola_length(60.0), 0.0)
    np.testing.assert_allclose(end[0], [60.0, 18.0, 0.0], atol=1e-9)


def test_the_heading_at_a_start_at_rest_is_its_limit():
    curve = ParamPoly3((0.0, 0.0, 30.0, 0.0), (0.0, -5e-14, 40.0, 0.0), p_max=1.0, length_m=50.0)
    assert curve.starts_at_rest
    _, _, heading, _ = curve.local(np.array([0.0, 1.0, 50.0]))
    np.testing.assert_allclose(heading, math.atan2(4, 3), atol=1e-6)


def judged_end(record):
    """Return dx, dy, turn of a record in its own frame by a way of its own: adaptive quadrature, polyval."""
    curve, length = record.curve, record.length_m
    if isinstance(curve, ParamPoly3):
        u, v = curve.u[::-1], curve.v[::-1]
        p = curve.p_max
        return (
            np.polyval(u, p),
            np.polyval(v, p),
            math.atan2(np.polyval(np.polyder(v), p), np.polyval(np.polyder(u), p)),
        )
    start = curve.curvature_per_m if isinstance(curve, Arc) else curve.start_per_m
    end = curve.curvature_per_m if isinstance(curve, Arc) else curve.end_per_m

    def turn(s):
        return start * s + (end - start) * s * s / (2 * length)

    exact = {"epsabs": 1e-11, "epsrel": 1e-12, "limit": 500}
    x = quad(lambda s: math.cos(turn(s)), 0, length, **exact)[0]
    y = quad(lambda s: math.sin(turn(s)), 0, length, **exact)[0]
    return x, y, turn(length)


def placed(record, x, y, turn):
    """Return the judge's end in the world."""
    cos, sin = math.cos(record.heading_rad), math.sin(record.heading_rad)
    return record.x_m + x * cos - y * sin, record.y_m + x * sin + y * cos, record.heading_rad + turn


def apart(end, record):
    """Return the gap in metres and radians between an end and the next record's stated start."""
    turn = math.remainder(end[2] - record.heading_rad, 2 * math.pi)
    return math.hypot(end[0] - record.x_m, end[1] - record.y_m), abs(turn)


def our_end(record):
    x, y, heading, _ = record.at(np.array([record.length_m]))
    return x[0], y[0], heading[0]


ROUNDED_BY_THE_FILE = {
    "Town01": 9,  # lengths and curvatures written from float32: up to 0.35 mm
    "Town04": 90,  # likewise: up to 1.5 mm
    "curves_elevation": 10,  # spirals fitted to 16 um
}
"""Joints whose own numbers do not meet within 1e-6 m, as the independent integration says too."""


@needs_shared
@pytest.mark.parametrize("path", REAL_MAPS, ids=lambda path: path.stem)
def test_records_close_where_the_files_numbers_do(path):
    open_joints = 0
    for each in load_map(path).roads.values():
        for record, after in itertools.pairwise(each.plan.records):
            judge, ours = placed(record, *judged_end(record)), our_end(record)
            np.testing.assert_allclose(ours, judge, atol=1e-9)
            open_joints += apart(judge, after)[0] > 1e-6
    assert open_joints == ROUNDED_BY_THE_FILE.get(path.stem, 0)
