"""The reference line against closed forms and against quadrature of 30 digits."""

import math

import mpmath
import numpy as np
import pytest

from tests.world.road.made import built, line_of

EXACT_M = 1e-9


def on_line(folder, s, *pieces, more=""):
    """Return x, y, heading (N,) of the first road of these pieces at s."""
    road = built(folder, line_of(*pieces, more=more)).roads["1"]
    x, y, heading, _ = road.plan.at(np.asarray(s, float))
    return x, y, heading


def test_a_straight_is_where_it_says_to_a_nanometre(tmp_path):
    x, y, heading = on_line(
        tmp_path,
        [0.0, 123.4, 300.0],
        'kind = "straight", length_m = 300',
        more="x_m = 10\ny_m = -5\nheading_deg = 30",
    )
    angle = math.radians(30)
    np.testing.assert_allclose(x, 10 + np.array([0, 123.4, 300]) * math.cos(angle), atol=EXACT_M)
    np.testing.assert_allclose(y, -5 + np.array([0, 123.4, 300]) * math.sin(angle), atol=EXACT_M)
    np.testing.assert_allclose(heading, angle, atol=1e-15)


@pytest.mark.parametrize("radius", [250.0, -40.0])
def test_an_arc_is_a_circle_to_a_nanometre(tmp_path, radius):
    s = np.linspace(0.0, 200.0, 41)
    x, y, heading = on_line(
        tmp_path,
        100.0 + s,
        'kind = "straight", length_m = 100',
        f'kind = "arc", radius_m = {radius}, length_m = 200',
    )
    np.testing.assert_allclose(x, 100.0 + radius * np.sin(s / radius), atol=EXACT_M)
    np.testing.assert_allclose(y, radius * (1.0 - np.cos(s / radius)), atol=EXACT_M)
    np.testing.assert_allclose(heading, s / radius, atol=1e-12)


def test_a_turn_of_an_arc_is_its_length_over_the_radius(tmp_path):
    road = built(tmp_path, line_of('kind = "arc", radius_m = -120, turn_deg = 30')).roads["1"]
    assert road.length_m == pytest.approx(120 * math.radians(30), abs=1e-12)
    assert road.heading(road.length_m)[0] == pytest.approx(-math.radians(30), abs=1e-12)


def test_a_clothoid_is_its_integral_to_a_nanometre(tmp_path):
    length, end = 180.0, 1.0 / 250.0
    s = [0.0, 31.4, 90.0, 180.0]
    x, y, heading = on_line(tmp_path, s, f'kind = "clothoid", length_m = {length}, to_radius_m = 250')
    with mpmath.workdps(30):
        rate = mpmath.mpf(end) / length
        points = [mpmath.quad(lambda u: mpmath.expj(rate * u * u / 2), [0, at]) for at in s]
    np.testing.assert_allclose(x, [float(p.real) for p in points], atol=EXACT_M)
    np.testing.assert_allclose(y, [float(p.imag) for p in points], atol=EXACT_M)
    np.testing.assert_allclose(heading, np.array(s) ** 2 * end / length / 2, atol=1e-13)


def test_a_clothoid_begins_with_the_curvature_before_it(tmp_path):
    road = built(
        tmp_path,
        line_of(
            'kind = "arc", radius_m = 300, length_m = 50',
            'kind = "clothoid", length_m = 80, to_radius_m = -200',
            'kind = "clothoid", length_m = 40',
        ),
    ).roads["1"]
    np.testing.assert_allclose(
        road.curvature([49.0, 50.0, 90.0, 130.0, 170.0 - 1e-9]),
        [1 / 300, 1 / 300, (1 / 300 - 1 / 200) / 2, -1 / 200, 0.0],
        atol=1e-12,
    )


def test_joints_of_pieces_are_closed_to_a_nanometre(tmp_path):
    road = built(
        tmp_path,
        line_of(
            'kind = "straight", length_m = 333.3',
            'kind = "bend", radius_m = 250, turn_deg = 77, clothoid_m = 90',
            'kind = "bend", radius_m = 600, turn_deg = -41, clothoid_m = 110',
        ),
    ).roads["1"]
    for before, after in zip(road.plan.records, road.plan.records[1:], strict=False):
        x, y, heading, _ = before.at(np.array([before.length_m]))
        assert math.hypot(x[0] - after.x_m, y[0] - after.y_m) < EXACT_M
        assert heading[0] == pytest.approx(after.heading_rad, abs=1e-12)
    assert road.heading(road.length_m)[0] == pytest.approx(math.radians(77 - 41), abs=1e-12)


def test_a_closed_road_meets_its_start_to_a_nanometre(tmp_path):
    road_map = built(
        tmp_path,
        line_of(
            'kind = "straight", length_m = 100, stretches = true',
            'kind = "bend", radius_m = 250, turn_deg = 130, clothoid_m = 90',
            'kind = "straight", length_m = 100, stretches = true',
            'kind = "bend", radius_m = 200, turn_deg = 120, clothoid_m = 90',
            'kind = "straight", length_m = 450',
            'kind = "bend", radius_m = 150, turn_deg = 110, clothoid_m = 90',
            more="closed = true",
        ),
    )
    road = road_map.roads["1"]
    end = road.point(road.length_m, 0.0)[0]
    assert np.linalg.norm(end - road.point(0.0, 0.0)[0]) < EXACT_M
    assert road.heading(road.length_m)[0] == pytest.approx(2 * math.pi, abs=1e-12)
    assert road.successor.id == "1"
    assert road_map.warnings == ()
