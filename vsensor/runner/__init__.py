"""The loop: compute ahead of the slot, let the frames go when they are due, hand the output to the sinks."""

from vsensor.runner.loop import Control, Loop, run_loop
from vsensor.runner.outbox import FrameBus
from vsensor.runner.stopwatch import STAGES, Stopwatch
from vsensor.runner.summary import Summary

__all__ = ["STAGES", "Control", "FrameBus", "Loop", "Stopwatch", "Summary", "run_loop"]
