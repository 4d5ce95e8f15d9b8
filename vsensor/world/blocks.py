"""The route as a growing row of blocks: one piece of lane each, at its place along the route."""

import math
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from vsensor.types import Array, IntArray
from vsensor.world.chains import Chains
from vsensor.world.lane_piece import LanePiece
from vsensor.world.lane_table import LaneTable
from vsensor.world.route import Route

TABLES_KEPT = 64

K = TypeVar("K")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Block:
    """A piece that the drive enters at the route distance `start_m`.

    `lane_ids` own the borders in reach, from left to right; `groups` are their chains. `extra` are the
    places of the road's other lines that reach into it, with the chains `extra_groups`.
    """

    piece: LanePiece
    start_m: float
    lane_ids: tuple[int, ...]
    groups: tuple[int, ...]
    extra: tuple[int, ...] = ()
    extra_groups: tuple[int, ...] = ()

    def sigma(self, s_m: float) -> Array:
        """Return the distance from the piece's start, (1,)."""
        return np.array([s_m - self.start_m])

    def own_groups(self) -> tuple[int, int]:
        """Return the groups of the driven lane's left and right border."""
        by_lane = dict(zip(self.lane_ids, self.groups, strict=True))
        left, right = self.piece.own_borders()
        return by_lane[left], by_lane[right]


class Blocks:
    """Takes piece after piece from the route as far as it is asked; a block costs some 200 bytes."""

    def __init__(self, route: Route, chains: Chains) -> None:
        self.route = route
        self._chains = chains
        self._row: list[Block] = []
        self.edges_m: list[float] = [0.0]
        self._tables: OrderedDict[int, LaneTable] = OrderedDict()

    def __getitem__(self, number: int) -> Block:
        return self._row[number]

    def __len__(self) -> int:
        return len(self._row)

    @property
    def end_m(self) -> float:
        """Where the last block so far ends."""
        return self.edges_m[-1]

    def extend(self) -> bool:
        """Take the next piece; False at the end of the route."""
        piece = self.route.advance()
        if piece is None:
            return False
        borders, extra = self._chains.extend(piece), self._chains.extend_extra(piece)
        self._row.append(Block(piece, self.end_m, *borders, *extra))
        self.edges_m.append(self.end_m + piece.length_m)
        return True

    def reach(self, s_m: float) -> bool:
        """Take pieces until the distance is reached; False if the route ends before."""
        while self.end_m < s_m:
            if not self.extend():
                return False
        return True

    def numbers_at(self, s_m: Array) -> IntArray:
        """Return the block (N,) of each distance, the nearest beyond the ends; ValueError if not finite."""
        if not np.isfinite(s_m).all():
            raise ValueError("a distance along the corridor is not finite")
        self.reach(float(s_m.max(initial=0.0)) + 1e-9)
        last = len(self._row) - 1
        return np.array([min(max(bisect_right(self.edges_m, s) - 1, 0), last) for s in s_m], dtype=np.int64)

    def at(self, s_m: float) -> Block:
        """Return the block of one distance."""
        if not math.isfinite(s_m):
            raise ValueError("a distance along the corridor is not finite")
        self.reach(s_m + 1e-9)
        return self._row[min(max(bisect_right(self.edges_m, s_m) - 1, 0), len(self._row) - 1)]

    def between(self, start_m: float, end_m: float) -> Iterator[int]:
        """Yield the blocks taken so far that lie between two distances, at least in part."""
        for number in range(max(0, bisect_right(self.edges_m, start_m) - 1), len(self._row)):
            if self.edges_m[number] >= end_m:
                return
            yield number

    def stations(self, number: int, spacing_m: float) -> tuple[int, int]:
        """Return the first station of a block and the first one behind it."""
        return math.ceil(self.edges_m[number] / spacing_m), math.ceil(self.edges_m[number + 1] / spacing_m)

    def table(self, piece: LanePiece) -> LaneTable:
        """Return the piece's table of poses; the most recent ones are kept."""
        return cached(self._tables, id(piece), TABLES_KEPT, lambda: LaneTable.of(piece))

    def has_table(self, piece: LanePiece) -> bool:
        """Return whether the table is there already."""
        return id(piece) in self._tables


def cached(cache: OrderedDict[K, T], key: K, most: int, make: Callable[[], T]) -> T:
    """Return the cached value, else make it and let the least recent go."""
    if key in cache:
        cache.move_to_end(key)
        return cache[key]
    value = cache[key] = make()
    while len(cache) > most:
        cache.popitem(last=False)
    return value
