"""What lies on the driven road beside its lines: painted areas in the world, swells along the route."""

from collections import OrderedDict
from collections.abc import Iterator
from functools import partial

import numpy as np

from vsensor.types import GroundPaint, Swell, frozen
from vsensor.world.blocks import Block, Blocks, cached
from vsensor.world.lane_piece import LanePiece
from vsensor.world.opendrive.extras import PaintedArea
from vsensor.world.opendrive.road import Road

BLOCKS_KEPT = 16
EDGE_M = 0.25
"""Edges of painted areas follow the road in steps of this."""


class SurfaceExtras:
    """Areas and swells, block by block; those of the blocks asked last are kept."""

    def __init__(self, blocks: Blocks) -> None:
        self._blocks = blocks
        self._areas: OrderedDict[int, tuple[GroundPaint, ...]] = OrderedDict()
        self._swells: OrderedDict[int, tuple[Swell, ...]] = OrderedDict()

    def ground(self, from_m: float, to_m: float) -> tuple[GroundPaint, ...]:
        """Return the painted areas of the blocks between two distances."""
        found: list[GroundPaint] = []
        for number, block in self._between(from_m, to_m):
            if block.piece.road.ground:
                areas = cached(self._areas, number, BLOCKS_KEPT, partial(_areas, block.piece))
                found += areas
        return tuple(found)

    def swells(self, from_m: float, to_m: float) -> tuple[Swell, ...]:
        """Return the swells that lie between two distances, at least in part, along the route."""
        found: list[Swell] = []
        for number, block in self._between(from_m, to_m):
            if block.piece.road.swells:
                swells = cached(self._swells, number, BLOCKS_KEPT, partial(_swells, block))
                found += swells
        return tuple(swell for swell in found if swell.from_m < to_m and swell.to_m > from_m)

    def _between(self, from_m: float, to_m: float) -> Iterator[tuple[int, Block]]:
        self._blocks.reach(to_m)
        return ((number, self._blocks[number]) for number in self._blocks.between(from_m, to_m))


def _areas(piece: LanePiece) -> tuple[GroundPaint, ...]:
    """Return the areas whose middle lies in the piece."""
    low, high = sorted((piece.s_from_m, piece.s_to_m))
    return tuple(
        _area(piece.road, area)
        for area in piece.road.ground
        if low <= float(area.corners[:, 0].mean()) < high or float(area.corners[:, 0].mean()) == high
    )


def _area(road: Road, area: PaintedArea) -> GroundPaint:
    """Return an area in the world, its edges subdivided so that they follow the road."""
    corners = area.corners
    parts = []
    for here, there in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(np.hypot(*(there - here)) / EDGE_M)))
        parts.append(here + np.arange(count)[:, None] / count * (there - here))
    s, t = np.concatenate(parts).T
    return GroundPaint(
        points_world_m=frozen(road.point(np.clip(s, 0.0, road.length_m), t)),
        colour=area.colour,
        contrast=area.contrast,
        wear=area.wear,
    )


def _swells(block: Block) -> tuple[Swell, ...]:
    """Return the road's swells along the route, cut to the block: waves are as long as the lane is there."""
    piece, found = block.piece, []
    low, high = sorted((piece.s_from_m, piece.s_to_m))
    for swell in piece.road.swells:
        ends = np.array([max(swell.from_m, low), min(swell.to_m, high)])
        if ends[1] <= ends[0]:
            continue
        first, last = ends[:: piece.place.direction].tolist()
        start_m, end_m = (block.start_m + piece.sigma_at(ends[:: piece.place.direction])).tolist()
        stretch = (last - first) / (end_m - start_m)
        phase = np.exp(1j * swell.wave_radpm * (first - swell.from_m))
        found.append(
            Swell(
                from_m=start_m,
                to_m=end_m,
                wave_radpm=frozen(swell.wave_radpm * stretch),
                amplitude_m=frozen(swell.amplitude_m * phase, np.complex128),
            )
        )
    return tuple(found)
