"""The sensor's state machine."""

import pytest

from tests.bus_values import PERIOD_NS, slot
from vsensor.state import Causes, StateConfig, advance, initial_state
from vsensor.types import SensorMode


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
