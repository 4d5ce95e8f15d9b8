"""The sensor's state machine: one place from which validity, SNA and status on the bus all follow.

INIT --init_s--> AVAILABLE <--ego motion lost, back--> DEGRADED          forced: BLOCKED, FAILED
"""

from dataclasses import dataclass
from typing import Annotated

import msgspec

from vsensor.schema import Config
from vsensor.types import NANOSECONDS_PER_SECOND, SensorMode, Tick


class StateConfig(Config, frozen=True, kw_only=True):
    """`[state]`: how long the sensor takes to start before it reports lines."""

    init_s: Annotated[float, msgspec.Meta(ge=0, le=600)] = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorState:
    """The mode, and the time since when the sensor is up (its start, later its last reset)."""

    mode: SensorMode
    up_since_ns: int


def initial_state(start_ns: int = 0) -> SensorState:
    """Return the state of a sensor that is switched on at `start_ns`."""
    return SensorState(mode=SensorMode.INIT, up_since_ns=start_ns)


def advance(
    config: StateConfig, state: SensorState, *, degraded: bool, tick: Tick, forced: SensorMode | None = None
) -> SensorState:
    """Return the state at `tick`; `degraded`: an input is missing or stale; `forced` wins while given."""
    return SensorState(mode=_mode(config, state, degraded, tick, forced), up_since_ns=state.up_since_ns)


def _mode(
    config: StateConfig, state: SensorState, degraded: bool, tick: Tick, forced: SensorMode | None
) -> SensorMode:
    if forced is not None:
        return forced
    if tick.t_ns - state.up_since_ns < round(config.init_s * NANOSECONDS_PER_SECOND):
        return SensorMode.INIT
    return SensorMode.DEGRADED if degraded else SensorMode.AVAILABLE
