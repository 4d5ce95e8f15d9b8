"""End-to-end protection of frames: checksums, alive counters, and what a receiver concludes from them.

guard(name, ...) -> Guard                          protect, check, check_bulk of one message
CHECKSUMS[name](data)                              a plain checksum over any bytes
receive(config, state, guard, data) -> state, Check        AUTOSAR's receiver, frame by frame
"""

from vsensor.e2e.checksums import CHECKSUMS
from vsensor.e2e.compile import NAMES, guard
from vsensor.e2e.field import Field
from vsensor.e2e.guard import Guard
from vsensor.e2e.layouts import DATA_ID_MODES
from vsensor.e2e.receiver import Check, ReceiverConfig, ReceiverState, Reception, Status, receive

__all__ = [
    "CHECKSUMS",
    "DATA_ID_MODES",
    "NAMES",
    "Check",
    "Field",
    "Guard",
    "ReceiverConfig",
    "ReceiverState",
    "Reception",
    "Status",
    "guard",
    "receive",
]
