"""The live source: paths in closed form, stale inputs, restarts, frames that nobody should believe."""

from dataclasses import replace
from math import cos, hypot, nan, pi, remainder, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from tests.maps import geometry, lane, loaded, road, section
from tests.vehicle_frames import CYCLE_NS, PLANS, Gateway
from vsensor.errors import ConfigError
from vsensor.sources.control import FOR_EVER_NS, Pose
from vsensor.sources.listening import ListenConfig
from vsensor.sources.live import LiveDrive
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.sources.placing import Foot, Ground
from vsensor.sources.reckoning import Course, heard, settled, value_at
from vsensor.transforms import rotation_from_rpy
from vsensor.types import Beam, Environment, Frame, Light, Tick
from vsensor.world.corridor import Corridor
from vsensor.world.vehicle import DynamicsConfig, SingleTrack, Tilt

PERIOD_NS = 40_000_000
HALF_LANE_M = 1.75
KMH = 1.0 / 3.6
MM = 1e-3
PLANS_BY_ID = {plan.layout.arbitration_id: plan for plan in PLANS.values()}


def tick(index):
    return Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)


def live(road_map, control="motion", environment=None, ego=None, **listen):
    """Return a live source on a map, road 1, lane -1 unless said otherwise."""
    config = EgoConfig(**{"road": "1", "lane": -1, "control": control, **(ego or {})})
    drive = MapDrive(Corridor(road_map, config.corridor()), config, (), environment)
    return LiveDrive.load(drive, config, ListenConfig(**listen), DynamicsConfig(), 2.8)


class Bench:
    """A source, its state, and the frames on their way to it: what came by a slot is heard at the next."""

    def __init__(self, source):
        self.source, self.state, self.index = source, source.initial_state(), 0
        self.waiting = []
        self.snapshots = []

    def step(self):
        """Run one tick; returns its snapshot."""
        before_ns = (self.index - 1) * PERIOD_NS
        inputs = tuple(frame for frame in self.waiting if frame.due_ns <= before_ns)
        self.waiting = [frame for frame in self.waiting if frame.due_ns > before_ns]
        self.state, snapshot = self.source.advance(self.state, tick(self.index), inputs)
        self.index += 1
        self.snapshots.append(snapshot)
        return snapshot

    def run(self, ticks):
        """Run several ticks; returns the last snapshot."""
        for _ in range(ticks):
            snapshot = self.step()
        return snapshot


def motion_frames(seconds, speed, rate, start_ns=0, gateway=None, cycle_ns=CYCLE_NS):
    """Return motion frames of speed(t) and yaw rate(t), t in s from the first."""
    gateway = gateway or Gateway()
    count = round(seconds * 1e9 / cycle_ns) + 1
    return [
        gateway.motion(start_ns + k * cycle_ns, speed(k * cycle_ns * 1e-9), rate(k * cycle_ns * 1e-9))
        for k in range(count)
    ]


def bench(road_map, frames, control="motion", **more):
    result = Bench(live(road_map, control, **more))
    result.waiting = list(frames)
    return result


def position(snapshot):
    return snapshot.ego.position_world_m.tolist()


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    return loaded(tmp_path_factory.mktemp("straight"), road(plan=None, length=2000.0))


RADIUS_M = 200.0


@pytest.fixture(scope="module")
def bend(tmp_path_factory):
    """A left-hand bend whose lane -1 has a radius of 201.75 m."""
    plan = geometry(f'<arc curvature="{1 / RADIUS_M!r}"/>', 600.0)
    return loaded(tmp_path_factory.mktemp("bend"), road(plan=plan, length=600.0))


# ---- motion ----


def test_before_the_first_frame_the_vehicle_stands_at_the_start_and_the_sensor_lacks_its_motion(straight):
    snapshot = bench(straight, []).run(20)
    assert position(snapshot) == pytest.approx([0.0, -HALF_LANE_M, 0.0], abs=1e-9)
    assert snapshot.ego.speed_mps == 0.0
    assert snapshot.stale == ("ego.speed_mps", "ego.yaw_rate_radps")
    assert snapshot.scene.markings


def test_constant_speed_on_a_straight_road_brings_the_vehicle_where_speed_times_time_says(straight):
    one = bench(straight, motion_frames(4.0, lambda t: 72 * KMH, lambda t: 0.0, start_ns=5_000_000))
    snapshot = one.run(101)
    assert position(snapshot) == pytest.approx([20.0 * (4.0 - 0.005), -HALF_LANE_M, 0.0], abs=1e-6)
    assert (snapshot.ego.speed_mps, snapshot.ego.yaw_rad) == pytest.approx((20.0, 0.0), abs=1e-9)
    assert snapshot.stale == ()


def test_constant_speed_and_yaw_rate_keep_the_vehicle_on_the_bend(bend):
    rate = np.deg2rad(0.005 * 1136)  # a multiple of the signal's step
    speed = 72 * KMH
    radius = speed / rate
    one = bench(bend, motion_frames(5.0, lambda t: speed, lambda t: rate))
    snapshot = one.run(126)
    x, y, _ = position(snapshot)
    turn = rate * 5.0
    start_y = -HALF_LANE_M
    assert (x, y) == pytest.approx((radius * sin(turn), start_y + radius * (1 - cos(turn))), abs=1e-6)
    assert radius == pytest.approx(RADIUS_M + HALF_LANE_M, abs=0.1)
    assert one.state.foot.offset_m == pytest.approx(RADIUS_M + HALF_LANE_M - hypot(x, y - RADIUS_M), abs=1e-3)
    assert one.state.foot.s_m == pytest.approx(5.0 * speed, abs=0.1)


def reckoned_error(cycle_ns):
    """Return the distance from the exact place after 2 s of changing speed and yaw rate."""
    end_ns = 2_000_000_000
    course = Course(pose=Pose(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    for t_ns in range(0, end_ns + 1, cycle_ns):
        speeds = heard(course.speeds, t_ns, 20.0 + 8.0 * sin(1.5e-9 * t_ns))
        # The yaw rate comes half as often and between the speeds.
        rates = course.rates
        if t_ns // cycle_ns % 2 == 0:
            rates = heard(rates, t_ns, 0.3 * sin(2e-9 * t_ns))
        course = settled(replace(course, speeds=speeds, rates=rates), rates[-1][0], FOR_EVER_NS, Tilt())
    t = np.linspace(0.0, 2.0, 200_001)
    yaw, v = 0.15 * (1.0 - np.cos(2.0 * t)), 20.0 + 8.0 * np.sin(1.5 * t)
    x, y = np.trapezoid(v * np.cos(yaw), t), np.trapezoid(v * np.sin(yaw), t)
    return hypot(course.pose.x_m - x, course.pose.y_m - y)


def test_the_path_is_of_second_order_though_yaw_rate_and_speed_come_at_other_times():
    coarse, fine = reckoned_error(40_000_000), reckoned_error(10_000_000)
    assert coarse / fine == pytest.approx(16.0, rel=0.1)
    assert fine < 2e-3


def test_acceleration_from_the_bus_leads_the_speed_between_its_frames(straight):
    gateway = Gateway()
    frames = [gateway.motion(0, 20.0, 0.0), gateway.frame("VEH_Acceleration", 0, acceleration_mps2=2.0)]
    snapshot = bench(straight, frames, timeout_ms=500).run(3)  # heard at t = 40 ms, seen at 80 ms
    assert snapshot.ego.speed_mps == pytest.approx(20.0 + 2.0 * 0.08)
    assert position(snapshot)[0] == pytest.approx(20.0 * 0.08 + 0.5 * 2.0 * 0.08**2)
    assert snapshot.ego.acceleration_mps2 == 2.0


def test_what_was_predicted_is_thrown_away_once_more_is_known(straight):
    """A frame that comes late tells what was driven meanwhile: the vehicle is where the frames say."""
    frames = motion_frames(2.0, lambda t: 20.0 - 5.0 * t, lambda t: 0.0)
    kept = [frame for k, frame in enumerate(frames) if k % 7 != 3]
    for one in (bench(straight, frames), bench(straight, kept)):
        snapshot = one.run(52)
        assert position(snapshot)[0] == pytest.approx(20.0 * 2.0 - 2.5 * 2.0**2 + 10.0 * 0.04, abs=MM)


def test_the_vehicle_stands_on_the_road_and_leans_with_it(tmp_path):
    slope, bank = 0.05, 0.03
    elevation = f'<elevation s="0" a="1" b="{slope}" c="0" d="0"/>'
    lateral = f'<superelevation s="0" a="{bank}" b="0" c="0" d="0"/>'
    road_map = loaded(tmp_path, road(length=500.0, elevation=elevation, lateral=lateral))
    source = live(road_map)
    along = source.drive.advance(None, tick(50), ())[1].ego  # on its lane at 100 km/h
    snapshot = bench(road_map, motion_frames(2.0, lambda t: 100 * KMH, lambda t: 0.0)).run(51)
    np.testing.assert_allclose(snapshot.ego.position_world_m, along.position_world_m, atol=2e-3)
    found = (snapshot.ego.roll_rad, snapshot.ego.pitch_rad, snapshot.ego.yaw_rad)
    assert found == pytest.approx((along.roll_rad, along.pitch_rad, along.yaw_rad), abs=1e-9)
    assert abs(along.roll_rad) > 0.02
    assert along.pitch_rad < -0.04


def test_a_yaw_rate_about_the_normal_of_a_banked_bend_turns_the_heading_on_the_map(tmp_path):
    """At 15 % of bank and slope it is 2 % less than the turn on the map."""
    plan = geometry(f'<arc curvature="{1 / RADIUS_M!r}"/>', 400.0)
    elevation = '<elevation s="0" a="0" b="0.15" c="0" d="0"/>'
    lateral = '<superelevation s="0" a="0.15" b="0" c="0" d="0"/>'
    road_map = loaded(tmp_path, road(plan=plan, length=400.0, elevation=elevation, lateral=lateral))
    source = live(road_map)
    along = [source.drive.advance(None, tick(k), ())[1].ego for k in range(101)]
    rates = [ego.yaw_rate_radps for ego in along]
    frames = motion_frames(4.0, lambda t: 100 * KMH, lambda t: rates[round(t * 25)], cycle_ns=PERIOD_NS)
    ego = bench(road_map, frames).run(101).ego
    assert along[100].yaw_rad == pytest.approx(0.55, abs=0.05)
    assert ego.yaw_rad == pytest.approx(along[100].yaw_rad, abs=1e-3)


@pytest.mark.parametrize("heading", [0.0, 0.4, -1.2])
def test_whatever_its_heading_the_vehicle_stands_flat_on_a_tilted_road(tmp_path, heading):
    elevation = '<elevation s="0" a="1" b="0.08" c="0" d="0"/>'
    lateral = '<superelevation s="0" a="-0.05" b="0" c="0" d="0"/>'
    road_map = loaded(tmp_path, road(length=500.0, elevation=elevation, lateral=lateral))
    corridor = live(road_map).drive.corridor
    foot = Ground(corridor).foot(Foot(s_m=100.0), 0.0, 103.0, -0.5, heading)
    lane_pose = corridor.pose(foot.s_m, foot.offset_m)
    x, y, z = lane_pose.position_world_m[0].tolist()
    assert (x, y, foot.z_m) == pytest.approx((103.0, -0.5, z), abs=1e-6)
    road_up = rotation_from_rpy(
        *(float(a[0]) for a in (lane_pose.roll_rad, lane_pose.pitch_rad, lane_pose.yaw_rad))
    )
    own_up = rotation_from_rpy(foot.roll_rad, foot.pitch_rad, heading)
    np.testing.assert_allclose(own_up[:, 2], road_up[:, 2], atol=1e-9)


# ---- missing, stale, back again ----


def test_a_silent_bus_is_missed_after_the_timeout_and_welcome_when_it_comes_back(straight):
    gateway = Gateway()
    first = motion_frames(1.0, lambda t: 20.0, lambda t: 0.0, gateway=gateway)
    second = motion_frames(1.0, lambda t: 20.0, lambda t: 0.0, start_ns=2_000_000_000, gateway=gateway)
    one = bench(straight, [*first, *second])
    one.run(78)
    stale = [bool(snapshot.stale) for snapshot in one.snapshots]
    # Heard up to the slot before: at 1.08 s the last frame is 40 ms old, at 1.12 s 80 ms, over 60.
    assert stale == [True] + [False] * 27 + [True] * 23 + [False] * 27
    assert one.source.remarks(one.state) == (
        "ego.speed_mps was missing once, at 1.12 s",
        "ego.yaw_rate_radps was missing once, at 1.12 s",
    )


@pytest.mark.parametrize("told", [{"speed_mps": 20.0}, {"yaw_rate_radps": 0.1}])
def test_while_one_of_speed_and_yaw_rate_has_not_come_the_vehicle_stands_and_keeps_no_samples(straight, told):
    gateway = Gateway()
    one = bench(straight, [gateway.frame("VEH_Motion", k * CYCLE_NS, **told) for k in range(200)])
    snapshot = one.run(90)
    assert position(snapshot) == pytest.approx([0.0, -HALF_LANE_M, 0.0], abs=1e-9)
    assert len(snapshot.stale) == 1
    assert len(one.state.control.speeds) + len(one.state.control.rates) == 1


def test_a_long_drive_with_and_without_silence_keeps_few_samples(straight):
    frames = motion_frames(20.0, lambda t: 5.0, lambda t: 0.0)
    one = bench(straight, [f for f in frames if not 6e9 < f.due_ns < 12e9])
    for _ in range(500):
        one.step()
        assert len(one.state.control.speeds) + len(one.state.control.rates) <= 8


def test_a_last_value_is_held_for_ever_or_as_long_as_is_said(straight):
    frames = motion_frames(1.0, lambda t: 20.0, lambda t: 0.0)
    held = bench(straight, frames).run(101)
    assert position(held)[0] == pytest.approx(80.0, abs=1e-6)
    assert held.ego.speed_mps == pytest.approx(20.0)
    released = bench(straight, frames, hold_ms=500).run(101)
    assert position(released)[0] == pytest.approx(30.0, abs=1e-6)
    assert released.ego.speed_mps == 0.0


def test_not_available_counts_as_missing_at_once(straight):
    gateway = Gateway()
    frames = motion_frames(0.4, lambda t: 20.0, lambda t: 0.0, gateway=gateway)
    frames.append(gateway.frame("VEH_Motion", 420_000_000, speed_mps=20.0))
    one = bench(straight, frames)
    one.run(13)
    assert one.snapshots[11].stale == ()
    assert one.snapshots[12].stale == ("ego.yaw_rate_radps",)


def test_a_frame_with_a_wrong_checksum_is_as_if_it_had_not_come(straight):
    frames = motion_frames(1.0, lambda t: 20.0, lambda t: 0.0)
    spoiled = [structs.replace(f, data=bytes([f.data[0] ^ 1]) + f.data[1:]) for f in frames]
    assert bench(straight, spoiled).run(20).stale
    assert not bench(straight, frames).run(20).stale


@pytest.mark.parametrize("flag", ["is_remote", "is_error", "is_extended"])
def test_a_frame_of_another_kind_is_not_believed_though_its_bytes_are_right(straight, flag):
    frames = motion_frames(1.0, lambda t: 20.0, lambda t: 0.0)
    one = bench(straight, [structs.replace(frame, **{flag: True}) for frame in frames])
    assert one.run(20).stale
    assert not one.source.accepts(structs.replace(frames[0], **{flag: True}))
    assert one.source.accepts(frames[0])


def test_a_frame_whose_counter_stands_brings_nothing_new(straight):
    frame = Gateway().motion(0, 20.0, 0.0)
    frames = [structs.replace(frame, due_ns=k * CYCLE_NS) for k in range(50)]
    assert bench(straight, frames).run(20).stale == ("ego.speed_mps", "ego.yaw_rate_radps")


def test_after_more_lost_frames_than_a_receiver_tolerates_the_next_but_one_is_believed(straight):
    gateway = Gateway()
    frames = motion_frames(1.0, lambda t: 20.0, lambda t: 0.0, gateway=gateway)
    few = [f for k, f in enumerate(frames) if not 10 <= k < 12]  # the counter steps by 3
    many = [f for k, f in enumerate(frames) if not 10 <= k < 13]
    found = []
    for kept in (few, many):
        source = live(straight)
        state = source.initial_state()
        for k, frame in enumerate(kept[:11]):
            state, _ = source.advance(state, Tick(index=k, t_ns=frame.due_ns, period_ns=1), (frame,))
        found.append(state.listened.quantities["ego.speed_mps"].t_ns)
    assert found == [few[10].due_ns, many[9].due_ns]


def test_values_that_no_vehicle_has_are_not_available(straight):
    assert bench(straight, motion_frames(1.0, lambda t: 154.0, lambda t: 0.0)).run(20).stale == (
        "ego.speed_mps",
    )


def test_nothing_heard_at_all_is_said_at_the_end(straight):
    one = bench(straight, [])
    one.run(3)
    assert one.source.remarks(one.state) == (
        "nothing was heard of ego.speed_mps",
        "nothing was heard of ego.yaw_rate_radps",
    )


# ---- the whole pose ----


def pose_frames(seconds, at, gateway=None):
    """Return the frames of poses at(t) = (x, y, yaw), every 20 ms."""
    gateway = gateway or Gateway()
    return [f for k in range(round(seconds * 50) + 1) for f in gateway.pose(k * CYCLE_NS, *at(k * 0.02))]


def test_the_vehicle_is_where_the_bus_says_and_goes_on_between_two_poses(straight):
    def at(t):
        return 30.0 + 25.0 * t, -HALF_LANE_M + 0.5 * t, 0.02

    snapshot = bench(straight, pose_frames(2.0, at), "pose").run(51)
    x, y, _ = at(2.0 - 0.0004)  # the last frame of a pose comes 0.4 ms after its first
    assert position(snapshot) == pytest.approx([x, y, 0.0], abs=2 * MM)
    assert snapshot.ego.yaw_rad == pytest.approx(0.02, abs=1e-5)
    assert snapshot.ego.speed_mps == pytest.approx(hypot(25.0, 0.5), abs=0.1)
    assert snapshot.stale == ()


def test_a_pose_on_a_bend_goes_on_along_the_arc(bend):
    rate = 0.1

    def at(t):
        return 20.0 / rate * sin(rate * t), 20.0 / rate * (1 - cos(rate * t)) - HALF_LANE_M, rate * t

    snapshot = bench(bend, pose_frames(3.0, at), "pose").run(75)
    assert position(snapshot)[:2] == pytest.approx(at(74 * 0.04 - 0.0004)[:2], abs=3 * MM)
    assert snapshot.ego.yaw_rate_radps == pytest.approx(rate, abs=1e-3)


def test_parts_of_two_poses_are_never_put_together(straight):
    """Every tenth x is lost: y and heading of that pose wait for no later x."""
    frames = pose_frames(1.0, lambda t: (30.0 + 100.0 * t, 10.0 * t, 0.1))
    kept = [f for k, f in enumerate(frames) if k % 30 != 27]
    one = Bench(live(straight, "pose", timeout_ms=500))
    state, seen = one.state, set()
    for k, frame in enumerate(kept):
        state, _ = one.source.advance(state, Tick(index=k, t_ns=frame.due_ns, period_ns=1), (frame,))
        seen.add((round(state.control.pose.x_m, 3), round(state.control.pose.y_m, 3)))
    seen.remove((0.0, -HALF_LANE_M))
    assert {round((x - 30.0) / 10.0 - y, 6) for x, y in seen} == {0.0}
    assert len(seen) == 51 - 5


def test_the_height_is_the_buss_if_it_comes_else_the_roads(straight):
    gateway = Gateway()
    with_z = [f for k in range(20) for f in gateway.pose(k * CYCLE_NS, 30.0, -1.0, 0.0, z_m=0.25)]
    assert position(bench(straight, with_z, "pose").run(9))[2] == pytest.approx(0.25)
    assert position(bench(straight, pose_frames(0.4, lambda t: (30.0, -1.0, 0.0)), "pose").run(9))[2] == 0.0


def test_a_vehicle_whose_pose_is_missing_stands(straight):
    one = bench(straight, pose_frames(1.0, lambda t: (30.0 + 20.0 * t, -1.0, 0.0)), "pose")
    one.run(40)
    a, b = one.snapshots[34], one.snapshots[39]
    assert a.stale == b.stale == ("ego.x_m", "ego.y_m", "ego.yaw_rad")
    assert position(a) == position(b)
    assert b.ego.speed_mps == 0.0


def test_a_vehicle_that_is_put_elsewhere_sees_the_road_there(tmp_path):
    road_map = loaded(tmp_path, road(plan=None, length=2000.0))
    gateway = Gateway()
    here = pose_frames(0.4, lambda t: (30.0, -HALF_LANE_M, 0.0), gateway)
    there = [f for k in range(22, 40) for f in gateway.pose(k * CYCLE_NS - 1_000_000, 1700.0, 0.4, 0.1)]
    one = bench(road_map, [*here, *there], "pose")
    snapshot = one.run(20)
    assert one.state.foot.s_m == pytest.approx(1700.0, abs=0.01)
    assert one.state.foot.offset_m == pytest.approx(0.4 + HALF_LANE_M, abs=0.01)
    assert snapshot.scene.markings
    assert {round(position(s)[0], 3) for s in one.snapshots} == {0.0, 30.0, 1700.0}  # not driven there


# ---- steering ----


def steering_frames(seconds, angle, start_ns=0):
    gateway = Gateway()
    return [
        gateway.frame("ECU_Steering", start_ns + k * CYCLE_NS, steering_request_rad=angle(k * 0.02))
        for k in range(round(seconds * 50) + 1)
    ]


def test_a_steered_vehicle_stands_until_the_first_request_and_then_drives_at_the_scenarios_speed(straight):
    one = bench(straight, steering_frames(3.0, lambda t: 0.0, 400_000_000), "steering", ego={"speed_kmh": 72})
    one.run(61)
    assert position(one.snapshots[10])[0] == 0.0
    # The request of 0.40 s is heard at the slot of 0.44 s.
    assert position(one.snapshots[60])[0] == pytest.approx(20.0 * (2.4 - 0.44), abs=1e-9)
    assert one.snapshots[60].stale == one.snapshots[0].stale == ()


def test_the_time_of_the_scenarios_speed_begins_with_the_first_request(straight):
    speed = [(0.0, 36.0), (1.0, 72.0)]
    one = bench(
        straight, steering_frames(3.0, lambda t: 0.0, 400_000_000), "steering", ego={"speed_kmh": speed}
    )
    one.run(60)
    found = [one.snapshots[k].ego.speed_mps for k in (10, 11, 12, 24, 50)]
    assert found == pytest.approx([0.0, 10.0, 10.4, 15.2, 20.0])
    assert one.snapshots[24].ego.acceleration_mps2 == pytest.approx(10.0)


def test_a_held_angle_drives_the_circle_of_steady_cornering(straight):
    angle, speed = 0.01, 20.0
    frames = steering_frames(6.0, lambda t: angle)
    one = bench(straight, frames, "steering", ego={"speed_kmh": 72})
    ego = one.run(140).ego
    vehicle = SingleTrack.of(DynamicsConfig(), 2.8)
    assert ego.yaw_rate_radps == pytest.approx(vehicle.steady_yaw_rate(speed, angle), rel=1e-6)
    assert ego.lateral_acceleration_mps2 == pytest.approx(speed * ego.yaw_rate_radps)


def test_the_steering_wheel_turns_the_front_wheels_by_its_ratio(straight):
    gateway = Gateway()
    frames = [gateway.frame("VEH_Steering", k * CYCLE_NS, steering_wheel_rad=0.15) for k in range(300)]
    by_wheel = bench(straight, frames, "steering", ego={"speed_kmh": 72}, steering="wheel").run(100)
    raw_angle = round(np.rad2deg(0.15) / 0.1) * 0.1
    rate = SingleTrack.of(DynamicsConfig(), 2.8).steady_yaw_rate(20.0, np.deg2rad(raw_angle) / 15.0)
    assert by_wheel.ego.yaw_rate_radps == pytest.approx(rate, rel=1e-6)
    assert by_wheel.stale == ()


def test_without_a_request_the_wheels_go_straight(straight):
    gateway = Gateway()
    frames = [gateway.frame("ECU_Steering", k * CYCLE_NS, steering_request_rad=0.02) for k in range(50)]
    frames += [gateway.frame("ECU_Steering", k * CYCLE_NS) for k in range(50, 150)]
    one = bench(straight, frames, "steering", ego={"speed_kmh": 72})
    assert one.run(25).ego.yaw_rate_radps > 0.1
    assert one.run(40).ego.yaw_rate_radps == pytest.approx(0.0, abs=1e-6)


def test_a_request_that_stays_away_is_no_lack_of_the_sensor_but_is_said(straight):
    one = bench(straight, steering_frames(0.5, lambda t: 0.0), "steering")
    assert one.run(40).stale == ()
    missing, steps = one.source.remarks(one.state)
    assert missing == "ego.steering_request_rad was missing once, at 0.64 s"
    assert steps.startswith("vehicle: its steps in time are wrong by at most ")


def test_speed_may_come_from_the_bus_while_an_ecu_steers(straight):
    gateway = Gateway()
    frames = steering_frames(2.0, lambda t: 0.0)
    frames += motion_frames(2.0, lambda t: 10.0, lambda t: 0.0, gateway=gateway)
    one = bench(straight, frames, "steering", speed="bus")
    ego = one.run(51).ego
    assert ego.speed_mps == pytest.approx(10.0)
    assert one.snapshots[0].stale == ("ego.speed_mps",)
    assert one.snapshots[-1].stale == ()


def test_a_loop_that_is_closed_over_the_bus_keeps_the_vehicle_in_its_lane(bend):
    """A law of our own: the bend's steering angle, more of it for an offset and a heading to the right."""
    one = bench(bend, [], "steering", ego={"speed_kmh": 72, "offset_m": 0.8})
    gateway, offsets = Gateway(), []
    vehicle = SingleTrack.of(DynamicsConfig(), 2.8)
    ahead = 20.0 / (vehicle.steady_yaw_rate(20.0, 1.0) * (RADIUS_M + HALF_LANE_M))
    for k in range(600):
        snapshot = one.step()
        foot = one.state.foot
        heading = remainder(snapshot.ego.yaw_rad - foot.s_m / (RADIUS_M + HALF_LANE_M), 2 * pi)
        request = ahead - 0.01 * foot.offset_m - 0.2 * heading
        one.waiting.append(gateway.frame("ECU_Steering", k * PERIOD_NS + 1, steering_request_rad=request))
        offsets.append(foot.offset_m)
    assert offsets[0] == pytest.approx(0.8, abs=1e-6)
    assert max(map(abs, offsets)) < 1.0
    # The rear axle slips by m (lf / L) v^2 / R / cr, so the nose points in: an offset balances that.
    slip = 1600.0 * 1.25 / 2.8 * 20.0**2 / (RADIUS_M + HALF_LANE_M) / 150_000.0
    assert offsets[-1] == pytest.approx(-0.2 * slip / 0.01, abs=0.01)
    assert one.state.foot.s_m > 450.0


# ---- the route ----


def test_a_lane_change_is_driven_over_the_map_and_the_foot_follows(straight):
    swing = motion_frames(3.0, lambda t: 20.0, lambda t: 0.1 * sin(2 * pi * t / 3.0))
    one = bench(straight, swing)
    snapshot = one.run(76)
    x, y, _ = position(snapshot)
    assert (one.state.foot.s_m, one.state.foot.offset_m) == pytest.approx((x, y + HALF_LANE_M), abs=1e-6)
    assert y > 1.0  # from lane -1 into lane 1
    left = [m for m in snapshot.scene.markings if m.points_world_m[0, 1] > y]
    assert left
    assert len(snapshot.scene.markings) == 3


def test_off_the_route_nothing_is_seen_and_that_is_said(straight):
    away = pose_frames(1.0, lambda t: (200.0 + 10.0 * t, -HALF_LANE_M + 30.0 * t, 1.2))
    one = bench(straight, away, "pose")
    one.run(27)
    off = [not snapshot.scene.markings for snapshot in one.snapshots]
    assert off.index(True) == 17  # 20 m after 0.667 s
    assert all(off[17:])
    assert one.source.remarks(one.state) == (
        "the vehicle was off the route (over 20 m away, or against it) once, at 0.68 s: "
        "nothing was seen there",
    )
    assert one.snapshots[-1].stale == ()


@pytest.mark.parametrize("x", [10.0, 200.0])  # beside the start, and so far off that it is looked for
def test_against_the_direction_of_the_route_nothing_is_seen(straight, x):
    snapshot = bench(straight, pose_frames(0.4, lambda t: (x, -HALF_LANE_M, pi)), "pose").run(9)
    assert snapshot.scene.markings == ()


def test_a_vehicle_that_comes_back_to_the_route_sees_it_again(straight):
    def at(t):
        return 200.0 + 20.0 * t, -HALF_LANE_M + 60.0 * sin(pi * t / 2.0), 0.0

    one = bench(straight, pose_frames(2.0, at), "pose")
    one.run(51)
    seen = [bool(snapshot.scene.markings) for snapshot in one.snapshots]
    assert (seen[5], seen[25], seen[50]) == (True, False, True)


def test_the_drive_ends_where_the_route_does(tmp_path):
    road_map = loaded(tmp_path, road(length=60.0))
    one = bench(road_map, motion_frames(5.0, lambda t: 20.0, lambda t: 0.0))
    one.run(100)
    ended = [snapshot is None for snapshot in one.snapshots]
    assert ended.index(True) == 76  # 60 m at 20 m/s: 3.0 s; the tick at 3.00 s is still on the road


def test_just_before_the_start_of_the_route_the_vehicle_is_still_on_it(straight):
    snapshot = bench(straight, pose_frames(0.4, lambda t: (-2.0, -HALF_LANE_M, 0.0)), "pose").run(9)
    assert position(snapshot)[0] == pytest.approx(-2.0)
    assert snapshot.scene.markings


def test_a_closed_circuit_goes_on_and_on(tmp_path):
    radius = 30.0
    link = '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    link += '<successor elementType="road" elementId="1" contactPoint="start"/>'
    lanes = section(right=[lane(-1, links='<predecessor id="-1"/><successor id="-1"/>')])
    length = 2 * pi * radius
    plan = geometry(f'<arc curvature="{1 / radius!r}"/>', length)
    ring = loaded(tmp_path, road(plan=plan, sections=lanes, length=length, link=link))
    outer = radius + HALF_LANE_M

    def at(t):
        turn = 20.0 / outer * t
        return outer * sin(turn), radius - outer * cos(turn), remainder(turn, 2 * pi)

    one = bench(ring, pose_frames(25.0, at), "pose")
    snapshot = one.run(626)
    assert one.state.foot.s_m == pytest.approx(25.0 * 20.0, abs=0.05)  # 2.5 rounds
    assert one.state.foot.offset_m == pytest.approx(0.0, abs=0.02)
    assert snapshot.scene.markings


# ---- environment ----


def body_frames(seconds, start_ns=0, **values):
    gateway = Gateway()
    count = round(seconds * 10) + 1
    return [gateway.frame("VEH_Body", start_ns + k * 100_000_000, **values) for k in range(count)]


NIGHT_RAIN = Environment(light=Light.NIGHT, rain=0.7)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"wiper": 3.0, "light": 1.0}, Environment(light=Light.DUSK, rain=1.0)),
        ({"wiper": 0.0, "low_beam": 0.0}, Environment(light=Light.DAY, rain=0.0)),
        ({"wiper": 1.0, "low_beam": 1.0}, Environment(light=Light.NIGHT, rain=0.2)),
        ({"wiper": 2.0}, Environment(light=Light.NIGHT, rain=0.5)),
        ({"light": 0.0, "low_beam": 1.0}, Environment(light=Light.DAY, rain=0.7)),
        ({"light": 2.0, "low_beam": 0.0}, replace(NIGHT_RAIN, beam=Beam.OFF)),
        ({"light": 2.0, "low_beam": 1.0}, NIGHT_RAIN),
        ({"high_beam": 1.0}, replace(NIGHT_RAIN, beam=Beam.HIGH)),
        ({}, NIGHT_RAIN),
    ],
)
def test_wiper_and_light_of_the_bus_come_before_the_scenarios(straight, values, expected):
    one = bench(straight, body_frames(0.4, **values), environment=NIGHT_RAIN)
    assert one.run(5).scene.environment == expected


def test_the_scenarios_environment_stays_where_that_is_wanted(straight):
    one = bench(straight, body_frames(0.4, wiper=3.0), environment=NIGHT_RAIN)
    one.source = live(straight, environment=NIGHT_RAIN)
    quiet = bench(straight, body_frames(0.4, wiper=3.0), environment=NIGHT_RAIN)
    quiet.source = LiveDrive.load(
        quiet.source.drive,
        EgoConfig(control="motion"),
        ListenConfig(environment=False),
        DynamicsConfig(),
        2.8,
    )
    assert quiet.run(5).scene.environment == NIGHT_RAIN
    assert one.run(5).scene.environment.rain == 1.0


def test_a_drive_along_its_lane_may_listen_to_the_weather_alone(straight):
    one = bench(straight, body_frames(0.5, wiper=3.0), "lane", profile="vehicle")
    plain = MapDrive(one.source.drive.corridor, EgoConfig(road="1", lane=-1))
    snapshot = one.run(10)
    assert snapshot.ego == replace(
        plain.advance(None, tick(9), ())[1].ego, position_world_m=snapshot.ego.position_world_m
    )
    assert snapshot.scene.environment.rain == 1.0
    assert snapshot.stale == ()
    assert one.run(20).stale == ("ego.wiper",)  # 0.5 s + 300 ms have passed; it is held
    assert one.snapshots[-1].scene.environment.rain == 1.0
    assert not one.source.needs_bus


def test_the_weather_is_missed_only_once_it_has_been_heard(straight):
    frames = motion_frames(2.0, lambda t: 20.0, lambda t: 0.0)
    assert bench(straight, frames).run(40).stale == ()
    one = bench(straight, [*frames, *body_frames(0.4, wiper=1.0, indicator=1.0)])
    assert one.run(40).stale == ("ego.wiper",)
    assert one.state.listened.value("ego.indicator", nan) == 1.0


# ---- values in, values out ----


def test_a_run_that_is_restarted_at_any_tick_goes_on_bit_for_bit(bend):
    gateway = Gateway()
    frames = motion_frames(1.2, lambda t: 20.0 + t, lambda t: 0.1, gateway=gateway)
    frames = [f for k, f in enumerate(frames) if not 20 < k < 30] + body_frames(1.0, wiper=2.0)
    whole = bench(bend, sorted(frames, key=lambda f: f.due_ns))
    whole.run(35)
    for stop in (7, 12, 20):
        first = bench(bend, sorted(frames, key=lambda f: f.due_ns))
        first.run(stop)
        second = Bench(live(bend))
        second.state, second.index, second.waiting = first.state, first.index, first.waiting
        second.run(35 - stop)
        assert second.state == whole.state
        for a, b in zip(second.snapshots, whole.snapshots[stop:], strict=True):
            assert position(a) == position(b)
            assert replace(a.ego, position_world_m=b.ego.position_world_m) == b.ego
            assert a.stale == b.stale


def test_times_of_another_clock_do_no_harm(straight):
    """Frames stamped years before or after count as come now; time never runs backwards."""
    frames = motion_frames(1.0, lambda t: 20.0, lambda t: 0.0)
    one = Bench(live(straight))
    for k in range(25):
        wild = [
            structs.replace(f, due_ns=f.due_ns + (10**18 if k % 2 else -(10**18)))
            for f in frames[2 * k : 2 * k + 2]
        ]
        one.state, snapshot = one.source.advance(one.state, tick(k), wild)
        assert snapshot.stale == ()
    assert position(snapshot)[0] == pytest.approx(20.0 * 24 * 0.04, abs=1.7)


def test_frames_of_the_future_or_out_of_order_are_taken_in_order(straight):
    frames = motion_frames(0.4, lambda t: 20.0 + t, lambda t: 0.0)
    ordered, mixed = Bench(live(straight)), Bench(live(straight))
    ordered.state, a = ordered.source.advance(ordered.state, tick(11), frames)
    mixed.state, b = mixed.source.advance(mixed.state, tick(11), frames[::-1])
    assert ordered.state == mixed.state
    assert position(a) == position(b)


def test_samples_are_interpolated_held_and_released():
    samples = ((0, 1.0), (10, 3.0))
    assert [value_at(samples, t, hold_ns=5) for t in (-5, 0, 5, 10, 15, 16)] == [1.0, 1.0, 2.0, 3.0, 3.0, 0.0]
    assert value_at((), 3) == 0.0
    assert value_at(((0, 1.0),), 2_000_000_000, slope_per_s=-1.0) == 0.0


# ---- what is refused ----


def test_a_profile_that_lacks_what_the_control_needs_is_refused_by_name(straight):
    with pytest.raises(
        ConfigError, match=r"no signal of native carries ego\.speed_mps, which ego\.control = \"motion\""
    ):
        live(straight, profile="native")


def test_the_notes_say_what_is_listened_to(straight):
    notes = live(straight).notes
    assert any(
        "listens to 0x100 VEH_Motion (profile vehicle): ego.speed_mps, ego.yaw_rate" in n for n in notes
    )
    assert any(n.endswith("missing after 60 ms") for n in notes)


# ---- frames that nobody should believe ----

IDS = st.one_of(
    st.sampled_from([0x100, 0x101, 0x103, 0x104, 0x105, 0x106, 0x200]), st.integers(0, 0x1FFFFFFF)
)
FRAMES = st.builds(
    Frame,
    due_ns=st.integers(-(10**10), 10**10),
    arbitration_id=IDS,
    data=st.binary(max_size=64),
    is_extended=st.booleans(),
    is_fd=st.booleans(),
    is_remote=st.booleans(),
    is_error=st.booleans(),
)


@pytest.fixture(scope="module")
def sources(straight):
    return {name: live(straight, name) for name in ("motion", "pose", "steering")}


@settings(max_examples=150, deadline=None)
@given(
    frames=st.lists(st.lists(FRAMES, max_size=6), min_size=1, max_size=5),
    control=st.sampled_from(["motion", "pose", "steering"]),
)
def test_random_frames_neither_stop_the_source_nor_are_believed(sources, frames, control):
    source = sources[control]
    state = source.initial_state()
    for k, inputs in enumerate(frames):
        state, snapshot = source.advance(state, tick(k), inputs)
        assert snapshot is not None
        assert np.isfinite(snapshot.ego.position_world_m).all()
    believed = [f for inputs in frames for f in inputs if source.accepts(f)]
    for frame in believed:  # 1 in 256 has the right checksum by chance
        plan = PLANS_BY_ID[frame.arbitration_id]
        assert plan.guard.check(frame.data[:8])
        assert (frame.is_error, frame.is_remote, frame.is_extended) == (False, False, False)
    if not believed:
        assert not state.listened.quantities
        assert position(snapshot) == position(source.advance(source.initial_state(), tick(0), ())[1])


@settings(max_examples=150, deadline=None)
@given(
    frames=st.lists(
        st.tuples(st.sampled_from(sorted(PLANS)), st.binary(min_size=8, max_size=8), st.integers(0, 10**9)),
        max_size=25,
    ),
    control=st.sampled_from(["motion", "pose", "steering"]),
)
def test_whatever_intact_frames_say_the_world_stays_finite(sources, frames, control):
    source = sources[control]
    state = source.initial_state()
    for k, (name, data, t_ns) in enumerate(frames):
        payload = bytearray(data)
        PLANS[name].guard.protect(payload, k % 15)
        frame = Frame(due_ns=t_ns, arbitration_id=PLANS[name].layout.arbitration_id, data=bytes(payload))
        state, snapshot = source.advance(state, tick(k), (frame,))
        if snapshot is None:
            return
        ego = snapshot.ego
        numbers = [
            *position(snapshot),
            ego.yaw_rad,
            ego.roll_rad,
            ego.pitch_rad,
            ego.speed_mps,
            ego.yaw_rate_radps,
        ]
        assert np.isfinite(numbers).all()
        assert abs(ego.speed_mps) <= 155.0
        assert 0.0 <= snapshot.scene.environment.rain <= 1.0
