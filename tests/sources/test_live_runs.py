"""Live scenarios in a run: what the bus brings reaches the source, and what cannot be is refused."""

from dataclasses import replace

import pytest

from tests.vehicle_frames import CYCLE_NS, Gateway
from vsensor.clock import SimulatedClock
from vsensor.config import load_scenario
from vsensor.errors import ConfigError
from vsensor.line import build_line, tick_count
from vsensor.run import RunOptions, run_scenario
from vsensor.runner import run_loop
from vsensor.study.sweep import simulated_trace
from vsensor.types import Frame, SensorMode

PERIOD_NS = 40_000_000
START_NS = 7_000_000_000_000


class Recorder:
    """A sink that keeps everything."""

    def __init__(self):
        self.outputs = []

    def write(self, output):
        self.outputs.append(output)

    def close(self):
        pass


class ScriptedBus:
    """A bus on which motion comes every 20 ms from slot 0 on, for some seconds, beside what is foreign."""

    def __init__(self, clock, seconds):
        gateway = Gateway()
        self.clock = clock
        self.waiting = [
            gateway.motion(START_NS + k * CYCLE_NS, 25.0, 0.0) for k in range(round(seconds * 50))
        ]
        self.waiting += [
            Frame(due_ns=START_NS + k * CYCLE_NS, arbitration_id=0x7DF, data=bytes(8)) for k in range(10)
        ]

    def send(self, frame):
        return True

    def drain(self):
        now_ns = self.clock.now_ns()
        come = [frame for frame in self.waiting if frame.due_ns <= now_ns]
        self.waiting = [frame for frame in self.waiting if frame.due_ns > now_ns]
        return come

    def confirmed(self):
        return ()


def run_of(seconds, motion_s):
    """Run live_bench on a scripted bus; returns the summary and the outputs."""
    line = build_line(load_scenario("live_bench", {"error_model": {"mode": "none"}}))
    clock, sink = SimulatedClock(), Recorder()
    clock.sleep_until_ns(START_NS - PERIOD_NS)
    summary = run_loop(
        line,
        clock,
        period_ns=PERIOD_NS,
        ticks=round(seconds * 25),
        start_ns=START_NS,
        bus=ScriptedBus(clock, motion_s),
        sinks=[sink],
    )
    return summary, sink.outputs


@pytest.fixture(scope="module")
def two_seconds():
    return run_of(2.0, motion_s=1.0)


def test_receive_times_count_from_slot_0(two_seconds):
    """The vehicle is where the frames bring it by the tick, though they came a tick before."""
    _, outputs = two_seconds
    x_m = [output.snapshot.ego.position_world_m[0] for output in outputs]
    assert x_m[20] == pytest.approx(25.0 * 0.8, abs=1e-3)
    assert x_m[49] == pytest.approx(25.0 * 1.96, abs=1e-3)  # held after 1 s


def test_the_state_of_the_sensor_follows_what_is_heard(two_seconds):
    _, outputs = two_seconds
    modes = [SensorMode(int(output.values["sensor.state"])) for output in outputs]
    assert modes == [SensorMode.INIT] * 5 + [SensorMode.AVAILABLE] * 23 + [SensorMode.DEGRADED] * 22


def test_the_summary_counts_what_is_listened_to_and_says_what_was_missing(two_seconds):
    summary, _ = two_seconds
    assert (summary.frames_heard, summary.frames_decoded) == (60, 50)
    assert "ego.speed_mps was missing once, at 1.12 s" in summary.text()


def test_without_a_duration_a_live_drive_goes_on_for_ever():
    scenario = load_scenario("live_bench")
    assert tick_count(scenario, build_line(scenario).source) is None


def test_in_simulated_time_without_a_bus_nothing_can_arrive():
    scenario = load_scenario("live_bench", {"duration_s": 1.0})
    with pytest.raises(ConfigError, match=r'live_bench: ego\.control = "motion": with --fast and no --bus'):
        run_scenario(scenario, RunOptions(fast=True), say=lambda text: None)


def test_a_sweep_has_no_bus_to_listen_to():
    with pytest.raises(ConfigError, match="a sweep has no bus"):
        simulated_trace(load_scenario("live_bench", {"duration_s": 1.0}))


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ('[ego]\ncontrol = "motion"', r'ego\.control = "motion": a map as source was expected'),
        ('[listen]\nprofile = "vehicle"', r"listen\.profile: a recorded drive listens to nothing"),
    ],
)
def test_a_recorded_drive_does_not_listen(tmp_path, section, said):
    (tmp_path / "drive.log").write_text("")
    (tmp_path / "drive.toml").write_text(f'schema = "vsensor.scenario/1"\nsource = "drive.log"\n{section}\n')
    with pytest.raises(ConfigError, match=said) as refused:
        build_line(load_scenario(str(tmp_path / "drive.toml")))
    assert str(refused.value).startswith(str(tmp_path / "drive.toml"))


def test_a_scenario_that_listens_to_nothing_is_driven_as_before():
    plain = build_line(load_scenario("highway"))
    assert not plain.needs_bus
    assert not plain.is_fd
    assert plain.remarks(plain.initial_state()) == ()
    assert type(plain.source).__name__ == "MapDrive"


def test_a_profile_with_can_fd_opens_the_bus_so(tmp_path):
    database = (build_line(load_scenario("live_bench")).source.listener.profiles[0].database).read_text()
    text = database.replace(
        'BA_DEF_ "DBName"',
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","StandardCAN_FD";\nBA_DEF_ "DBName"',
    )
    (tmp_path / "fd.dbc").write_text(text + 'BA_ "VFrameFormat" BO_ 256 1;\n')
    line = build_line(load_scenario("live_bench"))
    assert not line.is_fd
    scenario = load_scenario(
        "live_bench", {"listen": {"profile": "vehicle", "dbc": str(tmp_path / "fd.dbc")}}
    )
    assert build_line(scenario).is_fd
    assert replace(line, source=build_line(scenario).source).is_fd
