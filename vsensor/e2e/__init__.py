"""End-to-end protection of frames: checksums, alive counters, and what a receiver concludes from them.

guard(name, ...) -> Guard      protect, check, check_bulk of one message
CHECKSUMS[name](data)          a plain checksum over any bytes
"""

from vsensor.e2e.checksums import CHECKSUMS
from vsensor.e2e.compile import NAMES, guard
from vsensor.e2e.field import Field
from vsensor.e2e.guard import Guard

__all__ = ["CHECKSUMS", "NAMES", "Field", "Guard", "guard"]
