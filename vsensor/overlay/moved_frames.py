"""Recorded frames that tell how the vehicle moves, once it moves otherwise: what they say is put right.

    recorded frame ──► its signals + (simulated - recorded motion at its time) ──► same frame, protected anew

What a sensor of the car reads wrong (an offset, a factor) stays as it was, so nothing jumps at the take-over.
Frames that carry the pose, or motion that cannot be written back, are left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

from msgspec.structs import replace

from vsensor.codec import pack, unpack
from vsensor.profile import Binding, MessagePlan, Profile
from vsensor.sources.control import WHEEL, YAW, YAW_RATE, X, Y
from vsensor.types import Frame

LATERAL = "ego.lateral_acceleration_mps2"
WRITTEN = (YAW_RATE, LATERAL, WHEEL)
LEFT_OUT = (X, Y, YAW)


@dataclass(frozen=True, slots=True)
class Plan:
    """A message and those of its bindings that are written anew; none: it is left out."""

    message: MessagePlan
    bindings: tuple[Binding, ...]


class MovedFrames:
    """The messages of vehicle profiles that carry what an ECU's steering changes."""

    def __init__(self, profiles: Sequence[Profile]) -> None:
        self._plans: dict[tuple[int, bool], Plan] = {}
        for message in (message for profile in profiles for message in profile.messages):
            key = message.layout.arbitration_id, message.layout.is_extended
            if (plan := _plan(message)) is not None:
                self._plans.setdefault(key, plan)

    def lines(self) -> list[str]:
        """Return which messages are written anew and left out, as sentences."""
        written = [plan.message.layout.name for plan in self._plans.values() if plan.bindings]
        left_out = [plan.message.layout.name for plan in self._plans.values() if not plan.bindings]
        said = [f"from the take-over on {', '.join(written)} tell the simulated motion"] if written else []
        return said + ([f"from the take-over on {', '.join(left_out)} are left out"] if left_out else [])

    def moved(self, frame: Frame, changes: Mapping[str, float]) -> Frame | None:
        """Return the frame with its quantities changed by so much; None: it is left out."""
        plan = self._plans.get((frame.arbitration_id, frame.is_extended))
        if plan is None or frame.is_remote:
            return frame
        if not plan.bindings:
            return None
        layout, guard = plan.message.layout, plan.message.guard
        if len(frame.data) < layout.length:
            return frame
        head = frame.data[: layout.length]
        raws = unpack(layout, head)
        changed = dict(raws)
        for binding in plan.bindings:
            raw = binding.raw_in(raws)
            value = float("nan") if raw is None else binding.value(raw)
            if isfinite(value):
                changed[binding.signal.name] = binding.raw(value + changes[binding.quantity])[0]
        flips = zip(pack(layout, raws), pack(layout, changed), head, strict=True)
        data = bytearray(old ^ new ^ now for old, new, now in flips)  # bits of no signal stay
        if guard is not None:
            guard.protect(data, guard.counter(head) or 0)
        return replace(frame, data=bytes(data) + frame.data[layout.length :])


def _plan(message: MessagePlan) -> Plan | None:
    concerned = [one for one in message.bindings if one.quantity in (*WRITTEN, *LEFT_OUT)]
    if not concerned:
        return None
    can_be = all(
        one.quantity in WRITTEN and not one.parts and not one.magnitude_sign and not one.signal.is_float
        for one in concerned
    )
    return Plan(message, tuple(concerned) if can_be else ())
