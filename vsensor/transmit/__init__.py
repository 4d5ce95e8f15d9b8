"""Signal values into frames, once per send slot: which messages are due, their bytes, counters, CRCs.

A message is due at its start delay and every cycle time after it, counted from t = 0 in slots; so a slot
that was dropped (transmit was not called, or its state not kept) leaves the alive counters where they are.
"""

from vsensor.transmit.encode import Encoder
from vsensor.transmit.schedule import is_due
from vsensor.transmit.stage import TransmitState, Transmitter, initial_state, transmit

__all__ = ["Encoder", "TransmitState", "Transmitter", "initial_state", "is_due", "transmit"]
