"""A sensor in the hands of a test: the frames of `vsensor run`, broken and mended by calls."""

import math
import subprocess
import sys
from pathlib import Path

import can
import pytest

import vsensor
from tests.faults.runs import PERIOD_NS, tick
from vsensor.clock import SimulatedClock
from vsensor.config import load_scenario
from vsensor.errors import BusError, ConfigError, SessionError
from vsensor.line import build_line
from vsensor.runner import run_loop
from vsensor.session import Session

QUICK = {"state": {"init_s": 0.0}, "camera": {"occlusion": "none"}}


@pytest.fixture
def sensor():
    with Session("highway", overrides=QUICK) as session:
        yield session


def test_the_package_offers_a_session_and_loads_nothing_before():
    code = "import sys, vsensor; print('numpy' in sys.modules, vsensor.Session.__name__)"
    root = Path(__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root)
    assert done.stdout == "False Session\n"


def test_the_package_says_what_it_does_not_offer():
    with pytest.raises(AttributeError, match="'vsensor' has no attribute 'Sesion'"):
        _ = vsensor.Sesion


def test_a_session_sends_the_frames_of_a_run():
    class Frames:
        def __init__(self):
            self.frames = []

        def write(self, output):
            self.frames += output.frames

        def close(self):
            pass

    sink = Frames()
    line = build_line(load_scenario("highway", {**QUICK, "seed": 3}))
    run_loop(line, SimulatedClock(), period_ns=PERIOD_NS, ticks=30, sinks=[sink], real_time=False)
    with Session("highway", seed=3, overrides=QUICK) as session:
        session.step(10)
        session.run_for(0.4)
        session.step(10)
        assert list(session.take_frames()) == sink.frames
        assert session.take_frames() == ()
        assert session.time_s == pytest.approx(1.2)


def test_a_time_is_run_in_whole_ticks_and_never_less(sensor):
    assert sensor.run_for(0.01).tick == tick(0)
    assert sensor.run_for(0.12).tick == tick(3)
    assert sensor.run_for(0.13).tick == tick(7)


def test_an_override_is_sent_until_it_is_cleared(sensor):
    before = sensor.step(10).values["left.offset_m"]
    sensor.override("left.offset_m", 1.2)
    assert sensor.step().values["left.offset_m"] == 1.2
    assert sensor.step(5).values["left.offset_m"] == 1.2
    assert sensor.faults == ("override left.offset_m value 1.2 until it is cleared",)
    sensor.clear()
    assert sensor.step().values["left.offset_m"] == pytest.approx(before, abs=0.3) != 1.2
    assert sensor.faults == ()


def test_a_signal_is_overridden_by_its_name_on_the_bus(sensor):
    sensor.step(10)
    sensor.take_frames()
    sensor.override("LDS_Lane.LaneWidth", 3.2)
    sensor.override("SensorState", raw=7)
    sensor.step()
    decoded = {}
    for frame in sensor.take_frames():
        decoded |= sensor.loop.line.profile.decode(frame)
    assert decoded["lane.width_m"] == pytest.approx(3.2, abs=0.01)
    assert decoded["sensor.state"] == 7.0
    assert sensor.value("lane.width_m") != pytest.approx(3.2, abs=0.01)


def test_faults_are_numbered_as_they_come_and_cleared_one_by_one(sensor):
    numbers = [
        sensor.inject("frame_lost", message="LDS_Lane"),
        sensor.inject("crc_wrong"),
        sensor.inject("reset"),
    ]
    assert numbers == [0, 1, 2]
    sensor.step()
    assert sensor.inject("bus_off", at_s=100) == 3
    sensor.clear(0)
    sensor.step()
    assert sensor.faults == ("crc_wrong until it is cleared",)


def test_a_session_waits_for_what_is_to_happen(sensor):
    sensor.inject("sensor_blocked", at_s=0.4, for_s=0.2)
    assert sensor.run_until(lambda output: output.values["sensor.state"] == 4.0).tick == tick(10)
    assert sensor.run_until(lambda output: output.values["sensor.state"] == 2.0).tick == tick(15)


def test_a_wait_ends_in_the_time_of_the_run(sensor):
    with pytest.raises(TimeoutError, match=r"not within 0.2 s, at 0.2 s of the run"):
        sensor.run_until(lambda output: False, timeout_s=0.2)


def test_what_is_read_is_what_was_sent_last(sensor):
    with pytest.raises(SessionError, match="nothing was sent yet"):
        sensor.read()
    output = sensor.step(12)
    assert sensor.read() is output
    assert len(output.frames) == 13
    assert sensor.value("left.offset_m") == output.values["left.offset_m"]
    assert sensor.summary().frames_sent == 12 * 13


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda s: s.inject("frame_lst"), "inject: kind = 'frame_lst': not known; did you mean frame_lost?"),
        (lambda s: s.inject("frame_lost", tims=1), "inject: tims: unknown key; did you mean times?"),
        (lambda s: s.override("left.ofset_m", 1.0), "did you mean left.offset_m?"),
        (lambda s: s.override("LaneWith", 1.0), "did you mean LaneWidth?"),
        (lambda s: s.override("left.offset_m", math.nan), "override: value = nan: a finite number"),
        (lambda s: s.override("left.offset_m"), "override: value: override needs it"),
        (lambda s: s.step(0), "at least 1"),
        (lambda s: s.run_for(-1.0), "above 0"),
        (lambda s: (s.step(), s.value("left.ofset_m")), "left.ofset_m: no quantity that is sent"),
    ],
)
def test_a_wrong_call_is_one_line(sensor, call, said):
    with pytest.raises((ConfigError, SessionError)) as caught:
        call(sensor)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_call_that_was_wrong_changes_nothing(sensor):
    with pytest.raises(ConfigError):
        sensor.inject("frame_lst")
    assert sensor.inject("frame_lost") == 0


def test_the_end_of_the_road_is_told(tmp_path):
    from tests.test_readme import write_drive

    write_drive(tmp_path / "drive.log")
    with (
        Session(tmp_path / "drive.log") as session,
        pytest.raises(SessionError, match=r"has ended after 8 s"),
    ):
        session.step(1000)


def test_a_bus_that_is_not_there_is_told():
    with pytest.raises(BusError, match="socketcan:can9"):
        Session("highway", bus="socketcan:can9")


def test_a_drive_that_listens_needs_a_bus():
    with pytest.raises(ConfigError, match="nothing can arrive"):
        Session("live_bench")


def test_in_real_time_others_on_the_bus_hear_it_and_a_pause_drops_no_slot():
    with (
        can.Bus("session", interface="virtual") as ear,
        Session("highway", bus="virtual:session", real_time=True, overrides=QUICK) as session,
    ):
        session.run_for(0.2)
        session.loop.clock.sleep_until_ns(session.loop.clock.now_ns() + 150_000_000)  # the test thinks
        session.inject("frame_lost", message="LDS_Lane", times=1)
        session.run_for(0.2)
        heard = []
        while (message := ear.recv(0)) is not None:
            heard.append(message.arbitration_id)
        sent = [frame.arbitration_id for frame in session.take_frames()]
        assert heard == sent
        assert sent.count(0x320) - sent.count(0x322) == 1
        assert session.summary().dropped_slots + len(set(sent)) >= 13


def test_a_fault_that_never_was_cannot_be_cleared(sensor):
    with pytest.raises(ConfigError, match="clear: number = 0: no fault has it; none was given yet"):
        sensor.clear(0)
    sensor.inject("crc_wrong", times=1)
    sensor.step(2)
    sensor.clear(0)  # has ended
    with pytest.raises(ConfigError, match="clear: number = 1: no fault has it; 0 to 0 were given"):
        sensor.clear(1)


def test_a_closed_session_sends_nothing_more_but_can_still_be_read():
    with Session("highway", overrides=QUICK) as session:
        last = session.step()
    for more in (session.step, lambda: session.run_for(1.0), lambda: session.run_until(lambda _: True)):
        with pytest.raises(SessionError, match="the session is closed"):
            more()
    assert session.read() is last
