"""Manoeuvres as a speed over time and shifts along the road."""

import pytest

from vsensor.errors import ConfigError
from vsensor.sources.manoeuvres import ManoeuvreConfig, planned

KMH = 1.0 / 3.6


def plan(*manoeuvres, speed_kmh=90.0, offset_m=0.0):
    return planned(speed_kmh, offset_m, [ManoeuvreConfig(**one) for one in manoeuvres])


def test_one_begins_where_the_one_before_it_ended():
    found = plan(
        {"kind": "hold", "for_s": 4.0},
        {"kind": "accelerate", "to_kmh": 108.0, "acceleration_mps2": 2.0},
        {"kind": "brake", "to_kmh": 72.0, "acceleration_mps2": 5.0},
    ).speeds
    assert found.times_s == pytest.approx((0.0, 4.0, 6.5, 8.5))
    assert found.values == pytest.approx((25.0, 25.0, 30.0, 20.0))


def test_a_lane_change_over_metres_is_so_long_and_one_over_seconds_takes_them():
    found = plan(
        {"kind": "lane_change", "lanes_left": 1, "over_m": 100.0, "at_s": 2.0},
        {"kind": "lane_change", "offset_m": -0.5, "over_s": 3.0},
    ).shifts
    assert (found[0].start_m, found[0].end_m, found[0].lanes_left) == pytest.approx((50.0, 150.0, 1))
    assert (found[1].start_m, found[1].end_m, found[1].offset_m) == pytest.approx((150.0, 225.0, -0.5))


def test_a_lane_change_may_go_on_while_the_brakes_act():
    found = plan(
        {"kind": "lane_change", "lanes_left": -1, "over_s": 4.0, "at_s": 1.0},
        {"kind": "brake", "to_kmh": 54.0, "acceleration_mps2": 5.0, "at_s": 1.0},
    )
    assert found.shifts[0].end_m == pytest.approx(25.0 + 40.0 + 15.0 * 2.0)


def test_a_wished_offset_over_time_is_one_along_the_road():
    found = plan(offset_m=[(0.0, 0.2), (2.0, 0.2), (4.0, 1.0)]).shifts
    assert [one.start_m for one in found] == pytest.approx([0.0, 50.0])
    assert [one.end_m for one in found] == pytest.approx([0.0, 100.0])
    assert [one.offset_m for one in found] == pytest.approx([0.2, 0.8])


@pytest.mark.parametrize(
    ("manoeuvres", "said"),
    [
        ([{"kind": "accelerate", "to_kmh": 80}], r"\[0\].to_kmh = 80: accelerate from 90 km/h\?"),
        ([{"kind": "brake", "to_kmh": 90}], "brake from 90 km/h"),
        ([{"kind": "brake"}], "needs to_kmh"),
        ([{"kind": "hold", "to_kmh": 50}], r'to_kmh: kind = "hold" takes for_s'),
        ([{"kind": "hold"}, {"kind": "brake", "to_kmh": 50}], "the one before it has no end"),
        ([{"kind": "lane_change"}], "needs lanes_left or offset_m"),
        ([{"kind": "lane_change", "lanes_left": 1, "offset_m": 1}], "not both"),
        ([{"kind": "lane_change", "lanes_left": 1, "over_s": 1, "over_m": 50}], "not both"),
        (
            [{"kind": "brake", "to_kmh": 50}, {"kind": "accelerate", "to_kmh": 60, "at_s": 1}],
            r"\[1\]: begins at 1 s, before the change of speed",
        ),
        (
            [{"kind": "lane_change", "lanes_left": 1}, {"kind": "lane_change", "lanes_left": 1, "at_s": 1}],
            "before the lane change before it ends",
        ),
        (
            [
                {"kind": "brake", "to_kmh": 0, "acceleration_mps2": 10},
                {"kind": "lane_change", "lanes_left": 1},
            ],
            "a vehicle that stands changes no lane",
        ),
    ],
)
def test_what_no_driver_can_do_is_refused_by_name(manoeuvres, said):
    with pytest.raises(ConfigError, match=said):
        plan(*manoeuvres)


def test_manoeuvres_that_change_a_speed_that_changes_by_itself_are_refused():
    with pytest.raises(ConfigError, match="one number, where manoeuvres change the speed"):
        plan({"kind": "brake", "to_kmh": 50}, speed_kmh=[(0.0, 90.0), (5.0, 100.0)])
