"""`vsensor check FILE`: what a file says and costs, and what an ECU or a run would stumble over."""

from vsensor.check.busload import DEFAULT_SPEED, BusSpeed
from vsensor.check.files import Report, check_file

__all__ = ["DEFAULT_SPEED", "BusSpeed", "Report", "check_file"]
