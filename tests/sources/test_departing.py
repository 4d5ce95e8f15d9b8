"""The drift out of the lane: what the robot drives, and who steers when."""

import math

import numpy as np
import pytest

from vsensor.config import load_scenario
from vsensor.errors import ConfigError
from vsensor.experiment import ecu as ecus
from vsensor.experiment.matrix import SHIPPED
from vsensor.experiment.runs import run
from vsensor.line import build_source
from vsensor.sources.departing import Drift
from vsensor.study.vary import scenario_with
from vsensor.types import Tick

SOLID = SHIPPED / "lanes" / "solid.toml"


class Asks:
    """An ECU that asks for one angle all the time."""

    def __init__(self, angle_rad):
        self.angle_rad = angle_rad

    def answer(self, heard, t_ns):
        return {ecus.REQUEST: self.angle_rad}


def drive(tmp_path, name="solid", ecu="none", seconds=6.0, **departure):
    """Return the course (ticks, 5) of a departure and the time at which the robot lets go."""
    told = {f"departure.{key}": value for key, value in departure.items()}
    told["departure.start_s"] = 1.0
    scenario = scenario_with(str(SHIPPED / "lanes" / f"{name}.toml"), {"duration_s": seconds, **told})
    course = np.array(run(scenario, tmp_path, ecu=ecu)["course"])
    return course, scenario.config.departure.release_s(20.0)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("name", ["solid", "bend_800", "road_edge"])
def test_where_the_robot_lets_go_the_tyre_is_as_far_from_the_edge_as_was_told(tmp_path, side, name):
    if (name, side) == ("road_edge", "left"):
        name = "dashed"
    course, release_s = drive(tmp_path, name, side=side, lateral_mps=0.4, distance_m=0.6, seconds=3.0)
    t, dtle, *_ = course.T
    assert release_s == pytest.approx(1.0 + 0.4 * 1200 / 400)
    # 2 mm: the vehicle's heading foreshortens its width by 0.2 mm, the bend curves away over the wheelbase
    assert np.interp(release_s, t, dtle) == pytest.approx(0.6, abs=0.005)
    assert course[np.argmax(t >= release_s - 1e-9), 4] == pytest.approx(0.4, abs=0.002)


def test_the_curve_into_the_drift_has_the_standards_length():
    # Euro NCAP, appendix A: d1 = 0.375 m at 72 km/h and 0.5 m/s, 0.054 m less at 0.2 m/s
    for rate, expected in ((0.2, 0.060), (0.5, 0.375), (0.7, 0.735)):
        drift = Drift(from_m=0.1, rate_mps=rate, start_s=2.0, release_s=2.0 + rate * 1200 / 20**2)
        assert drift.derivatives(drift.release_s)[0] - 0.1 == pytest.approx(expected, abs=5e-4)
        assert drift.derivatives(drift.release_s)[1] == rate
        assert drift.derivatives(1.9) == (0.1, 0.0, 0.0)
        assert drift.derivatives(drift.release_s - 0.1)[2] == pytest.approx(20**2 / 1200)


def test_hands_off_the_vehicle_goes_on_at_the_speed_of_the_drift(tmp_path):
    course, release_s = drive(tmp_path, lateral_mps=0.5, seconds=4.0)
    t, dtle, *_ = course[course[:, 0] > release_s + 0.05].T
    np.testing.assert_allclose(np.diff(dtle) / np.diff(t), -0.5, atol=0.002)


def test_left_and_right_mirror_each_other(tmp_path):
    left, _ = drive(tmp_path, side="left", seconds=3.0)
    right, _ = drive(tmp_path, side="right", seconds=3.0)
    np.testing.assert_allclose(left[:, [1, 2, 4]], right[:, [1, 2, 4]], atol=1e-6)
    np.testing.assert_allclose(left[:, 3], -right[:, 3], atol=1e-6)


def test_what_the_ecu_asks_for_moves_the_wheels_from_the_release_on_and_not_before(tmp_path, monkeypatch):
    alone, release_s = drive(tmp_path, seconds=4.0)
    monkeypatch.setattr(ecus, "ECUS", {**ecus.ECUS, "right": lambda width_m: Asks(-0.01)})
    steered, _ = drive(tmp_path, ecu="right", seconds=4.0)
    count = min(len(alone), len(steered))
    before = alone[:count, 0] <= release_s + 0.001
    np.testing.assert_array_equal(alone[:count][before], steered[:count][before])
    assert steered[-1, 1] > alone[count - 1, 1] + 0.3


def test_a_robot_that_keeps_steering_is_not_moved_by_the_ecu(tmp_path, monkeypatch):
    monkeypatch.setattr(ecus, "ECUS", {**ecus.ECUS, "right": lambda width_m: Asks(-0.01)})
    alone, _ = drive(tmp_path, keeps_steering=True, seconds=3.0)
    steered, _ = drive(tmp_path, ecu="right", keeps_steering=True, seconds=3.0)
    np.testing.assert_array_equal(alone, steered)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"ego.offset_m": 0.3}, ["ego.offset_m", "[departure]"]),
        ({"ego.speed_kmh": [[0, 70], [9, 80]]}, ["ego.speed_kmh", "constant"]),
        ({"ego.speed_kmh": 5}, ["ego.speed_kmh", "18 km/h"]),
        ({"departure.distance_m": 3}, ["departure.distance_m = 3", "lane's middle"]),
        ({"departure.side": "up"}, ["departure.side", "up"]),
        ({"departure.lateral_mps": 0}, ["departure.lateral_mps"]),
    ],
)
def test_a_drift_that_cannot_be_is_refused_by_its_key(settings, words):
    with pytest.raises(ConfigError) as error:
        build_source(scenario_with(str(SOLID), settings))
    assert all(word in str(error.value) for word in words), str(error.value)


def test_the_shipped_lanes_are_as_wide_as_the_standards_want():
    # 3.5 to 3.7 m between the inner borders, Euro NCAP Lane Departure Collisions v1.1, 2.1.1
    source = build_source(load_scenario(str(SOLID)))
    snapshot = source.advance(source.initial_state(), _tick(), ())[1]
    inner = [
        marking.points_world_m[200, 1] - math.copysign(marking.width_m[200] / 2, _from_lane(marking))
        for marking in snapshot.scene.markings
        if abs(_from_lane(marking)) < 2.0
    ]
    assert len(inner) == 2
    assert 3.5 <= max(inner) - min(inner) <= 3.7


def _from_lane(marking):
    return marking.points_world_m[200, 1] + 3.75 / 2


def _tick():
    return Tick(index=0, t_ns=0, period_ns=40_000_000)
