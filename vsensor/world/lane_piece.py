"""A stretch of one lane, as driven: true distance along the lane's middle, frames, borders.

s of the road       s_from ------------> s_to     (driven along s or against it)
distance sigma      0 -----------------> length   (true length of the lane's middle, 3-D)
"""

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vsensor.types import Array
from vsensor.world.opendrive.lanes import Section
from vsensor.world.opendrive.network import Place
from vsensor.world.opendrive.planview import NODES, WEIGHTS
from vsensor.world.opendrive.road import Road
from vsensor.world.opendrive.surface import Cross

KNOT_M = 1.0
"""Distance of the knots between s and sigma; the cubic between them is then right to 1e-8 m on
clothoids and cubics down to R = 20 m (measured on the real maps; 16 times less than 2 m knots)."""

SLOWEST = 1e-3
"""Distance along the lane per s, at least: a lane inside the centre of a bend stands still or runs back."""


@dataclass(frozen=True, slots=True)
class Frames:
    """Along the middle of the lane: vectors (3, N), angles as for EgoState (N,)."""

    position: Array
    forward: Array
    left: Array
    up: Array
    s_m: Array
    t_m: Array
    cross: Cross


@dataclass(frozen=True, eq=False)
class LanePiece:
    """The drive along one lane of one section from `s_from_m` to `s_to_m`."""

    road: Road
    place: Place
    s_from_m: float
    s_to_m: float

    @property
    def section(self) -> Section:
        """The cross-section that the piece lies in."""
        return self.road.sections[self.place.section]

    @cached_property
    def _knots(self) -> tuple[Array, Array, Array, Array]:
        """Return driven s (K,), sigma (K,), and ds/dsigma just inside both ends of each interval (K-1,)."""
        driven = self._knot_places()
        span = np.diff(driven)
        inside = driven[:-1, None] + span[:, None] * np.concatenate((NODES, [1e-7, 1.0 - 1e-7]))
        speed = self._speed(inside.ravel()).reshape(inside.shape)
        sigma = np.concatenate(([0.0], np.cumsum(span * (speed[:, :-2] @ WEIGHTS))))
        return driven, sigma, 1.0 / speed[:, -2], 1.0 / speed[:, -1]

    def _knot_places(self) -> Array:
        low, high = sorted((self.s_from_m, self.s_to_m))
        starts = [s for s in self._breaks() if low + 1e-6 < s < high - 1e-6]
        even = np.linspace(low, high, max(2, int(np.ceil((high - low) / KNOT_M)) + 1))
        s = np.unique(np.concatenate((even, starts)))
        s = s[np.concatenate(([True], np.diff(s) > 1e-9))]
        return np.sort(np.abs(s - self.s_from_m))

    def _breaks(self) -> Iterable[float]:
        """Return every s at which a polynomial or a geometry record of this lane changes."""
        road, section, side = self.road, self.section, 1 if self.place.lane_id > 0 else -1
        yield from road.plan.starts_m
        for cubics in (road.elevation, road.superelevation, section.lane_offset):
            yield from cubics.starts_m
        for i, lane in section.lanes.items():
            if 0 < side * i <= side * self.place.lane_id:
                yield from lane.width.starts_m

    def _s(self, driven_m: Array) -> Array:
        return np.asarray(self.s_from_m + self.place.direction * driven_m)

    def _speed(self, driven_m: Array) -> Array:
        s = self._s(driven_m)
        t, slope, _ = self.section.centre(s, self.place.lane_id)
        tangent = _tangent(self.road.cross(s), t, slope)
        return np.asarray(np.maximum(np.sqrt((tangent * tangent).sum(axis=0)), SLOWEST))

    @cached_property
    def length_m(self) -> float:
        """Length of the lane's middle."""
        return float(self._knots[1][-1])

    def s_at(self, sigma_m: Array) -> Array:
        """Return s of the road (N,) at distances (N,) from the piece's start, clipped to the piece."""
        driven, sigma, first, last = self._knots
        k = np.clip(np.searchsorted(sigma, sigma_m, side="right") - 1, 0, len(sigma) - 2)
        h = sigma[k + 1] - sigma[k]
        x = np.clip((sigma_m - sigma[k]) / h, 0.0, 1.0)
        rise = driven[k + 1] - driven[k]
        a, b = first[k] * h - rise, rise - last[k] * h
        s = self._s(driven[k] + x * rise + x * (1.0 - x) * ((1.0 - x) * a + x * b))
        low, high = sorted((self.s_from_m, self.s_to_m))  # rounding must not step into another section
        return np.asarray(np.minimum(np.maximum(s, low), high))

    def sigma_at(self, s_m: Array) -> Array:
        """Return distances (N,) from the piece's start of places s (N,) of the road: linear between knots."""
        driven, sigma, _, _ = self._knots
        return np.interp(np.abs(s_m - self.s_from_m), driven, sigma)

    @cached_property
    def _knot_lists(self) -> tuple[list[float], ...]:
        return tuple(knots.tolist() for knots in self._knots)

    def s_one(self, sigma_m: float) -> float:
        """Return s of the road at one distance, as `s_at` in a twentieth of its time."""
        driven, sigma, first, last = self._knot_lists
        k = min(max(bisect_right(sigma, sigma_m) - 1, 0), len(sigma) - 2)
        h = sigma[k + 1] - sigma[k]
        x = min(max((sigma_m - sigma[k]) / h, 0.0), 1.0)
        rise = driven[k + 1] - driven[k]
        a, b = first[k] * h - rise, rise - last[k] * h
        way = driven[k] + x * rise + x * (1.0 - x) * ((1.0 - x) * a + x * b)
        s = self.s_from_m + self.place.direction * way
        return min(max(s, min(self.s_from_m, self.s_to_m)), max(self.s_from_m, self.s_to_m))

    def sigma_one(self, s_m: float) -> float:
        """Return the distance from the piece's start at s of the road: `s_one` turned around, to 1e-9 m."""
        driven, sigma, _, _ = self._knot_lists
        target = abs(s_m - self.s_from_m)
        k = min(max(bisect_right(driven, target) - 1, 0), len(driven) - 2)
        slope = (driven[k + 1] - driven[k]) / (sigma[k + 1] - sigma[k])
        found = sigma[k] + (target - driven[k]) / slope
        for _ in range(6):
            away = target - abs(self.s_one(found) - self.s_from_m)
            if abs(away) < 1e-12:
                break
            found = min(max(found + away / slope, 0.0), self.length_m)
        return found

    def frames(self, sigma_m: Array) -> Frames:
        """Return position and axes of the lane's middle at distances (N,); up is the road's normal."""
        s = self.s_at(sigma_m)
        t, slope, _ = self.section.centre(s, self.place.lane_id)
        cross = self.road.cross(s)
        position = cross.line + t * cross.e_t + self.road.height(s, t) * cross.e_h
        forward = _unit(self.place.direction * _tangent(cross, t, slope))
        up = _unit(_product(forward, self.place.direction * cross.e_t))
        return Frames(position, forward, _product(up, forward), up, s, t, cross)

    def breaks_m(self) -> Array:
        """Return the distances between which the lane's middle is one smooth curve, ends included."""
        return self._knots[1]

    def ids_left_to_right(self) -> tuple[int, ...]:
        """Return the lanes whose (outer) borders lie across the road, as the driver sees them."""
        return self.section.ids if self.place.direction > 0 else self.section.ids[::-1]

    def own_borders(self) -> tuple[int, int]:
        """Return the lane ids that own the left and the right border of the driven lane."""
        own, inner = self.place.lane_id, self.section.inner(self.place.lane_id)
        return (inner, own) if (own < 0) == (self.place.direction > 0) else (own, inner)


def _tangent(cross: Cross, t: Array, slope: Array) -> Array:
    """Return dP/ds of a line at lateral t with slope dt/ds, (3, N)."""
    return cross.d_line + slope * cross.e_t + t * cross.d_e_t


def _unit(v: Array) -> Array:
    return np.asarray(v / np.maximum(np.sqrt((v * v).sum(axis=0)), 1e-300))


def _product(a: Array, b: Array) -> Array:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
