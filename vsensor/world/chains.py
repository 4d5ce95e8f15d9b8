"""Which border goes on as which: the same line painted over sections and roads keeps one group.

Within a section a border keeps its group. Over a joint it is matched by where it lies: the end within
0.2 m of the next start, nearest first, never crossing; the driven lane's own borders go first, so
that the lane's links decide.
"""

from collections.abc import Mapping

import numpy as np

from vsensor.types import Array
from vsensor.world.borders import kind_at_end
from vsensor.world.lane_piece import LanePiece

SAME_LINE_M = 0.2
OTHER_LOOK_M = 0.01
"""Of two borders that start at one point (a lane that opens from width 0), the one that looks the same."""

PROBES = 5


class Chains:
    """Hands out groups to the borders of piece after piece; `lateral_m` limits how far aside they lie.

    `known` are the groups that borders of the first piece's lanes had on another way over the same road,
    `first_group` the first one for the others.
    """

    def __init__(
        self, lateral_m: float, known: Mapping[int, int] | None = None, first_group: int = 0
    ) -> None:
        self._lateral_m = lateral_m
        self._known = dict(known or {})
        self._next_group = first_group
        self._last: tuple[LanePiece, tuple[int, ...], tuple[int, ...]] | None = None
        self._last_extra: dict[tuple[str, int], int] = {}

    def extend(self, piece: LanePiece) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the lane ids that own the borders in reach, left to right, and their groups."""
        lane_ids = _in_reach(piece, self._lateral_m)
        groups = self._matched(piece, lane_ids)
        for i in lane_ids:
            if i not in groups:
                groups[i] = self._next_group
                self._next_group += 1
        ordered = tuple(groups[i] for i in lane_ids)
        self._last = (piece, lane_ids, ordered)
        return lane_ids, ordered

    def extend_extra(self, piece: LanePiece) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the road's lines beside its borders that reach into the piece (their places), and groups."""
        low, high = sorted((piece.s_from_m, piece.s_to_m))
        lines = piece.road.lines
        found = tuple(i for i, line in enumerate(lines) if line.from_m < high and line.to_m > low)
        groups = {}
        for i in found:
            key = (piece.road.id, i)
            if key not in self._last_extra:
                self._last_extra[key] = self._next_group
                self._next_group += 1
            groups[key] = self._last_extra[key]
        self._last_extra = groups
        return found, tuple(groups.values())

    def _matched(self, piece: LanePiece, lane_ids: tuple[int, ...]) -> dict[int, int]:
        if self._last is None:
            return {i: self._known[i] for i in lane_ids if i in self._known}
        before, ids, groups = self._last
        if before.place == piece.place and before.s_to_m == piece.s_from_m:
            pairs = [(i, i) for i in ids if i in lane_ids]
        else:
            pairs = _pairs(before, ids, piece, lane_ids)
        by_id = dict(zip(ids, groups, strict=True))
        return {after: by_id[i] for i, after in pairs}


def _in_reach(piece: LanePiece, lateral_m: float) -> tuple[int, ...]:
    s = np.linspace(piece.s_from_m, piece.s_to_m, PROBES)
    middle, _, _ = piece.section.centre(s, piece.place.lane_id)
    ids = piece.ids_left_to_right()
    t, _ = piece.section.borders(s, ids)
    own = piece.own_borders()
    return tuple(i for i in ids if i in own or np.abs(t[i] - middle).min() <= lateral_m)


def _pairs(
    before: LanePiece, ids: tuple[int, ...], after: LanePiece, next_ids: tuple[int, ...]
) -> list[tuple[int, int]]:
    """Return (lane id before, lane id after) of borders that go on."""
    apart = np.linalg.norm(
        _ends(before, ids, leaving=True)[:, None] - _ends(after, next_ids, leaving=False)[None, :], axis=2
    )
    own = {(a, b) for a, b in zip(before.own_borders(), after.own_borders(), strict=True)}
    looks = [kind_at_end(before, i, leaving=True) for i in ids]
    next_looks = [kind_at_end(after, i, leaving=False) for i in next_ids]
    ranked = []
    for i, j in zip(*np.nonzero(apart < SAME_LINE_M), strict=True):
        cost = float(apart[i, j]) + (OTHER_LOOK_M if looks[i] != next_looks[j] else 0.0)
        ranked.append(((ids[i], next_ids[j]) not in own, cost, int(i), int(j)))
    kept: list[tuple[int, int]] = []
    for _, _, i, j in sorted(ranked):
        if all((i - a) * (j - b) > 0 for a, b in kept):
            kept.append((i, j))
    return [(ids[i], next_ids[j]) for i, j in kept]


def _ends(piece: LanePiece, lane_ids: tuple[int, ...], *, leaving: bool) -> Array:
    """Return the world points (B, 3) of the borders where the drive leaves or enters the piece."""
    s = np.full(len(lane_ids), piece.s_to_m if leaving else piece.s_from_m)
    t, _ = piece.section.borders(s[:1], lane_ids)
    return piece.road.point(s, np.array([t[i][0] for i in lane_ids]))
