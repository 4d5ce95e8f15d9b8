"""Signal values into frames, once per send slot: which messages are due, their bytes, counters, CRCs.

A cyclic message is due at its offset and every cycle time after it, counted from t = 0 in slots; so a slot
that was dropped (transmit was not called, or its state not kept) leaves the alive counters where they are.
Other messages are sent when they change, or while they are active: see schedule.step.
"""

from vsensor.transmit.encode import Encoder, refused_range
from vsensor.transmit.schedule import Happening, MessageState, common_ns, is_due, slot_period_ns, step
from vsensor.transmit.stage import (
    TransmitState,
    Transmitter,
    initial_state,
    restarted,
    transmit,
    transmit_image,
)

__all__ = [
    "Encoder",
    "Happening",
    "MessageState",
    "TransmitState",
    "Transmitter",
    "common_ns",
    "initial_state",
    "is_due",
    "refused_range",
    "restarted",
    "slot_period_ns",
    "step",
    "transmit",
    "transmit_image",
]
