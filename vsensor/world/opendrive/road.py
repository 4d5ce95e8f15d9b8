"""One road and the map of all: points in the world from (s, t, h), evaluated only where asked."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vsensor.errors import MapError
from vsensor.types import Array, Swell
from vsensor.world.opendrive import taylor
from vsensor.world.opendrive.extras import PaintedArea, PaintedLine
from vsensor.world.opendrive.lanes import Section
from vsensor.world.opendrive.planview import PlanView
from vsensor.world.opendrive.polynomial import Cubics
from vsensor.world.opendrive.surface import Cross, CrossSeries, Shape, cross, cross_series


@dataclass(frozen=True, slots=True)
class RoadLink:
    """What follows an end of a road: a road at its `contact` ("start" or "end"), or a junction."""

    is_junction: bool
    id: str
    contact: str


@dataclass(frozen=True, slots=True)
class Connection:
    """One way through a junction; `contact` is the end of `connecting` that touches `incoming`.

    `direct`: `connecting` is no road inside the junction but the road beyond it, and the way is
    open in both directions. `lanes` maps incoming lane ids to connecting ones, empty = not stated.
    """

    incoming: str
    connecting: str
    contact: str
    lanes: tuple[tuple[int, int], ...]
    direct: bool


@dataclass(frozen=True, slots=True)
class Road:
    """One road. s in [0, length_m] along the reference line, t to its left, h up from the surface.

    `lines` are painted ones that are no lane's border, `ground` is paint that is no line, `swells` (over s)
    make it uneven.
    """

    id: str
    length_m: float
    junction: str
    left_hand_traffic: bool
    plan: PlanView
    elevation: Cubics
    superelevation: Cubics
    shape: Shape | None
    sections: tuple[Section, ...]
    predecessor: RoadLink | None
    successor: RoadLink | None
    lines: tuple[PaintedLine, ...] = ()
    ground: tuple[PaintedArea, ...] = ()
    swells: tuple[Swell, ...] = ()

    def cross(self, s_m: Array) -> Cross:
        """Return the road's frame and its derivatives at s (N,)."""
        tilt = None if self.superelevation.is_zero else self.superelevation.at(s_m)
        return cross(self.plan.at(s_m), self.elevation.at(s_m), tilt)

    def series(self, s_m: Array) -> CrossSeries:
        """Return the road's frame at s (N,) as Taylor series along s."""
        tilt = None if self.superelevation.is_zero else taylor.of_cubics(self.superelevation, s_m)
        elevation = taylor.of_cubics(self.elevation, s_m)
        return cross_series(self.plan.series(s_m), elevation, tilt, upwards=self.shape is not None)

    def point(self, s_m: Array, t_m: Array | float, h_m: Array | float = 0.0) -> Array:
        """Return world points (N, 3) at s, t, h (N,)."""
        s = np.atleast_1d(np.asarray(s_m, dtype=np.float64))
        frame = self.cross(s)
        t = np.broadcast_to(np.asarray(t_m, dtype=np.float64), s.shape)
        height = h_m + self.height(s, t)
        return np.ascontiguousarray((frame.line + t * frame.e_t + height * frame.e_h).T)

    def height(self, s_m: Array, t_m: Array) -> Array | float:
        """Return the shape's height above the tilted plane, 0.0 for a road without shape."""
        return 0.0 if self.shape is None else self.shape.height(s_m, t_m)

    def heading(self, s_m: Array) -> Array:
        """Return the reference line's heading (N,) in rad, not wrapped."""
        return self.plan.at(np.atleast_1d(np.asarray(s_m, dtype=np.float64)))[2]

    def curvature(self, s_m: Array) -> Array:
        """Return the reference line's curvature (N,) in the plane, left positive."""
        return self.plan.at(np.atleast_1d(np.asarray(s_m, dtype=np.float64)))[3]

    def link(self, direction: int) -> RoadLink | None:
        """Return what follows along s (+1) or against it (-1)."""
        return self.successor if direction > 0 else self.predecessor

    def direction(self, lane_id: int, *, reversed_lane: bool = False) -> int:
        """Return +1 if traffic on the lane drives along s, -1 if against it."""
        along = (lane_id < 0) != self.left_hand_traffic
        return 1 if along != reversed_lane else -1


@dataclass(frozen=True, slots=True)
class RoadMap:
    """A map file. `has_swells`: whether any road is uneven.

    `warnings` are the findings it survived, one line each, with file and line.
    """

    path: Path
    roads: Mapping[str, Road]
    connections: Mapping[str, tuple[Connection, ...]]
    has_swells: bool = False
    warnings: tuple[str, ...] = field(default=())

    def road(self, road_id: str | int) -> Road:
        """Return a road; raises MapError naming those that exist."""
        found = self.roads.get(str(road_id))
        if found is None:
            known = ", ".join(list(self.roads)[:20]) + (", ..." if len(self.roads) > 20 else "")
            raise MapError(f"{self.path}: road {road_id} not in map; roads: {known}")
        return found
