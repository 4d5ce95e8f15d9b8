"""The virtual line in the middle of the lane, and the vehicle's own motion among the values."""

import math

import pytest

from tests.bus_values import boundary, ego, estimate
from tests.made_profiles import VEHICLE, profile_of, raws, sent, values
from vsensor.profile import GeometryConfig
from vsensor.signals import VehicleConfig, from_bus, to_bus, values_from
from vsensor.types import EgoState, Environment, Light, SensorMode, Side, frozen

LEFT, RIGHT = [1.9, 0.02, 1e-3, 2e-6], [-1.5, 0.04, 3e-3, -4e-6]


def both(**changes):
    return estimate(
        boundary(Side.LEFT, LEFT, x_min_m=4.0, x_max_m=60.0, quality=3, **changes),
        boundary(Side.RIGHT, RIGHT, x_min_m=6.0, x_max_m=80.0, quality=4, measured=False),
    )


def centre(found):
    return {name.partition(".")[2]: value for name, value in found.items() if name.startswith("centre.")}


def test_the_centre_is_the_mean_of_left_and_right_where_both_are():
    assert centre(values(both())) == pytest.approx(
        {
            **{"available": 1, "offset_m": 0.2, "heading": 0.03, "c2_per_m": 2e-3, "c3_per_m2": -1e-6},
            **{"curvature_per_m": 4e-3, "curvature_rate_per_m2": -6e-6, "order": 3, "quality": 3},
            **{"measured": 0, "x_min_m": 6, "x_max_m": 60},
        }
    )


@pytest.mark.parametrize(("side", "line", "sign"), [(Side.LEFT, LEFT, -1), (Side.RIGHT, RIGHT, 1)])
def test_beside_the_only_line_the_centre_is_half_the_assumed_width_away(side, line, sign):
    vehicle = VehicleConfig(assumed_lane_width_m=3.8)
    found = centre(values_from(vehicle, estimate(boundary(side, line)), ego(), SensorMode.AVAILABLE))
    assert found["offset_m"] == pytest.approx(line[0] + sign * 1.9 * math.hypot(1, line[1]))
    assert (found["heading"], found["c2_per_m"], found["quality"]) == (line[1], line[2], 4)


def test_without_a_line_there_is_no_centre():
    for found in (values(estimate()), values(both(), SensorMode.BLOCKED)):
        assert {name for name, value in centre(found).items() if value == 0} == {
            "available",
            "measured",
            "quality",
        }
        assert all(math.isnan(value) for value in centre(found).values() if value)


@pytest.mark.parametrize("edge", ["centre", "inner"])
def test_the_centre_moves_with_the_origin_and_comes_back(edge):
    geometry = GeometryConfig(origin_x_m=2.0, edge=edge, heading="angle", curvature="true")
    found = values(both())
    moved = to_bus(geometry, VEHICLE, found)
    assert moved["centre.offset_m"] == pytest.approx(0.2 + 2 * (0.03 + 2 * (2e-3 - 2 * 1e-6)))
    assert moved["centre.x_max_m"] == pytest.approx(58)
    back = from_bus(geometry, VEHICLE, moved)
    assert centre(back) == pytest.approx(centre(found))


def test_a_bus_that_has_no_centre_gets_none_from_decoding():
    geometry = GeometryConfig(origin_x_m=2.0)
    assert "centre.offset_m" not in from_bus(geometry, VEHICLE, {"left.offset_m": 1.0, "left.heading": 0.0})


def test_eight_bit_coefficients_of_one_virtual_lane_leave_as_the_profile_says(tmp_path):
    dbc = (
        'BO_ 569 Lanes: 8 CAM\n SG_ LeftExists : 0|1@1+ (1,0) [0|0] "" ECU\n'
        ' SG_ RightExists : 1|1@1+ (1,0) [0|0] "" ECU\n SG_ Width : 4|4@1+ (0.3125,2) [2|7] "m" ECU\n'
        ' SG_ Range : 8|8@1+ (1,0) [0|160] "m" ECU\n SG_ C0 : 16|8@1+ (0.035,-3.5) [-3.5|3.5] "m" ECU\n'
        ' SG_ C1 : 24|8@1+ (0.0016,-0.2) [-0.2|0.2] "rad" ECU\n'
        ' SG_ C2 : 32|8@1+ (2E-05,-0.0025) [-0.0025|0.0025] "m-1" ECU\n'
    )
    text = (
        '[geometry]\nheading = "angle"\n[messages.Lanes]\ncycle_ms = 40\n[messages.Lanes.signals]\n'
        'LeftExists = "left.available"\nRightExists = "right.available"\nWidth = "lane.width_m"\n'
        'Range = "centre.x_max_m"\nC0 = "centre.offset_m"\nC1 = "centre.heading"\nC2 = "centre.c2_per_m"\n'
    )
    profile = profile_of(tmp_path, dbc, text)
    frames = sent(profile, values(both()))
    expected = {
        "C0": round(3.7 / 0.035),
        "C1": round((math.atan(0.03) + 0.2) / 0.0016),
        "C2": 225,
        "Range": 60,
    }
    raw = raws(profile, frames)[0]
    assert {name: raw[name] for name in expected} == expected
    assert profile.decode(frames[0])["centre.offset_m"] == pytest.approx(0.2, abs=0.0175)


def test_the_vehicles_motion_and_the_light_are_values_too():
    motion = EgoState(
        t_ns=0,
        position_world_m=frozen([0, 0, 0]),
        speed_mps=21.0,
        yaw_rate_radps=0.1,
        acceleration_mps2=-2.0,
        lateral_acceleration_mps2=2.1,
    )
    found = values_from(VEHICLE, estimate(), motion, SensorMode.INIT, Environment(light=Light.NIGHT))
    names = ("speed_mps", "yaw_rate_radps", "acceleration_mps2", "lateral_acceleration_mps2", "light")
    assert [found[f"ego.{name}"] for name in names] == [21.0, 0.1, -2.0, 2.1, float(Light.NIGHT)]


def test_unknown_motion_is_not_available_on_the_bus(tmp_path):
    dbc = 'BO_ 1 M: 8 CAM\n SG_ V : 0|16@1+ (0.01,0) [0|0] "km/h" ECU\n'
    text = '[messages.M]\ncycle_ms = 40\nsignals = { V = { quantity = "ego.speed_mps", sna = 65535 } }\n'
    profile = profile_of(tmp_path, dbc, text)
    assert raws(profile, sent(profile, values(speed_mps=10.0))) == [{"V": 3600}]
    assert raws(profile, sent(profile, values(speed_mps=math.nan))) == [{"V": 65535}]
