"""The whole straight line of one scenario: source, sensor, state machine, transmitter.

The real-time loop, a batch run and a Python test all call `compute`; it knows no wall clock.
"""

from vsensor.line.build import build_line, build_source, tick_count
from vsensor.line.compute import Computed, Line, LineState

__all__ = ["Computed", "Line", "LineState", "build_line", "build_source", "tick_count"]
