"""A storyboard as a source: the carrier's motion as differences of its poses, restart, boxes, markings."""

import pickle
from itertools import pairwise
from math import cos, hypot, pi, remainder, sin

import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from tests.stories import (
    BEND,
    BEND_M,
    CAR,
    after,
    by_entity,
    drive,
    event,
    group,
    lane_change,
    lane_offset,
    lane_position,
    private,
    snapshots,
    speed,
    story,
    teleport,
    text,
    trigger,
    written,
)
from vsensor.config import load_scenario
from vsensor.errors import ConfigError, StoryError
from vsensor.line import build_line, build_source
from vsensor.overlay.build import synth_of
from vsensor.sources.storyboard import StoryboardConfig, StoryDrive
from vsensor.types import Environment, Tick, Unseen

MS = 1_000_000


def manoeuvring(*actions, stop=8):
    """A scenario of the ego alone, which does each action at its time."""
    events = [event(f"e{k}", trigger(after(t, "none")), one) for k, (t, one) in enumerate(actions)]
    return text(
        init=private("Ego", teleport(lane_position(50)), speed(20)),
        stories=story(group(*events)),
        stop=trigger(after(stop, "none"), tag="StopTrigger"),
        entities=("Ego",),
    )


MANOEUVRES = {
    "cubic by time": lane_change(-2, "cubic", "time", 3),
    "sinusoidal by rate": lane_change(-2, "sinusoidal", "rate", 2),
    "cubic by distance": lane_change(-2, "cubic", "distance", 60),
    "offset": lane_offset(1.0),
}


@pytest.mark.parametrize("name", MANOEUVRES)
@pytest.mark.parametrize("road", ["straight", "bend"])
def test_yaw_rate_and_speed_are_those_of_the_path(tmp_path, name, road):
    scenario = manoeuvring((1, MANOEUVRES[name]), (2, speed(28, "cubic", "time", 4)))
    source = drive(tmp_path, scenario, BEND) if road == "bend" else drive(tmp_path, scenario)
    h = 2 * MS  # all within one step of the storyboard, so that only the path is differentiated
    state = source.initial_state()
    for t_ns in range(0, 7_000 * MS, 50 * MS):
        near = []
        for k in (2, 4, 6):
            state, one = source.advance(state, Tick(index=0, t_ns=t_ns + k * MS, period_ns=h), ())
            near.append(one.ego)
        before, now, later = near
        yaw_rate = remainder(later.yaw_rad - before.yaw_rad, 2 * pi) / 0.004
        moved = later.position_world_m - before.position_world_m
        assert now.yaw_rate_radps == pytest.approx(yaw_rate, abs=2e-4)
        assert now.speed_mps == pytest.approx(hypot(*moved[:2]) / 0.004, rel=2e-5)
        heading = np.array([cos(now.yaw_rad), sin(now.yaw_rad)])
        assert float(moved[:2] @ heading) == pytest.approx(hypot(*moved[:2]), rel=1e-8)
        assert now.acceleration_mps2 == pytest.approx((later.speed_mps - before.speed_mps) / 0.004, abs=1e-3)


def test_the_path_has_no_jump_at_the_steps_of_the_storyboard(tmp_path):
    source = drive(tmp_path, manoeuvring((1, lane_change(-2, "sinusoidal", "time", 2))), BEND)
    egos = [one.ego for one in snapshots(source, 4.0, period_ns=5 * MS)]
    for before, after_ in pairwise(egos):
        moved = np.linalg.norm(after_.position_world_m - before.position_world_m)
        assert moved == pytest.approx(before.speed_mps * 0.005, rel=1e-4)


def test_a_run_restarted_from_a_saved_state_goes_on_to_the_same_bits(tmp_path):
    scenario = text(
        stories=story(
            group(event("e", trigger(after(1, "none")), lane_change(-2)), actors=("Other",)),
            group(event("f", trigger(after(2, "none")), lane_offset(1.0)), name="g2"),
        )
    )
    source = drive(tmp_path, scenario, BEND)
    ticks = [Tick(index=k, t_ns=k * 40 * MS, period_ns=40 * MS) for k in range(100)]
    state, saved, whole = source.initial_state(), None, []
    for tick in ticks:
        if tick.index == 60:
            saved = pickle.dumps(state)
        state, one = source.advance(state, tick, ())
        whole.append(one)
    fresh = drive(tmp_path, scenario, BEND)
    state = pickle.loads(saved)
    for tick in ticks[60:]:
        state, one = fresh.advance(state, tick, ())
        assert one.ego.position_world_m.tobytes() == whole[tick.index].ego.position_world_m.tobytes()
        assert one.ego.yaw_rate_radps == whole[tick.index].ego.yaw_rate_radps
        boxes, others = one.scene.obstacles, whole[tick.index].scene.obstacles
        assert [box.centre_world_m.tobytes() for box in boxes] == [b.centre_world_m.tobytes() for b in others]


def test_what_happens_does_not_depend_on_the_cycle_of_the_sensor(tmp_path):
    source = drive(tmp_path, manoeuvring((1, lane_change(-2)), (1.5, speed(25, "linear", "rate", 2))), BEND)
    coarse = {one.t_ns: one.ego for one in snapshots(source, 5.0, period_ns=100 * MS)}
    fine = {one.t_ns: one.ego for one in snapshots(source, 5.0, period_ns=20 * MS)}
    for t_ns, ego in coarse.items():
        assert (ego.position_world_m == fine[t_ns].position_world_m).all()


def test_the_others_are_boxes_about_their_own_middles(tmp_path):
    source = drive(tmp_path)
    (box,) = snapshots(source, 0.0)[0].scene.obstacles
    assert box.centre_world_m == pytest.approx((100.0 + 1.5, -1.75, 0.75), abs=1e-9)
    assert box.size_m == (5.0, 2.0, 1.5)


def test_a_thing_that_stands_is_the_same_box_from_tick_to_tick(tmp_path):
    box = CAR.replace('<Vehicle name="car" vehicleCategory="car">', '<MiscObject name="b">')
    box = box[: box.index("<Performance")] + "</MiscObject>"
    init = private("Ego", teleport(lane_position(50)), speed(20)) + private(
        "Box", teleport(lane_position(120, inner='<Orientation type="relative" h="0.1"/>'))
    )
    source = drive(tmp_path, text(init=init, entities=("Ego", "Box"), bodies={"Box": box}))
    first, *_, last = snapshots(source, 1.0)
    assert first.scene.obstacles[0] is last.scene.obstacles[0]
    assert first.scene.obstacles[0].yaw_rad == pytest.approx(0.1, abs=1e-12)
    assert not first.scene.obstacles[0].is_moving


def test_a_line_keeps_its_id_when_the_carrier_changes_lanes(tmp_path):
    source = drive(tmp_path, manoeuvring((1, lane_change(-2, "cubic", "time", 2))))
    runs = snapshots(source, 4.0)

    def ids_at(snapshot):
        """The border's group by its y on the straight road."""
        return {
            round(float(marking.points_world_m[0, 1]), 2): marking.group
            for marking in snapshot.scene.markings
        }

    assert ids_at(runs[0]) == ids_at(runs[-1])
    assert len(ids_at(runs[0])) == 5


def test_the_carrier_follows_the_bend_at_the_radius_of_its_lane(tmp_path):
    ego = snapshots(drive(tmp_path, road_text=BEND), 1.0)[-1].ego
    assert ego.yaw_rate_radps == pytest.approx(20.0 / (BEND_M + 1.75), rel=1e-9)


def test_a_scenario_file_and_the_command_line_name_the_carrier_and_the_parameters(tmp_path):
    declared = '<ParameterDeclaration name="V" parameterType="double" value="20"/>'
    init = private("Ego", teleport(lane_position(50)), speed(20)) + private(
        "Other", teleport(lane_position(100)), speed('<AbsoluteTargetSpeed value="$V"/>')
    )
    written(tmp_path, text(init=init, parameters=declared))
    toml = tmp_path / "s.toml"
    toml.write_text(
        'schema = "vsensor.scenario/1"\nsource = "story.xosc"\n[storyboard.parameters]\nV = 12.5\n'
    )
    scenario = load_scenario(str(toml), {"storyboard": {"ego": "Other"}})
    _, one = (source := build_source(scenario)).advance(
        source.initial_state(), Tick(index=0, t_ns=0, period_ns=40 * MS), ()
    )
    assert one.ego.speed_mps == 12.5
    assert one.ego.position_world_m[0] == pytest.approx(100.0)


@pytest.mark.parametrize("section", ["[ego]\nspeed_kmh = 80", "[[traffic]]", "[[obstacle]]\ns_m = 5.0"])
def test_sections_of_other_sources_are_refused_beside_a_storyboard(tmp_path, section):
    written(tmp_path, text())
    toml = tmp_path / "s.toml"
    toml.write_text(f'schema = "vsensor.scenario/1"\nsource = "story.xosc"\n{section}\n')
    with pytest.raises(ConfigError, match="the storyboard says who drives where"):
        build_source(load_scenario(str(toml)))


def test_a_map_that_is_elsewhere_is_found_by_its_name_with_a_note(tmp_path):
    path = written(tmp_path, text(road_file="../somewhere/map.xodr"))
    (tmp_path / "map.xodr").rename((folder := tmp_path / "xodr").mkdir() or folder / "map.xodr")
    source = StoryDrive.load(path, StoryboardConfig(), Environment())
    assert any("map ../somewhere/map.xodr is not there" in note for note in source.notes)


def test_the_drive_ends_with_the_stop_trigger_and_with_the_road(tmp_path):
    source = drive(tmp_path, manoeuvring(stop=3))
    assert source.duration_s == pytest.approx(3.01)
    assert len(snapshots(source, 10.0)) == 76  # 0 to 3.00 s
    alone = private("Ego", teleport(lane_position(50)), speed(65))
    rolling = drive(tmp_path, text(init=alone, entities=("Ego",)), rehearsal_s=40.0)
    assert rolling.duration_s == pytest.approx(1950 / 65, abs=0.011)


def test_a_scenario_is_played_through_beforehand_no_longer_than_it_runs(tmp_path):
    late = event("late", trigger(after(9)), speed(10))
    path = written(tmp_path, text(stories=story(group(late))))
    for seconds, is_told in ((5, False), (12, True)):
        source = build_source(load_scenario(str(path), {"duration_s": seconds}))
        assert any("event late starts" in note for note in source.notes) is is_told


def test_a_scenario_that_stops_at_its_start_is_refused(tmp_path):
    stop = trigger(after(-1, "none"), tag="StopTrigger")
    with pytest.raises(StoryError, match="stops at its start"):
        drive(tmp_path, text(stop=stop))


def test_a_carrier_who_stands_has_no_yaw_rate(tmp_path):
    still = text(init=private("Ego", teleport(lane_position(50))), entities=("Ego",))
    ego = snapshots(drive(tmp_path, still, BEND), 0.2)[-1].ego
    assert (ego.speed_mps, ego.yaw_rate_radps) == (0.0, 0.0)


@needs_shared
@pytest.mark.parametrize("path", sorted((SHARED_DATA / "xosc").glob("*.xosc")), ids=lambda path: path.stem)
def test_each_shared_scenario_gives_the_truth_to_its_end(path):
    source = StoryDrive.load(path, StoryboardConfig(), Environment())
    assert 10.0 <= source.duration_s < 30.0
    state, count, period_ns = source.initial_state(), 0, 200 * MS
    while True:
        tick = Tick(index=count, t_ns=count * period_ns, period_ns=period_ns)
        state, one = source.advance(state, tick, ())
        if one is None:
            break
        assert np.isfinite(one.ego.position_world_m).all()
        assert len(one.scene.markings) >= 2
        count += 1
    assert count == -(-round(source.duration_s * 1e9) // period_ns)


def test_a_collision_course_is_seen_by_its_trigger(tmp_path):
    hit = by_entity('<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>', edge="none")
    init = private("Ego", teleport(lane_position(50)), speed(20)) + private(
        "Other", teleport(lane_position(100))
    )
    source = drive(tmp_path, text(init=init, stop=trigger(hit, tag="StopTrigger")))
    assert source.duration_s == pytest.approx(
        (50.0 - 5.0) / 20.0, abs=0.011
    )  # from front to rear of 5 m boxes


def test_a_storyboard_is_not_laid_over_a_log(tmp_path):
    path = written(tmp_path, text())
    with pytest.raises(ConfigError, match="a storyboard has a time of its own"):
        synth_of(load_scenario(str(path)))


def test_a_truck_ahead_hides_the_lines_behind_it(tmp_path):
    tall = (
        CAR.replace('height="1.5"', 'height="4"')
        .replace('z="0.75"', 'z="2"')
        .replace('width="2"', 'width="3"')
    )
    near = private("Ego", teleport(lane_position(50)), speed(20)) + private(
        "Other", teleport(lane_position(62)), speed(20)
    )
    seen = {}
    for name, entities, bodies in (("free", ("Ego",), {}), ("hidden", ("Ego", "Other"), {"Other": tall})):
        init = near if name == "hidden" else private("Ego", teleport(lane_position(50)), speed(20))
        (folder := tmp_path / name).mkdir()
        path = written(folder, text(init=init, entities=entities, bodies=bodies))
        scenario = load_scenario(str(path))
        line = build_line(scenario)
        computed = line.compute(line.initial_state(), Tick(index=0, t_ns=0, period_ns=40 * MS))
        reasons = computed.output.observation.reason
        seen[name] = int((reasons == Unseen.OCCLUDED).sum())
    assert seen["free"] == 0
    assert seen["hidden"] > 100
