"""Motion in the sensor: the camera alone sees it, any tick restarts, and off is off."""

import math
import pickle
import re

import msgspec
import numpy as np
import pytest

from tests.lines import tick
from tests.roads import ego, snapshot, straight
from vsensor.check import check_file
from vsensor.config import SHIPPED, load_scenario
from vsensor.draws import Draws
from vsensor.errors import ConfigError
from vsensor.line import build_line
from vsensor.motion import BumpConfig, MotionConfig, advance, initial_state, load_motion
from vsensor.schema import convert
from vsensor.sensor import Sensor, SensorConfig, sense
from vsensor.sensor import initial_state as sensor_start

ALL = {
    "body": True,
    "vibration": "rough",
    "bumps": [{"at_m": 5.0}, {"at_m": 20.0, "height_m": -0.05, "length_m": 2.0}],
}
AT_ONCE = {"tracker": {"confirm_images": 1}}  # a line is reported from its first image on
EXACT = {
    "camera": {"pixel_grid": False},
    "error_model": {"mode": "none"},
    "region": {"enabled": False},
    **AT_ONCE,
}


def sensor(seed=1, **sections):
    return Sensor.of(convert(sections, SensorConfig, "test"), seed)


def images(seen_by, count, vehicle=None, state=None, first=0):
    """Yield (state, Sensed) of images of a straight road."""
    state = state or sensor_start()
    vehicle = vehicle or ego(acceleration_mps2=-4.0, lateral_acceleration_mps2=2.0)
    road = snapshot([straight(1.8, 0), straight(-1.7, 1)], vehicle=vehicle)
    for index in range(first, first + count):
        state, sensed = sense(seen_by, state, road, tick(index))
        yield state, sensed


def coefficients(sensed):
    return np.array([line.coefficients for line in sensed.estimate.boundaries])


def run(overrides, ticks=60, state=None, first=0):
    """Return (line, outputs, states) of the shipped drive."""
    line = build_line(load_scenario("highway", overrides))
    state = state or line.initial_state()
    outputs, states = [], []
    for index in range(first, first + ticks):
        computed = line.compute(state, tick(index))
        state = computed.state_if_sent
        outputs.append(computed.output)
        states.append(computed)
    return outputs, states


def frames(outputs):
    return [output.frames for output in outputs]


def test_motion_is_off_unless_a_scenario_says_so():
    assert load_motion(MotionConfig()) is None
    assert Sensor.of(SensorConfig()).motion is None


def test_a_body_that_stands_still_gives_the_same_frames_as_none():
    still = {"body": True, "pitch_deg_per_mps2": 0.0, "roll_deg_per_mps2": 0.0}
    assert frames(run({"motion": still})[0]) == frames(run({})[0])


def test_motion_changes_what_a_camera_with_pixels_reports():
    assert frames(run({"motion": {"vibration": "smooth"}})[0]) != frames(run({})[0])


def test_with_true_depth_and_no_pixels_what_is_reported_stays_road_level():
    still = [coefficients(sensed) for _, sensed in images(sensor(**EXACT), 30)]
    moving = sensor(motion=ALL, **EXACT)
    for (_, sensed), expected in zip(images(moving, 30), still, strict=True):
        # the body's lean moves the nearest visible point, so other points are fitted: 1e-9 m at 100 m
        shift = (coefficients(sensed) - expected) * [1.0, 1e2, 1e4, 1e6]
        np.testing.assert_allclose(shift, 0.0, atol=1e-9)


def test_with_a_ground_plane_braking_becomes_an_error_of_known_size():
    """Seen from the camera: forward (cos, 0, -sin), down (-sin, 0, -cos) of the lean."""
    ground = {"pixel_grid": False, "inverse": "ground_plane"}
    seen_by = sensor(**EXACT | {"camera": ground}, motion={"body": True})
    ((_, sensed),) = images(seen_by, 1, ego(acceleration_mps2=-2.0))
    lean = math.radians(0.3)
    camera_x = 1.9 * math.cos(lean) + 1.35 * math.sin(lean)
    camera_z = -1.9 * math.sin(lean) + 1.35 * math.cos(lean) + 1.4 * math.sin(lean)
    lines = sensed.observation.lines
    for k, y in ((0, 1.8), (1, -1.7)):
        part = slice(lines.starts[k], lines.starts[k + 1])
        ahead = -20.0 + 0.1 * lines.index[part] - camera_x
        forward = ahead * math.cos(lean) + camera_z * math.sin(lean)
        below = camera_z * math.cos(lean) - ahead * math.sin(lean)
        found = lines.points_ego_m[part]
        np.testing.assert_allclose(found[:, 0], 1.9 + forward * 1.35 / below, rtol=1e-9)
        np.testing.assert_allclose(found[:, 1], y * 1.35 / below, rtol=1e-9)
        assert abs(found[-1, 1] - y) > 0.5  # m, where the road seems to end


def test_braking_lets_the_camera_see_the_road_from_nearer():
    def nearest(sections, acceleration):
        vehicle = ego(acceleration_mps2=acceleration)
        ((_, sensed),) = images(sensor(**EXACT, **sections), 1, vehicle)
        return sensed.observation.lines.points_ego_m[:, 0].min()

    assert nearest({"motion": {"body": True}}, -8.0) < nearest({}, -8.0)
    assert nearest({"motion": {"body": True}}, 4.0) > nearest({}, 4.0)


def test_the_truth_keeps_its_ego():
    outputs, _ = run({"motion": ALL}, 20)
    plain, _ = run({}, 20)
    for output, other in zip(outputs, plain, strict=True):
        assert output.snapshot.ego.body_pitch_rad == output.snapshot.ego.body_heave_m == 0.0
        np.testing.assert_array_equal(
            output.snapshot.ego.position_world_m, other.snapshot.ego.position_world_m
        )


def test_an_image_is_taken_from_where_the_body_stood():
    (output, *_), (computed, *_) = run({"motion": {"vibration": "rough"}}, 1)
    pitch, roll, heave = load_motion(MotionConfig(vibration="rough")).noise.motion(
        computed.state_if_sent.sensor.motion.noise
    )
    seen = output.seen.ego
    assert (seen.body_pitch_rad, seen.body_roll_rad) == (pitch, roll)
    assert seen.body_heave_m == pytest.approx(heave + 1.4 * math.sin(pitch))
    assert output.seen.scene is output.snapshot.scene
    (output, *_), _ = run({}, 1)
    assert output.seen is output.snapshot


def test_check_lists_what_moves_the_camera_and_its_cost(tmp_path):
    path = tmp_path / "shaken.toml"
    text = f'schema = "vsensor.scenario/1"\nsource = "{SHIPPED / "highway.xodr"}"\n'
    path.write_text(text)
    assert not any("motion" in line for line in check_file(str(path)).lines)
    path.write_text(f'{text}[motion]\nbody = true\nvibration = "smooth"\n[[motion.bumps]]\nat_m = 50\n')
    (line,) = (line for line in check_file(str(path)).lines if "motion" in line)
    assert re.fullmatch(r" +of it motion +\d\.\d{3} ms  springs on, 1 bumps, vibration smooth", line)


def test_a_run_restarts_from_a_saved_state_with_the_same_frames():
    overrides = {"motion": ALL, "seed": 3}
    outputs, computed = run(overrides, 40)
    saved = pickle.loads(pickle.dumps(computed[14].state_if_sent.sensor))
    assert saved.motion == computed[14].state_if_sent.sensor.motion
    again, _ = run(overrides, 25, state=computed[14].state_if_sent, first=15)
    assert frames(again) == frames(outputs[15:])


def test_a_dropped_slot_moves_the_body_all_the_same():
    _, computed = run({"motion": ALL}, 10)
    for one in computed:
        assert one.state_if_dropped.sensor.motion == one.state_if_sent.sensor.motion
    assert computed[9].state_if_sent.sensor.motion.driven_m > 10.0


def test_the_noise_is_drawn_from_seed_and_tick_alone():
    motion = load_motion(MotionConfig(vibration="normal"))

    def first(seed, index, before=0):
        draws = Draws(seed)
        for other in range(before):
            draws.at(2, other).random(7)
        return advance(motion, initial_state(), ego(), draws, tick(index))[1].body_pitch_rad

    assert first(1, 5) == first(1, 5, before=3)
    assert len({first(1, 5), first(2, 5), first(1, 6)}) == 3


def test_the_noise_is_stationary_from_the_first_tick():
    motion = load_motion(MotionConfig(vibration="normal", vibration_spread=0.0))
    drives = 2000
    found = np.zeros((drives, 4))
    for seed in range(drives):
        draws, state = Draws(seed), initial_state()
        for index in range(4):
            state, moved = advance(motion, state, ego(), draws, tick(index))
            found[seed, index] = moved.body_pitch_rad
    # 2000 drives tell a standard deviation to 1.6 %; four of these
    np.testing.assert_allclose(found.std(axis=0), motion.noise.std[0], rtol=0.064)


def test_a_tick_that_is_not_later_begins_a_new_drive():
    motion, draws = load_motion(convert(ALL, MotionConfig, "test")), Draws(1)
    begun, first = advance(motion, initial_state(), ego(), draws, tick(0))
    state, _ = advance(motion, begun, ego(), draws, tick(9))
    again, moved = advance(motion, state, ego(), draws, tick(0))
    assert again == begun
    assert moved.body_pitch_rad == first.body_pitch_rad


def test_an_ego_that_is_not_known_reports_nothing_and_moves_on():
    lost = ego((np.nan, 0.0, 0.0), acceleration_mps2=np.nan, speed_mps=np.nan)
    ((state, _),) = images(sensor(motion=ALL, **AT_ONCE), 1)
    for after, sensed in images(sensor(motion=ALL, **AT_ONCE), 5, lost, state, 1):
        assert sensed.estimate.degraded
        assert not sensed.estimate.boundaries
        assert after.motion.driven_m > state.motion.driven_m
        state = after
    ((_, sensed),) = images(sensor(motion=ALL, **AT_ONCE), 1, None, state, 6)
    assert len(sensed.estimate.boundaries) == 2


def test_the_wheelbase_is_that_of_the_vehicle():
    scenario = load_scenario("highway", {"motion": {"body": True}, "vehicle": {"wheelbase_m": 3.7}})
    assert build_line(scenario).sensor.motion.wheelbase_m == 3.7


def test_bumps_without_springs_are_refused():
    with pytest.raises(ConfigError, match="bumps: they need the body's springs"):
        load_motion(MotionConfig(bumps=(BumpConfig(at_m=1.0),)))


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ({"vibration": "wild"}, "motion.vibration = 'wild'"),
        ({"vibration": -1.0}, "motion.vibration = -1.0"),
        ({"bumps": [{"at_m": -5.0}]}, "motion.bumps[0].at_m = -5.0"),
        ({"bumps": [{"at": 5.0}]}, "motion.bumps[0].at: unknown key; did you mean at_m?"),
        ({"damping": 1.0}, "motion.damping = 1.0"),
    ],
)
def test_a_mistake_in_the_section_is_named(section, said):
    with pytest.raises(ConfigError) as refused:
        load_scenario("highway", {"motion": section})
    assert said in str(refused.value)


def test_a_whole_number_is_a_size_too():
    assert msgspec.convert({"vibration": 2}, MotionConfig).vibration == 2.0
