"""`vsensor replay --overlay`: a drive without a lane camera becomes one that an ECU steers by."""

import json
import multiprocessing
import os
import re
import subprocess
from math import sin

import numpy as np
import pytest

from tests.ecu.building import built_ecu
from tests.replay.laying import write_drive
from vsensor.cli import main
from vsensor.config import load_scenario
from vsensor.logs import read_log
from vsensor.overlay import Elsewhere, Here, Wish, synth_of
from vsensor.profile import load_profile
from vsensor.replay import ReplayOptions, replay_log
from vsensor.types import SensorMode

NATIVE = load_profile("native")
IDS = sorted(number for number, _ in NATIVE.by_id)
SCENARIO = 'schema = "vsensor.scenario/1"\nsource = "drive.log"\n'
FINE = {"sensor_not_ready", "left_not_available", "right_not_available"}
"""What a sensor says of itself as it starts, and where the scene is another one."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A drive of 4 s that sways, other frames beside it, some of them with ids of the lane sensor."""
    path = tmp_path_factory.mktemp("overlay")
    write_drive(path / "drive.log", yaw_rate=lambda t: 0.03 * sin(3 * t), others=(0x320, 0x111))
    (path / "lanes.toml").write_text(SCENARIO)
    return path


def replayed(folder, name, *words):
    """Replay the drive with the overlay and without waiting; returns the recording."""
    log, scenario = folder / "drive.log", folder / "lanes.toml"
    command = ["replay", log, "--overlay", scenario, "--as-fast-as-possible", "--log", folder / name, *words]
    assert main([*map(str, command)]) == 0
    return read_log(folder / name)


@pytest.fixture(scope="module")
def once(folder):
    return replayed(folder, "once.log")


def errors(path):
    """Return what the ECU finds wrong in a recording."""
    done = subprocess.run([built_ecu() / "ecu", "--log", path], capture_output=True, text=True, check=True)
    report = json.loads(done.stdout)
    assert report["bursts"] > 20
    return {name: count for name, count in report["errors"].items() if count and name not in FINE}


def of_sensor(table):
    return np.isin(table.arbitration_id, IDS)


def column(table, quantity):
    """Return the values of a quantity, one per frame that carries it."""
    columns = NATIVE.decode_arrays(table.arbitration_id, table.data, table.length, check=True)
    return columns[quantity].values


def test_an_ecu_accepts_what_comes_of_a_drive_without_a_camera(folder, once):
    assert errors(folder / "once.log") == {}
    assert of_sensor(once).sum() == 100 * len(IDS)


def test_the_cars_frames_are_those_of_the_log_and_the_sensors_ids_hold_the_new_ones_only(folder, once):
    log = read_log(folder / "drive.log")
    kept = ~of_sensor(log)
    np.testing.assert_array_equal(once.data[~of_sensor(once)], log.data[kept])
    since = once.t_ns - once.t_ns[0]
    np.testing.assert_array_equal(since[~of_sensor(once)], (log.t_ns - log.t_ns[0])[kept])


def test_the_ids_under_which_frames_leave_tell_what_the_sensor_replaces(folder, once):
    table = replayed(folder, "named.log", "--rename", "0x320=0x222,0x111=0x321")
    assert (table.arbitration_id == 0x222).sum() == (
        read_log(folder / "drive.log").arbitration_id == 0x320
    ).sum()
    assert of_sensor(table).sum() == of_sensor(once).sum()
    assert errors(folder / "named.log") == {}


def test_images_are_40_ms_apart(once):
    times = once.t_ns[once.arbitration_id == IDS[0]]
    assert set(np.diff(times).tolist()) == {40_000_000}


def test_over_a_seam_an_ecu_accepts_and_counters_run_on(folder):
    twice = replayed(folder, "twice.log", "--loop", "2", "--stop", "2")
    assert errors(folder / "twice.log") == {}
    np.testing.assert_array_equal(column(twice, "image.timestamp_ms"), 40.0 * np.arange(100))


def test_the_same_seed_gives_the_same_bytes(folder, once):
    again = replayed(folder, "again.log")
    np.testing.assert_array_equal(again.data, once.data)


def test_a_process_of_its_own_computes_the_same_frames_also_after_a_rewind(folder):
    synth = synth_of(load_scenario(str(folder / "lanes.toml")), lambda ids: read_log(folder / "drive.log"))
    wishes = [Wish(k, k * 40_000_000, is_cut=k == 3) for k in range(6)]
    here, elsewhere = Here(synth), Elsewhere(synth)
    made = []
    for desk in (here, elsewhere):
        for wish in wishes:
            desk.ask(wish)
        first = [desk.answer() for _ in range(2)]
        desk.rewind(1)
        for wish in wishes[1:]:
            desk.ask(wish)
        made.append([one.frames for one in (*first, *(desk.answer() for _ in wishes[1:]))])
        assert desk.remarks() == ()
        desk.close()
    assert made[0] == made[1]
    assert made[0][1] == made[0][2]


def test_a_process_that_computes_stands_back_when_told_to(folder):
    synth = synth_of(load_scenario(str(folder / "lanes.toml")), lambda ids: read_log(folder / "drive.log"))
    before = set(multiprocessing.active_children())
    desk = Elsewhere(synth, nice=5)
    (process,) = set(multiprocessing.active_children()) - before
    desk.ask(Wish(0))
    desk.answer()  # it has begun
    assert os.getpriority(os.PRIO_PROCESS, process.pid) == os.getpriority(os.PRIO_PROCESS, 0) + 5
    desk.close()


def test_in_real_time_the_same_is_sent_as_without_waiting(folder):
    sent = []
    for name, wishes in (("slow.log", {"speed": "10"}), ("fast.log", {"fast": True})):
        options = ReplayOptions(
            path=folder / "drive.log",
            overlay=str(folder / "lanes.toml"),
            bus="virtual:overlay",
            stop="1",
            log=folder / name,
            **wishes,
        )
        replay_log(options, lambda text: None)
        sent.append(read_log(folder / name))
    np.testing.assert_array_equal(sent[0].data, sent[1].data)
    np.testing.assert_array_equal(sent[0].arbitration_id, sent[1].arbitration_id)


@pytest.mark.parametrize(
    ("scenario", "said"),
    [
        ("nosuch.toml", "nosuch.toml: no such file"),
        ("nosuch", "neither a file nor a shipped scenario"),
        ("other.toml", r"ego.speed_mps was looked for in SPEED 0xB4"),
    ],
)
def test_an_overlay_that_cannot_be_is_refused_in_one_line(folder, scenario, said, capsys):
    dbc = 'VERSION ""\nBO_ 180 SPEED: 8 X\n SG_ V : 0|16@1+ (1,0) [0|0] "" X\n'
    (folder / "o.dbc").write_text(dbc)
    profile = 'schema = "vsensor.profile/1"\nrole = "vehicle"\ndatabase = "o.dbc"\n'
    (folder / "o.toml").write_text(profile + '[messages.SPEED.signals]\nV = "ego.speed_mps"\n')
    (folder / "other.toml").write_text(SCENARIO + '[drive]\nprofile = ["o.toml"]\n')
    name = str(folder / scenario) if scenario.endswith(".toml") else scenario
    assert main(["replay", str(folder / "drive.log"), "--overlay", name, "--as-fast-as-possible"]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1
    assert re.search(said, error[0])


@pytest.fixture(scope="module")
def on_map(folder):
    """The drive moves a vehicle on the map of the shipped bench, twice."""
    command = [
        "replay",
        folder / "drive.log",
        "--overlay",
        "live_bench",
        "--as-fast-as-possible",
        "--loop",
        "2",
    ]
    assert main([*map(str, command), "--log", str(folder / "map.log")]) == 0
    return read_log(folder / "map.log")


def test_on_a_map_the_frames_that_are_played_move_the_vehicle(folder, on_map):
    assert errors(folder / "map.log") == {}
    states = column(on_map, "sensor.state")
    assert states[10:].tolist() == [SensorMode.AVAILABLE] * (len(states) - 10)  # degraded where motion lacks


def test_on_a_map_the_vehicle_is_back_at_the_start_where_the_log_begins_again(on_map):
    width = column(on_map, "lane.width_m")
    offset = column(on_map, "left.offset_m")
    first, second = offset[10:95], offset[110:195]
    assert np.isfinite(width[20:95]).all()
    np.testing.assert_allclose(first, second, atol=0.1)  # the errors of the sensor are others
    assert np.ptp(first) > 0.3


def test_with_smoothed_times_the_scene_follows_what_is_played(folder):
    smooth = replayed(folder, "smooth.log", "--smooth")
    assert errors(folder / "smooth.log") == {}
    assert of_sensor(smooth).sum() == 100 * len(IDS)


def test_a_log_without_times_gets_them_from_its_rate(folder):
    lines = (folder / "drive.log").read_text().splitlines()
    (folder / "bare.log").write_text("".join(line.split()[2] + "\n" for line in lines))
    command = ["replay", folder / "bare.log", "--rate", "150", "--overlay", folder / "lanes.toml"]
    assert main([*map(str, command), "--as-fast-as-possible", "--log", str(folder / "rated.log")]) == 0
    assert errors(folder / "rated.log") == {}
