"""The sensor's state machine, and that frames which follow from it never contradict each other."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.bus_values import PERIOD_NS, boundary, ego, estimate, slot
from vsensor import transmit as sending
from vsensor.profile import load_profile
from vsensor.signals import VehicleConfig, values_from
from vsensor.state import Causes, StateConfig, advance, all_hidden, initial_state, reported
from vsensor.types import (
    Environment,
    Light,
    LinePoints,
    MarkingKind,
    Observation,
    SensorMode,
    Side,
    Unseen,
    frozen,
)

NATIVE, VEHICLE = load_profile("native"), VehicleConfig()
TRANSMITTER = sending.Transmitter(NATIVE, VEHICLE)


def modes(slots, degraded=(), forced=None, config=StateConfig(init_s=0.2)):  # noqa: B008
    state, seen = initial_state(), []
    for index in range(slots):
        wanted = (forced or {}).get(index)
        state = advance(config, state, Causes(degraded=index in degraded, forced=wanted), slot(index))
        seen.append(state.mode)
    return seen


def test_the_sensor_is_in_init_for_just_the_configured_time():
    assert modes(7) == [SensorMode.INIT] * 5 + [SensorMode.AVAILABLE] * 2


def test_without_a_start_time_it_is_available_at_once():
    assert modes(1, config=StateConfig(init_s=0.0)) == [SensorMode.AVAILABLE]


def test_a_missing_input_degrades_it_for_as_long_as_it_is_missing():
    assert modes(9, degraded={6, 7})[5:] == [
        SensorMode.AVAILABLE,
        SensorMode.DEGRADED,
        SensorMode.DEGRADED,
        SensorMode.AVAILABLE,
    ]


def test_a_missing_input_does_not_shorten_the_start():
    assert modes(3, degraded={0, 1, 2}) == [SensorMode.INIT] * 3


def test_a_forced_state_wins_and_leaves_no_trace():
    seen = modes(8, forced={5: SensorMode.BLOCKED, 6: SensorMode.FAILED})
    assert seen[5:] == [SensorMode.BLOCKED, SensorMode.FAILED, SensorMode.AVAILABLE]


def test_a_sensor_switched_on_later_starts_later():
    state = initial_state(start_ns=10 * PERIOD_NS)
    config = StateConfig(init_s=0.2)
    assert advance(config, state, Causes(), slot(14)).mode is SensorMode.INIT
    assert advance(config, state, Causes(), slot(15)).mode is SensorMode.AVAILABLE


@pytest.mark.parametrize("mode", SensorMode)
def test_lines_are_reported_when_available_or_degraded_only(mode):
    assert mode.reports_lines == (mode.name in ("AVAILABLE", "DEGRADED"))


def drive(config, causes):
    """Return the mode at each slot, of `causes` one after the other."""
    state, seen = initial_state(), []
    for index, cause in enumerate(causes):
        state = advance(config, state, cause, slot(index))
        seen.append(state.mode.name)
    return seen


AT_ONCE = StateConfig(init_s=0.0)


def test_after_the_start_it_calibrates_for_the_configured_time():
    config = StateConfig(init_s=0.08, calibrating_s=0.08)
    assert drive(config, [Causes()] * 5) == ["INIT"] * 2 + ["CALIBRATING"] * 2 + ["AVAILABLE"]


def test_only_metres_driven_fast_enough_and_after_the_start_calibrate():
    config = StateConfig(init_s=0.04, calibrating_m=2.0, calibrating_above_mps=10.0)
    fast, slow = Causes(speed_mps=25.0), Causes(speed_mps=9.9)  # 1 m in each slot of 40 ms
    unknown = Causes(speed_mps=float("nan"))
    seen = drive(config, [fast, slow, fast, unknown, slow, fast, slow])
    assert seen == ["INIT"] + ["CALIBRATING"] * 4 + ["AVAILABLE"] * 2


@pytest.mark.parametrize(
    ("config", "environment"),
    [
        (StateConfig(init_s=0.0, degraded_from_rain=0.5), Environment(rain=0.5)),
        (StateConfig(init_s=0.0, degraded_light=("night",)), Environment(light=Light.NIGHT)),
        (StateConfig(init_s=0.0, degraded_below_m=80.0), Environment(visibility_m=79.0)),
    ],
)
def test_bad_sight_degrades_it_where_the_configuration_says_so(config, environment):
    bad = Causes(environment=environment)
    assert drive(config, [Causes(), bad, Causes()]) == ["AVAILABLE", "DEGRADED", "AVAILABLE"]
    assert drive(AT_ONCE, [bad]) == ["AVAILABLE"]


def test_a_covered_camera_blocks_it_for_as_long():
    causes = [Causes(), Causes(covered=True), Causes()]
    assert drive(AT_ONCE, causes) == ["AVAILABLE", "BLOCKED", "AVAILABLE"]


def test_hidden_lines_block_it_only_after_the_configured_time_without_a_break():
    config = StateConfig(init_s=0.0, blocked_after_s=0.08)
    hidden, free = Causes(hidden=True), Causes()
    seen = drive(config, [hidden, hidden, free, hidden, hidden, hidden, free])
    assert seen == ["AVAILABLE"] * 5 + ["BLOCKED", "AVAILABLE"]
    assert drive(AT_ONCE, [hidden] * 9) == ["AVAILABLE"] * 9


def test_a_failure_stays_until_a_reset_and_the_sensor_starts_again():
    config = StateConfig(init_s=0.08)
    causes = [
        Causes(),
        Causes(),
        Causes(),
        Causes(failed=True),
        Causes(),
        Causes(reset=True),
        Causes(),
        Causes(),
    ]
    assert drive(config, causes)[2:] == ["AVAILABLE", "FAILED", "FAILED", "INIT", "INIT", "AVAILABLE"]


def test_without_an_image_it_is_still_starting():
    assert drive(AT_ONCE, [Causes(has_image=False), Causes()]) == ["INIT", "AVAILABLE"]


def test_while_degraded_no_line_is_better_than_configured():
    config = StateConfig(degraded_quality=2)
    lines = estimate(boundary(Side.LEFT, [1.8]), boundary(Side.RIGHT, [-1.8], quality=1))
    assert [line.quality for line in reported(config, SensorMode.DEGRADED, lines).boundaries] == [2, 1]
    assert reported(config, SensorMode.AVAILABLE, lines) is lines


def observation_of(*reasons):
    nothing = LinePoints(
        marking=frozen([], np.int64),
        starts=frozen([0], np.int64),
        index=frozen([], np.int64),
        points_ego_m=frozen(np.zeros((0, 3))),
    )
    none = frozen([], np.uint8)
    return Observation(
        lines=nothing,
        sigma_y_m=frozen([]),
        kind=none,
        colour=none,
        width_m=frozen([]),
        candidates=nothing,
        reason=frozen(list(reasons), np.uint8),
    )


@pytest.mark.parametrize(
    ("reasons", "hidden"),
    [
        ((Unseen.OCCLUDED, Unseen.OCCLUDED), True),
        ((Unseen.OCCLUDED, Unseen.NO_PAINT, Unseen.OUTSIDE_IMAGE), True),
        ((Unseen.OCCLUDED, Unseen.SEEN), False),
        ((Unseen.NO_PAINT, Unseen.NO_LINE), False),
        ((), False),
    ],
)
def test_all_is_hidden_when_something_stands_before_all_paint_in_view(reasons, hidden):
    assert all_hidden(observation_of(*reasons)) is hidden


lines = st.lists(
    st.builds(
        boundary,
        st.sampled_from(Side),
        st.lists(st.floats(-1e3, 1e3) | st.just(math.nan), min_size=1, max_size=4),
        quality=st.integers(0, 4),
        measured=st.booleans(),
        kind=st.sampled_from(MarkingKind),
        x_max_m=st.floats(5, 200) | st.just(math.nan),
    ),
    max_size=4,
    unique_by=lambda line: line.side,
)
causes = st.builds(
    Causes,
    degraded=st.booleans(),
    environment=st.builds(Environment, light=st.sampled_from(Light), rain=st.floats(0, 1)),
    speed_mps=st.floats(0, 40),
    has_image=st.booleans(),
    covered=st.booleans(),
    hidden=st.booleans(),
    failed=st.booleans(),
    reset=st.booleans(),
    forced=st.none() | st.sampled_from(SensorMode),
)
configs = st.builds(
    StateConfig,
    init_s=st.sampled_from([0.0, 0.05]),
    calibrating_s=st.sampled_from([0.0, 0.05]),
    degraded_from_rain=st.none() | st.floats(0.1, 1),
    degraded_quality=st.integers(0, 4),
    blocked_after_s=st.none() | st.floats(0, 0.1),
)


@settings(max_examples=100, deadline=None)
@given(configs, st.lists(st.tuples(causes, lines), min_size=1, max_size=8))
def test_whatever_happens_the_frames_of_an_image_never_contradict_each_other(config, story):
    state, sent = initial_state(), sending.initial_state(TRANSMITTER)
    for index, (cause, seen) in enumerate(story):
        state = advance(config, state, cause, slot(index))
        shown = reported(config, state.mode, estimate(*seen, index=index))
        values = values_from(VEHICLE, shown, ego(), state.mode, cause.environment)
        sent, frames = sending.transmit(TRANSMITTER, sent, values, slot(index))
        found = {}
        for frame in frames:
            found |= NATIVE.decode(frame, check=True)
        assert contradictions(found, config) == []


def contradictions(found, config):
    """Return what cannot be true together in the frames of one image, as an ECU would say it."""
    mode = SensorMode(int(found["sensor.state"]))
    wrong = []
    for side in ("left", "right", "next_left", "next_right"):
        there = found[f"{side}.available"] == 1
        numbers = [found[f"{side}.{name}"] for name in ("offset_m", "heading", "curvature_per_m", "x_max_m")]
        if there and not mode.reports_lines:
            wrong.append(f"{side} available in {mode.name}")
        if there != (not any(map(math.isnan, numbers))) or there == all(map(math.isnan, numbers)):
            wrong.append(f"{side}: available {there}, numbers {numbers}")
        if not there and (found[f"{side}.measured"] or found[f"{side}.quality"] or found[f"{side}.kind"]):
            wrong.append(f"{side}: not available, but measured, or of a quality or kind")
        if mode is SensorMode.DEGRADED and found[f"{side}.quality"] > config.degraded_quality:
            wrong.append(f"{side}: quality {found[f'{side}.quality']} while degraded")
        lane = found.get(f"{side}.lane_offset_m", math.nan)
        if not there and not math.isnan(lane):
            wrong.append(f"{side}: not available, but a lane offset")
    if not mode.reports_lines and not all(
        math.isnan(found[f"lane.{name}"]) for name in ("width_m", "lateral_speed_mps")
    ):
        wrong.append(f"a lane in {mode.name}")
    return wrong
