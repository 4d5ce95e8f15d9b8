"""The shipped lane tests: the reference ECU keeps their limits, a late one and none do not."""

import math

import numpy as np
import pytest
from msgspec import structs

from vsensor.experiment.ecu import ECUS
from vsensor.experiment.matrix import load_matrix, points_of, shipped_matrices
from vsensor.experiment.runs import run
from vsensor.experiment.tables import keeps

TESTS = [name for name in shipped_matrices() if load_matrix(name).config.loop is not None]


def point(name, entry, **told):
    """Return the one scenario of a matrix with these settings; the drift begins after 1 s, not 3."""
    told = {key.replace("__", "."): value for key, value in told.items()}
    (found,) = (
        one.scenario
        for one in points_of(load_matrix(name))
        if one.entry == entry and all(one.told[key] == value for key, value in told.items())
    )
    departure = structs.replace(found.config.departure, start_s=1.0)
    return structs.replace(found, config=structs.replace(found.config, departure=departure))


def broken(name, entry, ecu, folder, **told):
    """Return the columns whose limits a run is beyond."""
    figures = run(point(name, entry, **told), folder, ecu=ecu)["loop"]
    limits = load_matrix(name).config.limit
    return {
        limit.column
        for limit in limits
        if (not limit.scenarios or entry in limit.scenarios) and not keeps(limit, figures[limit.column])
    }


def test_there_are_the_tests_that_readme_lists():
    assert TESTS == ["euro_ncap_2026", "euro_ncap_lss", "iso_11270", "un_r130"]


@pytest.mark.parametrize("name", TESTS)
def test_every_limit_names_its_source(name):
    assert all(limit.source for limit in load_matrix(name).config.limit)


CASES = [
    ("un_r130", "lanes/bend_250.toml", {"rate": "0.8 m/s", "departure__side": "right"}),
    ("iso_11270", "lanes/bend_800.toml", {"departure__side": "left"}),
    ("euro_ncap_lss", "lanes/dashed.toml", {"drift": "0.6 m/s"}),
    ("euro_ncap_2026", "lanes/road_edge.toml", {"speed": "100 km/h", "drift": "0.7 m/s"}),
]
BROKEN = {
    ("un_r130", "late"): {"beyond_marking_at_warning_m"},
    ("euro_ncap_lss", "late"): {"dtle_min_m"},
    ("euro_ncap_lss", "none"): {"dtle_min_m"},
}


@pytest.mark.parametrize(("name", "entry", "told"), CASES)
def test_the_reference_ecu_keeps_the_limits(name, entry, told, tmp_path):
    assert broken(name, entry, "reference", tmp_path, **told) == set()


@pytest.mark.parametrize(("name", "ecu"), BROKEN)
def test_an_ecu_that_does_it_too_late_or_not_at_all_is_beyond_them(name, ecu, tmp_path):
    entry, told = next((entry, told) for one, entry, told in CASES if one == name)
    assert broken(name, entry, ecu, tmp_path, **told) == BROKEN[name, ecu]


def test_the_same_run_gives_the_same_course(tmp_path):
    scenario = point("euro_ncap_lss", "lanes/solid.toml", drift="0.4 m/s")
    scenario = structs.replace(scenario, config=structs.replace(scenario.config, duration_s=3.5))
    one, other = (run(scenario, tmp_path, ecu="reference") for _ in range(2))
    np.testing.assert_array_equal(one["course"], other["course"])


def test_the_reference_ecu_is_quiet_in_the_middle_of_the_lane():
    ecu = ECUS["reference"](1.85)
    lane = {
        "left.available": 1.0,
        "left.quality": 4.0,
        "left.lane_offset_m": 1.8,
        "right.available": 1.0,
        "right.quality": 4.0,
        "right.lane_offset_m": -1.8,
        "lane.lateral_speed_mps": 0.1,
    }
    answer = ecu.answer(lane, 0)
    assert math.isnan(answer["ego.steering_request_rad"])
    assert answer["ego.lane_warning"] == 0.0


def test_the_reference_ecu_asks_away_from_the_line_and_mirrors():
    near = {"available": 1.0, "quality": 4.0, "lane_offset_m": 1.0}
    away = {**near, "lane_offset_m": -1.0}
    near = {f"left.{name}": value for name, value in near.items()} | {"lane.lateral_speed_mps": 0.3}
    away = {f"right.{name}": value for name, value in away.items()} | {"lane.lateral_speed_mps": -0.3}
    left, right = ECUS["reference"](1.85), ECUS["reference"](1.85)
    one, other = left.answer(near, 0), right.answer(away, 0)
    assert one["ego.steering_request_rad"] < 0.0
    assert one["ego.steering_request_rad"] == pytest.approx(-other["ego.steering_request_rad"])
