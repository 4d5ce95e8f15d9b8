"""When a message is sent: what `[messages.X.send]` may say, and the SendPlan that it is compiled into.

    type                   sent
    cyclic                 every cycle; every fast cycle while active, if one is given
    on_change              when a watched signal changed, and at the start
    cyclic_and_on_change   both; the cycle's times stay where they were
    on_write               at every image
    if_active              while active only: at once, every (fast) cycle after it, and once when it ends

After a change, a write, or the end of an active time the frame is repeated `repetitions` times. Two frames
of a message are never closer than its minimum delay: what falls into it leaves at its end, once.
"""

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec

from vsensor.schema import Config

_Millis = Annotated[float, msgspec.Meta(ge=0, le=3_600_000)]
_Cycle = Annotated[float, msgspec.Meta(ge=1, le=3_600_000)]
SendType = Literal["cyclic", "on_change", "cyclic_and_on_change", "on_write", "if_active"]


class SendConfig(Config, frozen=True, kw_only=True):
    """`[messages.X.send]`: when this message is sent; a key that is not given is the database's.

    `watch` names the signals whose change counts (default: all that carry a quantity but counts).
    `active` is a condition "NAME OPERATOR NUMBER" on a quantity, or on a signal of this message in its
    unit on the bus; nothing is active while it has no value. `phase_ms` shifts the message in its cycle.
    """

    type: SendType | None = None
    cycle_ms: _Cycle | None = None
    fast_cycle_ms: _Cycle | None = None
    repetitions: Annotated[int, msgspec.Meta(ge=0, le=255)] | None = None
    repetition_ms: _Cycle | None = None
    min_delay_ms: _Millis | None = None
    phase_ms: _Millis | None = None
    active: str | None = None
    watch: tuple[str, ...] | None = None


class GroupConfig(Config, frozen=True, kw_only=True):
    """`[groups.NAME]`: messages that leave together, in the profile's order, at a phase of their cycle."""

    messages: tuple[str, ...]
    phase_ms: _Millis = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """`subject` compared with `bound`: of a quantity, or (`is_signal`) of a signal's physical value."""

    subject: str
    is_signal: bool
    word: str
    bound: float

    def holds(self, value: float) -> bool:
        """Return whether it holds for `value`; never for NaN."""
        return value == value and OPERATORS[self.word](value, self.bound)


OPERATORS: Mapping[str, Callable[[float, float], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SendPlan:
    """When one message is sent; times in ns.

    Cyclic frames are due at `offset_ns` + n * `cycle_ns` from t = 0 (`cycle_ns` 0: none), nothing before
    `offset_ns`. While one of `active` holds, every `fast_cycle_ns` since it began instead. `on_change`:
    at the start, and when one of `watched` changes; `on_write`: every image. `findings` are for
    `vsensor check`.
    """

    cycle_ns: int
    offset_ns: int = 0
    fast_cycle_ns: int = 0
    on_change: bool = False
    watched: tuple[str, ...] = ()
    on_write: bool = False
    active: tuple[Condition, ...] = ()
    repetitions: int = 0
    repetition_ns: int = 0
    min_delay_ns: int = 0
    findings: tuple[str, ...] = ()

    @property
    def is_event(self) -> bool:
        """Whether something else than time sends it."""
        return self.on_change or self.on_write or bool(self.active)

    @property
    def is_cyclic(self) -> bool:
        """Whether time alone says when it is sent, without memory."""
        return not self.is_event and not self.min_delay_ns

    @property
    def times_ns(self) -> tuple[int, ...]:
        """All its times, 0 left out: the slots must meet them."""
        repetition_ns = self.repetition_ns if self.repetitions else 0
        times = (self.cycle_ns, self.offset_ns, self.fast_cycle_ns, repetition_ns, self.min_delay_ns)
        return tuple(time for time in times if time)
