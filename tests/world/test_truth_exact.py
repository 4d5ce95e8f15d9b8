"""The truth on maps against closed forms: straight, arc, clothoid; to 1e-9 m, from the map's own curve."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

from tests.maps import geometry, lane, loaded, road, section
from tests.truths import ego_on, output_at, output_on
from vsensor.signals import VehicleConfig
from vsensor.types import Side
from vsensor.world.corridor import Corridor
from vsensor.world.route import CorridorConfig
from vsensor.world.truth import RANGES_M, lane_truth, line_truths

EXACT_M = 1e-9
AXLE_M = 2.8
WIDTH_M = 3.5
MARK_M = 0.12
LANES = section(left=[lane(1)], right=[lane(-1), lane(-2)])
RANGES = np.array(RANGES_M)


def corridor_of(tmp_path, plan, length):
    """Return the drive along lane -1, its left line the reference line, its right one 3.5 m beside."""
    road_map = loaded(tmp_path, road(plan, LANES, length=length))
    return Corridor(road_map, CorridorConfig(road="1", lane=-1))


def test_beside_a_straight_line_all_is_a_straight_line(tmp_path):
    plan = geometry("<line/>", 300.0, x=1e5, y=-5e5, hdg=0.9)
    offset, turn = 0.4, 0.03
    output = output_on(corridor_of(tmp_path, plan, 300.0), 63.21, offset, turn)
    truths = line_truths(output, AXLE_M)
    for side, lateral in ((Side.LEFT, WIDTH_M / 2), (Side.RIGHT, -WIDTH_M / 2)):
        y0, slope = (lateral - offset) / math.cos(turn), -math.tan(turn)
        truth = truths[side]
        np.testing.assert_allclose(truth.y_m, y0 + slope * RANGES, atol=EXACT_M)
        np.testing.assert_allclose(truth.taylor, [y0, slope, 0.0, 0.0], atol=EXACT_M)
        np.testing.assert_allclose(truth.whole.coefficients, [y0, slope, 0.0, 0.0], atol=EXACT_M)
        inner = -math.copysign(MARK_M / 2 / math.cos(turn), lateral)
        assert truth.lane_offset_m == pytest.approx(y0 + slope * AXLE_M + inner, abs=EXACT_M)


@pytest.mark.parametrize("radius", [250.0, -400.0, 1500.0])
def test_on_an_arc_the_lines_are_circles(tmp_path, radius):
    plan = geometry(f'<arc curvature="{1 / radius!r}"/>', 300.0, hdg=0.3)
    offset, turn = -0.25, -0.02
    output = output_on(corridor_of(tmp_path, plan, 300.0), 51.7, offset, turn)
    truths = line_truths(output, AXLE_M)
    middle = radius + WIDTH_M / 2  # of the lane's middle, signed
    centre = (middle - offset) * np.array([math.sin(turn), math.cos(turn)])  # in the ego frame
    for side, line in ((Side.LEFT, radius), (Side.RIGHT, radius + WIDTH_M)):
        up = -math.copysign(1.0, radius)

        def y(x, line=line, up=up):
            return centre[1] + up * np.sqrt(line**2 - (x - centre[0]) ** 2)

        truth = truths[side]
        np.testing.assert_allclose(truth.y_m, y(RANGES), atol=EXACT_M)
        root = y(0.0) - centre[1]
        slope = centre[0] / root
        second = -(1 + slope**2) / root
        third = -3 * slope * second / root
        np.testing.assert_allclose(
            truth.taylor, [y(0.0), slope, second / 2, third / 6], rtol=1e-9, atol=1e-12
        )
        flat = second / (1 + slope**2) ** 1.5
        assert flat == pytest.approx(1 / line, rel=1e-9)  # the curvature of the marking itself


def clothoid_point(start, rate, s):
    """Return x, y, heading of a clothoid that starts along x, to 20 digits."""
    with mpmath.workdps(20):

        def heading(u):
            return start * u + rate * u * u / 2

        return (
            mpmath.quad(lambda u: mpmath.cos(heading(u)), [0, s / 2, s]),
            mpmath.quad(lambda u: mpmath.sin(heading(u)), [0, s / 2, s]),
            heading(s),
        )


def test_on_a_clothoid_the_lines_are_its_parallels(tmp_path):
    start, end, length = 0.0, 1 / 250, 300.0
    rate = (end - start) / length
    plan = geometry(f'<spiral curvStart="{start!r}" curvEnd="{end!r}"/>', length)
    corridor = corridor_of(tmp_path, plan, length)
    output = output_on(corridor, 80.0)
    ego = output.snapshot.ego
    truths = line_truths(output, AXLE_M)
    x0, y0, _ = ego.position_world_m.tolist()
    cos, sin = mpmath.cos(ego.yaw_rad), mpmath.sin(ego.yaw_rad)
    for side, t in ((Side.LEFT, 0.0), (Side.RIGHT, -WIDTH_M)):

        def place(s, t=t):
            px, py, heading = clothoid_point(start, rate, s)
            east, north = px - t * mpmath.sin(heading) - x0, py + t * mpmath.cos(heading) - y0
            return east * cos + north * sin, north * cos - east * sin, heading

        for column, x in ((None, 0.0), (2, 50.0), (4, 100.0)):
            s = mpmath.findroot(lambda s, x=x: place(s)[0] - x, 80.0 + x)
            _, y, heading = place(s)
            if column is not None:
                assert truths[side].y_m[column] == pytest.approx(float(y), abs=EXACT_M)
                continue
            curvature = start + rate * s
            bend = float(curvature / (1 - t * curvature))
            change = float(rate / (1 - t * curvature) ** 3)
            slope = math.tan(float(heading) - ego.yaw_rad)
            second = bend * (1 + slope**2) ** 1.5
            third = change * (1 + slope**2) ** 2 + 3 * slope * second**2 / (1 + slope**2)
            expected = [float(y), slope, second / 2, third / 6]
            np.testing.assert_allclose(truths[side].taylor, expected, rtol=1e-9, atol=EXACT_M)


def test_the_taylor_series_is_the_line_near_the_axle(tmp_path):
    plan = geometry('<spiral curvStart="-0.002" curvEnd="0.004"/>', 300.0, hdg=2.0)
    truth = line_truths(output_on(corridor_of(tmp_path, plan, 300.0), 70.0, 0.3, 0.05), AXLE_M)[Side.LEFT]
    at = np.polynomial.polynomial.polyval(AXLE_M, truth.taylor)
    assert truth.axle_y_m == pytest.approx(at, abs=1e-7)  # the fourth derivative over 2.8 m


def test_mirroring_the_road_flips_the_truth_and_swaps_the_sides(tmp_path):
    def truth(sign, side, offset=""):
        plan = geometry(f'<spiral curvStart="{sign * 0.001}" curvEnd="{sign * 0.004}"/>', 300.0)
        road_map = loaded(tmp_path, road(plan, LANES, length=300.0, offset=offset))
        corridor = Corridor(road_map, CorridorConfig(road="1", lane=-1))
        s = corridor.poses(np.arange(60.0, 100.0, 0.01))  # beside the same place of the reference line
        s = 60.0 + 0.01 * float(np.argmin(np.abs(s.position_world_m[:, 0] - 80.0)))
        turn = -sign * (0.01 + float(corridor.pose(s).yaw_rad[0]) * sign)
        ego = replace(ego_on(corridor, s, 0.0, turn), position_world_m=np.array([80.0, -sign * 1.0, 0.0]))
        return line_truths(output_at(ego, corridor.markings_window(20.0, 250.0)), AXLE_M)[side]

    # The reference line is the left line of the one road, the right line of the other.
    left, right = truth(1, Side.LEFT), truth(-1, Side.RIGHT, '<laneOffset s="0" a="3.5" b="0" c="0" d="0"/>')
    np.testing.assert_allclose(right.taylor, -left.taylor, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(right.y_m, -left.y_m, atol=EXACT_M)
    assert right.lane_offset_m == pytest.approx(-left.lane_offset_m, abs=EXACT_M)


def test_a_drive_against_the_road_sees_the_same_lines_turned_round(tmp_path):
    plan = geometry('<spiral curvStart="0.001" curvEnd="0.004"/>', 300.0)
    road_map = loaded(tmp_path, road(plan, section(left=[lane(1)], right=[lane(-1)]), length=300.0))
    along, against = (Corridor(road_map, CorridorConfig(road="1", lane=i)) for i in (-1, 1))
    here = line_truths(output_on(along, 150.0), AXLE_M)[Side.LEFT]  # the reference line
    ego = ego_on(along, 150.0)
    turned = replace(ego, yaw_rad=ego.yaw_rad + math.pi)
    there = line_truths(output_at(turned, against.markings_window(0.0, 290.0)), AXLE_M)[Side.RIGHT]
    np.testing.assert_allclose(there.taylor, here.taylor * [-1, 1, -1, 1], rtol=1e-7, atol=1e-9)


def test_width_speed_across_and_time_to_crossing_are_those_of_a_straight_lane(tmp_path):
    corridor = corridor_of(tmp_path, geometry("<line/>", 300.0), 300.0)
    offset, turn = 0.3, 0.02
    output = output_on(corridor, 100.0, offset, turn)
    vehicle = VehicleConfig(wheelbase_m=AXLE_M, width_m=1.8)
    lane_at_axle = lane_truth(vehicle, line_truths(output, AXLE_M), output.snapshot.ego)
    across = 30.0 * math.sin(turn)
    gap = WIDTH_M / 2 - MARK_M / 2 - offset - AXLE_M * math.sin(turn) - 0.9 * math.cos(turn)
    assert lane_at_axle.width_m == pytest.approx(WIDTH_M - MARK_M, abs=1e-9)
    assert lane_at_axle.lateral_speed_mps == pytest.approx(across, abs=1e-9)
    assert lane_at_axle.time_to_crossing_s == pytest.approx(gap / across, abs=1e-8)


def test_without_a_line_beside_the_lane_has_no_truth(tmp_path):
    output = output_on(corridor_of(tmp_path, geometry("<line/>", 300.0), 300.0), 100.0)
    lane_at_axle = lane_truth(VehicleConfig(), {}, output.snapshot.ego)
    assert math.isnan(lane_at_axle.width_m)
    assert math.isnan(lane_at_axle.time_to_crossing_s)


def left_by_a_cubic_m(y, length_m):
    """Return what the best cubic leaves of y(x) on [0, length]: the Legendre terms from the fourth on."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    basis = np.polynomial.legendre.legvander(nodes, 24)
    order = 2 * np.arange(25) + 1
    terms = order / 2 * ((weights * y(length_m / 2 * (1 + nodes))) @ basis)
    return math.sqrt(float((terms[4:] ** 2 / order[4:]).sum()))


@pytest.mark.parametrize("radius", [250.0, 400.0, 600.0, 800.0, 1000.0, 1500.0])
def test_the_fit_over_100_m_of_an_arc_leaves_what_a_cubic_must_leave(tmp_path, radius):
    """P3's fit (3.2) of the points of the map, beside the limit of any cubic."""
    plan = geometry(f'<arc curvature="{1 / radius!r}"/>', 300.0)
    truth = line_truths(output_on(corridor_of(tmp_path, plan, 300.0), 60.0), AXLE_M)[Side.LEFT]
    up = -radius
    limit = left_by_a_cubic_m(lambda x: radius + up * np.sqrt(1 - (x / radius) ** 2), 100.2)
    assert truth.whole.std_m == pytest.approx(limit, rel=0.02)  # a sum over 0.1 m in place of an integral
    assert limit > (100.2 / 2) ** 4 / (105 * radius**3)  # x^4 / (8 R^3) alone


def test_the_limit_of_a_cubic_is_that_of_its_fourth_power_where_nothing_else_is_left():
    """Of x^4 a cubic leaves (L / 2)^4 8 / 35 P4, whose rms is 1 / 3."""
    assert left_by_a_cubic_m(lambda x: x**4, 100.0) == pytest.approx(50.0**4 * 8 / 105, rel=1e-9)
