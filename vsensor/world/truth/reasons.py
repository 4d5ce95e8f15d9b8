"""Why a line has no measured report."""

import numpy as np

from vsensor.types import Array, Boundary, LinePoints, Output, Unseen


def reason_unseen(output: Output, line: Boundary | None, k: int | None) -> Unseen:
    """Return why the side has no measured report: what befell most of its painted points."""
    if line is not None and line.measured:
        return Unseen.SEEN
    if k is None:
        return Unseen.NO_LINE
    observation = output.observation
    a, b = int(observation.candidates.starts[k]), int(observation.candidates.starts[k + 1])
    reasons = np.bincount(observation.reason[a:b], minlength=len(Unseen))
    if reasons[Unseen.SEEN]:
        return _reason_dropped(output, k)
    reasons[Unseen.NO_PAINT] = 0
    return Unseen(int(np.argmax(reasons))) if reasons.any() else Unseen.NO_PAINT


def _reason_dropped(output: Output, k: int) -> Unseen:
    """Return why a line of which the camera saw something was not reported as measured."""
    seen, detected = output.observation.lines, output.detections.lines
    marking = output.observation.candidates.marking[k]
    if _x_of(detected, int(marking)).size:
        return Unseen.TOO_FEW_POINTS
    x = _x_of(seen, int(marking))
    beyond = x.size > 0 and float(x.min()) > output.detections.operating_range_m
    return Unseen.BEYOND_RANGE if beyond else Unseen.LOST


def _x_of(lines: LinePoints, marking: int) -> Array:
    place = np.flatnonzero(lines.marking == marking)
    if not place.size:
        return np.empty(0)
    return lines.points_ego_m[lines.starts[place[0]] : lines.starts[place[0] + 1], 0]
