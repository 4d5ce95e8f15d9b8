"""A vehicle and its driver on a map: it keeps the lane, the speed, its word, and its state."""

import pickle
from dataclasses import replace
from math import cos, sin

import numpy as np
import pytest

from tests.maps import geometry, lane, loaded, road, section
from tests.vehicle_frames import CYCLE_NS, Gateway
from vsensor.config import SHIPPED, load_scenario
from vsensor.errors import ConfigError
from vsensor.line.build import build_source
from vsensor.signals import VehicleConfig
from vsensor.sources.driven import OFF_LANE, OFF_ROUTE, DrivenDrive
from vsensor.sources.listening import ListenConfig
from vsensor.sources.live import LiveDrive
from vsensor.sources.manoeuvres import ManoeuvreConfig, planned
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.sources.moving import FRONT_SLIDES, REAR_SLIDES
from vsensor.sources.traffic import TrafficConfig
from vsensor.types import Light, Tick
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map
from vsensor.world.vehicle import DriverConfig, DynamicsConfig, lean_degpmps2, placed

KMH = 1.0 / 3.6
PERIOD_NS = 40_000_000
REAL = {"tyres": "nonlinear", "steering_lag_s": 0.1, "steering_rate_degps": 30.0}
"""A vehicle as they are: tyres that end, wheels that lag."""

THREE_LANES = section(left=[lane(1)], right=[lane(-1), lane(-2), lane(-3)])
RADIUS_M = 250.0
HALF_LANE_M = 1.75


def tick(index, period_ns=PERIOD_NS):
    return Tick(index=index, t_ns=index * period_ns, period_ns=period_ns)


def map_drive(road_map, ego, traffic=()):
    plan = planned(ego.speed_kmh, ego.offset_m, ego.manoeuvre)
    ego = EgoConfig(road="1", lane=ego.lane, speed_kmh=plan.speed_kmh, s_m=ego.s_m, control="driver")
    return MapDrive(Corridor(road_map, ego.corridor()), ego, traffic), plan


def driver_on(
    road_map, speed_kmh=90.0, lane=-1, manoeuvres=(), dynamics=REAL, offset_m=0.0, traffic=(), **ego
):
    """Return the source of a driver on road 1."""
    ego = EgoConfig(
        lane=lane,
        speed_kmh=speed_kmh,
        offset_m=offset_m,
        manoeuvre=tuple(ManoeuvreConfig(**one) for one in manoeuvres),
        **ego,
        road="1",
    )
    drive, plan = map_drive(road_map, ego, traffic)
    return DrivenDrive(drive, plan, DriverConfig(), DynamicsConfig(**dynamics), VehicleConfig())


def states(source, seconds, state=None, first=0, period_ns=PERIOD_NS):
    """Return the states after every tick, up to so many seconds."""
    state, found = state or source.initial_state(), []
    for index in range(first, round(seconds * 1e9 / period_ns) + 1):
        state, snapshot = source.advance(state, tick(index, period_ns), ())
        found.append(state)
        if snapshot is None:
            break
    return found


def aside(source, metres):
    """Return the first state of a vehicle that stands so far to the left of its path."""
    state = source.initial_state()
    body = state.trip.body
    moved = replace(
        body, x_m=body.x_m - metres * sin(body.yaw_rad), y_m=body.y_m + metres * cos(body.yaw_rad)
    )
    foot = replace(state.foot, offset_m=state.foot.offset_m + metres)
    return replace(state, trip=placed(state.trip, moved), foot=foot)


@pytest.fixture(scope="module")
def highway():
    return load_map(SHIPPED / "highway.xodr")


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    return loaded(tmp_path_factory.mktemp("straight"), road(length=2000.0, sections=THREE_LANES))


@pytest.fixture(scope="module")
def bend(tmp_path_factory):
    """A left-hand bend; lane -1 has a radius of 251.75 m."""
    plan = geometry(f'<arc curvature="{1 / RADIUS_M!r}"/>', 1500.0)
    return loaded(tmp_path_factory.mktemp("bend"), road(plan=plan, length=1500.0))


# ---- the path ----


@pytest.mark.parametrize("speed_kmh", [20.0, 60.0, 120.0, 180.0])
def test_a_vehicle_beside_its_path_comes_back_to_it_without_swinging_over(highway, speed_kmh):
    source = driver_on(highway, speed_kmh, lane=-3, s_m=400.0)
    off = np.array([state.off_path_m for state in states(source, 10.0, aside(source, 0.5))])
    assert off[0] == pytest.approx(0.5, abs=1e-5)
    assert off.max() < 0.505  # the rear axle goes aside a little when the front wheels turn in
    assert off.min() > -0.01
    assert abs(off[-75:]).max() < 0.01


@pytest.mark.parametrize(("tyres", "most_m"), [("linear", 2e-4), ("nonlinear", 6e-3)])
def test_a_bend_is_driven_on_the_lanes_middle(bend, tyres, most_m):
    """At 3 m/s^2; what tyres slip more than linear ones is known to the driver."""
    source = driver_on(bend, 100.0, dynamics={**REAL, "tyres": tyres})
    assert max(abs(state.off_path_m) for state in states(source, 8.0)) < most_m


def test_a_clothoid_ahead_is_seen_before_it_comes(highway):
    """Straight, clothoid and arc of the shipped ring at 180 km/h, where the road tilts and climbs, too."""
    source = driver_on(highway, 180.0, lane=-3, s_m=150.0)
    assert max(abs(state.off_path_m) for state in states(source, 10.0)) < 0.02


def test_a_lane_change_ends_on_the_lane_beside_and_begins_where_it_was_told_to(straight):
    change = {"kind": "lane_change", "lanes_left": 1, "over_s": 4.0, "at_s": 3.0}
    source = driver_on(straight, 100.0, -2, [change])
    run = states(source, 12.0)
    offsets = [state.foot.offset_m for state in run]
    assert offsets[75] == pytest.approx(0.0, abs=0.02)
    assert offsets[125] == pytest.approx(HALF_LANE_M, abs=0.03)  # halfway in time and aside
    assert offsets[-1] == pytest.approx(3.5, abs=0.002)
    assert max(offsets) < 3.52
    assert run[-1].troubles.met == {}


def test_a_lane_that_is_not_there_is_told_before(straight):
    change = {"kind": "lane_change", "lanes_left": -1, "over_s": 4.0}
    assert driver_on(straight, lane=-2, manoeuvres=[change]).findings == ()
    found = driver_on(straight, lane=-3, manoeuvres=[change]).findings
    assert found == ("ego.manoeuvre[0]: no such lane at 100 m, so it drives beside the road's lanes",)


def test_a_lane_change_in_a_year_is_not_looked_for_along_a_year_of_road(straight, monkeypatch):
    monkeypatch.setattr(
        Corridor, "reaches", lambda self, s_m: s_m < 1e6 or pytest.fail(f"gone {s_m} m along")
    )
    change = {"kind": "lane_change", "lanes_left": 5, "at_s": 3e7}
    assert driver_on(straight, manoeuvres=[change]).findings == ()


# ---- the speed ----


def test_braking_goes_evenly_and_ends_at_the_speed_that_was_told(straight):
    brake = {"kind": "brake", "to_kmh": 72, "acceleration_mps2": 4.0, "at_s": 2.0}
    run = states(driver_on(straight, 108.0, manoeuvres=[brake]), 7.0)
    speeds = np.array([state.trip.speed_mps for state in run])
    t = 0.04 * np.arange(len(run))
    wanted = np.interp(t, [2.0, 4.5], [30.0, 20.0])
    assert abs(speeds - wanted).max() < 0.4  # while the brakes come on, 0.15 s
    assert abs(speeds[t > 6.0] - 20.0).max() < 0.025
    assert speeds.min() > 19.95
    middle = [state.trip.acceleration_mps2 for state, at_s in zip(run, t, strict=True) if 3.0 < at_s < 4.0]
    assert middle == pytest.approx([-4.0] * len(middle), abs=0.1)


def test_a_vehicle_told_to_stop_stands_and_goes_on_again(straight):
    stop = {"kind": "brake", "to_kmh": 0, "acceleration_mps2": 5.0}
    go = {"kind": "accelerate", "to_kmh": 36, "acceleration_mps2": 2.0, "at_s": 5.0}
    run = states(driver_on(straight, 36.0, manoeuvres=[stop, go]), 14.0)
    assert min(state.trip.speed_mps for state in run) < 0.02
    assert run[-1].trip.speed_mps == pytest.approx(10.0, abs=0.02)
    assert max(abs(state.off_path_m) for state in run) < 1e-3


def test_on_ice_a_driver_brakes_no_harder_than_the_road_gives(straight):
    brake = {"kind": "brake", "to_kmh": 36, "acceleration_mps2": 8.0}
    ice = {**REAL, "friction": 0.2}
    run = states(driver_on(straight, 108.0, manoeuvres=[brake], dynamics=ice), 8.0)
    hardest = min(state.trip.acceleration_mps2 for state in run)
    assert hardest == pytest.approx(-0.9 * 0.2 * 9.81, rel=1e-3)
    assert max(abs(state.off_path_m) for state in run) < 0.01


# ---- a value ----


def busy(road_map):
    return driver_on(
        road_map,
        108.0,
        -2,
        [
            {"kind": "brake", "to_kmh": 90, "at_s": 0.5},
            {"kind": "lane_change", "lanes_left": 1, "over_m": 80.0, "at_s": 1.0},
        ],
    )


def test_a_state_saved_at_any_tick_goes_on_to_the_last_bit(straight):
    source = busy(straight)
    whole = states(source, 3.0)
    saved = pickle.loads(pickle.dumps(whole[37]))
    again = states(busy(straight), 3.0, saved, first=38)
    assert again[-1] == whole[-1]


@pytest.mark.parametrize("period_ns", [25_000_000, 100_000_000])
def test_the_path_does_not_depend_on_the_cycle(straight, period_ns):
    usual, other = (states(busy(straight), 2.0, period_ns=one)[-1] for one in (PERIOD_NS, period_ns))
    assert other.t_ns == usual.t_ns == 2_000_000_000
    a, b = other.trip.body, usual.trip.body
    assert (a.x_m, a.y_m, a.yaw_rad) == pytest.approx((b.x_m, b.y_m, b.yaw_rad), abs=1e-7)


def test_ticks_that_were_dropped_are_driven_all_the_same(straight):
    source = busy(straight)
    every = states(source, 2.0)[-1]
    state, _ = source.advance(source.initial_state(), tick(0), ())
    late, _ = source.advance(state, tick(50), ())
    assert late.trip == every.trip


# ---- the world around ----


def test_the_scene_is_that_of_a_drive_along_the_lane(straight):
    """The same map drive shows it: traffic, markings, weather at the vehicle's place on the route."""
    car = TrafficConfig(ahead_m=40.0)
    source = driver_on(straight, 90.0, traffic=(car,))
    state = states(source, 2.0)[-1]
    _, snapshot = source.advance(state, tick(51), ())
    s_m = snapshot.ego.position_world_m[0]
    assert s_m == pytest.approx(25.0 * 2.04, abs=1e-6)
    (there,) = snapshot.scene.obstacles
    assert there.centre_world_m[0] == pytest.approx(s_m + 40.0, abs=1e-3)
    assert len(snapshot.scene.markings) == len(source.drive.scene(2.04, s_m).markings) > 0


def test_the_ego_tells_how_it_moves(bend):
    source = driver_on(bend, 100.0)
    state = states(source, 5.0)[-1]
    _, snapshot = source.advance(state, tick(126), ())
    ego, speed, radius = snapshot.ego, 100.0 * KMH, RADIUS_M + HALF_LANE_M
    assert ego.yaw_rate_radps == pytest.approx(speed / radius, rel=1e-3)
    assert ego.lateral_acceleration_mps2 == pytest.approx(speed**2 / radius, rel=2e-3)
    assert ego.acceleration_mps2 == pytest.approx(0.0, abs=1e-9)


def test_the_drive_ends_with_the_road(straight):
    source = driver_on(straight, 180.0, s_m=1900.0)
    assert source.duration_s == pytest.approx(2.0)
    assert states(source, 3.0)[-1].t_ns == pytest.approx(2.0e9, abs=0.05e9)


def test_light_may_come_from_the_bus_while_a_driver_drives(straight):
    ego = EgoConfig(road="1", lane=-1, control="driver")
    drive, plan = map_drive(straight, ego)
    alone = DrivenDrive(drive, plan, DriverConfig(), DynamicsConfig(), VehicleConfig())
    listen = ListenConfig(profile="vehicle")
    live = LiveDrive.load(drive, ego, listen, DynamicsConfig(), 2.8, alone=alone)
    frame = Gateway().frame("VEH_Body", CYCLE_NS, light=2.0)
    state, _ = live.advance(live.initial_state(), tick(0), ())
    state, snapshot = live.advance(state, tick(1), (frame,))
    assert not live.needs_bus
    assert snapshot.scene.environment.light is Light.NIGHT
    assert snapshot.ego.speed_mps == pytest.approx(100.0 * KMH)
    assert live.remarks(state) == alone.remarks(state.control)


# ---- what goes wrong ----


def test_a_bend_taken_too_fast_for_the_road_is_told(bend):
    """3 m/s^2 on a road that gives 2: all tyres slide, it leaves its lane and at last the route."""
    source = driver_on(bend, 100.0, dynamics={**REAL, "friction": 0.2})
    run = states(source, 12.0)
    assert list(run[-1].troubles.met) == [REAR_SLIDES, FRONT_SLIDES, OFF_LANE, OFF_ROUTE]
    assert not run[-1].foot.is_on_route
    _, snapshot = source.advance(run[-1], tick(301), ())
    assert snapshot.scene.markings == ()
    said = source.remarks(run[-1])
    assert said[1].startswith("the front tyres lost their grip, the vehicle went straight on, once, at ")
    assert said[-1].startswith("vehicle: its steps in time are wrong by at most ")


def test_an_ordinary_drive_says_how_well_the_path_was_kept_and_nothing_else(bend):
    source = driver_on(bend, 80.0)
    kept, steps = source.remarks(states(source, 2.0)[-1])
    assert kept.startswith("driver: at most 0.00")
    assert steps.endswith(" m within 60 s")


# ---- in a scenario ----


def scenario(folder, text):
    path = folder / "one.toml"
    source = f'schema = "vsensor.scenario/1"\nsource = "{SHIPPED / "highway.xodr"}"\n'
    path.write_text(source + text, encoding="utf-8")
    return load_scenario(str(path))


def test_manoeuvres_without_a_driver_are_refused(tmp_path):
    text = '[[ego.manoeuvre]]\nkind = "hold"\n'
    with pytest.raises(
        ConfigError, match=r'ego.manoeuvre: ego.control = "driver" was expected, it is "lane"'
    ):
        build_source(scenario(tmp_path, text))


def test_the_body_leans_as_the_scenarios_masses_and_springs_say(tmp_path):
    lean = 'pitch_deg_per_mps2 = "dynamics"\nroll_deg_per_mps2 = "dynamics"\n'
    one = scenario(tmp_path, f"[motion]\nbody = true\n{lean}[dynamics]\ncg_height_m = 0.8\n")
    motion = one.config.sensor().motion
    expected = lean_degpmps2(DynamicsConfig(cg_height_m=0.8), 2.8)
    assert (motion.pitch_deg_per_mps2, motion.roll_deg_per_mps2) == expected


@pytest.mark.parametrize("name", ["p3_hold", "p3_accelerate", "p3_brake", "p3_lane_change"])
def test_p3s_manoeuvres_are_driven_on_its_track_from_80_kmh_on(name):
    source = build_source(load_scenario(name))
    speeds, shifts = source.plan.speeds, source.plan.shifts
    assert min(speeds.values) == pytest.approx(80.0 * KMH) if name != "p3_lane_change" else len(shifts) == 8
    assert load_scenario(name).source == SHIPPED / "p3_track.toml"
    assert source.findings == ()
    assert states(source, 0.4)[-1].troubles.met == {}
