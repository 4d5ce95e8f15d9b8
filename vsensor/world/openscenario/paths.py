"""Trajectories in the world: a smooth curve through vertices, or a clothoid, by distance along it.

Between vertices the curve is the monotone cubic in x, y, z over the vertices' distance: no heading jumps
at a vertex, since no vehicle turns on the spot, and it overshoots nowhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from vsensor.types import Array

NODE_M = 0.2
MOST_NODES = 200_000
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Path:
    """A curve by nodes: distance along it, position (3, N), heading, curvature (N,); times or None."""

    way_m: Array
    points_m: Array
    heading_rad: Array
    curvature_per_m: Array
    times_s: tuple[Array, Array] | None = None

    @property
    def length_m(self) -> float:
        """Length of the path."""
        return float(self.way_m[-1])

    def at(self, way_m: float) -> tuple[Point, float, float]:
        """Return position, heading, curvature at a distance, straight on beyond the ends."""
        k = int(np.clip(self.way_m.searchsorted(way_m, side="right") - 1, 0, len(self.way_m) - 2))
        h = float(self.way_m[k + 1] - self.way_m[k])
        x = min(max((way_m - float(self.way_m[k])) / h, 0.0), 1.0)
        over = way_m - float(self.way_m[k]) - x * h
        headings = self.heading_rad[k : k + 2]
        tangents = np.array([np.cos(headings), np.sin(headings)]) * h
        p, q = self.points_m[:2, k], self.points_m[:2, k + 1]
        rise = q - p
        a, b = tangents[:, 0] - rise, rise - tangents[:, 1]
        xy = p + x * rise + x * (1 - x) * ((1 - x) * a + x * b)
        heading = float(headings[0] + x * (headings[1] - headings[0]))
        z = float(self.points_m[2, k] + x * (self.points_m[2, k + 1] - self.points_m[2, k]))
        curvature = float(
            self.curvature_per_m[k] + x * (self.curvature_per_m[k + 1] - self.curvature_per_m[k])
        )
        xy = xy + over * np.array([np.cos(heading), np.sin(heading)])
        return (float(xy[0]), float(xy[1]), z), heading, curvature

    @cached_property
    def _timing(self) -> PchipInterpolator:
        assert self.times_s is not None
        return PchipInterpolator(*self.times_s)

    def way_at(self, t_s: float) -> tuple[float, float, float]:
        """Return distance, speed, acceleration of a timed path at a time, standing before and after."""
        assert self.times_s is not None
        first, last = float(self.times_s[0][0]), float(self.times_s[0][-1])
        inside = min(max(t_s, first), last)
        way = float(self._timing(inside))
        if t_s != inside:
            return way, 0.0, 0.0
        return way, float(self._timing(inside, 1)), float(self._timing(inside, 2))


@dataclass(frozen=True, slots=True)
class PathRun:
    """A trajectory being driven: its points and times, or heading, curvature, rate, length of a clothoid.

    It is driven from `started_m` on at `from_ns`; times count from there.
    """

    points: tuple[Point, ...]
    times_s: tuple[float, ...] | None
    clothoid: tuple[float, float, float, float] | None
    from_ns: int
    started_m: float


def made_path(run: PathRun) -> Path:
    """Return the curve of a trajectory; ValueError if two of its points are one."""
    if run.clothoid is not None:
        return clothoid(run.points[0], *run.clothoid)
    return polyline(run.points, run.times_s)


def polyline(points: Sequence[Point], times_s: Sequence[float] | None) -> Path:
    """Return the curve through points; ValueError if two that follow each other are one."""
    corners = np.array(points, dtype=np.float64)
    steps = np.linalg.norm(np.diff(corners[:, :2], axis=0), axis=1)
    if not (steps > 1e-6).all():
        raise ValueError("two vertices are at one place")
    along = np.concatenate(([0.0], np.cumsum(steps)))
    curve = PchipInterpolator(along, corners) if len(corners) > 2 else None
    count = min(max(2 * len(along), int(along[-1] / NODE_M) + 2), MOST_NODES)
    grid = np.unique(np.concatenate((np.linspace(0.0, along[-1], count), along)))
    nodes = (
        curve(grid) if curve is not None else corners[0] + np.outer(grid / along[-1], corners[1] - corners[0])
    )
    if curve is not None:
        d, dd = curve(grid, 1), curve(grid, 2)
    else:
        d, dd = np.broadcast_to((corners[1] - corners[0]) / along[-1], nodes.shape), np.zeros_like(nodes)
    speed = np.maximum(np.hypot(d[:, 0], d[:, 1]), 1e-9)
    way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(nodes[:, :2], axis=0), axis=1))))
    heading = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    curvature = (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / speed**3
    times = None
    if times_s is not None:
        times = np.array(times_s), np.interp(along, grid, way)
    return Path(way, np.ascontiguousarray(nodes.T), heading, curvature, times)


def clothoid(start: Point, heading_rad: float, curvature: float, rate: float, length_m: float) -> Path:
    """Return a clothoid: heading and curvature in closed form, positions by Gauss-Legendre to 1e-12 m."""
    count = min(max(2, int(length_m / NODE_M) + 2), MOST_NODES)
    way = np.linspace(0.0, length_m, count)
    nodes, weights = np.polynomial.legendre.leggauss(5)
    h = way[1] - way[0]
    inside = way[:-1, None] + h * (nodes + 1.0) / 2.0
    angle = heading_rad + inside * (curvature + rate * inside / 2.0)
    steps = np.array([np.cos(angle) @ weights, np.sin(angle) @ weights]) * h / 2.0
    points = np.zeros((3, count))
    points[:2, 1:] = np.cumsum(steps, axis=1)
    points += np.array(start)[:, None]
    heading = heading_rad + way * (curvature + rate * way / 2.0)
    return Path(way, points, heading, curvature + rate * way)
