"""The truth beside an output: where each line really is, in the words and the frame of the report.

All of it comes from `Observation.candidates`, the exact points of every line near the pose in the
road-level ego frame, so truth and sensor speak of the same line and nothing is computed twice.

A line is *true* if some of it is painted within the window that the sensor looks at; a border without
any paint there is none. Which true line is on which side follows from its true place beside the
vehicle, whatever was reported. A boundary is compared with the marking that it was fitted to, now or when
it was seen last (`Boundary.marking`), on the side where it is reported: a swap of sides is not an error of
place. One that was fitted to what does not count (a ghost, white under yellow) is compared with the true line
of its side.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsensor.scene import world_from_ego
from vsensor.transforms import Rigid, relative_to
from vsensor.types import (
    Array,
    Boundary,
    IntArray,
    LinePoints,
    MarkingKind,
    Output,
    Side,
    Snapshot,
    Unseen,
)

RANGES_M: tuple[float, ...] = (10.0, 20.0, 50.0, 80.0, 100.0)
"""Where truth and report are compared, x in the ego frame."""

_RANGES = np.array(RANGES_M)
_NO_Y = np.full(len(RANGES_M), np.nan)
_NO_CUBIC = np.full(4, np.nan)
_TANGENT_HALF_M = 0.5  # the slope at the front axle is taken over one metre: no noise of 0.1 m points
_LEFT_SIDES = (Side.LEFT, Side.NEXT_LEFT)
_RIGHT_SIDES = (Side.RIGHT, Side.NEXT_RIGHT)

OWN_LANE_M = 4.5
"""A line farther to the side does not bound the own lane, not even from its other edge (3.75 m wide)."""
BESIDE_M = 8.0
"""A line farther to the side is no next line: own half, one lane, and a vehicle off its middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LineTruth:
    """The true line beside one reported or missing line.

    `marking` is its place in `scene.markings`, -1 if there is no line (then all is NaN). `y_m`
    (len(RANGES_M),) by linear interpolation between the dense points, NaN where the line does not
    reach. `coefficients` (4,) of the best cubic through the true line: uniform least squares at the
    true points that the reported fit used; for a predicted boundary at those within its x range, for
    a line that was not reported at all of the window. `lane_offset_m` from the vehicle's centreline
    to the inner edge at the front axle, left positive.
    """

    side: Side
    marking: int
    kind: MarkingKind
    y_m: Array
    coefficients: Array
    lane_offset_m: float
    reason_unseen: Unseen


def line_truths(output: Output, front_axle_x_m: float) -> Mapping[Side, LineTruth]:
    """Return the truth of each side that has a true line or a report; `front_axle_x_m` in the ego frame."""
    candidates, snapshot = output.observation.candidates, output.snapshot
    place = {marking: k for k, marking in enumerate(candidates.marking.tolist())}
    on_side = true_sides(candidates, snapshot)
    reported = {line.side: line for line in output.estimate.boundaries}
    frame = world_from_ego(snapshot.ego)
    found = {}
    for side in Side:
        line, k = reported.get(side), on_side.get(side)
        if line is None and k is None:
            continue
        if line is not None and line.marking >= 0:
            fitted = place.get(line.marking)
            if fitted is None:
                k = None if line.measured else k
            elif not _is_void(candidates, snapshot, fitted):
                k = fitted
        is_lost = line is None and side in output.estimate.lost
        reason = Unseen.LOST if is_lost else _reason_unseen(output, line, k)
        if k is None:
            found[side] = _no_line(side, reason)
        else:
            found[side] = _line_truth(output, side, line, k, frame, front_axle_x_m, reason)
    return found


def true_sides(candidates: LinePoints, snapshot: Snapshot) -> dict[Side, int]:
    """Return the line (place in `candidates`) on each side, by true lateral position beside the vehicle.

    Counted are lines with paint within the window, at their first point with x >= 0. The nearest one
    within OWN_LANE_M bounds the own lane; where none does, that side has no line, and the nearest one
    within BESIDE_M is the next lane's.
    """
    starts = candidates.starts.tolist()
    lateral = []
    for k, (a, b) in enumerate(itertools.pairwise(starts)):
        if _counts(candidates, snapshot, k):
            abeam = min(a + int(candidates.points_ego_m[a:b, 0].searchsorted(0.0)), b - 1)
            lateral.append((float(candidates.points_ego_m[abeam, 1]), k))
    left = sorted((y, k) for y, k in lateral if 0.0 < y <= BESIDE_M)
    right = sorted((-y, k) for y, k in lateral if -BESIDE_M <= y <= 0.0)
    sides = {}
    for lines, names in ((left, _LEFT_SIDES), (right, _RIGHT_SIDES)):
        is_bounded = bool(lines) and lines[0][0] <= OWN_LANE_M
        sides.update({side: k for side, (_, k) in zip(names[not is_bounded :], lines, strict=False)})
    return sides


def _counts(candidates: LinePoints, snapshot: Snapshot, k: int) -> bool:
    """Return whether some paint of a line within the window bounds a lane: no ghost, nothing overridden."""
    index = candidates.index[candidates.starts[k] : candidates.starts[k + 1]]
    marking = snapshot.scene.markings[int(candidates.marking[k])]
    painted = marking.painted if marking.valid is True else marking.painted & marking.valid
    return bool(painted[index].any())


def _is_void(candidates: LinePoints, snapshot: Snapshot, k: int) -> bool:
    """Return whether a line has paint within the window, but none that counts."""
    index = candidates.index[candidates.starts[k] : candidates.starts[k + 1]]
    marking = snapshot.scene.markings[int(candidates.marking[k])]
    return not _counts(candidates, snapshot, k) and bool(marking.painted[index].any())


def lane_width_m(truths: Mapping[Side, LineTruth]) -> float:
    """Return the true distance between the own lane's inner edges at the front axle, NaN without both."""
    left, right = truths.get(Side.LEFT), truths.get(Side.RIGHT)
    return left.lane_offset_m - right.lane_offset_m if left and right else math.nan


def best_cubic(x_m: Array, y_m: Array) -> Array:
    """Return c0..c3 (4,) of the least-squares cubic, uniform weights; x increasing.

    NaN with fewer than four points. Normal equations on x scaled to [-1, 1], where their condition is
    about 60: as good as QR to 1e-12 m and half its time. Its own code, so that it does not share a
    fault with the fit that it judges.
    """
    if x_m.size < 4:
        return _NO_CUBIC
    first, last = float(x_m[0]), float(x_m[-1])
    m, half = (last + first) / 2, (last - first) / 2
    basis = np.empty((4, x_m.size))
    basis[0] = 1.0
    np.multiply(x_m - m, 1.0 / half, out=basis[1])
    np.multiply(basis[1], basis[1], out=basis[2])
    np.multiply(basis[2], basis[1], out=basis[3])
    a, b, c, d = np.linalg.solve(basis @ basis.T, basis @ y_m).tolist()
    b, c, d = b / half, c / half**2, d / half**3  # now in powers of (x - middle)
    return np.array([a - m * (b - m * (c - m * d)), b - m * (2 * c - 3 * m * d), c - 3 * m * d, d])


def _no_line(side: Side, reason: Unseen) -> LineTruth:
    return LineTruth(
        side=side,
        marking=-1,
        kind=MarkingKind.NONE,
        y_m=_NO_Y,
        coefficients=_NO_CUBIC,
        lane_offset_m=math.nan,
        reason_unseen=reason,
    )


def _line_truth(
    output: Output, side: Side, line: Boundary | None, k: int, frame: Rigid, axle_m: float, reason: Unseen
) -> LineTruth:
    candidates = output.observation.candidates
    a, b = int(candidates.starts[k]), int(candidates.starts[k + 1])
    number = int(candidates.marking[k])
    marking = output.snapshot.scene.markings[number]
    points, index = candidates.points_ego_m[a:b], candidates.index[a:b]
    if line is None:
        used = points
    elif line.measured and line.points >= 0 and line.marking == number:
        used = points[_places(output.detections.lines, line, index)]
    else:
        used = points[(points[:, 0] >= line.x_min_m) & (points[:, 0] <= line.x_max_m)]
    abeam = int(index[min(int(points[:, 0].searchsorted(axle_m)), index.size - 1)])
    x, y = _one_point_further(points, index, marking.points_world_m, frame)
    return LineTruth(
        side=side,
        marking=number,
        kind=MarkingKind(int(marking.kind[abeam])),
        y_m=np.interp(_RANGES, x, y, left=np.nan, right=np.nan),
        coefficients=best_cubic(used[:, 0], used[:, 1]),
        lane_offset_m=_lane_offset_m(side, x, y, axle_m, float(marking.width_m[abeam])),
        reason_unseen=reason,
    )


def _places(lines: LinePoints, line: Boundary, index: IntArray) -> IntArray | slice:
    """Return where the points that a line was fitted to stand among the candidates with places `index`."""
    first, last = int(lines.starts[line.points]), int(lines.starts[line.points + 1])
    count = int(lines.points_ego_m[first:last, 0].searchsorted(line.x_max_m, "right"))
    wanted = lines.index[first : first + count]
    if wanted.size == index.size:  # all of them, in the same order
        return slice(None)
    sign = 1 if index[-1] >= index[0] else -1  # -1: a marking drawn against the driving direction
    if abs(int(index[-1]) - int(index[0])) == index.size - 1:  # no joint was left out
        return sign * (wanted - int(index[0]))
    return np.searchsorted(sign * index, sign * wanted)


def _one_point_further(
    points: Array, index: IntArray, chain_world_m: Array, frame: Rigid
) -> tuple[Array, Array]:
    """Return x and y of the line with the next point after the window, so that y at its end is known."""
    step = 1 if index.size < 2 or index[-1] >= index[-2] else -1
    following = int(index[-1]) + step
    if 0 <= following < len(chain_world_m):
        point = relative_to(frame, chain_world_m[following : following + 1])
        if point[0, 0] > points[-1, 0]:
            return np.append(points[:, 0], point[0, 0]), np.append(points[:, 1], point[0, 1])
    return points[:, 0], points[:, 1]


def _lane_offset_m(side: Side, x: Array, y: Array, axle_m: float, width_m: float) -> float:
    """Return the lateral position of the inner edge at the front axle, measured along the axle."""
    if not x[0] <= axle_m <= x[-1]:
        return math.nan
    low, high = max(axle_m - _TANGENT_HALF_M, float(x[0])), min(axle_m + _TANGENT_HALF_M, float(x[-1]))
    before, centre, after = np.interp((low, axle_m, high), x, y).tolist()
    half_m = width_m / 2 * math.hypot(1.0, (after - before) / (high - low))
    return float(centre - half_m if side in _LEFT_SIDES else centre + half_m)


def _reason_unseen(output: Output, line: Boundary | None, k: int | None) -> Unseen:
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
