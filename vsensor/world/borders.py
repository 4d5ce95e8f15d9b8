"""The borders of a stretch of road at its stations: points, paint, kind, colour, width of each stripe."""

from dataclasses import dataclass

import numpy as np

from vsensor.types import Array, BoolArray, CodeArray, Colour, MarkingKind, Stripe
from vsensor.world.lane_piece import LanePiece
from vsensor.world.opendrive.extras import PaintedLine
from vsensor.world.opendrive.marks import STANDARD_WIDTH_M, RoadMark, marks_between
from vsensor.world.opendrive.surface import Cross


@dataclass(frozen=True, slots=True)
class StripeLine:
    """One stripe at the stations: centre (N, 3), paint (N,), width (N,)."""

    points_world_m: Array
    painted: BoolArray
    width_m: Array


@dataclass(frozen=True, slots=True)
class BorderLine:
    """One border at the stations; a single one has one stripe, used as left and right alike.

    `contrast`, `wear`, `valid` (N,) as in Marking, None where all paint is new and counts.
    """

    kind: CodeArray
    colour: CodeArray
    stripes: tuple[StripeLine, ...]
    contrast: Array | None = None
    wear: Array | None = None
    valid: BoolArray | None = None

    @property
    def is_double(self) -> bool:
        """Whether there are two stripes anywhere on it."""
        return len(self.stripes) == 2

    def stripe(self, which: Stripe) -> StripeLine:
        """Return the left or the right stripe (of a single border its only one)."""
        return self.stripes[-1] if which is Stripe.RIGHT else self.stripes[0]


def border_lines(
    piece: LanePiece, s_m: Array, cross: Cross, lane_ids: tuple[int, ...]
) -> tuple[BorderLine, ...]:
    """Return the outer borders of these lanes at the stations s (N,), seen in the piece's direction."""
    t, _ = piece.section.borders(s_m, lane_ids)
    return tuple(
        _border(piece, _present(piece.section.lanes[i].marks, s_m), s_m, t[i], cross) for i in lane_ids
    )


def extra_line(piece: LanePiece, line: PaintedLine, s_m: Array, cross: Cross) -> BorderLine:
    """Return a line that is no lane's border at stations s (N,) between its ends."""
    return _border(piece, _present(line.marks, s_m), s_m, line.t.at(s_m)[0], cross)


def _border(
    piece: LanePiece, marks: list[tuple[slice, RoadMark]], s_m: Array, t_m: Array, cross: Cross
) -> BorderLine:
    n, direction = len(s_m), piece.place.direction
    count = 2 if any(len(mark.stripes) == 2 for _, mark in marks) else 1
    kind, colour = np.zeros(n, np.uint8), np.zeros(n, np.uint8)
    offset, painted = np.zeros((count, n)), np.zeros((count, n), np.bool_)
    width = np.full((count, n), STANDARD_WIDTH_M)
    for where, mark in marks:
        kind[where], colour[where] = _kind(mark, direction), mark.colour
        stripes = mark.stripes[::direction]
        for row in range(count if stripes else 0):
            stripe = stripes[min(row, len(stripes) - 1)]
            offset[row, where], width[row, where] = stripe.t_offset_m, stripe.width_m
            painted[row, where] = stripe.painted(s_m[where])
    lines = []
    for row in range(count):
        points = _points(piece, s_m, t_m + offset[row] if offset[row].any() else t_m, cross)
        lines.append(StripeLine(points, painted[row], width[row]))
    return BorderLine(kind, colour, tuple(lines), *_condition(marks, s_m))


def _condition(
    marks: list[tuple[slice, RoadMark]], s_m: Array
) -> tuple[Array | None, Array | None, BoolArray | None]:
    """Return contrast, wear, and whether the paint counts, (N,) each, None for what is so all along."""
    contrast, wear, valid = np.ones(len(s_m)), np.zeros(len(s_m)), np.ones(len(s_m), np.bool_)
    for where, mark in marks:
        if mark.contrast is not None:
            contrast[where] = np.clip(mark.contrast.at(s_m[where])[0], 0.0, 1.0)
        if mark.wear is not None:
            wear[where] = np.clip(mark.wear.at(s_m[where])[0], 0.0, 1.0)
        valid[where] = mark.valid
    return (
        contrast if any(mark.contrast is not None for _, mark in marks) else None,
        wear if any(mark.wear is not None for _, mark in marks) else None,
        None if valid.all() else valid,
    )


def _present(marks: tuple[RoadMark, ...], s_m: Array) -> list[tuple[slice, RoadMark]]:
    """Return (stations, mark) for each mark that lies at any of the stations; s runs one way."""
    if not len(s_m):
        return []
    low, high = min(s_m[0], s_m[-1]), max(s_m[0], s_m[-1])
    found = []
    for start, end, mark in marks_between(marks, low, high + 1e-9):
        inside = np.flatnonzero((s_m >= start) & (s_m < end))
        if len(inside):
            found.append((slice(int(inside[0]), int(inside[-1]) + 1), mark))
    return found


def _kind(mark: RoadMark, direction: int) -> MarkingKind:
    return mark.kind if direction > 0 else mark.mirrored_kind


def _points(piece: LanePiece, s_m: Array, t_m: Array, cross: Cross) -> Array:
    points = cross.line + t_m * cross.e_t
    if piece.road.shape is not None:
        points = points + piece.road.height(s_m, t_m) * cross.e_h
    return np.ascontiguousarray(points.T)


def kind_at_end(piece: LanePiece, lane_id: int, *, leaving: bool) -> tuple[MarkingKind, Colour]:
    """Return kind and colour of a border where the drive leaves or enters the piece."""
    s = piece.s_to_m if leaving else piece.s_from_m
    s += piece.place.direction * (-1e-6 if leaving else 1e-6)
    mark = marks_between(piece.section.lanes[lane_id].marks, s, s + 1e-9)[-1][2]
    return _kind(mark, piece.place.direction), mark.colour
