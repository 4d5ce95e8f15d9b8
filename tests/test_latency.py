"""Images on their way to the bus, against closed forms."""

from dataclasses import replace
from math import atan, cos, sin, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.bus_values import PERIOD_NS, boundary, ego, estimate, slot
from vsensor.latency import Image, Motion, arc, delayed, moved
from vsensor.types import Environment, Side

MS = 1_000_000
CUBIC = [1.8, 0.02, 4e-4, -2e-6]


def image(index, line=(1.8, 0.0), speed_mps=20.0, yaw_rate_radps=0.0):
    found = replace(estimate(boundary(Side.LEFT, list(line)), index=index), exposed_at_ns=index * PERIOD_NS)
    vehicle = replace(ego(), speed_mps=speed_mps, yaw_rate_radps=yaw_rate_radps)
    return Image(estimate=found, ego=vehicle, environment=Environment())


def leaving(images, latency_ms, pose="exposure"):
    """Return what leaves at each tick."""
    line, out = (), []
    for index, newest in enumerate(images):
        line, left = delayed(line, newest, latency_ms * MS, pose, slot(index))
        out.append(left)
    return out


def y_at(line, x):
    return np.polynomial.polynomial.polyval(x, line.coefficients)


def only(estimate):
    (line,) = estimate.boundaries
    return line


def test_straight_ahead_every_coefficient_is_the_taylor_shift_of_the_line():
    line = only(moved(estimate(boundary(Side.LEFT, CUBIC)), Motion(7.0, 0.0, 0.0)))
    before = boundary(Side.LEFT, CUBIC)
    expected = np.polynomial.Polynomial(CUBIC)(np.polynomial.Polynomial([7.0, 1.0])).coef
    np.testing.assert_allclose(line.coefficients, expected, rtol=1e-9)
    assert (line.x_min_m, line.x_max_m) == pytest.approx((before.x_min_m - 7.0, before.x_max_m - 7.0))


def test_turning_on_the_spot_turns_a_straight_line_by_the_angle():
    line = only(moved(estimate(boundary(Side.LEFT, [2.0, 0.1, 0.0, 0.0])), Motion(0.0, 0.0, 0.03)))
    slope = tan(atan(0.1) - 0.03)
    expected = [2.0 / (cos(0.03) + 0.1 * sin(0.03)), slope, 0, 0]
    np.testing.assert_allclose(line.coefficients, expected, atol=1e-9)


def test_on_a_circle_the_line_beside_the_vehicle_stays_where_it_is():
    radius_m, beside_m = 500.0, 1.8
    inner = radius_m - beside_m  # of the line, left of a vehicle that turns left
    circle = [beside_m, 0.0, 1 / (2 * inner), 0.0]
    on_it = arc(ego(20.0, 20.0 / radius_m), 0.1)
    line = only(moved(estimate(boundary(Side.LEFT, circle)), on_it))
    end = line.x_max_m
    missing_m = (end + 2.0) ** 4 / (8 * inner**3) + 0.01  # what a parabola leaves out of a circle
    x = np.linspace(line.x_min_m, end, 20)
    np.testing.assert_allclose(y_at(line, x), beside_m + x**2 / (2 * inner), atol=missing_m)
    assert abs(line.coefficients[0] - beside_m) < 2e-3


@settings(max_examples=100, deadline=None)
@given(st.floats(-40, 40), st.floats(-0.8, 0.8), st.floats(0.01, 0.5))
def test_an_arc_is_many_short_straight_steps(speed_mps, rate_radps, seconds):
    whole = arc(replace(ego(), speed_mps=speed_mps, yaw_rate_radps=rate_radps), seconds)
    x = y = 0.0
    for k in range(2000):
        yaw = rate_radps * seconds * (k + 0.5) / 2000
        x += speed_mps * seconds / 2000 * cos(yaw)
        y += speed_mps * seconds / 2000 * sin(yaw)
    assert (whole.x_m, whole.y_m, whole.yaw_rad) == pytest.approx((x, y, rate_radps * seconds), abs=1e-6)


@settings(max_examples=100, deadline=None)
@given(st.floats(0, 40), st.floats(-0.5, 0.5), st.floats(0, 0.2))
def test_there_and_back_again_is_no_motion(speed_mps, rate_radps, seconds):
    vehicle = replace(ego(), speed_mps=speed_mps, yaw_rate_radps=rate_radps)
    back = arc(vehicle, seconds).then(arc(vehicle, -seconds))
    assert (back.x_m, back.y_m, back.yaw_rad) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_without_latency_the_newest_image_leaves_as_it_is():
    images = [image(k) for k in range(3)]
    assert [left is newest for left, newest in zip(leaving(images, 0), images, strict=True)] == [True] * 3


def test_whole_ticks_of_latency_delay_the_images_by_them():
    out = leaving([image(k) for k in range(6)], 80)
    assert out[:2] == [None, None]
    assert [left.estimate.image_index for left in out[2:]] == [0, 1, 2, 3]
    assert [left.estimate.exposed_at_ns for left in out[2:]] == [k * PERIOD_NS for k in range(4)]


def test_the_rest_of_a_tick_is_in_the_time_stamp_and_in_the_place_of_the_lines():
    out = leaving([image(k, line=(1.8, 0.1)) for k in range(6)], 100)  # 2.5 ticks of 40 ms, 20 m/s
    assert out[2] is None
    assert out[3].estimate.exposed_at_ns == 3 * PERIOD_NS - 100 * MS
    assert only(out[3].estimate).coefficients[0] == pytest.approx(1.8 - 0.1 * 20.0 * 0.02)


def test_motion_compensated_lines_are_described_from_where_the_vehicle_is_at_the_send_time():
    out = leaving([image(k, line=(1.8, 0.1)) for k in range(6)], 100, "send")
    assert out[5].estimate.exposed_at_ns == 5 * PERIOD_NS - 100 * MS
    assert only(out[5].estimate).coefficients[0] == pytest.approx(1.8 + 0.1 * 20.0 * 0.08)


def test_an_unknown_motion_moves_nothing():
    images = [image(k, line=(1.8, 0.1), speed_mps=float("nan")) for k in range(4)]
    assert only(leaving(images, 60, "send")[3].estimate).coefficients[0] == 1.8
