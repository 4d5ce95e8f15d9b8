"""The true lines beside an output: which is on which side, where it runs, why it was not seen.

They are those of `Observation.candidates`, the exact points of every line near the pose in the road-level
ego frame, so truth and sensor speak of the same line. Where the map's own curve is known (`Marking.curve`)
it says where the line is between two points, and how it turns; else it is straight between them.

A boundary is compared with the marking that it was fitted to, now or when
it was seen last (`Boundary.marking`), on the side where it is reported: a swap of sides is not an error of
place. One that was fitted to what does not count (a ghost, white under yellow) is compared with the true line
of its side.
"""

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
    Marking,
    MarkingKind,
    Output,
    Side,
    Unseen,
)
from vsensor.world.truth.course import Course, courses
from vsensor.world.truth.cubic import NO_CUBIC, CubicFit, best_cubic, fitted
from vsensor.world.truth.reasons import reason_unseen
from vsensor.world.truth.sides import LEFT_SIDES, is_void, true_sides

RANGES_M: tuple[float, ...] = (10.0, 20.0, 50.0, 80.0, 100.0)
"""Where truth and report are compared, x in the ego frame."""

_RANGES = np.array(RANGES_M)
_NO_Y = np.full(len(RANGES_M), np.nan)
_NO_FIT = CubicFit(coefficients=NO_CUBIC, std_m=math.nan)
_TANGENT_HALF_M = 0.5  # the slope at the front axle is taken over one metre: no noise of 0.1 m points


@dataclass(frozen=True, slots=True, kw_only=True)
class LineTruth:
    """The true line beside one reported or missing line.

    `marking` is its place in `scene.markings`, `line` that in the candidates; -1 if there is no line (then
    all is NaN). `y_m` (len(RANGES_M),), NaN where the line does not reach or another one overrides it (yellow
    paint of a construction site). `coefficients` (4,) of the best
    cubic through the true line: uniform least squares at the true points that the reported fit used; for a
    predicted boundary at those within its x range, for a line that was not reported at all of the window.
    `whole` is the best cubic through all points of the window (P3 3.2). `taylor` (4,) is y, y', y''/2, y'''/6
    at x = 0 by the map's own curve, NaN without one. `axle_y_m`, `axle_slope`: of the line at the front axle;
    `lane_offset_m` from the vehicle's centreline to the inner edge there, left positive.
    """

    side: Side
    marking: int
    line: int
    kind: MarkingKind
    width_m: float
    y_m: Array
    coefficients: Array
    whole: CubicFit
    taylor: Array
    axle_y_m: float
    axle_slope: float
    lane_offset_m: float
    reason_unseen: Unseen


@dataclass(frozen=True, slots=True)
class _Chain:
    """A true line: its marking, exact points within the window and their places in it.

    `x`, `y` have one more point at either end; `course` is that of the curve at 0, the front axle and
    RANGES_M, None without one.
    """

    number: int
    marking: Marking
    points: Array
    index: IntArray
    x: Array
    y: Array
    course: Course | None


def line_truths(output: Output, front_axle_x_m: float) -> Mapping[Side, LineTruth]:
    """Return the truth of each side that has a true line or a report; `front_axle_x_m` in the ego frame."""
    candidates, snapshot = output.observation.candidates, output.snapshot
    place = {marking: k for k, marking in enumerate(candidates.marking.tolist())}
    on_side = true_sides(candidates, snapshot)
    reported = {line.side: line for line in output.estimate.boundaries}
    meant: dict[Side, int | None] = {}
    for side in Side:
        line, k = reported.get(side), on_side.get(side)
        if line is None and k is None:
            continue
        if line is not None and line.marking >= 0:
            known = place.get(line.marking)
            if known is None:
                k = None if line.measured else k
            elif not is_void(candidates, snapshot, known):
                k = known
        meant[side] = k
    chains = _chains(output, {k for k in meant.values() if k is not None}, front_axle_x_m)
    found = {}
    for side, k in meant.items():
        line = reported.get(side)
        is_lost = line is None and side in output.estimate.lost
        reason = Unseen.LOST if is_lost else reason_unseen(output, line, k)
        if k is None:
            found[side] = _no_line(side, reason)
        else:
            found[side] = _line_truth(output, side, line, k, chains[k], front_axle_x_m, reason)
    return found


def _chains(output: Output, wanted: set[int], axle_m: float) -> dict[int, _Chain]:
    """Return the lines (places in the candidates) that are wanted."""
    candidates, markings = output.observation.candidates, output.snapshot.scene.markings
    frame = world_from_ego(output.snapshot.ego)
    parts, asked = {}, {}
    for k in sorted(wanted):
        part = slice(int(candidates.starts[k]), int(candidates.starts[k + 1]))
        number, index = int(candidates.marking[k]), candidates.index[part]
        marking = markings[number]
        points = candidates.points_ego_m[part]
        x, y, places = _one_point_further(points, index, marking.points_world_m, frame)
        parts[k] = number, marking, points, index, x, y
        asked[k] = marking, x, places
    at = courses(frame, np.array((0.0, axle_m, *RANGES_M)), asked)
    return {k: _Chain(*part, at.get(k)) for k, part in parts.items()}


def _no_line(side: Side, reason: Unseen) -> LineTruth:
    return LineTruth(
        side=side,
        marking=-1,
        line=-1,
        kind=MarkingKind.NONE,
        width_m=math.nan,
        y_m=_NO_Y,
        coefficients=NO_CUBIC,
        whole=_NO_FIT,
        taylor=NO_CUBIC,
        axle_y_m=math.nan,
        axle_slope=math.nan,
        lane_offset_m=math.nan,
        reason_unseen=reason,
    )


def _line_truth(
    output: Output, side: Side, line: Boundary | None, k: int, chain: _Chain, axle_m: float, reason: Unseen
) -> LineTruth:
    points, index, marking = chain.points, chain.index, chain.marking
    abeam = int(index[min(int(points[:, 0].searchsorted(axle_m)), index.size - 1)])
    width_m = float(marking.width_m[abeam])
    axle_y_m, slope = _at_axle(chain, axle_m)
    half_m = width_m / 2 * math.hypot(1.0, slope)
    whole = fitted(points[:, 0], points[:, 1])
    used = _used(output, line, chain)
    return LineTruth(
        side=side,
        marking=chain.number,
        line=k,
        kind=MarkingKind(int(marking.kind[abeam])),
        width_m=width_m,
        y_m=_y_at_ranges(chain),
        coefficients=whole.coefficients if used is points else best_cubic(used[:, 0], used[:, 1]),
        whole=whole,
        taylor=NO_CUBIC if chain.course is None else chain.course.series[:, 0],
        axle_y_m=axle_y_m,
        axle_slope=slope,
        lane_offset_m=axle_y_m - half_m if side in LEFT_SIDES else axle_y_m + half_m,
        reason_unseen=reason,
    )


def _used(output: Output, line: Boundary | None, chain: _Chain) -> Array:
    """Return the true points (N, 3) that the reported fit used, all of the window for a missing line."""
    points = chain.points
    if line is None:
        return points
    if line.measured and line.points >= 0 and line.marking == chain.number:
        places = _places(output.detections.lines, line, chain.index)
        return points if isinstance(places, slice) and places == slice(None) else points[places]
    return points[(points[:, 0] >= line.x_min_m) & (points[:, 0] <= line.x_max_m)]


def _y_at_ranges(chain: _Chain) -> Array:
    """Return y at RANGES_M, NaN where the line does not reach or another one overrides it."""
    y: Array = np.interp(_RANGES, chain.x, chain.y, left=np.nan, right=np.nan)
    if chain.course is not None:
        exact = chain.course.y_m[2:]
        y = np.where(np.isnan(exact), y, exact)
    if not isinstance(chain.marking.valid, bool):
        at = np.minimum(chain.points[:, 0].searchsorted(_RANGES), len(chain.index) - 1)
        y[~chain.marking.valid[chain.index[at]]] = np.nan
    return y


def _at_axle(chain: _Chain, axle_m: float) -> tuple[float, float]:
    """Return y and slope at the front axle, NaN where the line does not reach it."""
    x, y = chain.x, chain.y
    if chain.course is not None and not math.isnan(chain.course.series[0, 1]):
        return float(chain.course.series[0, 1]), float(chain.course.series[1, 1])
    if not x[0] <= axle_m <= x[-1]:
        return math.nan, math.nan
    low, high = max(axle_m - _TANGENT_HALF_M, float(x[0])), min(axle_m + _TANGENT_HALF_M, float(x[-1]))
    before, centre, after = np.interp((low, axle_m, high), x, y).tolist()
    return centre, (after - before) / (high - low)


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
) -> tuple[Array, Array, Array]:
    """Return x, y and places of the line with the next point before and after the window, if they go on.

    So that y at either end of the window is known.
    """
    step = 1 if index.size < 2 or index[-1] >= index[-2] else -1
    x, y, places = points[:, 0], points[:, 1], index.astype(np.float64)
    ends = (int(index[0]) - step, int(index[-1]) + step)
    known = [place for place in ends if 0 <= place < len(chain_world_m)]
    if not known:
        return x, y, places
    more = dict(zip(known, relative_to(frame, chain_world_m[known]).tolist(), strict=True))
    before = [ends[0]] if ends[0] in more and more[ends[0]][0] < x[0] else []
    after = [ends[1]] if ends[1] in more and more[ends[1]][0] > x[-1] else []
    if not before and not after:
        return x, y, places
    rows = [[(*more[place][:2], float(place)) for place in end] for end in (before, after)]
    front, back = (np.array(row).reshape(-1, 3).T for row in rows)
    x, y, places = np.concatenate((front, (x, y, places), back), axis=1)
    return x, y, places
