"""What `vsensor check` says of settings that load, but do nothing or what nobody wants."""

import shutil
from math import atan, degrees, pi, radians, sqrt, tan

import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.config import SHIPPED, load_scenario
from vsensor.line import build_line
from vsensor.pitfalls import pitfalls

RAV4_DBC = SHARED_DATA / "dbc" / "toyota_rav4_2017_pt_generated.dbc"


def found(folder, text):
    shutil.copy(SHIPPED / "highway.xodr", folder / "highway.xodr")
    path = folder / "scenario.toml"
    path.write_text(f'schema = "vsensor.scenario/1"\nsource = "highway.xodr"\n{text}', encoding="utf-8")
    scenario = load_scenario(str(path))
    return pitfalls(scenario, build_line(scenario))


def test_the_shipped_scenario_has_none():
    scenario = load_scenario()
    assert pitfalls(scenario, build_line(scenario)) == []


def test_a_lens_that_folds_inside_the_image_is_said_with_the_part_that_is_lost(tmp_path):
    (text,) = found(tmp_path, "[camera]\nhfov_deg = 100.0\ndistortion.k1 = -0.3\n")
    fold = 1 / sqrt(3 * 0.3)
    radius_px = 640 / tan(radians(50)) * fold * (1 - 0.3 * fold**2)
    lost = 1 - pi * radius_px**2 / (1280 * 800)
    assert f"at {degrees(atan(fold)):.0f} deg off axis, inside the image: " in text
    assert int(text.partition("image: ")[2].partition(" %")[0]) == pytest.approx(100 * lost, abs=1.0)


@pytest.mark.parametrize("more", ["hfov_deg = 40.0", 'hfov_deg = 100.0\nmodel = "none"'])
def test_a_lens_that_folds_outside_the_image_or_is_bypassed_is_no_finding(tmp_path, more):
    assert found(tmp_path, f"[camera]\n{more}\ndistortion.k1 = -0.3\n") == []


@pytest.mark.parametrize("key", ["assumed_height_m", "assumed_pitch_deg", "assumed_roll_deg"])
def test_what_the_inverse_may_assume_is_said_to_be_without_effect_where_it_knows_the_depth(tmp_path, key):
    assert found(tmp_path, f"[camera]\n{key} = 1.0\n") == [
        f'camera.{key}: without effect, as camera.inverse is "true_depth"'
    ]
    assert found(tmp_path, f'[camera]\n{key} = 1.0\ninverse = "ground_plane"\n') == []


@pytest.mark.parametrize("control", ["", '[ego]\ncontrol = "lane"\n[listen]\nprofile = "vehicle"\n'])
def test_a_vehicle_on_a_lane_that_is_not_there_is_named(tmp_path, control):
    text = (
        control + "[[traffic]]\nlanes_left = 1\n[[traffic]]\nlanes_left = 7\nahead_m = [[0, 30], [5, 90]]\n"
    )
    assert found(tmp_path, text) == [
        "traffic[1].lanes_left = 7: no such lane where it starts, so it drives beside the road's lanes"
    ]


@needs_shared
def test_traffic_and_obstacles_of_a_recorded_drive_are_said_to_be_without_effect(tmp_path):
    log = SHARED_DATA / "can" / "rav4_drive.log"
    drive = f'[drive]\nprofile = ["toyota_rav4"]\ndbc = "{RAV4_DBC}"\n'
    path = tmp_path / "scenario.toml"
    others = "[[traffic]]\nahead_m = 30.0\n[[obstacle]]\ns_m = 20.0\nsize_m = [1, 1, 1]\n"
    path.write_text(f'schema = "vsensor.scenario/1"\nsource = "{log}"\n{drive}{others}', encoding="utf-8")
    scenario = load_scenario(str(path))
    assert pitfalls(scenario, build_line(scenario)) == [
        "[[traffic]]: without effect, as source is a log and not a map",
        "[[obstacle]]: without effect, as source is a log and not a map",
    ]
