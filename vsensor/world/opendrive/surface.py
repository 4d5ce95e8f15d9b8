"""The road's surface: elevation, superelevation, and the height of its shape across the road.

A point (s, t, h) lies at `line(s) + t e_t + h e_h`, with (e_s, e_t, e_h) = Rz(heading) Ry(pitch)
Rx(superelevation) and tan(pitch) = -dz/ds: t is measured along the tilted surface, and a positive
superelevation lifts the left side.
"""

from dataclasses import dataclass

import numpy as np

from vsensor.types import Array, IntArray
from vsensor.world.opendrive import taylor
from vsensor.world.opendrive.polynomial import Cubics


@dataclass(frozen=True, slots=True)
class Cross:
    """The road's frame at N places and its change along s; vectors (3, N)."""

    line: Array
    e_t: Array
    e_h: Array
    d_line: Array
    d_e_t: Array
    d_e_h: Array


def cross(
    plan: tuple[Array, Array, Array, Array],
    elevation: tuple[Array, Array, Array],
    tilt: tuple[Array, Array, Array] | None,
) -> Cross:
    """Return the frames from plan view (x, y, heading, curvature), elevation and tilt with derivatives."""
    x, y, heading, curvature = plan
    z, slope, bend = elevation
    zero, one = np.zeros_like(x), np.ones_like(x)
    cy, sy = np.cos(heading), np.sin(heading)
    root = np.sqrt(1.0 + slope * slope)
    cp, sp, d_pitch = 1.0 / root, -slope / root, -bend / (root * root)
    cr, sr, d_roll = (np.cos(tilt[0]), np.sin(tilt[0]), tilt[1]) if tilt else (one, zero, zero)
    e_t = np.array([cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr])
    e_h = np.array([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr])
    forward = np.array([cy * cp, sy * cp, -sp])
    d_e_t = curvature * np.array([-e_t[1], e_t[0], zero]) + d_pitch * sr * forward + d_roll * e_h
    d_e_h = curvature * np.array([-e_h[1], e_h[0], zero]) + d_pitch * cr * forward - d_roll * e_t
    return Cross(np.array([x, y, z]), e_t, e_h, np.array([cy, sy, slope]), d_e_t, d_e_h)


@dataclass(frozen=True, slots=True)
class CrossSeries:
    """The road's frame at N places as Taylor series along s, each (TERMS, 3, N); `e_h` where asked for."""

    line: Array
    e_t: Array
    e_h: Array | None


def cross_series(
    plan: tuple[Array, Array, Array, Array], elevation: Array, tilt: Array | None, *, upwards: bool
) -> CrossSeries:
    """Return the frames from the series of plan view (position, tangent), elevation and tilt.

    `upwards`: with e_h, which only a road with a shape across needs.
    """
    x, y, cy, sy = plan
    zero, one = np.zeros_like(x), taylor.constant(np.ones_like(x[0]))
    line = np.stack((x, y, elevation), axis=1)
    product, is_level = taylor.product, not elevation[1:].any()
    if tilt is None and is_level:
        return CrossSeries(line, np.stack((-sy, cy, zero), axis=1), np.stack((zero, zero, one), axis=1))
    if is_level and not upwards and tilt is not None:
        sr, cr = taylor.sine_cosine(tilt)
        return CrossSeries(line, np.stack((-product(sy, cr), product(cy, cr), sr), axis=1), None)
    slope = taylor.slope_of(elevation)
    cp = taylor.power(one + product(slope, slope), -0.5)
    sp = -product(slope, cp)
    sr, cr = taylor.sine_cosine(tilt) if tilt is not None else (zero, one)
    low = product(sp, sr)
    e_t = (product(cy, low) - product(sy, cr), product(sy, low) + product(cy, cr), product(cp, sr))
    if not upwards:
        return CrossSeries(line, np.stack(e_t, axis=1), None)
    high = product(sp, cr)
    e_h = (product(cy, high) + product(sy, sr), product(sy, high) - product(cy, sr), product(cp, cr))
    return CrossSeries(line, np.stack(e_t, axis=1), np.stack(e_h, axis=1))


@dataclass(frozen=True, slots=True)
class Shape:
    """`lateralProfile/shape`: height over t at some stations, linear in s between them.

    `stations_m` (K,) ascending; `profiles` one Cubics in t for each.
    """

    stations_m: Array
    profiles: tuple[Cubics, ...]

    def _between(self, s_m: Array) -> tuple[IntArray, IntArray, Array, Array]:
        """Return the stations before and after s (N,), their distance, and the share of the latter."""
        place = np.clip(np.searchsorted(self.stations_m, s_m, side="right") - 1, 0, len(self.stations_m) - 1)
        after = np.minimum(place + 1, len(self.stations_m) - 1)
        span = np.maximum(self.stations_m[after] - self.stations_m[place], 1e-9)
        return place, after, span, np.clip((s_m - self.stations_m[place]) / span, 0.0, 1.0)

    def height(self, s_m: Array, t_m: Array) -> Array:
        """Return h (N,) at (s, t); before the first and after the last station theirs holds."""
        place, after, _, share = self._between(s_m)
        heights = np.array([_across(profile, t_m) for profile in self.profiles])
        columns = np.arange(len(s_m))
        return np.asarray((1.0 - share) * heights[place, columns] + share * heights[after, columns])

    def series(self, s_m: Array, t: Array) -> Array:
        """Return the series of h along a line whose t is a series at s (N,)."""
        place, after, span, share = self._between(s_m)
        part = taylor.constant(share)
        part[1] = np.where((share > 0.0) & (share < 1.0), 1.0 / span, 0.0)
        heights = np.array([_across_series(profile, t) for profile in self.profiles])
        columns = np.arange(len(s_m))
        low, high = (heights[row, :, columns].T for row in (place, after))
        return np.asarray(low + taylor.product(part, high - low))


def _across(profile: Cubics, t_m: Array) -> Array:
    """Return the height over t; outside the profile's first record that record goes on."""
    return profile.at(np.maximum(t_m, profile.starts_m[0]))[0]


def _across_series(profile: Cubics, t: Array) -> Array:
    """Return the series of `_across` along a line whose t is a series."""
    inside = np.where(
        t[0] < profile.starts_m[0], taylor.constant(np.full(t.shape[1], profile.starts_m[0])), t
    )
    place = np.searchsorted(profile.starts_m, inside[0], side="right") - 1
    offset = inside.copy()
    offset[0] -= profile.starts_m[place]
    return taylor.polynomial(profile.coefficients[place].T, offset)
