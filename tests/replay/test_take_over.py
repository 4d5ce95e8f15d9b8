"""`vsensor replay --take-over`: from a time on an ECU steers, and what the car says of its motion follows."""

import json
import subprocess
from math import sin

import numpy as np
import pytest

from tests.ecu.building import built_ecu
from tests.replay.laying import write_drive
from tests.vehicle_frames import PLANS, Gateway
from vsensor.bus import open_bus
from vsensor.cli import main
from vsensor.logs import read_log
from vsensor.overlay import LATERAL, MovedFrames
from vsensor.profile import load_profile
from vsensor.replay import ReplayOptions, replay_log
from vsensor.signals import VehicleConfig
from vsensor.sources.control import WHEEL, YAW_RATE
from vsensor.types import Frame
from vsensor.world.vehicle import DynamicsConfig, SingleTrack

VEHICLE, NATIVE = load_profile("vehicle"), load_profile("native")
SCENARIO = 'schema = "vsensor.scenario/1"\nsource = "drive.log"\n'
SPEED_MPS, OVER_S = 20.0, 2.0
STEP_RADPS = 0.0002
"""Of the yaw rate on the bus, twice its resolution."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("over")
    write_drive(path / "drive.log", 6.0, SPEED_MPS, lambda t: 0.02 + 0.01 * sin(2 * t), others=(0x555,))
    (path / "lanes.toml").write_text(SCENARIO)
    return path


def replayed(folder, name, *, request_rad=None, **wishes):
    """Replay without waiting, with an ECU that asks for one angle all the time; returns the table."""
    gateway = Gateway()
    with open_bus("virtual:over", echo=False) as ecu:

        def steer():
            if request_rad is not None:
                ecu.send(gateway.frame("ECU_Steering", steering_request_rad=request_rad))
            ecu.drain()
            return False

        options = ReplayOptions(
            path=folder / "drive.log",
            overlay=str(folder / "lanes.toml"),
            bus="virtual:over",
            fast=True,
            log=folder / name,
            **{"take_over": str(OVER_S), **wishes},
        )
        replay_log(options, lambda text: None, steer)
    return read_log(folder / name)


@pytest.fixture(scope="module")
def steered(folder):
    return replayed(folder, "steered.log", request_rad=0.01)


def motion(table):
    """Return times (s from the first frame), speed and yaw rate of VEH_Motion, its CRCs checked."""
    columns = VEHICLE.decode_arrays(table.arbitration_id, table.data, table.length, check=True)
    rows = columns["ego.speed_mps"].rows
    assert len(rows) == np.count_nonzero(table.arbitration_id == 0x100)
    since = (table.t_ns[rows] - table.t_ns[0]) / 1e9
    return since, columns["ego.speed_mps"].values, columns["ego.yaw_rate_radps"].values


def test_up_to_the_take_over_the_cars_frames_are_those_of_the_log(folder, steered):
    log, out = read_log(folder / "drive.log"), steered
    for table in (log, out):
        table.t_ns.flags.writeable = True
        table.t_ns[:] -= table.t_ns[0]
    for number in (0x100, 0x555):
        recorded, sent = ((t.arbitration_id == number) & (t.t_ns < OVER_S * 1e9) for t in (log, out))
        np.testing.assert_array_equal(out.data[sent], log.data[recorded])
    everywhere = [table.data[table.arbitration_id == 0x555] for table in (log, out)]
    np.testing.assert_array_equal(*everywhere)


def test_a_constant_request_ends_in_the_steady_bend_of_the_vehicle(steered):
    vehicle = SingleTrack.of(DynamicsConfig(), VehicleConfig().wheelbase_m)
    since, _, rate = motion(steered)
    expected = vehicle.steady_yaw_rate(SPEED_MPS, 0.01)
    np.testing.assert_allclose(rate[since > OVER_S + 2.0], expected, atol=STEP_RADPS)


def test_the_yaw_rate_has_no_step_at_the_take_over(folder):
    since, _, rate = motion(replayed(folder, "silent.log"))
    at = np.searchsorted(since, OVER_S)
    before, after = np.diff(rate[:at]), np.diff(rate[at - 1 :])
    assert abs(after[0]) <= np.abs(before).max() + STEP_RADPS
    assert np.abs(after).max() < 0.1 * 0.02  # the tyres take up their slip: below 0.1 rad/s^2


def test_the_speed_stays_the_recorded_one_and_counters_run_on(steered):
    _, speed, _ = motion(steered)
    np.testing.assert_allclose(speed, SPEED_MPS, atol=0.01)
    data = steered.data[steered.arbitration_id == 0x100]
    counters = PLANS["VEH_Motion"].guard.counters_bulk(data)
    states = PLANS["VEH_Motion"].guard.counter_states
    np.testing.assert_array_equal(np.diff(counters) % states, 1)


def test_the_lanes_move_as_the_vehicle_leaves_the_recorded_path(folder, steered):
    lanes = NATIVE.decode_arrays(steered.arbitration_id, steered.data, steered.length)["left.lane_offset_m"]
    recorded = replayed(folder, "recorded.log", take_over=None)
    others = NATIVE.decode_arrays(recorded.arbitration_id, recorded.data, recorded.length)
    change = lanes.values - others["left.lane_offset_m"].values
    at = round(OVER_S / 0.04)
    assert np.nanmax(np.abs(change[: at + 1])) == 0.0
    assert change[at + 25] < -0.3  # more to the left than recorded: the line comes nearer


def test_an_ecu_accepts_the_stream_across_the_take_over(folder, steered):
    command = [built_ecu() / "ecu", "--log", folder / "steered.log"]
    report = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    said = {"sensor_not_ready", "left_not_available", "right_not_available"}
    assert {name for name, count in report["errors"].items() if count} <= said


def test_in_the_next_pass_the_log_moves_the_vehicle_again(folder):
    _, _, rate = motion(replayed(folder, "twice.log", request_rad=0.01, loops=2))
    _, _, recorded = motion(read_log(folder / "drive.log"))
    count = round((OVER_S - 0.1) / 0.02)
    np.testing.assert_array_equal(rate[len(recorded) :][:count], recorded[:count])
    assert abs(rate[-1] - recorded[-1]) > 0.01


def test_a_frame_is_changed_in_the_bits_of_its_quantity_alone_and_protected_anew():
    plan = PLANS["VEH_Motion"]
    frame = Gateway().motion(0, 10.0, 0.1)
    moved = MovedFrames([VEHICLE]).moved(frame, {YAW_RATE: 0.05, LATERAL: 0.0, WHEEL: 0.0})
    before, after = VEHICLE.decode(frame, check=True), VEHICLE.decode(moved, check=True)
    assert after["ego.speed_mps"] == before["ego.speed_mps"]
    assert after["ego.yaw_rate_radps"] == pytest.approx(before["ego.yaw_rate_radps"] + 0.05, abs=STEP_RADPS)
    assert plan.guard.counter(moved.data) == plan.guard.counter(frame.data)


def test_frames_of_the_pose_are_left_out_and_others_left_alone():
    frames = MovedFrames([VEHICLE])
    changes = {YAW_RATE: 0.05, LATERAL: 1.0, WHEEL: 0.0}
    assert [frames.moved(one, changes) for one in Gateway().pose(0, 1.0, 2.0, 0.1)] == [None] * 3
    other = Frame(due_ns=0, arbitration_id=0x555, data=b"\x01")
    assert frames.moved(other, changes) is other


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--take-over", "1"), "--take-over: needs --overlay"),
        (("--take-over", "1", "--overlay", "lanes.toml", "--speed", "2"), "--take-over and --speed exclude"),
        (("--take-over", "1", "--overlay", "live_bench"), "a log as source was expected, not a map"),
        (("--take-over", "noon", "--overlay", "lanes.toml"), "--take-over noon: s, or a time such as"),
        (
            ("--take-over", "60", "--overlay", "lanes.toml"),
            "--take-over 60: what is played ends before, at 5.98",
        ),
        (
            ("--take-over", "3", "--stop", "2", "--overlay", "lanes.toml"),
            "--take-over 3: what is played ends before, at 2.0",
        ),
    ],
)
def test_a_take_over_that_cannot_be_is_refused_in_one_line(folder, words, said, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    assert main(["replay", "drive.log", "--log", "never.log", "--bus", "virtual:no", *words]) == 2
    assert said in capsys.readouterr().err.strip().splitlines()[-1]
