"""A map as reference: the painted lines beside the vehicle, wherever its pose in the log says that it is."""

from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vsensor.errors import LogError
from vsensor.field.foot import Polyline, feet, nearest_places
from vsensor.field.reference import Near, Poses, place_beside
from vsensor.types import Array, BoolArray, IntArray, Marking, Side
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map
from vsensor.world.opendrive.network import drivable
from vsensor.world.opendrive.road import RoadMap
from vsensor.world.route import DRIVABLE, CorridorConfig
from vsensor.world.truth import BESIDE_M, OWN_LANE_M

PAGE_M = 400.0
AHEAD_M = 150.0
BEHIND_M = 30.0
PAGES_KEPT = 32
ROUTE_STEP_M = 1.0
OFF_ROUTE_M = 20.0
FARTHEST_START_M = 10.0
"""From the middle of a lane; a vehicle that is farther off its first pose is not on a road."""
PAINT_BEHIND_M, PAINT_AHEAD_M = 5.0, 60.0
"""A line counts if some of it is painted there: gaps between dashes are up to 12 m."""

Lines = list[tuple[Polyline, Array, Array]]
"""Markings near a place, each with the number of painted points before each of its points, and their s."""


class MapReference:
    """Markings of a route over the map, found from the first pose on the straightest way ahead."""

    kind = "map"

    def __init__(self, path: Path, poses: Poses, log: str, route: tuple[str, ...] = ()) -> None:
        """Load the map and find the route; raises MapError, LogError if no pose is on a road."""
        self.poses = poses
        self._corridor = _corridor(load_map(path), poses, log, route)
        s = np.arange(0.0, self._corridor.lap_m + ROUTE_STEP_M, ROUTE_STEP_M)
        way = self._corridor.poses(s).position_world_m
        self._middle = middle = Polyline(
            x_m=way[:, 0],
            y_m=way[:, 1],
            gap=np.zeros(len(s) - 1, dtype=bool),
            lane=np.zeros(len(s), dtype=np.int64),
        )
        known = np.isfinite(poses.x_m)
        self._s_m = np.full(len(known), np.nan)
        x, y, yaw = poses.x_m[known], poses.y_m[known], poses.yaw_rad[known]
        self._s_m[known] = nearest_places(middle, x, y, yaw, OFF_ROUTE_M) * ROUTE_STEP_M
        off = int(np.count_nonzero(known & np.isnan(self._s_m)))
        self.notes: tuple[str, ...] = (f"{off} images off the route over {path.name}",) if off else ()
        self._pages: OrderedDict[int, Lines] = OrderedDict()

    def near(self, start: int, stop: int, side: Side) -> Iterator[Near]:
        """Yield the markings that are the side's line in some of the images."""
        s = self._s_m[start:stop]
        page = np.floor(np.nan_to_num(s, nan=-1.0) / PAGE_M).astype(np.int64)
        for number in np.unique(page[~np.isnan(s)]).tolist():
            images = start + np.flatnonzero((page == number) & ~np.isnan(s))
            yield from self._in_page(number, images, side)

    def _in_page(self, number: int, images: IntArray, side: Side) -> Iterator[Near]:
        lines = self._lines(number)
        if not lines:
            return
        x, y = self.poses.x_m[images], self.poses.y_m[images]
        offset = np.full((len(lines), len(images)), np.inf)
        place = np.full((len(lines), len(images)), np.nan)
        for k, (line, painted, s_m) in enumerate(lines):
            guess = np.interp(self._s_m[images], s_m, np.arange(len(s_m)), left=np.nan, right=np.nan)
            to_left, place[k] = place_beside(line, x, y, guess)
            there = _is_painted(line, painted, place[k])
            offset[k] = np.where(there, to_left, np.nan)
        chosen = _line_of(offset, side)
        for k in np.unique(chosen[chosen >= 0]).tolist():
            mine = chosen == k
            line = lines[k][0]
            lane = np.full(int(mine.sum()), line.lane[0])
            yield Near(images=images[mine], line=line, place=place[k][mine], lane=lane)

    def _lines(self, number: int) -> Lines:
        if number not in self._pages:
            low, high = number * PAGE_M - BEHIND_M, (number + 1) * PAGE_M + AHEAD_M
            markings = self._corridor.markings_window(max(low, 0.0), high)
            self._pages[number] = [self._line(m, max(low, 0.0)) for m in markings if m.painted.any()]
            while len(self._pages) > PAGES_KEPT:
                self._pages.popitem(last=False)
        return self._pages[number]

    def _line(self, marking: Marking, low_m: float) -> tuple[Polyline, Array, Array]:
        """Return a marking in driving direction, its paint, and the route's distance at its points."""
        x, y = marking.points_world_m[:, 0], marking.points_world_m[:, 1]
        keep = np.concatenate([[True], np.hypot(np.diff(x), np.diff(y)) > 1e-6])
        x, y, painted = x[keep], y[keep], marking.painted[keep]
        expected: Array = low_m + np.arange(len(x), dtype=np.float64) * self._corridor.spacing_m
        s_m = self._along(x, y, expected)
        if np.median(np.diff(s_m)) < 0.0:  # drawn against the driving direction
            x, y, painted, s_m = x[::-1], y[::-1], painted[::-1], s_m[::-1]
        line = Polyline(
            x_m=x,
            y_m=y,
            gap=np.zeros(len(x) - 1, dtype=bool),
            lane=np.full(len(x), marking.id, dtype=np.int64),
        )
        return line, np.concatenate([[0], np.cumsum(painted)]), np.maximum.accumulate(s_m)

    def _along(self, x_m: Array, y_m: Array, expected_m: Array) -> Array:
        """Return the route's distance at points (K,) near where it is expected; linear between known ones."""
        around = np.full(len(x_m), (PAGE_M + AHEAD_M + BEHIND_M) / ROUTE_STEP_M)
        place = feet(self._middle, x_m, y_m, (expected_m % self._corridor.lap_m) / ROUTE_STEP_M, around).place
        known = np.flatnonzero(~np.isnan(place))
        return np.interp(np.arange(len(place)), known, place[known]) * ROUTE_STEP_M


def _is_painted(line: Polyline, painted: Array, place: Array) -> BoolArray:
    last = len(painted) - 1
    at = np.nan_to_num(place)
    low = np.clip(at - PAINT_BEHIND_M / line.spacing_m, 0, last).astype(np.int64)
    high = np.clip(at + PAINT_AHEAD_M / line.spacing_m, 0, last).astype(np.int64)
    there: BoolArray = (painted[high] > painted[low]) & ~np.isnan(place)
    return there


def _line_of(offset: Array, side: Side) -> IntArray:
    """Return which line (of `offset` (L, M), left positive) is on a side of each image, -1 if none is.

    As `world.truth.true_sides`: the nearest within OWN_LANE_M bounds the own lane, the one after it the next.
    """
    sign = 1.0 if side in (Side.LEFT, Side.NEXT_LEFT) else -1.0
    away = np.where(sign * offset > 0.0, sign * offset, np.inf)
    order = np.argsort(away, axis=0)
    nearest = np.take_along_axis(away, order, axis=0)
    is_bounded = nearest[0] <= OWN_LANE_M
    if side in (Side.LEFT, Side.RIGHT):
        return np.where(is_bounded, order[0], -1)
    second = np.minimum(1, len(offset) - 1)
    row = np.where(is_bounded, second, 0)
    columns = np.arange(offset.shape[1])
    found = (nearest[row, columns] <= BESIDE_M) & (~is_bounded | (len(offset) > 1))
    return np.where(found, order[row, columns], -1)


def _corridor(road_map: RoadMap, poses: Poses, log: str, route: tuple[str, ...]) -> Corridor:
    """Return the route of a drive whose first pose is on some lane of the map."""
    known = np.flatnonzero(np.isfinite(poses.x_m))
    first = int(known[0])
    x, y, yaw = (float(v[first]) for v in (poses.x_m, poses.y_m, poses.yaw_rad))
    found = _lane_under(road_map, x, y, yaw)
    if found is None:
        raise LogError(f"{log}: the pose {x:.1f}, {y:.1f} is on no lane of {road_map.path}")
    road, lane, s_m = found
    return Corridor(road_map, CorridorConfig(road=road, lane=lane, s_m=s_m, route=route))


def _lane_under(road_map: RoadMap, x_m: float, y_m: float, yaw_rad: float) -> tuple[str, int, float] | None:
    """Return road, lane and s of the driven lane's middle that is nearest to a pose and leads its way."""
    best, found = FARTHEST_START_M, None
    for kind in sorted(DRIVABLE):
        for place in drivable(road_map, kind):
            road = road_map.roads[place.road_id]
            section = road.sections[place.section]
            s = np.linspace(section.start_m, section.end_m, max(int(section.end_m - section.start_m), 2))
            points = road.point(s, section.centre(s, place.lane_id)[0])
            apart = np.hypot(points[:, 0] - x_m, points[:, 1] - y_m)
            turned = road.heading(s) + (np.pi if place.direction < 0 else 0.0) - yaw_rad
            apart[np.cos(turned) < np.cos(np.pi / 4)] = np.inf
            k = int(apart.argmin())
            if apart[k] < best:
                best, found = float(apart[k]), (place.road_id, place.lane_id, float(s[k]))
    return found
