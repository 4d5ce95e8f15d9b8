"""The whole line: same in, same out; restarts; slots that are dropped."""

from dataclasses import replace

import numpy as np
import pytest

from vsensor.clock import SimulatedClock
from vsensor.config import load_scenario
from vsensor.line import build_line, tick_count
from vsensor.runner import run_loop
from vsensor.types import SensorMode, Side, Tick

PERIOD_NS = 40_000_000


AT_ONCE = {"state": {"init_s": 0.0}, "tracker": {"confirm_images": 1}}
"""Lines are sent from the first image on."""


class Recorder:
    """A sink that keeps everything."""

    def __init__(self):
        self.outputs = []

    def write(self, output):
        self.outputs.append(output)

    def close(self):
        pass


class SlowClock(SimulatedClock):
    """A clock on which computing takes no time, but for one stall after a number of slots was waited for."""

    def __init__(self, stall_after, stall_ns):
        super().__init__()
        self.slots, self.stall_after, self.stall_ns = 0, stall_after, stall_ns

    def sleep_until_ns(self, deadline_ns):
        super().sleep_until_ns(deadline_ns)
        self.slots += 1
        if self.slots == self.stall_after:
            self._now_ns += self.stall_ns


def record(line, ticks, clock=None):
    recorder = Recorder()
    summary = run_loop(line, clock or SimulatedClock(), period_ns=PERIOD_NS, ticks=ticks, sinks=[recorder])
    return summary, recorder.outputs


def frames(outputs):
    return [(output.tick.index, frame) for output in outputs for frame in output.frames]


def tick(index):
    return Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)


def test_the_same_seed_gives_the_same_frames_and_another_seed_others():
    runs = [frames(record(build_line(load_scenario("highway", {"seed": s})), 50)[1]) for s in (3, 3, 4)]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_a_run_restarted_from_its_state_goes_on_bit_for_bit():
    line = build_line(load_scenario("highway"))
    state = line.initial_state()
    whole, saved = [], None
    for index in range(60):
        if index == 37:
            saved = state
        computed = line.compute(state, tick(index))
        state = computed.state_if_sent
        whole.append(computed.output.frames)
    fresh, rest = build_line(load_scenario("highway")), []
    for index in range(37, 60):
        computed = fresh.compute(saved, tick(index))
        saved = computed.state_if_sent
        rest.append(computed.output.frames)
    assert rest == whole[37:]


def test_every_message_is_sent_from_the_first_slot_on_in_state_init_too():
    line = build_line(load_scenario("highway"))
    _, outputs = record(line, 2)
    known = {plan.layout.arbitration_id for plan in line.profile.messages}
    assert {frame.arbitration_id for frame in outputs[0].frames} == known
    assert outputs[0].values["sensor.state"] == 0.0
    assert outputs[0].values["left.available"] == 0.0


def test_a_stall_drops_slots_says_so_and_never_bursts():
    line = build_line(load_scenario("highway"))
    clock = SlowClock(stall_after=10, stall_ns=150_000_000)  # more than three and a half slots
    summary, outputs = record(line, 20, clock)
    sent = [output.tick.index for output in outputs]
    assert sent == [*range(9), *range(13, 20)]
    assert summary.dropped_slots == 4
    assert summary.frames_sent == sum(len(output.frames) for output in outputs)


def test_after_a_stall_counters_go_on_and_the_image_index_follows_the_tick():
    plain_line = build_line(load_scenario("highway"))
    _, plain = record(plain_line, 20)
    stalled_line = build_line(load_scenario("highway"))
    _, stalled = record(stalled_line, 20, SlowClock(stall_after=10, stall_ns=150_000_000))
    by_tick = {output.tick.index: output for output in plain}
    for output in stalled:
        assert output.values == pytest.approx(by_tick[output.tick.index].values, abs=0.0, nan_ok=True)
    guard_of = {plan.layout.arbitration_id: plan.guard for plan in stalled_line.profile.messages}
    counters = {}
    for _, frame in frames(stalled):
        guard = guard_of[frame.arbitration_id]
        if guard is not None:
            now = guard.counter(frame.data)
            before = counters.get(frame.arbitration_id)
            assert before is None or now == (before + 1) % 15
            counters[frame.arbitration_id] = now
    assert counters


def test_a_slot_that_is_less_than_half_a_period_late_is_still_sent():
    line = build_line(load_scenario("highway"))
    summary, outputs = record(line, 12, SlowClock(stall_after=5, stall_ns=19_000_000))
    assert summary.dropped_slots == 0
    assert [output.tick.index for output in outputs] == list(range(12))
    assert max(summary.lateness_ns) == 19_000_000


def test_a_sensor_that_lacks_an_input_still_sees_its_lines_but_is_degraded():
    line = build_line(load_scenario("highway", AT_ONCE))
    state = line.initial_state()
    snapshot = line.compute(state, tick(0)).output.snapshot

    class Lacking:
        def advance(self, state, tick, inputs):
            return None, replace(snapshot, stale=("ego.speed_mps",))

    output = replace(line, source=Lacking()).compute(state, tick(0)).output
    assert output.estimate.degraded
    assert output.estimate.on(Side.LEFT) is not None
    assert output.values["sensor.state"] == SensorMode.DEGRADED


def test_an_ego_state_that_is_not_finite_means_no_lines_and_a_degraded_sensor():
    line = build_line(load_scenario("highway", AT_ONCE))
    state = line.initial_state()
    computed = line.compute(state, tick(0))
    assert computed.output.estimate.on(Side.LEFT) is not None

    class Lost:
        def initial_state(self):
            return None

        def advance(self, state, tick, inputs):
            snapshot = computed.output.snapshot
            return None, replace(snapshot, ego=replace(snapshot.ego, yaw_rad=float("nan")))

    lost = replace(line, source=Lost()).compute(state, tick(0)).output
    assert lost.estimate.boundaries == ()
    assert lost.estimate.degraded
    assert all(frame.data for frame in lost.frames)
    decoded = {}
    for frame in lost.frames:
        decoded |= line.profile.decode(frame, check=True)
    assert decoded["left.available"] == 0.0
    assert decoded["sensor.state"] != computed.output.values["sensor.state"]


def test_the_demo_lasts_a_minute_at_least_and_shows_what_it_promises():
    scenario = load_scenario("highway")
    line = build_line(scenario)
    assert tick_count(scenario, line.source) * scenario.config.cycle_ms >= 60_000
    assert len(scenario.config.traffic) >= 10
    state, reasons, kinds, slopes, changes = line.initial_state(), set(), set(), [], 0
    for index in range(0, tick_count(scenario, line.source)):
        computed = line.compute(state, tick(index))
        state, output = computed.state_if_sent, computed.output
        if index % 5 == 0:
            reasons |= set(np.unique(output.observation.reason).tolist())
            kinds |= {int(b.kind) for b in output.estimate.boundaries}
            slopes.append(output.snapshot.ego.pitch_rad)
        changes += abs(output.estimate.lane_change)
    assert {0, 2, 5} <= reasons  # seen, gap, hidden
    assert {1, 2} <= kinds  # solid and dashed
    assert min(slopes) < -0.005 < 0.005 < max(slopes)  # up and down: a crest between
    assert changes == 2
