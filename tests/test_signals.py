"""Signal values in model signs, and a line as each bus describes it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.bus_values import AVAILABLE, boundary, ego, estimate, four_lines
from vsensor.errors import ConfigError
from vsensor.profile import QUANTITIES, GeometryConfig, Wiper
from vsensor.signals import VehicleConfig, columns_from_bus, from_bus, to_bus, values_from
from vsensor.types import Beam, Environment, Light, SensorMode, Side

VEHICLE = VehicleConfig(wheelbase_m=3.0, front_overhang_m=1.0, width_m=2.0)
LATERAL = [name for name, quantity in QUANTITIES.items() if quantity.lateral]
TO_THE_LEFT = ["ego.yaw_rate_radps", "ego.lateral_acceleration_mps2"]


def values(lines, speed_mps=20.0, yaw_rate_radps=0.0, mode=AVAILABLE):
    return values_from(VEHICLE, lines, ego(speed_mps, yaw_rate_radps), mode)


def straight(left_m, right_m, slope=0.0, width_m=0.2):
    return estimate(
        boundary(Side.LEFT, [left_m, slope], width_m=width_m),
        boundary(Side.RIGHT, [right_m, slope], width_m=width_m),
    )


def test_every_quantity_is_always_there():
    assert set(values(four_lines())) == set(QUANTITIES)
    assert set(values(estimate())) == set(QUANTITIES)


def test_the_coefficients_are_reported_as_they_are_and_as_derivatives():
    found = values(estimate(boundary(Side.LEFT, [1.0, 0.02, 3e-4, 5e-6])))
    names = ("offset_m", "heading", "c2_per_m", "c3_per_m2", "curvature_per_m", "curvature_rate_per_m2")
    assert [found[f"left.{name}"] for name in names] == pytest.approx([1.0, 0.02, 3e-4, 5e-6, 6e-4, 3e-5])


def test_an_absent_line_has_no_numbers_and_is_not_available():
    found = values(estimate(boundary(Side.LEFT, [1.8])))
    zero = {"available", "measured", "quality", "kind"}
    for name, value in found.items():
        line, _, part = name.partition(".")
        if line in ("right", "next_left", "next_right"):
            assert value == 0.0 if part in zero else math.isnan(value), name


def test_a_mirrored_road_flips_every_lateral_quantity_and_nothing_else():
    lines = straight(1.9, -1.6, slope=0.01)
    mirrored = straight(1.6, -1.9, slope=-0.01)
    swap = {"left": "right", "right": "left"}
    here, there = values(lines, yaw_rate_radps=0.02), values(mirrored, yaw_rate_radps=-0.02)
    for name, value in here.items():
        line, _, part = name.partition(".")
        other = there[f"{swap.get(line, line)}.{part}"]
        expected = -value if name in LATERAL + TO_THE_LEFT else value
        assert other == pytest.approx(expected, nan_ok=True, abs=1e-12), name


@pytest.mark.parametrize("mode", [mode for mode in SensorMode if not mode.reports_lines])
def test_a_sensor_that_is_not_up_reports_its_state_and_no_line(mode):
    found = values(four_lines(index=7), mode=mode)
    assert found["sensor.state"] == mode
    assert found["image.index"] == 7
    assert found["left.available"] == 0
    assert all(math.isnan(found[name]) for name in LATERAL)


def test_lane_offset_is_to_the_inner_edge_at_the_front_axle():
    found = values(straight(1.9, -1.7, slope=0.05, width_m=0.2))
    half_m = 0.1 * math.hypot(1, 0.05)  # the half width lies across the line
    assert found["left.lane_offset_m"] == pytest.approx(1.9 + 0.05 * 3.0 - half_m)
    assert found["right.lane_offset_m"] == pytest.approx(-1.7 + 0.05 * 3.0 + half_m)


def test_lane_width_is_measured_across_the_lane_however_the_vehicle_stands():
    width_m, angle = 3.5, 0.2
    half_y = (width_m + 0.2) / 2 / math.cos(angle)  # from inner edges to the stripes' centres
    found = values(straight(half_y, -half_y, slope=math.tan(angle), width_m=0.2))
    assert found["lane.width_m"] == pytest.approx(width_m)


def test_lateral_speed_is_to_the_left_when_the_lane_turns_right_under_the_vehicle():
    found = values(straight(1.8, -1.8, slope=math.tan(-0.1)), speed_mps=10.0)
    assert found["lane.lateral_speed_mps"] == pytest.approx(10.0 * math.sin(0.1))


def test_a_vehicle_that_follows_a_bend_has_no_lateral_speed():
    speed, radius = 15.0, 200.0
    curve = [boundary(side, [y, 0.0, 0.5 / radius]) for side, y in ((Side.LEFT, 1.8), (Side.RIGHT, -1.8))]
    found = values(estimate(*curve), speed, speed / radius)
    assert found["lane.lateral_speed_mps"] == pytest.approx(0.0, abs=2e-3)  # chord against arc over 3 m


def test_time_to_crossing_is_gap_of_the_wheel_over_lateral_speed():
    speed, angle = 10.0, 0.05
    found = values(straight(1.8, -1.8, slope=-math.tan(angle)), speed)
    gap_m = (found["left.lane_offset_m"] - VEHICLE.width_m / 2) * math.cos(angle)
    assert found["lane.time_to_crossing_s"] == pytest.approx(gap_m / (speed * math.sin(angle)))


@pytest.mark.parametrize(
    ("lines", "speed_mps", "expected"),
    [
        (straight(1.8, -1.8), 10.0, math.nan),  # no lateral motion
        (straight(1.8, -1.8, slope=-0.05), 0.0, math.nan),  # standing
        (straight(1.8, -1.8, slope=-0.05), math.nan, math.nan),  # speed not known
        (straight(1.0, -2.6, slope=-0.05), 10.0, 0.0),  # the wheel is on the line
        (straight(1.8, -1.8, slope=-1e-6), 10.0, math.nan),  # in some hours
    ],
)
def test_time_to_crossing_is_not_available_when_nothing_is_about_to_be_crossed(lines, speed_mps, expected):
    assert values(lines, speed_mps)["lane.time_to_crossing_s"] == pytest.approx(expected, nan_ok=True)


def test_moving_away_from_the_only_line_is_no_crossing():
    only_right = estimate(boundary(Side.RIGHT, [-1.8, -0.05]))
    assert math.isnan(values(only_right)["lane.time_to_crossing_s"])


@pytest.mark.parametrize(("change", "expected"), [(0, 0), (1, 1), (-1, 2)])
def test_a_lane_change_is_none_left_or_right(change, expected):
    assert values(estimate(boundary(Side.LEFT, [1.0]), lane_change=change))["lane.change"] == expected


def test_a_polynomial_of_higher_order_is_reported_as_the_nearest_cubic():
    quintic = [1.8, 0.01, 1e-4, 1e-6, 2e-8, -1e-10]
    found = values(estimate(boundary(Side.LEFT, quintic, x_min_m=0.0, x_max_m=80.0)))
    cubic = [found[f"left.{name}"] for name in ("offset_m", "heading", "c2_per_m", "c3_per_m2")]
    x = np.linspace(0, 80, 400)
    truth = np.polynomial.polynomial.polyval(x, quintic)
    worst = np.abs(np.polynomial.polynomial.polyval(x, cubic) - truth).max()
    least = np.polynomial.Polynomial.fit(x, truth, 3)
    assert worst <= 1.5 * np.abs(least(x) - truth).max()
    assert found["left.order"] == 3


def test_light_and_rain_come_from_the_environment():
    found = values_from(VEHICLE, estimate(), ego(), AVAILABLE, Environment(light=Light.NIGHT, rain=0.5))
    assert (found["sensor.light"], found["sensor.rain"]) == (2, 0.5)


@pytest.mark.parametrize(
    ("environment", "wiper", "low", "high"),
    [
        (Environment(), Wiper.OFF, 0, 0),
        (Environment(rain=0.01), Wiper.INTERVAL, 1, 0),
        (Environment(rain=0.4), Wiper.SLOW, 1, 0),
        (Environment(rain=0.9), Wiper.FAST, 1, 0),
        (Environment(light=Light.NIGHT), Wiper.OFF, 1, 0),
        (Environment(visibility_m=80.0), Wiper.OFF, 1, 0),
        (Environment(light=Light.NIGHT, beam=Beam.HIGH), Wiper.OFF, 1, 1),
        (Environment(light=Light.NIGHT, beam=Beam.OFF), Wiper.OFF, 0, 0),
    ],
)
def test_wipers_and_headlights_follow_from_the_weather(environment, wiper, low, high):
    found = values_from(VEHICLE, estimate(), ego(), AVAILABLE, environment)
    assert [found[f"ego.{name}"] for name in ("wiper", "low_beam", "high_beam")] == [wiper, low, high]


# ---- geometry of a bus -----------------------------------------------------------------------------

LINE = (1.8, 0.03, 4e-4, -2e-6)


def y_of(found, word, x):
    c = [found[f"{word}.{name}"] for name in ("offset_m", "heading", "c2_per_m", "c3_per_m2")]
    return np.polynomial.polynomial.polyval(x, c)


@pytest.mark.parametrize(
    ("geometry", "origin_m"),
    [
        ({"origin": "rear_axle"}, 0.0),
        ({"origin": "front_axle"}, 3.0),
        ({"origin": "bumper"}, 4.0),
        ({"origin": "camera"}, 1.7),
        ({"origin_x_m": -0.5}, -0.5),
    ],
)
def test_moving_the_origin_moves_the_curve_and_both_ranges(geometry, origin_m):
    here = values(estimate(boundary(Side.LEFT, LINE)))
    bus = to_bus(GeometryConfig(**geometry), VEHICLE, here, camera_x_m=1.7)
    x = np.linspace(0, 60, 7)
    assert y_of(bus, "left", x) == pytest.approx(y_of(here, "left", x + origin_m), abs=1e-9)
    assert bus["left.x_min_m"] == pytest.approx(4.0 - origin_m)
    assert bus["left.x_max_m"] == pytest.approx(80.0 - origin_m)
    assert bus["left.curvature_per_m"] == pytest.approx(2 * bus["left.c2_per_m"])


def test_the_inner_edge_is_nearer_to_the_vehicle_on_both_sides():
    bus = to_bus(GeometryConfig(edge="inner"), VEHICLE, values(straight(1.8, -1.7, width_m=0.2)))
    assert (bus["left.offset_m"], bus["right.offset_m"]) == pytest.approx((1.7, -1.6))


def test_heading_can_be_an_angle_and_curvature_the_true_one():
    here = values(estimate(boundary(Side.LEFT, [1.8, 0.5, 0.01])))
    bus = to_bus(GeometryConfig(heading="angle", curvature="true"), VEHICLE, here)
    assert bus["left.heading"] == pytest.approx(math.atan(0.5))
    assert bus["left.curvature_per_m"] == pytest.approx(0.02 / 1.25**1.5)


def test_a_range_start_of_zero_is_zero_for_a_line_that_is_there():
    bus = to_bus(GeometryConfig(range_start="zero"), VEHICLE, values(estimate(boundary(Side.LEFT, LINE))))
    assert bus["left.x_min_m"] == 0.0
    assert math.isnan(bus["right.x_min_m"])


geometries = st.builds(
    GeometryConfig,
    origin=st.sampled_from(["rear_axle", "front_axle", "bumper", "camera"]),
    edge=st.sampled_from(["centre", "inner"]),
    heading=st.sampled_from(["slope", "angle"]),
    curvature=st.sampled_from(["2c2", "true"]),
)


@given(geometry=geometries, slope=st.floats(-1, 1), c2=st.floats(-0.05, 0.05), c3=st.floats(-1e-3, 1e-3))
def test_what_a_bus_says_of_a_line_is_brought_back_exactly(geometry, slope, c2, c3):
    here = values(estimate(boundary(Side.RIGHT, [-1.8, slope, c2, c3])))
    back = from_bus(geometry, VEHICLE, to_bus(geometry, VEHICLE, here, 1.7), 1.7)
    assert back == pytest.approx(here, nan_ok=True, rel=1e-9, abs=1e-9)


@given(geometry=geometries)
def test_many_images_at_once_are_brought_back_as_one_by_one(geometry):
    images = [
        to_bus(geometry, VEHICLE, values(estimate(boundary(side, [y, 0.1 * y, 1e-3, 1e-5]))), 1.7)
        for side, y in ((Side.LEFT, 1.8), (Side.RIGHT, -1.7), (Side.LEFT, 2.2))
    ]
    columns = {name: np.array([image[name] for image in images]) for name in images[0]}
    together = columns_from_bus(geometry, VEHICLE, columns, 1.7)
    for row, image in enumerate(images):
        alone = columns_from_bus(geometry, VEHICLE, {n: np.array(v) for n, v in image.items()}, 1.7)
        found = {name: float(column[row]) for name, column in together.items()}
        assert found == pytest.approx({n: float(v) for n, v in alone.items()}, nan_ok=True, rel=1e-12)


def test_the_models_own_geometry_costs_nothing():
    here = values(four_lines())
    assert to_bus(GeometryConfig(), VEHICLE, here) is here


def test_an_origin_at_a_camera_that_is_not_there_is_an_error():
    with pytest.raises(ConfigError, match=r"no camera here; give geometry\.origin_x_m"):
        to_bus(GeometryConfig(origin="camera"), VEHICLE, values(four_lines()))
