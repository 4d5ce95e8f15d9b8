"""The drive over a map as a source: poses in closed form, rates as differences, traffic on the lanes."""

from math import atan2, cos, hypot, inf, pi, sin

import numpy as np
import pytest

from tests.maps import geometry, lane, loaded, real, road, section
from tests.shared import needs_shared
from vsensor.errors import ConfigError, MapError
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.sources.traffic import VEHICLE_SIZES_M, TrafficConfig
from vsensor.transforms import rotation_from_rpy
from vsensor.types import Environment, Light, Tick
from vsensor.world.corridor import Corridor

KMH = 1.0 / 3.6
HALF_LANE_M = 1.75
OFFSET_PROFILE = [(0.0, 0.0), (2.0, 0.6), (5.0, -0.5), (7.0, 0.0)]
SPEED_PROFILE = [(0.0, 54.0), (3.0, 90.0), (5.0, 90.0), (8.0, 36.0)]


def tick(t_s, period_ns=40_000_000):
    t_ns = round(t_s * 1e9)
    return Tick(index=t_ns // period_ns, t_ns=t_ns, period_ns=period_ns)


def drive(road_map, traffic=(), range_m=100.0, **ego):
    config = EgoConfig(**ego)
    return MapDrive(
        Corridor(road_map, config.corridor()),
        config,
        tuple(TrafficConfig(**one) for one in traffic),
        range_m=range_m,
    )


def at(source, t_s):
    return source.advance(None, tick(t_s), ())[1]


def rotation(pose):
    return rotation_from_rpy(pose.roll_rad, pose.pitch_rad, pose.yaw_rad)


def differences(source, t_s, step_s=1e-3):
    """Return velocity (3,) in the ego frame, turn rates (3,) about its axes, and acceleration along x."""
    before, now, after = (at(source, t_s + k * step_s).ego for k in (-1, 0, 1))
    velocity = (after.position_world_m - before.position_world_m) / (2 * step_s)
    turn = rotation(before).T @ rotation(after)
    rates = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    return (
        rotation(now).T @ velocity,
        rates / (2 * step_s),
        (after.speed_mps - before.speed_mps) / (2 * step_s),
    )


def arc_road(radius_m, length_m=1000.0, **more):
    length_m = min(length_m, 6.0 * abs(radius_m))  # not quite round: a road on itself is refused
    plan = geometry(f'<arc curvature="{1.0 / radius_m!r}"/>', length_m)
    return road(plan=plan, length=length_m, **more)


# ---- the pose ----


def test_on_a_straight_road_the_vehicle_is_where_speed_times_time_brings_it(tmp_path):
    source = drive(loaded(tmp_path, road()), road="1", lane=-1, speed_kmh=72)
    ego = at(source, 2.5).ego
    np.testing.assert_allclose(ego.position_world_m, [50.0, -HALF_LANE_M, 0.0], atol=1e-9)
    assert (ego.roll_rad, ego.pitch_rad, ego.yaw_rad) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert ego.speed_mps == pytest.approx(20.0, abs=1e-12)
    assert ego.yaw_rate_radps == pytest.approx(0.0, abs=1e-12)


def test_an_oncoming_lane_is_driven_the_other_way(tmp_path):
    ego = at(drive(loaded(tmp_path, road()), road="1", lane=1, speed_kmh=72), 1.0).ego
    np.testing.assert_allclose(ego.position_world_m, [80.0, HALF_LANE_M, 0.0], atol=1e-9)
    assert abs(ego.yaw_rad) == pytest.approx(pi, abs=1e-12)


def test_in_left_hand_traffic_the_left_lane_is_driven_along_the_road(tmp_path):
    left = road().replace("<road ", '<road rule="LHT" ')
    source = drive(loaded(tmp_path, left), road="1", lane=1, speed_kmh=72)
    ego = at(source, 1.0).ego
    np.testing.assert_allclose(ego.position_world_m, [20.0, HALF_LANE_M, 0.0], atol=1e-9)
    assert ego.yaw_rad == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("radius", [150.0, -150.0])
def test_on_a_circle_the_pose_is_that_of_the_circle(tmp_path, radius):
    own_radius = radius + HALF_LANE_M  # lane -1 lies to the right
    source = drive(loaded(tmp_path, arc_road(radius)), road="1", lane=-1, speed_kmh=72)
    for t_s in (0.3, 4.0, 17.0):
        ego = at(source, t_s).ego
        turn = 20.0 * t_s / own_radius
        expected = [own_radius * sin(turn), radius - own_radius * cos(turn), 0.0]
        np.testing.assert_allclose(ego.position_world_m, expected, atol=1e-7)
        assert np.remainder(ego.yaw_rad - turn + pi, 2 * pi) - pi == pytest.approx(0.0, abs=1e-8)
        assert ego.yaw_rate_radps == pytest.approx(20.0 / own_radius, abs=1e-8)
        assert ego.lateral_acceleration_mps2 == pytest.approx(400.0 / own_radius, abs=1e-6)


def test_an_offset_to_the_left_moves_the_vehicle_to_the_left_of_its_lane(tmp_path):
    source = drive(loaded(tmp_path, road()), road="1", lane=-1, speed_kmh=36, offset_m=0.4)
    np.testing.assert_allclose(
        at(source, 1.0).ego.position_world_m, [10.0, 0.4 - HALF_LANE_M, 0.0], atol=1e-9
    )


def test_inside_of_a_bend_the_vehicle_is_slower_than_its_place_on_the_lanes_middle(tmp_path):
    source = drive(loaded(tmp_path, arc_road(100.0)), road="1", lane=-1, speed_kmh=72, offset_m=1.0)
    own_radius = 100.0 + HALF_LANE_M
    ego = at(source, 3.0).ego
    assert ego.speed_mps == pytest.approx(20.0 * (own_radius - 1.0) / own_radius, abs=1e-7)
    assert ego.yaw_rate_radps == pytest.approx(20.0 / own_radius, abs=1e-8)


def test_on_a_banked_road_the_vehicle_rolls_with_it(tmp_path):
    lateral = '<superelevation s="0" a="0.1" b="0" c="0" d="0"/>'
    ego = at(drive(loaded(tmp_path, road(lateral=lateral)), road="1", lane=-1, speed_kmh=36), 1.0).ego
    # positive superelevation lifts the left side, which is a positive roll of ISO 8855
    assert ego.roll_rad == pytest.approx(0.1, abs=1e-9)
    assert ego.position_world_m[2] == pytest.approx(-HALF_LANE_M * sin(0.1), abs=1e-9)


def test_over_a_crest_the_pitch_is_the_slope_of_the_road(tmp_path):
    elevation = '<elevation s="0" a="0" b="0.05" c="-0.0005" d="0"/>'  # up to x = 50, then down
    source = drive(loaded(tmp_path, road(elevation=elevation)), road="1", lane=-1, speed_kmh=36)
    for t_s in (1.0, 5.0, 9.0):
        ego = at(source, t_s).ego
        x = ego.position_world_m[0]
        assert ego.position_world_m[2] == pytest.approx(0.05 * x - 0.0005 * x * x, abs=1e-7)
        assert ego.pitch_rad == pytest.approx(-atan2(0.05 - 0.001 * x, 1.0), abs=1e-7)


# ---- rates against differences of the poses ----


BANKED_BEND = {
    "elevation": '<elevation s="0" a="3" b="0.04" c="-0.0001" d="0"/>',
    "lateral": '<superelevation s="0" a="-0.06" b="0" c="0" d="0"/>',
}
TIMES_S = (0.5, 1.37, 2.2, 3.6, 5.4, 6.1, 7.6)


@pytest.mark.parametrize("radius", [60.0, -60.0])
@pytest.mark.parametrize("more", [{}, BANKED_BEND], ids=["flat", "banked and over a crest"])
def test_speed_and_yaw_rate_in_a_bend_are_the_differences_of_the_poses(tmp_path, radius, more):
    source = drive(
        loaded(tmp_path, arc_road(radius, **more)),
        road="1",
        lane=-1,
        speed_kmh=SPEED_PROFILE,
        offset_m=OFFSET_PROFILE,
    )
    _compare_rates(source, TIMES_S, slip_rad=0.0 if not more else 1e-3)


@needs_shared
@pytest.mark.parametrize("name", ["velodrome", "curves_elevation", "e6mini-lht"])
def test_speed_and_yaw_rate_on_real_roads_are_the_differences_of_the_poses(name):
    source = drive(real(name), speed_kmh=SPEED_PROFILE, offset_m=[(0.0, 0.0), (5.0, 0.8), (14.0, -0.7)])
    _compare_rates(source, np.arange(0.53, 13.0, 0.71).tolist(), slip_rad=0.02)


def _compare_rates(source, times_s, slip_rad):
    """Compare; `slip_rad`: a road that twists about its middle lifts the offset vehicle a little."""
    for t_s in times_s:
        ego = at(source, t_s).ego
        velocity, rates, acceleration = differences(source, t_s)
        assert ego.speed_mps == pytest.approx(np.linalg.norm(velocity), rel=1e-6 + slip_rad**2)
        assert atan2(velocity[1], velocity[0]) == pytest.approx(0.0, abs=1e-6), t_s  # no side slip
        assert atan2(velocity[2], velocity[0]) == pytest.approx(0.0, abs=1e-6 + slip_rad), t_s
        assert ego.yaw_rate_radps == pytest.approx(rates[2], abs=2e-5), t_s
        assert ego.acceleration_mps2 == pytest.approx(acceleration, abs=1e-4), t_s
        assert ego.lateral_acceleration_mps2 == pytest.approx(ego.speed_mps * rates[2], abs=1e-3), t_s


@needs_shared
def test_in_the_velodromes_bend_the_vehicle_leans_by_60_degrees_and_turns_about_its_own_axis():
    source = drive(real("velodrome"), speed_kmh=36)
    egos = [at(source, t_s).ego for t_s in np.arange(0.0, 120.0, 0.5).tolist()]
    leaning = [ego for ego in egos if abs(abs(ego.roll_rad) - pi / 3) < 1e-6]
    assert leaning
    for ego in leaning:
        # a horizontal circle at constant speed turns about the vertical; the vehicle feels its own part of it
        assert abs(ego.yaw_rate_radps) < 10.0 / 20.0
        assert ego.pitch_rad == pytest.approx(0.0, abs=1e-6)


def test_a_vehicle_that_stands_and_moves_sideways_in_no_time_keeps_its_heading(tmp_path):
    ego = at(drive(loaded(tmp_path, road()), road="1", lane=-1, s_m=10.0, speed_kmh=0), 3.0).ego
    assert (ego.speed_mps, ego.yaw_rate_radps, ego.yaw_rad) == (0.0, 0.0, 0.0)


# ---- speed and time ----


def test_the_distance_driven_is_the_integral_of_the_speed_profile(tmp_path):
    source = drive(
        loaded(tmp_path, road(length=300.0, plan=None)), road="1", lane=-1, speed_kmh=SPEED_PROFILE
    )
    # trapezoids: 15 to 25 m/s in 3 s, 2 s at 25 m/s, down to 10 m/s in 3 s, then 10 m/s
    for t_s, x in ((3.0, 60.0), (5.0, 110.0), (8.0, 162.5), (10.0, 182.5)):
        assert at(source, t_s).ego.position_world_m[0] == pytest.approx(x, abs=1e-9)
    assert at(source, 1.5).ego.speed_mps == pytest.approx(20.0, abs=1e-12)
    assert at(source, 1.5).ego.acceleration_mps2 == pytest.approx(10.0 / 3.0, abs=1e-12)


@pytest.mark.parametrize("speed", [72.0, [(0.0, 72.0), (3.0, 72.0)], [(0.0, 36.0), (10.0, 144.0)]])
def test_the_drive_ends_where_the_road_ends_and_its_duration_says_when(tmp_path, speed):
    source = drive(loaded(tmp_path, road()), road="1", lane=-1, speed_kmh=speed)
    end_s = source.duration_s
    assert at(source, end_s - 1e-6).ego.position_world_m[0] == pytest.approx(100.0, abs=1e-3)
    assert at(source, end_s + 1e-6) is None


def test_a_vehicle_that_stops_before_the_end_never_gets_there(tmp_path):
    source = drive(loaded(tmp_path, road()), road="1", lane=-1, speed_kmh=[(0.0, 36.0), (4.0, 0.0)])
    assert source.duration_s == inf
    assert at(source, 1000.0).ego.position_world_m[0] == pytest.approx(20.0, abs=1e-9)


@needs_shared
@pytest.mark.parametrize("name", ["circle_300m", "velodrome"])
def test_a_closed_circuit_has_no_end_and_repeats_its_poses(name):
    source = drive(real(name), speed_kmh=72)
    assert source.duration_s == inf
    start = at(source, 0.0).ego.position_world_m
    lap_s = np.arange(5.0, 150.0, 0.05).tolist()
    away = [hypot(*(at(source, t_s).ego.position_world_m - start)[:2]) for t_s in lap_s]
    assert max(away) > 20.0
    assert min(away) < 1.0  # back again, within a step of 1 m


def test_any_tick_may_be_asked_for_in_any_order(tmp_path):
    traffic = [{"ahead_m": 30, "speed_kmh": 50, "recycle_m": 200}, {"ahead_m": 20, "lanes_left": -1}]
    kept = {"speed_kmh": SPEED_PROFILE, "offset_m": OFFSET_PROFILE}
    first = drive(loaded(tmp_path, arc_road(200.0)), traffic, road="1", lane=-1, **kept)
    again = drive(loaded(tmp_path, arc_road(200.0)), traffic, road="1", lane=-1, **kept)
    times = [0.04 * k for k in range(0, 700, 7)]
    forwards = {t_s: at(first, t_s) for t_s in times}
    for t_s in reversed(times):
        here, there = forwards[t_s], at(again, t_s)
        assert (here is None) == (there is None)
        if here is not None:
            assert here.ego.yaw_rad == there.ego.yaw_rad
            np.testing.assert_array_equal(here.ego.position_world_m, there.ego.position_world_m)
            for box, other in zip(here.scene.obstacles, there.scene.obstacles, strict=True):
                np.testing.assert_array_equal(box.centre_world_m, other.centre_world_m)
            for line, other in zip(here.scene.markings, there.scene.markings, strict=True):
                np.testing.assert_array_equal(line.points_world_m, other.points_world_m)


# ---- what is around ----


def test_markings_reach_past_the_range_and_behind_the_vehicle(tmp_path):
    source = drive(loaded(tmp_path, road(length=900.0)), range_m=150.0, road="1", lane=-1, speed_kmh=72)
    snapshot = at(source, 5.0)
    for line in snapshot.scene.markings:
        assert line.points_world_m[:, 0].min() <= 100.0 - 20.0 + 0.1
        assert line.points_world_m[:, 0].max() >= 100.0 + 150.0


def test_light_and_rain_are_those_given(tmp_path):
    weather = Environment(light=Light.NIGHT, rain=0.7)
    source = MapDrive(Corridor(loaded(tmp_path, road())), environment=weather)
    assert at(source, 0.0).scene.environment == weather


THREE_LANES = section(right=[lane(-1), lane(-2, width="4"), lane(-3)])
LONG = {"length": 2000.0, "sections": THREE_LANES}


@pytest.mark.parametrize(("lanes_left", "y"), [(1, -1.75), (0, -5.5), (-1, -9.25)])
def test_a_vehicle_stands_on_the_road_in_the_middle_of_its_lane(tmp_path, lanes_left, y):
    source = drive(
        loaded(tmp_path, road(**LONG)),
        [{"lanes_left": lanes_left, "ahead_m": 40}],
        road="1",
        lane=-2,
        speed_kmh=72,
    )
    (box,) = at(source, 10.0).scene.obstacles
    np.testing.assert_allclose(box.centre_world_m, [240.0, y, VEHICLE_SIZES_M["car"][2] / 2], atol=1e-9)
    assert (box.roll_rad, box.pitch_rad, box.yaw_rad) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def test_a_vehicle_on_a_bank_stands_along_its_normal(tmp_path):
    lateral = '<superelevation s="0" a="0.2" b="0" c="0" d="0"/>'
    source = drive(
        loaded(tmp_path, road(lateral=lateral)),
        [{"kind": "truck", "ahead_m": 40}],
        road="1",
        lane=-1,
        speed_kmh=36,
    )
    snapshot = at(source, 1.0)
    (box,) = snapshot.scene.obstacles
    seen = rotation(snapshot.ego).T @ (box.centre_world_m - snapshot.ego.position_world_m)
    np.testing.assert_allclose(seen, [40.0, 0.0, VEHICLE_SIZES_M["truck"][2] / 2], atol=1e-8)
    assert box.roll_rad == pytest.approx(0.2, abs=1e-9)


def test_a_vehicle_without_a_speed_keeps_its_distance_profile(tmp_path):
    source = drive(
        loaded(tmp_path, road(**LONG)),
        [{"ahead_m": [(0.0, 60.0), (10.0, 20.0)]}],
        road="1",
        lane=-2,
        speed_kmh=SPEED_PROFILE,
    )
    for t_s, ahead_m in ((0.0, 60.0), (5.0, 40.0), (10.0, 20.0), (20.0, 20.0)):
        snapshot = at(source, t_s)
        (box,) = snapshot.scene.obstacles
        assert box.centre_world_m[0] - snapshot.ego.position_world_m[0] == pytest.approx(ahead_m, abs=1e-9)


def test_a_vehicle_with_a_speed_moves_by_its_integral_whatever_the_ego_does(tmp_path):
    source = drive(
        loaded(tmp_path, road(**LONG)),
        [{"ahead_m": 10, "speed_kmh": [(0.0, 72.0), (10.0, 36.0)]}],
        road="1",
        lane=-2,
        speed_kmh=50,
    )
    (box,) = at(source, 5.0).scene.obstacles
    assert box.centre_world_m[0] == pytest.approx(10.0 + 5.0 * 17.5, abs=1e-9)


CHANGE = {"lanes_left": [(0.0, -1), (1.0, -1), (4.0, 1)], "ahead_m": 40}


@pytest.mark.parametrize(
    ("t_s", "y"), [(0.5, -9.25), (2.5, -5.5), (4.0, -1.75), (9.0, -1.75)]
)  # the lanes' middles are 3.75 m apart, the change goes over two of them
def test_a_vehicle_of_the_traffic_changes_lanes_as_told(tmp_path, t_s, y):
    source = drive(loaded(tmp_path, road(**LONG)), [CHANGE], road="1", lane=-2, speed_kmh=72)
    (box,) = at(source, t_s).scene.obstacles
    assert box.centre_world_m[1] == pytest.approx(y, abs=1e-9)


@pytest.mark.parametrize("more", [{}, {"ahead_m": [(0.0, 60.0), (10.0, 20.0)]}, {"speed_kmh": 90}])
@pytest.mark.parametrize("radius_m", [400.0, 1e6])
def test_a_vehicle_that_changes_lanes_heads_where_it_goes(tmp_path, more, radius_m):
    plan = geometry(f'<arc curvature="{1.0 / radius_m!r}"/>', 1000.0)
    ring = road(plan=plan, length=1000.0, sections=THREE_LANES)
    change = {**CHANGE, "offset_m": [(1.0, 0.0), (4.0, 0.5)], **more}
    source = drive(loaded(tmp_path, ring), [change], road="1", lane=-2, speed_kmh=72)
    before, now, after = (at(source, 2.2 + k * 1e-3).scene.obstacles[0] for k in (-1, 0, 1))
    x, y, _ = after.centre_world_m - before.centre_world_m
    assert now.yaw_rad == pytest.approx(atan2(y, x), abs=1e-5)


def test_a_lane_of_the_traffic_is_a_whole_number(tmp_path):
    with pytest.raises(ConfigError, match=r"traffic\[0\].lanes_left: 0.5: whole numbers from -8 to 8"):
        drive(loaded(tmp_path, road(**LONG)), [{"lanes_left": [(0.0, 0), (2.0, 0.5)]}], road="1", lane=-2)


def test_a_faster_vehicle_drives_away_and_a_slower_one_falls_behind(tmp_path):
    traffic = [{"ahead_m": 10, "speed_kmh": 144}, {"ahead_m": 10, "speed_kmh": 36, "lanes_left": 1}]
    source = drive(loaded(tmp_path, road(**LONG)), traffic, road="1", lane=-2, speed_kmh=90)
    assert len(at(source, 0.0).scene.obstacles) == 2
    assert len(at(source, 20.0).scene.obstacles) == 0


@pytest.mark.parametrize("recycle_m", [100, 250, 500])
@pytest.mark.parametrize("speed", [50, 90, 130])
def test_traffic_that_comes_round_again_has_one_vehicle_every_so_many_metres(tmp_path, recycle_m, speed):
    source = drive(
        loaded(tmp_path, road(**LONG)),
        [{"ahead_m": 30, "speed_kmh": speed, "lanes_left": 1, "recycle_m": recycle_m}],
        road="1",
        lane=-2,
        speed_kmh=90,
    )
    for t_s in np.arange(4.0, 60.0, 0.04).tolist():
        snapshot = at(source, t_s)
        ego_x = snapshot.ego.position_world_m[0]
        expected = 30.0 + speed * KMH * t_s
        near = sorted(box.centre_world_m[0] for box in snapshot.scene.obstacles)
        for x in near:
            away = (x - expected) / recycle_m
            assert away == pytest.approx(round(away), abs=1e-9)
        k = np.arange(-40, 40)
        visible = expected + recycle_m * k
        visible = visible[(visible > ego_x - 15.0) & (visible < ego_x + 125.0)]
        assert set(np.round(visible, 6)) <= set(np.round(near, 6))


def test_a_vehicle_follows_its_lane_where_the_lanes_beside_change_their_width(tmp_path):
    wider = '<width sOffset="0" a="3.5" b="0.01" c="0" d="0"/>'
    inner = lane(-1).replace('<width sOffset="0" a="3.5" b="0" c="0" d="0"/>', wider)
    source = drive(
        loaded(tmp_path, road(length=400.0, sections=section(right=[inner, lane(-2)]))),
        [{"lanes_left": 1, "ahead_m": 50}],
        road="1",
        lane=-2,
        speed_kmh=72,
    )
    (box,) = at(source, 5.0).scene.obstacles
    x, y, _ = box.centre_world_m
    assert y == pytest.approx(-(3.5 + 0.01 * x) / 2, abs=5e-3)  # its normal leans by 0.3 degrees


def test_traffic_beyond_the_end_of_the_road_is_not_there(tmp_path):
    source = drive(loaded(tmp_path, road()), [{"ahead_m": 60}], road="1", lane=-1, speed_kmh=36)
    assert len(at(source, 3.9).scene.obstacles) == 1
    assert len(at(source, 4.1).scene.obstacles) == 0


@needs_shared
@pytest.mark.parametrize("name", ["e6mini", "e6mini-lht", "curves_elevation", "soderleden"])
def test_on_real_roads_every_vehicle_stands_between_the_borders_of_its_lane(name):
    source = drive(real(name), [{"ahead_m": 25}, {"ahead_m": 60, "kind": "truck"}], speed_kmh=70)
    count = 0
    for t_s in np.arange(1.0, 12.0, 0.9).tolist():
        snapshot = at(source, t_s)
        if snapshot is None:
            break
        for box in snapshot.scene.obstacles:
            down = box.centre_world_m - 0.5 * box.size_m[2] * rotation(box)[:, 2]
            gaps = [
                np.linalg.norm(line.points_world_m - down, axis=1).min() for line in snapshot.scene.markings
            ]
            assert 1.0 < min(gaps) < 3.0
            count += 1
    assert count > 10


# ---- mistakes ----


@pytest.mark.parametrize(
    ("ego", "traffic", "says"),
    [
        ({"speed_kmh": -1}, {}, "ego.speed_kmh"),
        ({"speed_kmh": 1000}, {}, "540 km/h"),
        ({"speed_kmh": [(0, 10), (0, 20)]}, {}, "times must rise"),
        ({"offset_m": 30}, {}, "ego.offset_m"),
        ({}, {"recycle_m": 200}, r"traffic\[0\].recycle_m"),
        ({}, {"speed_kmh": 50, "ahead_m": [(0, 1), (1, 2)]}, r"traffic\[0\].ahead_m"),
        ({}, {"ahead_m": -2e5}, r"traffic\[0\].ahead_m: at most 100000 m"),
        ({}, {"size_m": (4.0, 0.0, 1.0)}, r"traffic\[0\].size_m"),
    ],
)
def test_motion_that_cannot_be_is_refused_by_name(tmp_path, ego, traffic, says):
    with pytest.raises(ConfigError, match=says):
        drive(loaded(tmp_path, road()), [traffic], **ego)


def test_a_start_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(MapError, match="no lane 7"):
        drive(loaded(tmp_path, road()), road="1", lane=7)
