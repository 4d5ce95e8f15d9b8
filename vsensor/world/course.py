"""The exact curves of the markings along a route: where they run, how they turn, at any place.

A marking's points are exact; between them, and for directions and curvatures, the map's own formulas are
asked here, at the few places where somebody wants to know. Nothing is computed before.
"""

import numpy as np

from vsensor.types import Array, BoolArray, IntArray, Stripe
from vsensor.world.blocks import Block, Blocks
from vsensor.world.opendrive import taylor
from vsensor.world.opendrive.extras import PaintedLine
from vsensor.world.opendrive.marks import RoadMark, marks_between


class RouteCurve:
    """The curves of all markings of a route; see `types.Curve`. Its stations are `spacing_m` apart."""

    def __init__(self, blocks: Blocks, spacing_m: float) -> None:
        self._blocks = blocks
        self._spacing_m = spacing_m

    def series(self, ids: IntArray, stations: Array) -> Array:
        """Return the series (TERMS, 3, N) of the world points of markings at stations; NaN where none is."""
        out = np.full((taylor.TERMS, 3, len(ids)), np.nan)
        route_m = stations * self._spacing_m
        known = (route_m >= 0.0) & np.isfinite(route_m)
        if not known.any():
            return out
        places = known.nonzero()[0]
        numbers = self._blocks.numbers_at(route_m[places])
        for number in np.unique(numbers):
            mine = places[numbers == number]
            out[:, :, mine] = _in_block(self._blocks[int(number)], ids[mine], route_m[mine])
        return out


def _in_block(block: Block, ids: IntArray, route_m: Array) -> Array:
    piece = block.piece
    s = piece.s_at(route_m - block.start_m)
    frame = piece.road.series(s)
    t = np.full((taylor.TERMS, len(ids)), np.nan)
    numbers: list[int] = np.unique(ids).tolist()
    lanes = dict(zip(block.groups, block.lane_ids, strict=True))
    wanted = [lanes[n // len(Stripe)] for n in numbers if n // len(Stripe) in lanes]
    borders = piece.section.border_series(s, wanted)
    for number in numbers:
        group, stripe = divmod(number, len(Stripe))
        mine = ids == number
        if group in lanes:
            t[:, mine], marks = borders[lanes[group]][:, mine], piece.section.lanes[lanes[group]].marks
        elif group in block.extra_groups:
            line = piece.road.lines[block.extra[block.extra_groups.index(group)]]
            t[:, mine], marks = _extra_series(line, s[mine]), line.marks
        else:
            continue
        t[0, mine] += _stripe_offsets(marks, Stripe(stripe), s[mine], piece.place.direction)
    point = frame.line + _times(t, frame.e_t)
    if piece.road.shape is not None and frame.e_h is not None:
        point += _times(piece.road.shape.series(s, t), frame.e_h)
    point[1::2] *= piece.place.direction  # the parameter runs as the drive does
    return point


def _times(factor: Array, vectors: Array) -> Array:
    """Return the series of factor times vectors (TERMS, 3, N)."""
    return taylor.product(factor[:, None], vectors)


def _extra_series(line: PaintedLine, s_m: Array) -> Array:
    """Return the series of t of a line beside the borders; beyond its ends t stays."""
    inside = np.clip(s_m, line.from_m, line.to_m)
    t = taylor.of_cubics(line.t, inside)
    t[1:, inside != s_m] = 0.0
    return t


def _stripe_offsets(marks: tuple[RoadMark, ...], stripe: Stripe, s_m: Array, direction: int) -> Array:
    """Return how far left of its border (N,) a stripe lies, as `borders` lays it."""
    offset = np.zeros(len(s_m))
    for start, end, mark in marks_between(marks, float(s_m.min()), float(s_m.max()) + 1e-9):
        here: BoolArray = (s_m >= start) & (s_m < end)
        if mark.stripes and here.any():
            stripes = mark.stripes[::direction]
            offset[here] = stripes[-1 if stripe is Stripe.RIGHT else 0].t_offset_m
    return offset
