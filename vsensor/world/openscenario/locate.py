"""The road that a point of the world is on: all reference lines sampled once, the nearest refined."""

from functools import cached_property

import numpy as np

from vsensor.types import Array
from vsensor.world.opendrive.road import RoadMap

SAMPLE_M = 4.0
CANDIDATES = 24
FARTHEST_M = 60.0
"""A point farther from every reference line is on no road."""

LEVEL_M = 3.0
"""A road so far above or below a point counts as farther away: bridges."""


class Locator:
    """Finds the nearest road of points; samples the map when first asked."""

    def __init__(self, road_map: RoadMap) -> None:
        self._map = road_map

    @cached_property
    def _samples(self) -> tuple[list[str], Array, Array, Array]:
        """Return road ids, and per sample the road's place in them, s, and x, y (2, N)."""
        ids = list(self._map.roads)
        number, s, points = [], [], []
        for k, road in enumerate(self._map.roads.values()):
            along = np.linspace(0.0, road.length_m, max(2, int(road.length_m / SAMPLE_M) + 2))
            x, y, _, _ = road.plan.at(along)
            number.append(np.full(len(along), float(k)))
            s.append(along)
            points.append(np.array([x, y]))
        return ids, np.concatenate(number), np.concatenate(s), np.concatenate(points, axis=1)

    def nearest(self, x_m: float, y_m: float, z_m: float | None) -> tuple[str, float, float] | None:
        """Return road, s, t of a point; of several roads the one whose lanes it lies on, else the nearest."""
        ids, number, s, points = self._samples
        apart = np.hypot(points[0] - x_m, points[1] - y_m)
        best: tuple[float, str, float, float] | None = None
        seen: set[str] = set()
        for k in np.argsort(apart, kind="stable").tolist():
            road_id = ids[int(number[k])]
            if apart[k] > FARTHEST_M or len(seen) >= CANDIDATES:
                break
            if road_id in seen:
                continue
            seen.add(road_id)
            found = self._refined(road_id, float(s[k]), x_m, y_m)
            cost = self._outside(road_id, *found, z_m)
            if best is None or cost < best[0] - 1e-9:
                best = (cost, road_id, *found)
        return None if best is None else best[1:]

    def _refined(self, road_id: str, s_m: float, x_m: float, y_m: float) -> tuple[float, float]:
        """Return s, t of the foot on the reference line near `s_m` (Newton, clipped to the road)."""
        road = self._map.roads[road_id]
        t_m = 0.0
        for _ in range(12):
            x, y, heading, curvature = (float(a[0]) for a in road.plan.at(np.array([s_m])))
            c, n = np.cos(heading), np.sin(heading)
            along, t_m = (x_m - x) * c + (y_m - y) * n, (y_m - y) * c - (x_m - x) * n
            after = min(max(s_m + along / max(1.0 - curvature * t_m, 0.2), 0.0), road.length_m)
            if abs(after - s_m) < 1e-9:
                break
            s_m = after
        return s_m, float(t_m)

    def _outside(self, road_id: str, s_m: float, t_m: float, z_m: float | None) -> float:
        """Return how far outside the lanes a place is, and a bit for its distance from the line."""
        road = self._map.roads[road_id]
        section = road.sections[max(0, sum(one.start_m <= s_m for one in road.sections) - 1)]
        borders, _ = section.borders(np.array([s_m]), section.ids)
        ts = [float(t[0]) for t in borders.values()]
        outside = max(min(ts) - t_m, t_m - max(ts), 0.0)
        at_end = 0.0 < s_m < road.length_m
        cost = outside + 1e-3 * abs(t_m) + (0.0 if at_end else 1e-2)
        if z_m is not None:
            height = abs(float(road.point(np.array([s_m]), np.array([t_m]))[0, 2]) - z_m)
            cost += height if height > LEVEL_M else 0.0
        return cost
