"""A clock that has run for a day and turn rates next to none, through the whole chain."""

import numpy as np
import pytest

from tests.hard_cases import chain
from tests.hard_cases.times import DAY_NS, PERIODS_NS, RATES, endless_drive
from tests.roads import ego, snapshot, straight
from vsensor.clock import SimulatedClock
from vsensor.draws import Draws, Stage
from vsensor.logs import open_log_writer, read_log
from vsensor.runner import run_loop
from vsensor.sources.drive import DriveConfig, load_drive
from vsensor.sources.map_drive import EgoConfig, MapDrive, TrafficConfig
from vsensor.types import Frame, Side
from vsensor.world.corridor import Corridor

EVERY_PERIOD = pytest.mark.parametrize("period_ns", PERIODS_NS)
STRAIGHT = [straight(y, number) for number, y in enumerate((1.8, -1.7, 5.4, -5.3))]


class Later(SimulatedClock):
    """A clock that notes the deadlines it was asked to wait for."""

    def __init__(self, start_ns):
        super().__init__(start_ns)
        self.deadlines = []

    def sleep_until_ns(self, deadline_ns):
        self.deadlines.append(deadline_ns)
        super().sleep_until_ns(deadline_ns)


@EVERY_PERIOD
def test_a_slots_time_is_a_whole_number_of_nanoseconds_for_a_day_and_a_year(period_ns):
    for days in (1, 365):
        index = days * DAY_NS // period_ns
        tick = chain.tick_at(index, period_ns)
        assert (type(tick.t_ns), tick.t_ns) == (int, days * DAY_NS)
        assert tick.t_ns // 1_000_000 * 1_000_000 == tick.t_ns  # milliseconds on the bus lose nothing


@EVERY_PERIOD
def test_the_loop_waits_for_exact_deadlines_on_a_machine_that_has_been_up_for_years(period_ns):
    start_ns = 20 * 365 * DAY_NS + 1
    clock = Later(start_ns)
    summary = run_loop(chain.line_of(lambda tick: snapshot(STRAIGHT)), clock, period_ns=period_ns, ticks=50)
    assert clock.deadlines == [start_ns + period_ns * (k + 1) for k in range(50)]
    assert summary.dropped_slots == 0


@EVERY_PERIOD
def test_after_a_day_everything_goes_on_as_in_the_first_minute(period_ns):
    config = EgoConfig(road="1", lane=-3, speed_kmh=31.4159)
    traffic = (TrafficConfig(kind="car", ahead_m=20.0, lanes_left=1, speed_kmh=60.0, recycle_m=120.0),)
    source = MapDrive(Corridor(endless_drive().corridor.road_map, config.corridor()), config, traffic)
    line = chain.line_of(lambda tick: source.advance(None, tick, ())[1], seed=3)
    first = DAY_NS // period_ns
    found = list(chain.drive(line, 40, first=first, period_ns=period_ns))
    assert len(found) == 40
    assert all({Side.LEFT, Side.RIGHT} <= chain.reported(output) for output, _ in found)
    assert any(output.snapshot.scene.obstacles for output, _ in found)
    # the error process moves on from image to image by as much as it does at the start
    offsets = [
        np.array([o.estimate.on(Side.LEFT).coefficients[0] for o, _ in part])
        for part in (found, list(chain.drive(line, 40, period_ns=period_ns)))
    ]
    late, early = (float(np.abs(np.diff(part)).mean()) for part in offsets)
    assert 0.2 < late / early < 5.0


@EVERY_PERIOD
def test_a_run_restarted_after_a_day_gives_the_same_frames(period_ns):
    line = chain.line_of(lambda tick: snapshot(STRAIGHT))
    first = DAY_NS // period_ns
    runs = [
        [chain.bits(output) for output, _ in chain.drive(line, 10, first=first, period_ns=period_ns)]
        for _ in range(2)
    ]
    assert runs[0] == runs[1]
    assert len({str(frames) for frames in runs[0] if frames}) > 1


def test_messages_keep_their_cycle_over_a_day_in_slots_that_are_no_divisor_of_it():
    from vsensor.transmit import is_due

    plan = chain.profile("native").messages[0]
    for period_ns in (10_000_000, 7_000_000, 30_000_000, 33_333_333):
        first = DAY_NS // period_ns
        due = [is_due(plan, chain.tick_at(first + k, period_ns)) for k in range(1000)]
        expected = min(1000, 1000 * period_ns / plan.cycle_ns)
        assert abs(sum(due) - expected) <= 1


@pytest.mark.parametrize("index", [DAY_NS // 40_000_000, DAY_NS // 10_000_000, 2**32, 2**53 + 1, 2**63])
def test_draws_of_a_late_tick_are_its_own_and_standard(index):
    draws = Draws(1)
    here, after, before = (
        draws.at(Stage.ERROR_MODEL, k).standard_normal(4000) for k in (index, index + 1, index - 1)
    )
    assert abs(here.mean()) < 4 / np.sqrt(4000)
    assert here.std() == pytest.approx(1.0, abs=4 / np.sqrt(8000))
    for other in (after, before):
        assert abs(np.corrcoef(here, other)[0, 1]) < 4 / np.sqrt(4000)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("speed_mps", [0.0, 1e-12, 1e-3, 40.0])
def test_any_small_turn_rate_and_speed_leave_the_chain_sound(rate, speed_mps):
    far = [straight(y, number, start=30.0) for number, y in enumerate((1.8, -1.7))]
    for lines in (STRAIGHT, far):
        vehicle = ego(yaw_rate_radps=rate, speed_mps=speed_mps)
        chain.shown(snapshot(lines, (), vehicle), 3)


@pytest.mark.parametrize("rate", [0.0, 1e-12, -1e-12])
def test_a_recorded_drive_that_turns_by_next_to_nothing_is_a_straight_one(tmp_path, rate):
    (tmp_path / "floats.dbc").write_text(FLOATS_DBC)
    (tmp_path / "floats.toml").write_text(FLOATS_PROFILE)
    path = tmp_path / "drive.log"
    with open_log_writer(path) as writer:
        for k in range(3000):
            data = np.array([30.0, rate], dtype="<f4").tobytes()
            writer.write(Frame(due_ns=DAY_NS + k * 20_000_000, arbitration_id=0x100, data=data))
    assert read_log(path).t_ns[0] == DAY_NS
    drive = load_drive(path, DriveConfig(profile=("floats.toml",), yaw_rate_offset_degps=0.0), tmp_path)
    seconds = float(drive.path.t_ns[-1] - drive.path.t_ns[0]) / 1e9
    assert drive.path.y_m[-1] == pytest.approx(15.0 * float(np.float32(rate)) * seconds**2, rel=1e-9, abs=0.0)
    assert drive.path.x_m[-1] == pytest.approx(30.0 * seconds, rel=1e-12)


FLOATS_DBC = """VERSION ""
NS_ :
BS_:
BU_: CAR
BO_ 256 Motion: 8 CAR
 SG_ Speed : 0|32@1- (1,0) [0|0] "m/s" CAR
 SG_ YawRate : 32|32@1- (1,0) [0|0] "rad/s" CAR
SIG_VALTYPE_ 256 Speed : 1;
SIG_VALTYPE_ 256 YawRate : 1;
"""
FLOATS_PROFILE = """schema = "vsensor.profile/1"
role = "vehicle"
database = "floats.dbc"
[messages.Motion]
cycle_ms = 20
[messages.Motion.signals]
Speed = "ego.speed_mps"
YawRate = "ego.yaw_rate_radps"
"""
