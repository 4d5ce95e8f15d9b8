"""What faults do to the lines of an image: lost, seen where there is none, taken for another kind."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vsensor.faults.fault import Fault
from vsensor.types import Boundary, Colour, LaneEstimate, MarkingKind, Side, frozen

GHOST_RANGE_M = (0.0, 50.0)
GHOST_QUALITY = 3
GHOST_WIDTH_M = 0.15
ORDER = 3


def spoiled_lines(faults: Sequence[Fault], estimate: LaneEstimate) -> LaneEstimate:
    """Return the estimate after the faults of lines, in their order.

    What follows from the lines (lane offsets, width, quality, "not available") follows from these.
    """
    for fault in faults:
        lines = _spoiled(fault, estimate.boundaries)
        kept = {line.side for line in lines}
        lost = (*estimate.lost, *(line.side for line in estimate.boundaries if line.side not in kept))
        estimate = replace(estimate, boundaries=lines, lost=lost)
    return estimate


def _spoiled(fault: Fault, lines: tuple[Boundary, ...]) -> tuple[Boundary, ...]:
    config, others = fault.config, tuple(line for line in lines if line.side not in fault.sides)
    if config.kind == "line_lost":
        return others
    if config.kind == "ghost_line":
        ghosts = (_ghost(fault, side) for side in fault.sides)
        return tuple(sorted((*others, *ghosts), key=lambda line: line.side))
    return tuple(_retyped(fault, line) if line.side in fault.sides else line for line in lines)


def _retyped(fault: Fault, line: Boundary) -> Boundary:
    return replace(line, kind=_kind(fault, line.kind), colour=_colour(fault, line.colour))


def _ghost(fault: Fault, side: Side) -> Boundary:
    """Return a straight line along the vehicle that belongs to no marking: a tar seam, a shadow."""
    start_m, end_m = GHOST_RANGE_M
    return Boundary(
        side=side,
        coefficients=frozen([fault.config.offset_m or 0.0, *(0.0,) * ORDER]),
        covariance=frozen(np.zeros((ORDER + 1, ORDER + 1))),
        x_min_m=start_m,
        x_max_m=end_m,
        quality=GHOST_QUALITY,
        kind=_kind(fault, MarkingKind.SOLID),
        colour=_colour(fault, Colour.WHITE),
        width_m=GHOST_WIDTH_M,
        measured=True,
        marking=-1,
        points=-1,
    )


def _kind(fault: Fault, otherwise: MarkingKind) -> MarkingKind:
    name = fault.config.marking
    return otherwise if name is None else MarkingKind[name.upper()]


def _colour(fault: Fault, otherwise: Colour) -> Colour:
    name = fault.config.colour
    return otherwise if name is None else Colour[name.upper()]
