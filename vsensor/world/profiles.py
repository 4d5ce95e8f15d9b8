"""Quantities over time as a scenario writes them: a number, or a list of [time, value] points."""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise

from vsensor.errors import ConfigError

Points = float | list[tuple[float, float]]
"""What a scenario file holds: one value for all times, or points [[t_s, value], ...]."""


def _points(points: Points, key: str) -> list[tuple[float, float]]:
    """Return the points with strictly rising times; raises ConfigError naming `key`."""
    if not isinstance(points, list):
        return [(0.0, float(points))]
    if not points:
        raise ConfigError(f"{key}: an empty list; a number or points [[t_s, value], ...] were expected")
    for (t0, _), (t1, _) in pairwise(points):
        if t1 <= t0:
            raise ConfigError(f"{key}: times must rise, but {t1:g} s comes after {t0:g} s")
    return [(float(t), float(value)) for t, value in points]


@dataclass(frozen=True, slots=True)
class LinearProfile:
    """Piecewise linear value over time, constant before the first and after the last point."""

    times_s: tuple[float, ...]
    values: tuple[float, ...]
    integrals: tuple[float, ...]  # from the first point to each point

    @classmethod
    def of(cls, points: Points, key: str, scale: float = 1.0) -> "LinearProfile":
        """Build from scenario points, values multiplied by `scale`; raises ConfigError naming `key`."""
        rows = [(t, value * scale) for t, value in _points(points, key)]
        sums = [0.0]
        for (t0, v0), (t1, v1) in pairwise(rows):
            sums.append(sums[-1] + (t1 - t0) * (v0 + v1) / 2.0)
        return cls(tuple(t for t, _ in rows), tuple(v for _, v in rows), tuple(sums))

    def value(self, t_s: float) -> float:
        """Return the value at `t_s`."""
        return self._segment(t_s)[0]

    def slope(self, t_s: float) -> float:
        """Return the derivative at `t_s` per second (from the right at a point)."""
        return self._segment(t_s)[1]

    def integral(self, t_s: float) -> float:
        """Return the exact integral from 0 to `t_s`."""
        return self._antiderivative(t_s) - self._antiderivative(0.0)

    def _segment(self, t_s: float) -> tuple[float, float]:
        i = bisect_right(self.times_s, t_s) - 1
        if i < 0:
            return self.values[0], 0.0
        if i >= len(self.times_s) - 1:
            return self.values[-1], 0.0
        t0, t1, v0, v1 = self.times_s[i], self.times_s[i + 1], self.values[i], self.values[i + 1]
        rate = (v1 - v0) / (t1 - t0)
        return v0 + rate * (t_s - t0), rate

    def _antiderivative(self, t_s: float) -> float:
        i = max(0, bisect_right(self.times_s, t_s) - 1)
        if t_s < self.times_s[0]:
            return self.values[0] * (t_s - self.times_s[0])
        dt = t_s - self.times_s[i]
        return self.integrals[i] + dt * (self.values[i] + self.value(t_s)) / 2.0


@dataclass(frozen=True, slots=True)
class SmoothProfile:
    """Value over time that moves between points on the quintic 10 u^3 - 15 u^4 + 6 u^5.

    Speed and acceleration of the value are zero at every point, as in a lane change.
    """

    times_s: tuple[float, ...]
    values: tuple[float, ...]

    @classmethod
    def of(cls, points: Points, key: str) -> "SmoothProfile":
        """Build from scenario points; raises ConfigError naming `key`."""
        rows = _points(points, key)
        return cls(tuple(t for t, _ in rows), tuple(v for _, v in rows))

    def derivatives(self, t_s: float) -> tuple[float, float, float]:
        """Return value, first and second time derivative at `t_s`."""
        i = bisect_right(self.times_s, t_s) - 1
        if i < 0:
            return self.values[0], 0.0, 0.0
        if i >= len(self.times_s) - 1:
            return self.values[-1], 0.0, 0.0
        span = self.times_s[i + 1] - self.times_s[i]
        step = self.values[i + 1] - self.values[i]
        u = (t_s - self.times_s[i]) / span
        return (
            self.values[i] + step * u**3 * (10.0 + u * (6.0 * u - 15.0)),
            step / span * 30.0 * u**2 * (1.0 - u) ** 2,
            step / span**2 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
        )
