"""A polynomial seen a while ago, as it lies now: the vehicle has moved by a rigid motion since.

y ▲      . ' line            then: y = p(x)               X =  (x - x_m) cos h + (y - y_m) sin h
  |   . '   ▲ Y              now:  points (X, Y)          Y = -(x - x_m) sin h + (y - y_m) cos h
  | '      /      X
  +-------o- - ->            (x_m, y_m, h): the vehicle now in the frame of then
"""

from dataclasses import dataclass
from math import cos, hypot, pi, sin

import numpy as np

from vsensor.types import Array, Fit, frozen

YAW_RATE_STD_RADPS = 0.004
"""Constant error of a car's yaw-rate sensor, 0.23 deg/s: half of what the recorded drive's has (-0.41)."""
SLIP_STD = 0.005
"""Lateral motion that no sensor tells, as a share of the distance: side slip and the road's cross fall."""
FOLDED = 0.2
"""Below this dX/dx a line turned so far that it is no function of X any more (a slope above 78 deg)."""
BASE_M = 10.0
"""Least length over which a polynomial is converted, so that a short rest of a line keeps its curvature."""

_POWERS = np.arange(10)
_NODES = {n: 0.5 - 0.5 * np.cos(pi * (np.arange(n) + 0.5) / n) for n in range(1, 11)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """The vehicle's pose now in the ego frame of then, and the distance it drove."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    path_m: float = 0.0

    def further(self, step: "Moved") -> "Moved":
        """Return this motion followed by `step`."""
        c, s = cos(self.heading_rad), sin(self.heading_rad)
        return Moved(
            x_m=self.x_m + c * step.x_m - s * step.y_m,
            y_m=self.y_m + s * step.x_m + c * step.y_m,
            heading_rad=self.heading_rad + step.heading_rad,
            path_m=self.path_m + step.path_m,
        )


HERE = Moved()


def driven(speed_mps: float, yaw_rate_radps: float, duration_s: float) -> Moved:
    """Return the motion of the rear axle's centre at constant speed and yaw rate: an arc."""
    path_m, half = speed_mps * duration_s, 0.5 * yaw_rate_radps * duration_s
    chord_m = path_m * (sin(half) / half if half else 1.0)
    return Moved(x_m=chord_m * cos(half), y_m=chord_m * sin(half), heading_rad=2 * half, path_m=abs(path_m))


def x_now(fit: Fit, moved: Moved, x_m: float) -> float:
    """Return the X at which the line's point of x then lies now."""
    y_m = fit.y_at(x_m)
    return (x_m - moved.x_m) * cos(moved.heading_rad) + (y_m - moved.y_m) * sin(moved.heading_rad)


def beside(fit: Fit, moved: Moved) -> tuple[float, float] | None:
    """Return Y and slope of the line at X = 0 now (Newton); None if it does not cross there."""
    c, s, x = cos(moved.heading_rad), sin(moved.heading_rad), moved.x_m
    for _ in range(3):
        y, slope = _value_and_slope(fit, x)
        stretch = c + slope * s
        if stretch < FOLDED:
            return None
        ahead = c * (x - moved.x_m) + s * (y - moved.y_m)
        if abs(ahead) < 1e-9:
            break
        x -= ahead / stretch
    y, slope = _value_and_slope(fit, x)
    return c * (y - moved.y_m) - s * (x - moved.x_m), (c * slope - s) / (c + s * slope)


def aside_m(fit: Fit, moved: Moved, x_m: float, y_m: float) -> float:
    """Return how far to the left, along y then, the point (X, Y) of now lies from the line."""
    c, s = cos(moved.heading_rad), sin(moved.heading_rad)
    then_x, then_y = moved.x_m + c * x_m - s * y_m, moved.y_m + s * x_m + c * y_m
    return then_y - fit.y_at(then_x)


def drift_std_m(moved: Moved, age_s: float) -> float:
    """Return the standard deviation of Y at X = 0 that the unknown part of the motion adds."""
    return hypot(0.5 * moved.path_m * YAW_RATE_STD_RADPS * age_s, SLIP_STD * moved.path_m)


def fit_now(fit: Fit, moved: Moved, age_s: float) -> Fit | None:
    """Return the polynomial in the frame of now, of the same order; None if it folds or lies behind.

    Exact for a straight line and for a motion without turning. A turned polynomial of order 2 or more
    is none; it is interpolated at the Chebyshev nodes of the part ahead. The covariance is carried
    through the same map, exact to first order, and grows by a yaw-rate error constant since then and
    by side slip. The range ends where the seen part ends, and begins at X = 0 where it began behind.
    """
    end_m = x_now(fit, moved, fit.x_max_m)
    if not end_m > 0.0:
        return None
    size = len(fit.coefficients)
    powers = _POWERS[:size]
    c, s = cos(moved.heading_rad), sin(moved.heading_rad)
    first_m = min(max(fit.x_min_m, moved.x_m), fit.x_max_m - BASE_M)
    x = first_m + (fit.x_max_m - first_m) * _NODES[size]
    basis = x[:, None] ** powers
    y = basis @ fit.coefficients
    stretch = c + s * (basis[:, :-1] @ (fit.coefficients[1:] * powers[1:]))
    if not stretch.min() > FOLDED:
        return None
    ahead, across = x - moved.x_m, y - moved.y_m
    x, y = c * ahead + s * across, c * across - s * ahead
    scale_m = float(np.abs(x).max())
    # moving a point by dy then moves Y at its X by dy / (dX/dx)
    images = np.column_stack([y, basis / stretch[:, None]])
    converted = np.linalg.solve((x[:, None] / scale_m) ** powers, images) / scale_m ** powers[:, None]
    jacobian = converted[:, 1:]
    return Fit(
        coefficients=frozen(converted[:, 0]),
        covariance=frozen(jacobian @ fit.covariance @ jacobian.T + _drift(size, moved, age_s)),
        x_min_m=max(x_now(fit, moved, fit.x_min_m), min(fit.x_min_m, 0.0)),
        x_max_m=end_m,
        residual_std_m=fit.residual_std_m,
        points=fit.points,
    )


def _drift(size: int, moved: Moved, age_s: float) -> Array:
    """Return the covariance that unknown motion adds to c0 and c1.

    A yaw-rate error b turns the vehicle by b t and carries it b t d / 2 aside on a path d.
    """
    added = np.zeros((size, size))
    turned, half_m = YAW_RATE_STD_RADPS * age_s, 0.5 * moved.path_m
    added[0, 0] = drift_std_m(moved, age_s) ** 2
    if size > 1:
        added[0, 1] = added[1, 0] = half_m * turned**2
        added[1, 1] = turned**2
    return added


def _value_and_slope(fit: Fit, x_m: float) -> tuple[float, float]:
    y = slope = 0.0
    for coefficient in reversed(fit.coefficients.tolist()):
        slope = slope * x_m + y
        y = y * x_m + coefficient
    return y, slope
