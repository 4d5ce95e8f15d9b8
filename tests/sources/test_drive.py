"""The recorded drive as a source: poses at exact tick times, errors that name time and signal."""

from pathlib import Path

import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import ConfigError, LogError
from vsensor.logs import LogWriter, open_log_writer
from vsensor.profile import load_profile
from vsensor.schema import convert
from vsensor.sources.drive import DriveConfig, RecordedDrive, load_drive
from vsensor.types import Environment, Frame, Light, Tick
from vsensor.world.laid_road import LaidRoadConfig

T0 = 1_700_000_000_000_000_000
RAV4_LOG = SHARED_DATA / "can/rav4_drive.log"
DBC_FILE = SHARED_DATA / "dbc/toyota_rav4_2017_pt_generated.dbc"

# A small bus of floats, so that NaN and infinity can be on it.
DBC = """VERSION ""
NS_ :
BS_:
BU_: CAR
BO_ 256 Motion: 8 CAR
 SG_ Speed : 0|32@1- (1,0) [0|0] "m/s" CAR
 SG_ YawRate : 32|32@1- (1,0) [0|0] "rad/s" CAR
SIG_VALTYPE_ 256 Speed : 1;
SIG_VALTYPE_ 256 YawRate : 1;
"""
PROFILE = """schema = "vsensor.profile/1"
role = "vehicle"
database = "floats.dbc"
[messages.Motion]
cycle_ms = 20
[messages.Motion.signals]
Speed = "ego.speed_mps"
YawRate = "ego.yaw_rate_radps"
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "floats.dbc").write_text(DBC)
    (tmp_path / "floats.toml").write_text(PROFILE)
    return tmp_path


def write_motion(writer: LogWriter, t_ns: int, speed: float, rate: float) -> None:
    data = np.array([speed, rate], dtype="<f4").tobytes()
    writer.write(Frame(due_ns=t_ns, arbitration_id=0x100, data=data))


def made_log(folder: Path, speeds, rates, step_ns: int = 20_000_000) -> Path:
    path = folder / "made.log"
    with open_log_writer(path) as writer:
        for k, (speed, rate) in enumerate(zip(speeds, rates, strict=True)):
            write_motion(writer, T0 + k * step_ns, speed, rate)
    return path


def config(**changes) -> DriveConfig:
    return DriveConfig(**({"profile": ("floats.toml",), "yaw_rate_offset_degps": 0.0} | changes))


def source(folder: Path, speeds, rates, **changes) -> RecordedDrive:
    log = made_log(folder, speeds, rates)
    return RecordedDrive.load(log, config(**changes), LaidRoadConfig(), folder)


def tick(index: int, period_ns: int = 40_000_000) -> Tick:
    return Tick(index=index, t_ns=index * period_ns, period_ns=period_ns)


def test_the_ego_is_where_constant_speed_and_turn_rate_bring_it_at_the_exact_tick(folder):
    drive = source(folder, [16.0] * 500, [0.125] * 500)
    for index in (0, 1, 7, 100):
        _, snapshot = drive.advance(None, tick(index, 33_333_333), ())
        turn = 0.125 * index * 33_333_333 / 1e9
        expected = (128.0 * np.sin(turn), 128.0 * (1.0 - np.cos(turn)), 0.0)
        np.testing.assert_allclose(snapshot.ego.position_world_m, expected, atol=1e-9)
        assert snapshot.ego.yaw_rad == pytest.approx(turn, abs=1e-12)
        assert (snapshot.ego.speed_mps, snapshot.ego.yaw_rate_radps) == (16.0, 0.125)
        assert snapshot.ego.lateral_acceleration_mps2 == pytest.approx(2.0)
        assert snapshot.t_ns == snapshot.ego.t_ns == index * 33_333_333


def test_the_drive_ends_with_the_log_and_not_before(folder):
    drive = source(folder, [10.0] * 101, [0.0] * 101)  # 2 s
    assert drive.duration_s == 2.0
    assert drive.advance(None, tick(50), ())[1] is not None
    assert drive.advance(None, tick(51), ())[1] is None


def test_any_tick_gives_the_same_snapshot_whatever_came_before(folder):
    drive = source(folder, np.linspace(5, 15, 200), np.linspace(0, 0.1, 200))
    first = drive.advance(None, tick(30), ())[1]
    drive.advance(None, tick(90), ())
    again = drive.advance(None, tick(30), ())[1]
    assert first.ego.yaw_rad == again.ego.yaw_rad
    np.testing.assert_array_equal(first.ego.position_world_m, again.ego.position_world_m)


def test_markings_are_those_around_the_ego(folder):
    drive = source(folder, [20.0] * 1500, [0.0] * 1500)  # 30 s
    _, snapshot = drive.advance(None, tick(500), ())  # at 400 m
    for marking in snapshot.scene.markings:
        assert marking.points_world_m[0, 0] == pytest.approx(380.0, abs=0.2)
        assert marking.points_world_m[-1, 0] == pytest.approx(400.0 + 1.3 * 100.0 + 20.0, abs=0.2)


def test_the_vehicle_runs_beside_its_lanes_centre_as_configured(folder):
    drive = source(folder, [20.0] * 300, [0.0] * 300, offset_m=0.4)
    left, right, *_ = drive.advance(None, tick(0), ())[1].scene.markings
    assert left.points_world_m[0, 1] == pytest.approx(1.75 - 0.4)
    assert right.points_world_m[0, 1] == pytest.approx(-1.75 - 0.4)


def test_light_and_rain_come_from_the_scenario(folder):
    log = made_log(folder, [20.0] * 10, [0.0] * 10)
    night = Environment(light=Light.NIGHT, rain=0.5)
    drive = RecordedDrive.load(log, config(), LaidRoadConfig(), folder, night)
    assert drive.advance(None, tick(0), ())[1].scene.environment == night


def test_a_given_offset_and_speed_factor_are_applied(folder):
    drive = source(folder, [20.0] * 300, [0.1] * 300, yaw_rate_offset_degps=np.degrees(0.1), speed_factor=0.5)
    pose = drive.drive.path.at(T0 + 2_000_000_000)
    assert (pose.x_m, pose.speed_mps) == pytest.approx((20.0, 10.0))
    assert pose.y_m == pytest.approx(0.0, abs=1e-6)  # the signal is a float32


def test_start_and_stop_cut_a_part_out(folder):
    drive = source(folder, [20.0] * 500, [0.0] * 500, start_s=2.0, stop_s=5.0)
    assert drive.drive.path.t_ns[0] == T0 + 2_000_000_000
    assert drive.duration_s == 3.0


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 1e6])
@pytest.mark.parametrize("signal", ["speed", "rate"])
def test_an_ego_that_is_no_number_is_refused_with_time_and_signal(folder, signal, value):
    speeds, rates = [20.0] * 100, [0.0] * 100
    (speeds if signal == "speed" else rates)[37] = value
    name = "ego.speed_mps" if signal == "speed" else "ego.yaw_rate_radps"
    with pytest.raises(LogError, match=rf"made\.log: {name} = \S+ at 0\.740000 s"):
        source(folder, speeds, rates)


def test_a_silent_signal_is_refused_with_its_time(folder):
    path = folder / "gap.log"
    with open_log_writer(path) as writer:
        for k in (*range(50), *range(150, 200)):
            write_motion(writer, T0 + k * 20_000_000, 20.0, 0.0)
    with pytest.raises(LogError, match=r"ego\.speed_mps is silent for 2\.0 s from 0\.980000 s"):
        load_drive(path, config(), folder)


def test_driving_backwards_is_refused_with_its_time(folder):
    with pytest.raises(LogError, match=r"the vehicle runs backwards at 1\.000000 s"):
        source(folder, [5.0] * 50 + [-2.0] * 50, [0.0] * 100)


def test_a_log_without_the_signals_says_what_was_looked_for_and_what_is_there(folder):
    path = folder / "other.log"
    path.write_text("(1.0) can0 123#00\n(2.0) can0 456#00\n")
    looked_for = r"ego\.speed_mps was looked for in Motion 0x100 \(profile \S+\)"
    with pytest.raises(LogError, match=looked_for + r", but the log holds 0x123, 0x456$"):
        load_drive(path, config(), folder)


def test_a_profile_without_the_signals_is_named(folder):
    text = PROFILE.replace('YawRate = "ego.yaw_rate_radps"\n', "")
    (folder / "half.toml").write_text(text)
    log = made_log(folder, [20.0] * 10, [0.0] * 10)
    with pytest.raises(LogError, match=r"no signal carries ego\.yaw_rate_radps in the profile half"):
        load_drive(log, config(profile=("half.toml",)), folder)


def test_an_unknown_channel_is_named_with_those_there_are(folder):
    log = made_log(folder, [20.0] * 10, [0.0] * 10)
    with pytest.raises(LogError, match="no channel 'can7'; it has can0"):
        load_drive(log, config(channel="can7"), folder)


def test_one_channel_of_several_can_be_chosen(folder):
    path = folder / "two.log"
    lines = []
    for k in range(100):
        for channel, speed in (("can0", 10.0), ("can1", 30.0)):
            data = np.array([speed, 0.0], dtype="<f4").tobytes().hex()
            lines.append(f"({k * 0.02:.6f}) {channel} 100#{data}\n")
    path.write_text("".join(lines))
    drive = load_drive(path, config(channel="can1"), folder)
    assert set(drive.path.speed_mps) == {30.0}


def test_timestamps_that_run_backwards_are_put_in_order_and_reported(folder):
    path = folder / "back.log"
    with open_log_writer(path) as writer:
        for k in (0, 1, 3, 2, 4, 5):
            write_motion(writer, T0 + k * 20_000_000, 20.0, 0.0)
    drive = load_drive(path, config(), folder)
    assert (np.diff(drive.path.t_ns) > 0).all()
    assert any("1 timestamps run backwards" in finding for finding in drive.findings)


def test_garbage_lines_of_the_log_are_among_the_findings(folder):
    log = made_log(folder, [20.0] * 10, [0.0] * 10)
    log.write_text("garbage\n" + log.read_text())
    assert any(
        "1 lines are no CAN frames" in finding for finding in load_drive(log, config(), folder).findings
    )


def test_a_clean_log_has_notes_but_no_findings(folder):
    drive = source(folder, [20.0] * 2000, [0.01] * 2000, yaw_rate_offset_degps="auto")
    assert drive.findings == ()
    assert drive.notes[0].endswith("made.log: 2000 frames, 1 ids, 39.980 s, channels can0")
    assert drive.notes[-1].startswith("yaw-rate offset +0.5730 deg/s removed (median of 2 s means")


def test_a_yaw_rate_offset_of_another_unit_is_refused_by_its_key():
    with pytest.raises(ConfigError, match="yaw_rate_offset_degps"):
        convert({"yaw_rate_offset_degps": 400.0}, DriveConfig, "x.toml")


def test_the_profiles_decode_as_named():
    vehicle = load_profile("vehicle")
    assert {"ego.speed_mps", "ego.yaw_rate_radps"} <= vehicle.quantities()
    assert DriveConfig().profile == ("vehicle",)


@needs_shared
def test_the_rav4_drive_runs_for_its_minute_with_its_offset_found():
    rav4 = DriveConfig(profile=("toyota_rav4",), dbc=str(DBC_FILE))
    drive = RecordedDrive.load(RAV4_LOG, rav4, LaidRoadConfig())
    assert drive.duration_s == pytest.approx(59.98, abs=0.01)
    assert np.degrees(drive.drive.offset.offset_radps) == pytest.approx(-0.41, abs=0.015)
    last = round(drive.duration_s / 0.04) - 1
    speeds = [drive.advance(None, tick(k), ())[1].ego.speed_mps * 3.6 for k in range(0, last, 25)]
    assert min(speeds) == pytest.approx(29.4, abs=0.1)
    assert max(speeds) < 73.1
    assert drive.advance(None, tick(last + 2), ())[1] is None
