"""Which line truly is on which side.

A line is *true* if some of it is painted within the window that the sensor looks at; a border without
any paint there is none. Which true line is on which side follows from its true place beside the
vehicle, whatever was reported.
"""

import itertools

from vsensor.types import LinePoints, Side, Snapshot

LEFT_SIDES = (Side.LEFT, Side.NEXT_LEFT)
RIGHT_SIDES = (Side.RIGHT, Side.NEXT_RIGHT)

OWN_LANE_M = 4.5
"""A line farther to the side does not bound the own lane, not even from its other edge (3.75 m wide)."""
AHEAD_M = 1.0
"""A line that begins farther ahead does not take the place of one that is beside the vehicle."""
BESIDE_M = 8.0
"""A line farther to the side is no next line: own half, one lane, and a vehicle off its middle."""


def true_sides(candidates: LinePoints, snapshot: Snapshot) -> dict[Side, int]:
    """Return the line (place in `candidates`) on each side, by true lateral position beside the vehicle.

    Counted are lines with paint within the window, at their first point with x >= 0, unless another line
    overrides them there. The nearest one within OWN_LANE_M bounds the own lane; where none does, that side
    has no line, and the nearest one within BESIDE_M is the next lane's. A line that begins ahead (yellow
    paint of a construction site) is left out where it lies nearer than one that is beside the vehicle and
    bounds the own lane.
    """
    starts = candidates.starts.tolist()
    lateral = []
    for k, (a, b) in enumerate(itertools.pairwise(starts)):
        abeam = _abeam(candidates, a, b)
        if counts(candidates, snapshot, k) and not _is_overridden(candidates, snapshot, k, abeam):
            x, y, _ = candidates.points_ego_m[abeam].tolist()
            lateral.append((y, k, x > AHEAD_M))
    left = sorted((y, k, ahead) for y, k, ahead in lateral if 0.0 < y <= BESIDE_M)
    right = sorted((-y, k, ahead) for y, k, ahead in lateral if -BESIDE_M <= y <= 0.0)
    sides = {}
    for found, names in ((left, LEFT_SIDES), (right, RIGHT_SIDES)):
        beside = next((n for n, (y, _, ahead) in enumerate(found) if not ahead and y <= OWN_LANE_M), 0)
        lines = [(y, k) for y, k, _ in found[beside:]]
        is_bounded = bool(lines) and lines[0][0] <= OWN_LANE_M
        sides.update({side: k for side, (_, k) in zip(names[not is_bounded :], lines, strict=False)})
    return sides


def counts(candidates: LinePoints, snapshot: Snapshot, k: int) -> bool:
    """Return whether some paint of a line within the window bounds a lane: no ghost, nothing overridden."""
    index = candidates.index[candidates.starts[k] : candidates.starts[k + 1]]
    marking = snapshot.scene.markings[int(candidates.marking[k])]
    painted = marking.painted if marking.valid is True else marking.painted & marking.valid
    return bool(painted[index].any())


def is_void(candidates: LinePoints, snapshot: Snapshot, k: int) -> bool:
    """Return whether a line has paint within the window, but none that counts, or is overridden abeam."""
    a, b = int(candidates.starts[k]), int(candidates.starts[k + 1])
    if _is_overridden(candidates, snapshot, k, _abeam(candidates, a, b)):
        return True
    marking = snapshot.scene.markings[int(candidates.marking[k])]
    return not counts(candidates, snapshot, k) and bool(marking.painted[candidates.index[a:b]].any())


def _abeam(candidates: LinePoints, a: int, b: int) -> int:
    """Return which of the points a to b - 1 of a line is the first beside the vehicle or ahead."""
    return min(a + int(candidates.points_ego_m[a:b, 0].searchsorted(0.0)), b - 1)


def _is_overridden(candidates: LinePoints, snapshot: Snapshot, k: int, point: int) -> bool:
    """Return whether a line does not count at one of its points."""
    marking = snapshot.scene.markings[int(candidates.marking[k])]
    return not isinstance(marking.valid, bool) and not marking.valid[candidates.index[point]]
