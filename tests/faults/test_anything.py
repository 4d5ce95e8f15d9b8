"""Any faults in any order: the run goes on, frames stay frames, and afterwards all is well again."""

from dataclasses import replace
from functools import cache

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.faults.runs import PERIOD_NS, frames_of, is_valid_at_end, line, run
from vsensor.codec import unpack
from vsensor.config import load_scenario
from vsensor.faults import FaultConfig, faults_of
from vsensor.line import build_line
from vsensor.types import MarkingKind

TICKS, OVER = 40, 20
"""All faults have ended by tick OVER."""

NAMES = [plan.layout.name for plan in line().profile.messages]
SIGNALS = {
    f"{plan.layout.name}.{name}": signal
    for plan in line().profile.messages
    for name, signal in plan.layout.signals.items()
    if not name.endswith(("Crc", "Counter"))
}
QUANTITIES = sorted(line().profile.quantities())
MESSAGE = {"message": st.none() | st.sampled_from(NAMES)}
BY = {"by": st.integers(-40, 40).filter(lambda by: by % 15)}
LINE = st.sampled_from(["left", "right", "next_left", "next_right"])
MARKING = st.sampled_from([kind.name.lower() for kind in MarkingKind if kind])
RAWS = st.sampled_from(sorted(SIGNALS)).flatmap(
    lambda name: st.fixed_dictionaries(
        {"signal": st.just(name), "raw": st.integers(SIGNALS[name].raw_min, SIGNALS[name].raw_max)}
    )
)
VALUES = st.floats(-1e15, 1e15, allow_nan=False)
WITH_SNA = st.sampled_from([name for name, signal in SIGNALS.items() if signal.sna_raw is not None])


def told(**keys):
    return st.fixed_dictionaries(keys)


ONE = st.one_of(
    st.tuples(
        st.sampled_from(["frame_lost", "frame_doubled", "crc_wrong", "counter_frozen"]), told(**MESSAGE)
    ),
    st.tuples(st.just("frame_delayed"), told(delay_ms=st.floats(0.001, 150.0), **MESSAGE)),
    st.tuples(st.just("frame_truncated"), told(length=st.integers(0, 7), **MESSAGE)),
    st.tuples(st.sampled_from(["counter_jumped", "counter_offset"]), told(**BY, **MESSAGE)),
    st.tuples(st.just("signal_stuck"), told(signal=st.sampled_from(sorted(SIGNALS)))),
    st.tuples(st.just("signal_sna"), told(signal=WITH_SNA)),
    st.tuples(st.just("signal_raw"), RAWS),
    st.tuples(st.just("signal_value"), told(signal=st.sampled_from(sorted(SIGNALS)), value=VALUES)),
    st.tuples(st.just("override"), told(quantity=st.sampled_from(QUANTITIES), value=VALUES)),
    st.tuples(st.just("line_lost"), told(line=st.none() | LINE)),
    st.tuples(st.just("ghost_line"), told(line=LINE, offset_m=st.floats(-30, 30))),
    st.tuples(st.just("line_kind"), told(line=st.none() | LINE, marking=MARKING)),
    st.tuples(st.just("line_colour"), told(colour=st.sampled_from(["red", "unknown"]))),
    st.tuples(st.sampled_from(["image_frozen", "sensor_blocked", "reset", "bus_off"]), told()),
)
ONCE = ("counter_jumped",)
FOR_A_TIME = ("reset", "bus_off")


@st.composite
def faults(draw):
    """Return a fault that ends by tick OVER."""
    kind, keys = draw(ONE)
    begins = draw(st.integers(0, OVER - 5))
    config = {
        "kind": kind,
        "at_s": begins * PERIOD_NS / 1e9,
        **{k: v for k, v in keys.items() if v is not None},
    }
    if kind in ONCE:
        return config
    lasts = draw(st.integers(1, OVER - 4 - begins))
    if kind in FOR_A_TIME or draw(st.booleans()):
        return {**config, "for_s": lasts * PERIOD_NS / 1e9}
    return {**config, "times": min(lasts, 3)}


@cache
def quick():
    """Return the drive without a camera and without traffic: as many frames, made sooner."""
    overrides = {"state": {"init_s": 0.0}, "camera": {"model": "none", "occlusion": "none"}, "traffic": []}
    return build_line(load_scenario("highway", overrides))


def with_timeline(configs):
    timeline = faults_of([FaultConfig(**config) for config in configs], quick().profile)
    return replace(quick(), timeline=timeline)


@settings(max_examples=60)
@given(st.lists(faults(), max_size=6))
def test_after_any_faults_every_receiver_is_content_again(configs):
    outputs, state = run(with_timeline(configs), TICKS)
    assert state.faults.is_quiet
    for output in outputs[OVER:]:
        assert [frame.arbitration_id for frame in output.frames] == [0x320 + k for k in range(13)]
    for name in NAMES:
        assert is_valid_at_end(outputs, name)
        guard = next(plan.guard for plan in quick().profile.messages if plan.layout.name == name)
        found = [guard.counter(frames[0].data) for frames in frames_of(outputs[OVER:], name)]
        assert found == [(found[0] + k) % 15 for k in range(len(found))]
        assert all(guard.check(frames[0].data) for frames in frames_of(outputs[OVER:], name))


@settings(max_examples=60)
@given(st.lists(faults(), max_size=6))
def test_under_any_faults_frames_stay_frames(configs):
    outputs, state = run(with_timeline(configs), OVER)
    layouts = {plan.layout.arbitration_id: plan.layout for plan in quick().profile.messages}
    total = 0
    for output in outputs:
        due_ns = [frame.due_ns for frame in output.frames]
        assert due_ns == sorted(due_ns)
        total += len(due_ns)
        for frame in output.frames:
            assert output.tick.t_ns <= frame.due_ns < output.tick.t_ns + PERIOD_NS
            assert len(frame.data) <= layouts[frame.arbitration_id].length
            if len(frame.data) == layouts[frame.arbitration_id].length:
                assert unpack(layouts[frame.arbitration_id], frame.data)
    assert state.transmit.frames == total


@settings(max_examples=20)
@given(st.lists(faults(), max_size=4))
def test_the_same_faults_give_the_same_frames(configs):
    first, second = (run(with_timeline(configs), OVER)[0] for _ in range(2))
    assert [output.frames for output in first] == [output.frames for output in second]
