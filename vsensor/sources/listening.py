"""What is heard on the bus: frames in, the last value of every quantity out, with the time it came.

    frame --profile, CRC, counter--> values --plausible?--> Heard(value, t_ns)     one for each quantity
                   |                              |
                not ours, damaged, repeated,   not available: the value is kept, but counts as missing
                out of sequence: as if it had
                not come

A quantity is missing before its first value, when its frames say that it is not available, and when
none came for `timeout_ms`. All of that is a value, `Listened`, so a run restarts at any tick.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite, nan
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal

import msgspec

from vsensor.e2e import ReceiverConfig, ReceiverState, receive
from vsensor.errors import ConfigError
from vsensor.profile import QUANTITIES, MessagePlan, Profile
from vsensor.schema import Config
from vsensor.sources.profiles import profiles_of
from vsensor.types import Frame, Tick

CYCLES_MISSED = 3
TIMEOUT_WITHOUT_CYCLE_MS = 200.0
TOLERANCES = ReceiverConfig()
OTHER_CLOCK_NS = 10_000_000_000  # a receive time this far from the tick is of another clock

LARGEST: Mapping[str, float] = MappingProxyType(
    {
        "ego.speed_mps": 150.0,
        "ego.yaw_rate_radps": 10.0,
        "ego.acceleration_mps2": 100.0,
        "ego.lateral_acceleration_mps2": 100.0,
        "ego.steering_wheel_rad": 50.0,
        "ego.steering_request_rad": 1.5,
        "ego.x_m": 1e8,
        "ego.y_m": 1e8,
        "ego.z_m": 2e4,
        "ego.yaw_rad": 100.0,
    }
)
"""Beyond these no road vehicle moves, stands or is steered: such a value counts as not available."""


class ListenConfig(Config, frozen=True, kw_only=True):
    """`[listen]`: what is taken from the bus; `dbc` is the database that the profiles map.

    `profile` may name several; without it the shipped `vehicle` is taken where [ego] control needs one.
    A quantity is missing `timeout_ms` after its last frame (default: 3 cycles of its message, 200 ms if it
    has none). Motion goes on with the last value, for `hold_ms` if that is given, then with 0.
    """

    profile: str | tuple[str, ...] = ()
    dbc: str | None = None
    timeout_ms: Annotated[float, msgspec.Meta(ge=1, le=3_600_000)] | None = None
    hold_ms: Annotated[float, msgspec.Meta(ge=0, le=3_600_000)] | None = None
    environment: bool = True
    steering: Literal["request", "wheel"] = "request"
    speed: Literal["scenario", "bus"] = "scenario"

    @property
    def profiles(self) -> tuple[str, ...]:
        """The profiles that are named."""
        return (self.profile,) if isinstance(self.profile, str) else self.profile


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """The last value of a quantity and when it came; `is_lost`: a later frame said "not available"."""

    value: float
    t_ns: int
    is_lost: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Listened:
    """All that was heard: quantity -> Heard, message -> its receiver's state; `now_ns`: up to when."""

    quantities: Mapping[str, Heard] = field(default_factory=dict[str, Heard])
    receivers: Mapping[str, ReceiverState] = field(default_factory=dict[str, ReceiverState])
    now_ns: int = 0

    def value(self, quantity: str, default: float) -> float:
        """Return the last value, `default` before the first."""
        heard = self.quantities.get(quantity)
        return default if heard is None else heard.value


@dataclass(frozen=True, slots=True, kw_only=True)
class News:
    """What one frame told: its time from slot 0 on, its message and its quantities, NaN = not available."""

    t_ns: int
    message: str
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """Where a quantity comes from, and after what silence it is missing."""

    profile: Profile
    plan: MessagePlan
    timeout_ns: int


class Listener:
    """The profiles that are listened through, compiled; of several messages the first tells a quantity."""

    def __init__(self, profiles: Sequence[Profile], config: ListenConfig, wanted: Sequence[str]) -> None:
        """Find where each of the `wanted` quantities comes from; those that no profile has are left out."""
        self.profiles = tuple(profiles)
        found = {
            binding.quantity: Channel(profile=profile, plan=plan, timeout_ns=_timeout_ns(config, plan))
            for profile in reversed(profiles)
            for plan in reversed(profile.messages)
            for binding in plan.told
        }
        self.channels = {name: found[name] for name in wanted if name in found}
        self._told: dict[int, frozenset[str]] = {}
        for name, channel in self.channels.items():
            key = id(channel.plan)
            self._told[key] = self._told.get(key, frozenset()) | {name}

    @classmethod
    def load(cls, config: ListenConfig, folder: Path, wanted: Sequence[str]) -> "Listener":
        """Load the profiles; raises ConfigError, DbcError."""
        return cls(profiles_of(config.profiles or ("vehicle",), config.dbc, folder), config, wanted)

    @property
    def is_fd(self) -> bool:
        """Whether a message that is listened to is CAN FD."""
        return any(channel.plan.layout.is_fd for channel in self.channels.values())

    def require(self, quantities: Sequence[str], who: str) -> None:
        """Raise ConfigError if a quantity is told by no profile."""
        for name in quantities:
            if name not in self.channels:
                names = ", ".join(profile.name for profile in self.profiles)
                raise ConfigError(f"listen.profile: no signal of {names} carries {name}, which {who} needs")

    def lines(self) -> Iterator[str]:
        """Yield which messages are listened to, as sentences."""
        by_plan: dict[int, list[str]] = {}
        for name, channel in self.channels.items():
            by_plan.setdefault(id(channel.plan), []).append(name)
        for names in by_plan.values():
            channel = self.channels[names[0]]
            layout = channel.plan.layout
            yield (
                f"listens to 0x{layout.arbitration_id:03X} {layout.name} (profile {channel.profile.name}): "
                f"{', '.join(names)}; missing after {channel.timeout_ns / 1e6:g} ms"
            )

    def accepts(self, frame: Frame) -> bool:
        """Return whether a frame tells something that is listened to, and passes its check."""
        return any(self._decoded(profile, frame) is not None for profile in self.profiles)

    def hear(self, state: Listened, frames: Sequence[Frame], tick: Tick) -> tuple[Listened, tuple[News, ...]]:
        """Return the state after `frames`, whose times count from slot 0, and what each of them told.

        Times run forward: one before the last of its message or after the tick is put there, and one that
        cannot be meant counts as now.
        """
        news = []
        receivers = dict(state.receivers)
        quantities = dict(state.quantities)
        for frame in sorted(frames, key=lambda frame: frame.due_ns):
            for profile in self.profiles:
                told = self._decoded(profile, frame)
                if told is None:
                    continue
                plan, values = told
                if not _is_fresh(plan, frame, receivers):
                    continue
                t_ns = frame.due_ns if abs(frame.due_ns - tick.t_ns) < OTHER_CLOCK_NS else tick.t_ns
                t_ns = min(t_ns, tick.t_ns)
                t_ns = max([t_ns, *(quantities[name].t_ns for name in values if name in quantities)])
                for name, value in values.items():
                    _put(quantities, name, value, t_ns)
                news.append(News(t_ns=t_ns, message=plan.layout.name, values=values))
        # What came up to the last slot is here; this tick is computed ahead of its own.
        now_ns = tick.t_ns - tick.period_ns
        return Listened(quantities=quantities, receivers=receivers, now_ns=now_ns), tuple(news)

    def is_missing(self, state: Listened, quantity: str) -> bool:
        """Return whether a quantity has no value that is young enough."""
        heard = state.quantities.get(quantity)
        if heard is None or heard.is_lost:
            return True
        return state.now_ns - heard.t_ns > self.channels[quantity].timeout_ns

    def _decoded(self, profile: Profile, frame: Frame) -> tuple[MessagePlan, dict[str, float]] | None:
        """Return the message and what it tells of what is wanted; None if nothing, or its check fails."""
        if frame.is_error or frame.is_remote:
            return None
        plan = profile.by_id.get((frame.arbitration_id, frame.is_extended))
        wanted = self._told.get(id(plan))
        if plan is None or wanted is None:
            return None
        values = profile.decode(frame, check=True)
        if values is None:
            return None
        return plan, {name: _plausible(name, value) for name, value in values.items() if name in wanted}


def _timeout_ns(config: ListenConfig, plan: MessagePlan) -> int:
    if config.timeout_ms is not None:
        return round(config.timeout_ms * 1e6)
    return CYCLES_MISSED * plan.cycle_ns or round(TIMEOUT_WITHOUT_CYCLE_MS * 1e6)


def _plausible(name: str, value: float) -> float:
    """Return a value that a vehicle may have, NaN for any other: signals hold codes that mean nothing."""
    codes = QUANTITIES[name].codes
    if codes is not None:
        return value if value in {float(code) for code in codes} else nan
    return value if abs(value) <= LARGEST.get(name, inf) else nan


def _put(quantities: dict[str, Heard], name: str, value: float, t_ns: int) -> None:
    """Keep a value; "not available" marks the one before as lost."""
    if isfinite(value):
        quantities[name] = Heard(value=value, t_ns=t_ns)
    elif name in quantities:
        quantities[name] = replace(quantities[name], is_lost=True)


def _is_fresh(plan: MessagePlan, frame: Frame, receivers: dict[str, ReceiverState]) -> bool:
    """Return whether the counter has moved on, and not too far; note it for the next frame."""
    if plan.guard is None:
        return True
    name = plan.layout.name
    before = receivers.get(name, ReceiverState())
    receivers[name], check = receive(TOLERANCES, before, plan.guard, frame.data[: plan.layout.length])
    return check.status.is_fresh
