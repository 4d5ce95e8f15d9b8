"""Which messages are due in a slot: by the clock alone, or by what happened to the message.

A slot stands for the time since the slot before it: what is due in between leaves at the slot.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import gcd

from vsensor.profile import MessagePlan
from vsensor.profile.sending import SendPlan
from vsensor.types import Tick

FINEST_SLOT_NS = 1_000_000


def common_ns(plans: Iterable[MessagePlan]) -> int:
    """Return the greatest time that divides all times of the messages, 0 if they have none."""
    return gcd(*(time for plan in plans for time in plan.sending.times_ns))


def slot_period_ns(message_ns: int, image_period_ns: int) -> int:
    """Return the time between send slots: it divides the image's period and `message_ns` (see common_ns).

    The image's period where that would be finer than 1 ms: then what does not fit leaves in the next slot.
    """
    period_ns = gcd(image_period_ns, message_ns)
    return period_ns if period_ns >= FINEST_SLOT_NS else image_period_ns


def is_due(plan: MessagePlan, slot: Tick) -> bool:
    """Return whether a cyclic message has a send time within (slot before, this slot], from t = 0."""
    return due_in(slot, plan.sending.offset_ns, plan.sending.cycle_ns)


def due_in(slot: Tick, offset_ns: int, cycle_ns: int) -> bool:
    """Return whether offset + n * cycle lies within (slot before, this slot] for a whole n of 0 or more."""
    return _on_grid(slot.index * slot.period_ns - offset_ns, slot.period_ns, cycle_ns)


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageState:
    """What a message that more than time sends remembers; times since t = 0 in ns.

    `watched`, `written`: the watched raw values and the image of the slot before (None: none yet). `waits`:
    a frame waits for the minimum delay to pass since `sent_ns`. `repeats` frames are to follow, the next at
    `repeat_ns`. `active_ns`: since when it is active, None while it is not.
    """

    watched: tuple[int | None, ...] | None = None
    written: float | None = None
    waits: bool = False
    sent_ns: int | None = None
    repeats: int = 0
    repeat_ns: int = 0
    active_ns: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Happening:
    """What there is to a message in a slot: its watched raw values, its image, and whether it is active."""

    watched: tuple[int | None, ...]
    written: float
    active: bool


def step(plan: SendPlan, state: MessageState, now: Happening, slot: Tick) -> tuple[MessageState, bool]:
    """Return what the message remembers after this slot, and whether its frame leaves in it."""
    at_ns = slot.index * slot.period_ns
    if at_ns < plan.offset_ns:
        return state, False
    started = now.active and state.active_ns is None
    ended = not now.active and state.active_ns is not None
    active_ns = (at_ns if started else state.active_ns) if now.active else None
    news = ended or (plan.on_change and now.watched != state.watched)
    news = news or (plan.on_write and now.written != state.written)
    repeats, repeat_ns, again = state.repeats, state.repeat_ns, False
    if news:
        repeats, repeat_ns = plan.repetitions, at_ns + plan.repetition_ns
    elif repeats and at_ns >= repeat_ns:
        repeats, repeat_ns, again = repeats - 1, repeat_ns + plan.repetition_ns, True
    waits = state.waits or news or again or started or _by_time(plan, active_ns, at_ns, slot.period_ns)
    leaves = waits and (state.sent_ns is None or at_ns - state.sent_ns >= plan.min_delay_ns)
    after = MessageState(
        watched=now.watched,
        written=now.written,
        waits=waits and not leaves,
        sent_ns=at_ns if leaves else state.sent_ns,
        repeats=repeats,
        repeat_ns=repeat_ns,
        active_ns=active_ns,
    )
    return after, leaves


def _by_time(plan: SendPlan, active_ns: int | None, at_ns: int, period_ns: int) -> bool:
    """Return whether the cycle's time has come: of the fast cycle while active."""
    if active_ns is not None:
        return _on_grid(at_ns - active_ns, period_ns, plan.fast_cycle_ns)
    return _on_grid(at_ns - plan.offset_ns, period_ns, plan.cycle_ns)


def _on_grid(elapsed_ns: int, period_ns: int, cycle_ns: int) -> bool:
    """Return whether a multiple of the cycle lies within (elapsed - period, elapsed]; no cycle has none."""
    if elapsed_ns < 0 or not cycle_ns:
        return False
    before_ns = elapsed_ns - period_ns
    return before_ns < 0 or elapsed_ns // cycle_ns != before_ns // cycle_ns
