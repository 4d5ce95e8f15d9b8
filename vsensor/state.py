"""The sensor's state machine: one place from which validity, quality, SNA and status on the bus all follow.

    reset
      |
      v        init_s, first image        calibrated
    INIT -----------------------> CALIBRATING -----> AVAILABLE <--> DEGRADED    an input lost, rain, night
      ^                                 ^--------------^---- BLOCKED ----^      camera covered
      '----- reset ------- FAILED <------ from anywhere, until a reset          a fault within

What is forced from outside wins while it lasts and leaves no trace. Lines are reported in AVAILABLE and
DEGRADED alone.
"""

from dataclasses import dataclass, replace
from math import isfinite
from typing import Annotated, Literal

import msgspec
import numpy as np

from vsensor.schema import Config
from vsensor.types import (
    NANOSECONDS_PER_SECOND,
    Boundary,
    Environment,
    LaneEstimate,
    Observation,
    SensorMode,
    Tick,
    Unseen,
)

_DRY_DAY = Environment()
_Seconds = Annotated[float, msgspec.Meta(ge=0, le=600)]


class StateConfig(Config, frozen=True, kw_only=True):
    """`[state]`: how long the sensor takes to start, and what makes it less than available.

    After `init_s` it calibrates for `calibrating_s` and until it has driven `calibrating_m` at
    `calibrating_above_mps` or faster. Rain of `degraded_from_rain` (0 to 1), a visibility below
    `degraded_below_m` and the light named in `degraded_light` degrade it; no line is better than
    `degraded_quality` then. It calls itself blocked once something has hidden all lines for
    `blocked_after_s` (None: never).
    """

    init_s: _Seconds = 0.2
    calibrating_s: _Seconds = 0.0
    calibrating_m: Annotated[float, msgspec.Meta(ge=0, le=100_000)] = 0.0
    calibrating_above_mps: Annotated[float, msgspec.Meta(ge=0, le=100)] = 0.0
    degraded_from_rain: Annotated[float, msgspec.Meta(gt=0, le=1)] | None = None
    degraded_below_m: Annotated[float, msgspec.Meta(gt=0, le=10_000)] | None = None
    degraded_light: tuple[Literal["dusk", "night"], ...] = ()
    degraded_quality: Annotated[int, msgspec.Meta(ge=0, le=4)] = 4
    blocked_after_s: Annotated[float, msgspec.Meta(ge=0, le=3600)] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Causes:
    """What the state follows from at one tick.

    `degraded`: an input is missing or stale. `has_image`: one has come through since the start.
    `covered`: the camera is; `hidden`: something hides all lines from it. `failed`: a fault within, kept
    until `reset`. `forced` is the state that somebody demands.
    """

    degraded: bool = False
    environment: Environment = _DRY_DAY
    speed_mps: float = 0.0
    has_image: bool = True
    covered: bool = False
    hidden: bool = False
    failed: bool = False
    reset: bool = False
    forced: SensorMode | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorState:
    """The mode, since when the sensor is up (its start or last reset), and how far it drove calibrating.

    `hidden_since_ns`: since when something hides all lines, None while nothing does.
    """

    mode: SensorMode
    up_since_ns: int
    hidden_since_ns: int | None = None
    calibrated_m: float = 0.0
    has_failed: bool = False


def initial_state(start_ns: int = 0) -> SensorState:
    """Return the state of a sensor that is switched on at `start_ns`."""
    return SensorState(mode=SensorMode.INIT, up_since_ns=start_ns)


def advance(config: StateConfig, state: SensorState, causes: Causes, tick: Tick) -> SensorState:
    """Return the state at `tick`."""
    if causes.reset:
        state = initial_state(tick.t_ns)
    has_failed = state.has_failed or causes.failed
    up_ns = tick.t_ns - state.up_since_ns
    is_up = up_ns >= _ns(config.init_s) and causes.has_image
    driven_m = state.calibrated_m
    if is_up and causes.speed_mps >= config.calibrating_above_mps:  # never of an unknown speed
        driven_m += causes.speed_mps * tick.period_ns / NANOSECONDS_PER_SECOND
    calibrated = up_ns >= _ns(config.init_s) + _ns(config.calibrating_s) and driven_m >= config.calibrating_m
    hidden_since_ns = None
    if causes.hidden:
        hidden_since_ns = tick.t_ns if state.hidden_since_ns is None else state.hidden_since_ns
    if causes.forced is not None:
        mode = causes.forced
    elif has_failed:
        mode = SensorMode.FAILED
    elif not is_up:
        mode = SensorMode.INIT
    elif causes.covered or _is_blocked(config, hidden_since_ns, tick):
        mode = SensorMode.BLOCKED
    elif not calibrated:
        mode = SensorMode.CALIBRATING
    else:
        mode = SensorMode.DEGRADED if _is_degraded(config, causes) else SensorMode.AVAILABLE
    return replace(
        state,
        mode=mode,
        hidden_since_ns=hidden_since_ns,
        calibrated_m=min(driven_m, config.calibrating_m),
        has_failed=has_failed,
    )


def reported(config: StateConfig, mode: SensorMode, estimate: LaneEstimate) -> LaneEstimate:
    """Return the estimate as this mode lets it be reported: while degraded no line is better than configured.

    A line whose numbers are not all finite is none: it cannot be available without them. Whether lines
    are reported at all is SensorMode.reports_lines.
    """
    best = config.degraded_quality if mode is SensorMode.DEGRADED else 4
    lines = estimate.boundaries
    if all(line.quality <= best and _is_finite(line) for line in lines):
        return estimate
    kept = (replace(line, quality=min(line.quality, best)) for line in lines if _is_finite(line))
    return replace(estimate, boundaries=tuple(kept))


def _is_finite(line: Boundary) -> bool:
    return isfinite(sum(line.coefficients.tolist(), line.x_min_m + line.x_max_m))


def all_hidden(observation: Observation) -> bool:
    """Return whether something hides all paint that the camera would see: a cover, or a lorry close by."""
    reasons = observation.reason
    return bool(((reasons == Unseen.OCCLUDED) | np.isin(reasons, _NOT_IN_VIEW)).all()) and bool(
        (reasons == Unseen.OCCLUDED).any()
    )


_NOT_IN_VIEW = (Unseen.NO_LINE, Unseen.NO_PAINT, Unseen.BEHIND_CAMERA, Unseen.OUTSIDE_IMAGE)


def _is_blocked(config: StateConfig, hidden_since_ns: int | None, tick: Tick) -> bool:
    if config.blocked_after_s is None or hidden_since_ns is None:
        return False
    return tick.t_ns - hidden_since_ns >= _ns(config.blocked_after_s)


def _is_degraded(config: StateConfig, causes: Causes) -> bool:
    weather = causes.environment
    wet = config.degraded_from_rain is not None and weather.rain >= config.degraded_from_rain
    foggy = config.degraded_below_m is not None and weather.visibility_m < config.degraded_below_m
    return causes.degraded or wet or foggy or weather.light.name.lower() in config.degraded_light


def _ns(seconds: float) -> int:
    return round(seconds * NANOSECONDS_PER_SECOND)
