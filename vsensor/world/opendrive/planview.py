"""The reference line in the plane: line, arc, spiral, poly3, paramPoly3, evaluated at any s.

v
|      ___--- heading(ds)
|  _--            each record has its own frame (u, v), placed at (x0, y0) and turned by hdg;
|-_________ u     `local(ds)` returns u, v, heading, curvature in it, ds = distance along the line
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from vsensor.types import Array
from vsensor.world.opendrive.taylor import (
    TERMS,
    constant,
    integral,
    polynomial,
    power,
    product,
    sine_cosine,
)

NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2
"""Gauss-Legendre on [0, 1]: exact to degree 19; over 0.25 rad of turn the remainder is below 1e-16."""

TURN_PER_PIECE_RAD = 0.25
LARGEST_TURN_RAD = 1000.0
"""A single record that turns further is a mistake, and its table would not end."""

Local = tuple[Array, Array, Array, Array]
Series = tuple[Array, Array, Array, Array]
"""Taylor series of a position and of the unit tangent there, see `taylor`."""


class Curve(Protocol):
    """One geometry record in its own frame."""

    def local(self, ds_m: Array) -> Local:
        """Return u, v, heading, curvature (N,) at distances from the record's start."""
        ...

    def series(self, ds_m: Array) -> Series:
        """Return the series of u, v and of the unit tangent at distances from the record's start."""
        ...


def _from_heading(u: Array, v: Array, heading: Array) -> Series:
    """Return the series of a line from a point (N,) of it and the series of its heading."""
    sine, cosine = sine_cosine(heading)
    return integral(u, cosine), integral(v, sine), cosine, sine


@dataclass(frozen=True)
class Arc:
    """Constant curvature; 0 is a line."""

    curvature_per_m: float

    def local(self, ds_m: Array) -> Local:
        """Chord form, which stays exact as the curvature goes to 0."""
        half = self.curvature_per_m * ds_m / 2
        chord = ds_m * np.sinc(half / np.pi)
        return chord * np.cos(half), chord * np.sin(half), 2 * half, np.full_like(ds_m, self.curvature_per_m)

    def series(self, ds_m: Array) -> Series:
        """See Curve."""
        u, v, heading, curvature = self.local(ds_m)
        zero = np.zeros_like(ds_m)
        return _from_heading(u, v, np.array((heading, curvature, zero, zero)))


@dataclass(frozen=True)
class Spiral:
    """Curvature linear in the distance (clothoid); of equal ends an arc, of zero ends a line.

    Positions by Gauss-Legendre from the nearest knot: no digits are lost as the rate goes to 0,
    where differences of Fresnel integrals cancel.
    """

    start_per_m: float
    end_per_m: float
    length_m: float

    @cached_property
    def _rate_per_m2(self) -> float:
        return (self.end_per_m - self.start_per_m) / self.length_m

    @cached_property
    def _knots(self) -> tuple[Array, Array, Array]:
        turn = max(abs(self.start_per_m), abs(self.end_per_m)) * self.length_m
        s = np.linspace(0.0, self.length_m, int(np.ceil(turn / TURN_PER_PIECE_RAD)) + 2)
        du, dv = self._from(s[:-1], s[1:])
        return s, np.concatenate(([0.0], np.cumsum(du))), np.concatenate(([0.0], np.cumsum(dv)))

    def _heading(self, ds_m: Array) -> Array:
        return ds_m * (self.start_per_m + ds_m * self._rate_per_m2 / 2)

    def _from(self, from_m: Array, to_m: Array) -> tuple[Array, Array]:
        span = to_m - from_m
        heading = self._heading(from_m[:, None] + span[:, None] * NODES)
        return span * (np.cos(heading) @ WEIGHTS), span * (np.sin(heading) @ WEIGHTS)

    def local(self, ds_m: Array) -> Local:
        """See Curve."""
        s, u, v = self._knots
        knot = np.clip(np.searchsorted(s, ds_m, side="right") - 1, 0, len(s) - 2)
        du, dv = self._from(s[knot], ds_m)
        return u[knot] + du, v[knot] + dv, self._heading(ds_m), self.start_per_m + ds_m * self._rate_per_m2

    def series(self, ds_m: Array) -> Series:
        """See Curve."""
        u, v, heading, curvature = self.local(ds_m)
        half_rate = np.full_like(ds_m, self._rate_per_m2 / 2)
        return _from_heading(u, v, np.array((heading, curvature, half_rate, np.zeros_like(ds_m))))


@dataclass(frozen=True)
class ParamPoly3:
    """`u(p), v(p)` cubic, p from 0 to `p_max`; the distance along the line decides p.

    s is the arc length of the reference line, so p is found from it, for `normalized` and
    `arcLength` alike; where the stated length differs from the true one, s is stretched evenly so
    that the record ends at p_max. `stretch` False (poly3): s is the true arc length.
    """

    u: tuple[float, float, float, float]
    v: tuple[float, float, float, float]
    p_max: float
    length_m: float
    stretch: bool = True
    _knot_count: int = field(default=65, repr=False)

    def _speed(self, p: Array) -> Array:
        return np.hypot(
            self.u[1] + p * (2 * self.u[2] + p * 3 * self.u[3]),
            self.v[1] + p * (2 * self.v[2] + p * 3 * self.v[3]),
        )

    def _arc(self, from_p: Array, to_p: Array) -> Array:
        span = to_p - from_p
        return span * (self._speed(from_p[:, None] + span[:, None] * NODES) @ WEIGHTS)

    @cached_property
    def _knots(self) -> tuple[Array, Array]:
        p = np.linspace(0.0, self.p_max, self._knot_count)
        return p, np.concatenate(([0.0], np.cumsum(self._arc(p[:-1], p[1:]))))

    @cached_property
    def arc_length_m(self) -> float:
        """The true length of the curve from p = 0 to p_max."""
        return float(self._knots[1][-1])

    @cached_property
    def starts_at_rest(self) -> bool:
        """Whether du/dp and dv/dp vanish at p = 0: the heading there is only a limit."""
        return bool(self._speed(np.zeros(1))[0] * self.p_max < 1e-6 * self.arc_length_m)

    def parameter(self, ds_m: Array) -> Array:
        """Return p (N,) at arc distances: table, then Newton kept inside its interval."""
        knots, arcs = self._knots
        arc = ds_m * (self.arc_length_m / self.length_m) if self.stretch else ds_m
        arc = np.clip(arc, 0.0, arcs[-1])
        place = np.clip(np.searchsorted(arcs, arc, side="right") - 1, 0, len(knots) - 2)
        low, high = knots[place], knots[place + 1]
        step = np.maximum(arcs[place + 1] - arcs[place], 1e-300)
        p = low + (high - low) * np.clip((arc - arcs[place]) / step, 0.0, 1.0)
        for _ in range(12):
            miss = arcs[place] + self._arc(low, p) - arc
            if np.all(np.abs(miss) < 1e-12 * (1.0 + self.length_m)):
                break
            p = np.clip(p - miss / np.maximum(self._speed(p), 1e-9), low, high)
        return p

    def local(self, ds_m: Array) -> Local:
        """See Curve."""
        p = self.parameter(ds_m)
        u = self.u[0] + p * (self.u[1] + p * (self.u[2] + p * self.u[3]))
        v = self.v[0] + p * (self.v[1] + p * (self.v[2] + p * self.v[3]))
        if self.starts_at_rest:
            p = np.maximum(p, 1e-6 * self.p_max)
        du = self.u[1] + p * (2 * self.u[2] + p * 3 * self.u[3])
        dv = self.v[1] + p * (2 * self.v[2] + p * 3 * self.v[3])
        ddu, ddv = 2 * self.u[2] + p * 6 * self.u[3], 2 * self.v[2] + p * 6 * self.v[3]
        speed = np.maximum(np.hypot(du, dv), 1e-9)
        return u, v, np.arctan2(dv, du), (du * ddv - dv * ddu) / speed**3

    def series(self, ds_m: Array) -> Series:
        """See Curve. dp/ds = 1 / speed(p): each turn of the loop makes one more term right."""
        start = self.parameter(ds_m)
        if self.starts_at_rest:
            start = np.maximum(start, 1e-6 * self.p_max)
        per_s = self.arc_length_m / self.length_m if self.stretch else 1.0
        p = constant(start)
        for _ in range(3):
            du, dv = (polynomial((c[1], 2 * c[2], 3 * c[3]), p) for c in (self.u, self.v))
            slowness = power(product(du, du) + product(dv, dv), -0.5)
            p = integral(start, per_s * slowness)
        du, dv = (polynomial((c[1], 2 * c[2], 3 * c[3]), p) for c in (self.u, self.v))
        slowness = power(product(du, du) + product(dv, dv), -0.5)
        return polynomial(self.u, p), polynomial(self.v, p), product(du, slowness), product(dv, slowness)


@dataclass(frozen=True)
class Record:
    """A curve placed in the world."""

    s_m: float
    x_m: float
    y_m: float
    heading_rad: float
    length_m: float
    curve: Curve

    def at(self, ds_m: Array) -> Local:
        """Return world x, y, heading, curvature; beyond the record's end its tangent goes on."""
        inside = np.minimum(ds_m, self.length_m)
        u, v, heading, curvature = self.curve.local(inside)
        beyond = ds_m - inside
        if beyond.any():
            u, v = u + beyond * np.cos(heading), v + beyond * np.sin(heading)
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        return (
            self.x_m + u * cos - v * sin,
            self.y_m + u * sin + v * cos,
            self.heading_rad + heading,
            curvature,
        )

    def series(self, ds_m: Array) -> Series:
        """Return the series of x, y and of the unit tangent; beyond the record's end its tangent goes on."""
        inside = np.minimum(ds_m, self.length_m)
        u, v, along_u, along_v = self.curve.series(inside)
        beyond = ds_m - inside
        if beyond.any():
            out = beyond > 0.0
            for position, along in ((u, along_u), (v, along_v)):
                along[1:, out] = 0.0
                position[0] += beyond * along[0]
                position[1, out], position[2:, out] = along[0, out], 0.0
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        x, y = u * cos - v * sin, u * sin + v * cos
        x[0] += self.x_m
        y[0] += self.y_m
        return x, y, along_u * cos - along_v * sin, along_u * sin + along_v * cos


class PlanView:
    """The records of one road, ordered by s."""

    def __init__(self, records: tuple[Record, ...]) -> None:
        self.records = records
        self.starts_m: Array = np.array([record.s_m for record in records])

    @property
    def end_m(self) -> float:
        """The s at which the last record ends."""
        return self.records[-1].s_m + self.records[-1].length_m

    def at(self, s_m: Array) -> Local:
        """Return world x, y, heading, curvature (N,) at s; only the records that are asked are touched."""
        place = np.clip(np.searchsorted(self.starts_m, s_m, side="right") - 1, 0, len(self.records) - 1)
        first = int(place[0]) if len(place) else 0
        if len(place) == 1 or (place == first).all():
            return self.records[first].at(s_m - self.records[first].s_m)
        x, y, heading, curvature = np.empty((4, len(s_m)))
        for number in np.unique(place):
            mine = place == number
            record = self.records[number]
            x[mine], y[mine], heading[mine], curvature[mine] = record.at(s_m[mine] - record.s_m)
        return x, y, heading, curvature

    def series(self, s_m: Array) -> Series:
        """Return the series of world x, y and of the unit tangent at s (N,)."""
        place = np.clip(np.searchsorted(self.starts_m, s_m, side="right") - 1, 0, len(self.records) - 1)
        out = np.empty((4, TERMS, len(s_m)))
        for number in np.unique(place):
            mine = place == number
            record = self.records[number]
            out[:, :, mine] = record.series(s_m[mine] - record.s_m)
        return out[0], out[1], out[2], out[3]
