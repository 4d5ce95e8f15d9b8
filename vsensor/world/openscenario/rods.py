"""The rod of a trailer: from the axle to the hitch that draws it, in closed form along a straight pull.

      axle o-----------------o hitch --> d
           <---- length ---->

With the angle beta from the pull's direction to the rod, tan(beta / 2) falls by exp(-d / length) (the
tractrix); the slope of the rod falls to that of the pull alike.
"""

from dataclasses import dataclass
from math import atan, atan2, cos, exp, hypot, pi, remainder, sin, sqrt, tan

LEAST_M = 1e-9
FOLDED_RAD = pi - 1e-6
"""Pushed straight back, a rod has no side to fold to: it stays."""

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Rod:
    """Where the hitch was, the heading of the trailer, and how far it rises per metre of its length."""

    hitch_m: Point
    heading_rad: float
    rise: float = 0.0

    def drawn(self, hitch_m: Point, length_m: float) -> "Rod":
        """Return the rod after its hitch has moved straight to another point."""
        dx, dy, dz = (b - a for a, b in zip(self.hitch_m, hitch_m, strict=True))
        way = hypot(dx, dy)
        if way < LEAST_M:
            return Rod(hitch_m, self.heading_rad, self.rise)
        along = atan2(dy, dx)
        beta = remainder(self.heading_rad - along, 2 * pi)
        left = exp(-way / length_m)
        if abs(beta) < FOLDED_RAD:
            beta = 2.0 * atan(tan(beta / 2.0) * left)
        slope = dz / hypot(way, dz)
        return Rod(hitch_m, along + beta, slope + (self.rise - slope) * left)

    def axle(self, length_m: float) -> Point:
        """Return the point of the trailer's axle."""
        x, y, z = self.hitch_m
        run = length_m * sqrt(max(1.0 - self.rise * self.rise, 0.0))
        return x - run * cos(self.heading_rad), y - run * sin(self.heading_rad), z - length_m * self.rise
