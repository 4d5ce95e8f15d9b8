"""The road's surface: elevation, superelevation, and the height of its shape across the road.

A point (s, t, h) lies at `line(s) + t e_t + h e_h`, with (e_s, e_t, e_h) = Rz(heading) Ry(pitch)
Rx(superelevation) and tan(pitch) = -dz/ds: t is measured along the tilted surface, and a positive
superelevation lifts the left side.
"""

from dataclasses import dataclass

import numpy as np

from vsensor.types import Array
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
class Shape:
    """`lateralProfile/shape`: height over t at some stations, linear in s between them.

    `stations_m` (K,) ascending; `profiles` one Cubics in t for each.
    """

    stations_m: Array
    profiles: tuple[Cubics, ...]

    def height(self, s_m: Array, t_m: Array) -> Array:
        """Return h (N,) at (s, t); before the first and after the last station theirs holds."""
        place = np.clip(np.searchsorted(self.stations_m, s_m, side="right") - 1, 0, len(self.stations_m) - 1)
        after = np.minimum(place + 1, len(self.stations_m) - 1)
        span = np.maximum(self.stations_m[after] - self.stations_m[place], 1e-9)
        share = np.clip((s_m - self.stations_m[place]) / span, 0.0, 1.0)
        heights = np.array([_across(profile, t_m) for profile in self.profiles])
        columns = np.arange(len(s_m))
        return np.asarray((1.0 - share) * heights[place, columns] + share * heights[after, columns])


def _across(profile: Cubics, t_m: Array) -> Array:
    """Return the height over t; outside the profile's first record that record goes on."""
    return profile.at(np.maximum(t_m, profile.starts_m[0]))[0]
