"""The exact curves of markings: their Taylor series against closed forms and against the points."""

import math

import numpy as np
import pytest

from tests.maps import REAL_MAPS, geometry, lane, loaded, road, section
from tests.shared import needs_shared
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map, taylor
from vsensor.world.route import CorridorConfig

RIGHT = section(right=[lane(-1, width="4.0")])
S_M = np.array([20.0, 41.3, 63.7])


def curvature_of(series):
    """Return curvature and its change per metre of length of plane curves, from their series (4, 3, N)."""
    (dx, dy), (ax, ay), (jx, jy) = (factor * series[k, :2] for k, factor in ((1, 1.0), (2, 2.0), (3, 6.0)))
    speed = np.hypot(dx, dy)
    bend = dx * ay - dy * ax
    along = (dx * jy - dy * jx) / speed**3 - 3.0 * bend * (dx * ax + dy * ay) / speed**5
    return bend / speed**3, along / speed


def series_of(road_map, lane_id, s_m):
    """Return the series of a lane's outer border at s, along s."""
    each = next(iter(road_map.roads.values()))
    frame, t = each.series(s_m), each.sections[0].border_series(s_m, (lane_id,))[lane_id]
    return frame.line + taylor.product(t[:, None], frame.e_t)


@pytest.mark.parametrize("curvature", [0.0, 1 / 250, -1 / 40])
def test_a_border_beside_an_arc_has_the_curvature_of_its_own_radius(tmp_path, curvature):
    plan = geometry(f'<arc curvature="{curvature!r}"/>', 100.0, hdg=0.7)
    found, change = curvature_of(series_of(loaded(tmp_path, road(plan, RIGHT)), -1, S_M))
    np.testing.assert_allclose(found, curvature / (1 + 4.0 * curvature), atol=1e-15)
    np.testing.assert_allclose(change, 0.0, atol=1e-15)


def test_a_border_beside_a_clothoid_turns_as_its_parallel_does(tmp_path):
    start, end = -1 / 300, 1 / 60
    plan = geometry(f'<spiral curvStart="{start!r}" curvEnd="{end!r}"/>', 100.0, hdg=-2.0)
    found, change = curvature_of(series_of(loaded(tmp_path, road(plan, RIGHT)), -1, S_M))
    k, rate = start + (end - start) * S_M / 100.0, (end - start) / 100.0
    np.testing.assert_allclose(found, k / (1 + 4.0 * k), rtol=1e-13)
    np.testing.assert_allclose(change, rate / (1 + 4.0 * k) ** 3, rtol=1e-12)


def test_a_lane_that_widens_on_a_straight_road_is_its_own_cubic(tmp_path):
    widening = '<width sOffset="0" a="3" b="0.01" c="2e-4" d="-1e-6"/>'
    lanes = section(right=[lane(-1).replace('<width sOffset="0" a="3.5" b="0" c="0" d="0"/>', widening)])
    found = series_of(loaded(tmp_path, road(None, lanes)), -1, S_M)
    expected = [
        -(3 + 0.01 * S_M + 2e-4 * S_M**2 - 1e-6 * S_M**3),
        -(0.01 + 4e-4 * S_M - 3e-6 * S_M**2),
        -(2e-4 - 3e-6 * S_M),
        np.full(3, 1e-6),
    ]
    np.testing.assert_allclose(found[:, 1], expected, rtol=1e-12)


def test_a_parabola_as_param_poly3_has_the_parabolas_curvature(tmp_path):
    b = 0.004  # v = b u^2, u from 0 to 80
    length = 40 * math.hypot(1, 160 * b) + math.asinh(160 * b) / (4 * b)
    inner = (
        f'<paramPoly3 aU="0" bU="80" cU="0" dU="0" aV="0" bV="0" cV="{b * 6400}" dV="0" pRange="normalized"/>'
    )
    plan = geometry(inner, length)
    found = series_of(loaded(tmp_path, road(plan, RIGHT, length=length)), 0, S_M)
    curvature, change = curvature_of(found)
    u = found[0, 0]
    slope = 2 * b * u
    np.testing.assert_allclose(found[0, 1], b * u**2, atol=1e-9)
    np.testing.assert_allclose(curvature, 2 * b / (1 + slope**2) ** 1.5, rtol=1e-9)
    np.testing.assert_allclose(change, -12 * b**2 * slope / (1 + slope**2) ** 3, rtol=1e-8)
    np.testing.assert_allclose(np.hypot(*found[1, :2]), 1.0, rtol=1e-9)


def remainder_m(corridor, marking, step):
    """Return how far the series, taken half a step and a step further on, is from the curve there, m."""
    stations = marking.station + np.linspace(30.0, len(marking.points_world_m) - 60.0, 7)
    ids = np.full(7, marking.id)
    at = marking.curve.series(ids, stations)
    worst = []
    for further in (step, step / 2):
        there = marking.curve.series(ids, stations + further)[0]
        along = np.linalg.norm(at[1], axis=0)
        reach = np.linalg.norm(there - at[0], axis=0) / along
        for _ in range(4):  # the parameter at which the series is nearest
            here = at[0] + reach * (at[1] + reach * (at[2] + reach * at[3]))
            reach = reach + ((there - here) * at[1]).sum(axis=0) / along**2
        worst.append(np.linalg.norm(there - here, axis=0))
    return np.array(worst)


HILLY = {
    "elevation": '<elevation s="0" a="1" b="0.03" c="-4e-4" d="2e-6"/>',
    "lateral": '<superelevation s="0" a="0.02" b="1e-3" c="-1e-5" d="0"/>'
    '<shape s="0" t="-9" a="0.1" b="0.01" c="1e-3" d="0"/>'
    '<shape s="300" t="-9" a="0" b="0.03" c="0" d="1e-4"/>',
}


@pytest.mark.parametrize("lane_id", [1, -1])
def test_the_series_is_right_to_its_third_derivative_on_a_hill_that_bends_and_tilts(tmp_path, lane_id):
    plan = geometry('<spiral curvStart="0.002" curvEnd="0.02"/>', 200.0)
    lanes = section(left=[lane(1)], right=[lane(-1)])
    corridor = Corridor(
        loaded(tmp_path, road(plan, lanes, length=200.0, **HILLY)), CorridorConfig(road="1", lane=lane_id)
    )
    for marking in corridor.markings_window(20.0, 160.0):
        whole, half = remainder_m(corridor, marking, 16.0)  # stations: 1.6 m
        assert whole.max() > 1e-9  # a fourth derivative is left
        assert (half < whole / 12).all()  # of fourth order: a sixteenth


def test_every_station_lies_where_the_marking_has_its_point(tmp_path):
    plan = geometry('<arc curvature="0.01"/>', 150.0)
    corridor = Corridor(loaded(tmp_path, road(plan, length=150.0)), CorridorConfig(road="1", lane=-1))
    for marking in corridor.markings_window(10.0, 120.0):
        count = len(marking.points_world_m)
        found = marking.curve.series(np.full(count, marking.id), marking.station + np.arange(count))
        np.testing.assert_allclose(found[0].T, marking.points_world_m, atol=1e-11)
        assert ((found[1].T[:-1] * np.diff(marking.points_world_m, axis=0)).sum(axis=1) > 0).all()


@needs_shared
@pytest.mark.parametrize("path", REAL_MAPS, ids=lambda path: path.stem)
def test_on_real_maps_the_curves_go_through_the_points_of_their_markings(path):
    corridor = Corridor(load_map(path))
    for marking in corridor.markings_window(0.0, 400.0):
        places = np.arange(0, len(marking.points_world_m), 37)
        found = marking.curve.series(np.full(len(places), marking.id), marking.station + places)
        np.testing.assert_allclose(found[0].T, marking.points_world_m[places], atol=1e-8)


def test_a_line_that_is_not_on_the_route_has_no_curve(tmp_path):
    corridor = Corridor(loaded(tmp_path, road()), CorridorConfig(road="1", lane=-1))
    (marking, *_) = corridor.markings_window(10.0, 60.0)
    assert np.isnan(marking.curve.series(np.array([999, marking.id]), np.array([200.0, -5.0]))).all()
