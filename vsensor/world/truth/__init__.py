"""The truth beside an output: where each line really is, in the words and the frame of the report.

`sides` says which line is on which side, `reasons` why it was not seen, `course` where it runs exactly,
`cubic` the best cubic, `lines` all of that for each line; `lane` what follows for the lane, `hiders` which
object hides what.
"""

from vsensor.world.truth.course import Course
from vsensor.world.truth.cubic import CubicFit, best_cubic, fitted
from vsensor.world.truth.hiders import hiders
from vsensor.world.truth.lane import LaneTruth, lane_truth
from vsensor.world.truth.lines import RANGES_M, LineTruth, line_truths
from vsensor.world.truth.sides import BESIDE_M, OWN_LANE_M, true_sides

__all__ = [
    "BESIDE_M",
    "OWN_LANE_M",
    "RANGES_M",
    "Course",
    "CubicFit",
    "LaneTruth",
    "LineTruth",
    "best_cubic",
    "fitted",
    "hiders",
    "lane_truth",
    "line_truths",
    "true_sides",
]
