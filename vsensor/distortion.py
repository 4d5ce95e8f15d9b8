"""Lens distortion, radial and tangential, and its inverse (P2 eq. 2.14, 2.15; OpenCV's five numbers).

    x'' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)        r^2 = x^2 + y^2
    y'' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p2 x y + p1 (r^2 + 2 y^2)

x, y are normalised image coordinates: x / z right and y / z down in the optical frame. The Jacobian
is symmetric. So on a disc (it is convex) where it is positive definite the map is the gradient of a
strictly convex function, and no two points share an image. The largest such disc is the monotone
range; beyond it the polynomial folds back and would show what lies far aside a second time, inside.
"""

from dataclasses import dataclass
from math import hypot, inf
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.polynomial import polynomial

from vsensor.schema import Config
from vsensor.types import Array, BoolArray, frozen

ROUNDING = 16.0 * float(np.finfo(np.float64).eps)
"""A residual of the inverse below this part of the terms that were added up is rounding."""
MARGIN = 1e-6
"""The range ends by this part of its radius before the fold, where the inverse has no derivative."""
TABLE_RADIUS = 4.0
"""The table of first guesses ends here (76 degrees off axis) or with the range."""
FAST_STEPS = 2
"""Newton steps on all points at once, with the derivative of the first: from the table's guess (1e-7)
two end at rounding. One more where there is a tangential part, of which the guess knows the first order."""
GUARDED_STEPS = 100
"""Further steps, damped, for the few points that are then not there: close to the fold, or outside."""
FAR = 1e9
"""No image is so wide; beyond it the sixth power of the radius would overflow."""
NOTHING = 1e-9
"""A root whose inverse is below this lies further out than any image, where rounding puts some."""


class DistortionConfig(Config, frozen=True, kw_only=True):
    """`[camera.distortion]`: coefficients as OpenCV names them, of normalised coordinates; 0 = none."""

    k1: Annotated[float, Meta(ge=-5.0, le=5.0)] = 0.0
    k2: Annotated[float, Meta(ge=-50.0, le=50.0)] = 0.0
    k3: Annotated[float, Meta(ge=-500.0, le=500.0)] = 0.0
    p1: Annotated[float, Meta(ge=-0.5, le=0.5)] = 0.0
    p2: Annotated[float, Meta(ge=-0.5, le=0.5)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Distortion:
    """A lens ready for use. `radius` ends the monotone range (inf = none); the tables start the inverse.

    `squares` (n,) are squared distorted radii, `shrinks` (n,) the undistorted radius over the distorted.
    """

    k1: float
    k2: float
    k3: float
    p1: float
    p2: float
    radius: float
    squares: Array
    shrinks: Array

    @classmethod
    def of(cls, config: DistortionConfig) -> "Distortion | None":
        """Find the range and fill the tables; None where there is no distortion at all."""
        k1, k2, k3, p1, p2 = config.k1, config.k2, config.k3, config.p1, config.p2
        if not (k1 or k2 or k3 or p1 or p2):
            return None
        radius = monotone_radius(config) * (1.0 - MARGIN)
        r2 = np.linspace(0.0, min(radius, TABLE_RADIUS), 1025) ** 2
        gain = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return cls(
            k1=k1,
            k2=k2,
            k3=k3,
            p1=p1,
            p2=p2,
            radius=radius,
            squares=frozen(r2 * gain * gain),
            shrinks=frozen(1.0 / gain),
        )


def monotone_radius(config: DistortionConfig) -> float:
    """Return the radius where the Jacobian first stops to be positive definite in any direction; inf = none.

    With g = 1 + k1 r^2 + ..., A = d(r g)/dr, P = hypot(p1, p2) and c the cosine of the angle to (p2, p1)
    the determinant is A g + 2 P r (A + 3 g) c + P^2 r^2 (16 c^2 - 4). Over c its least value is
    (A - 6 P r)(g - 2 P r) at c = -1, or, where |A + 3 g| < 16 P r, -(A - g)(A - 9 g)/16 - 4 P^2 r^2.
    """
    k1, k2, k3 = config.k1, config.k2, config.k3
    tangential = hypot(config.p1, config.p2)
    radii = _positive_roots([1.0, -6.0 * tangential, 3.0 * k1, 0.0, 5.0 * k2, 0.0, 7.0 * k3])
    radii += _positive_roots([1.0, -2.0 * tangential, k1, 0.0, k2, 0.0, k3])
    if tangential:
        difference = polynomial.polymul([2.0 * k1, 4.0 * k2, 6.0 * k3], [8.0, 6.0 * k1, 4.0 * k2, 2.0 * k3])
        difference[0] -= 64.0 * tangential**2  # (A - g)(A - 9 g) + 64 P^2 r^2 = -r^2 difference(r^2)
        for r2 in _positive_roots(difference.tolist()):
            least_at = 4.0 + r2 * (6.0 * k1 + r2 * (8.0 * k2 + r2 * 10.0 * k3))  # A + 3 g
            if abs(least_at) <= 16.0 * tangential * r2**0.5 + 1e-6:
                radii.append(r2**0.5)
    return min(radii, default=inf)


def _positive_roots(coefficients: list[float]) -> list[float]:
    """Return the positive roots of a polynomial (ascending); one that it only just misses counts, too.

    Found as their inverses, so that the least are exact and the numbers that do nothing do no harm.
    """
    inverses = np.roots(coefficients)
    is_real = np.abs(inverses.imag) <= 1e-6 * np.abs(inverses)
    found: list[float] = (1.0 / inverses.real[is_real & (inverses.real > NOTHING)]).tolist()
    return found


def distort(lens: Distortion, x: Array, y: Array) -> tuple[Array, Array]:
    """Return where points x, y (N,) appear; NaN outside the monotone range, where only ghosts would be."""
    x_seen, y_seen = _distorted(lens, x, y)
    if lens.radius < inf:
        outside = ~_is_inside(lens, x, y)
        x_seen[outside] = np.nan
        y_seen[outside] = np.nan
    return x_seen, y_seen


def undistort(lens: Distortion, x_seen: Array, y_seen: Array) -> tuple[Array, Array]:
    """Return the points (N,) of the monotone range that appear at x_seen, y_seen; NaN where there is none.

    Distorted again they give x_seen, y_seen to rounding (`ROUNDING`).
    """
    r2_seen = x_seen * x_seen + y_seen * y_seen
    shrink = np.interp(r2_seen, lens.squares, lens.shrinks, right=np.nan)
    x, y = x_seen * shrink, y_seen * shrink
    steps = FAST_STEPS
    if lens.p1 or lens.p2:
        steps += 1
        dx, dy = _missing(lens, x, y, x_seen, y_seen)
        x, y = x + dx * shrink, y + dy * shrink
    xx, xy, yy = inverse_jacobian(lens, x, y)
    for _ in range(steps):
        dx, dy = _missing(lens, x, y, x_seen, y_seen)
        x, y = x + xx * dx + xy * dy, y + xy * dx + yy * dy
    solved = _is_solved(lens, x, y, *_missing(lens, x, y, x_seen, y_seen))
    if not solved.all():
        x[~solved] = y[~solved] = np.nan
        lost = (~solved & (r2_seen <= _reach(lens) ** 2)).nonzero()[0]
        x[lost], y[lost] = _guarded(lens, x_seen[lost], y_seen[lost])
    return x, y


def jacobian(lens: Distortion, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return dx''/dx, dx''/dy = dy''/dx, dy''/dy at undistorted points (N,)."""
    r2 = x * x + y * y
    slope = 2.0 * (lens.k1 + r2 * (2.0 * lens.k2 + r2 * (3.0 * lens.k3)))
    gain = 1.0 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3))
    if not (lens.p1 or lens.p2):
        return gain + slope * x * x, slope * x * y, gain + slope * y * y
    px, py = 2.0 * lens.p2 * x, 2.0 * lens.p1 * y
    return (
        gain + slope * x * x + 3.0 * px + py,
        slope * x * y + 2.0 * (lens.p1 * x + lens.p2 * y),
        gain + slope * y * y + px + 3.0 * py,
    )


def inverse_jacobian(lens: Distortion, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return dx/dx'', dx/dy'' = dy/dx'', dy/dy'' at undistorted points (N,); NaN past the fold."""
    xx, xy, yy = jacobian(lens, x, y)
    determinant = xx * yy - xy * xy
    scale = 1.0 / np.where(determinant > 0.0, determinant, np.nan)
    return yy * scale, -xy * scale, xx * scale


def _distorted(lens: Distortion, x: Array, y: Array) -> tuple[Array, Array]:
    r2 = x * x + y * y
    gain = 1.0 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3))
    if not (lens.p1 or lens.p2):
        return x * gain, y * gain
    gain += 2.0 * (lens.p2 * x + lens.p1 * y)  # 2 p1 x y + p2 (r2 + 2 x^2) = x 2 (p2 x + p1 y) + p2 r2
    return x * gain + lens.p2 * r2, y * gain + lens.p1 * r2


def _reach(lens: Distortion) -> float:
    """Return a distorted radius beyond which no point of the range appears."""
    if lens.radius == inf:
        return FAR
    r2 = lens.radius * lens.radius
    edge = lens.radius * (1.0 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3)))
    return (edge + 3.0 * hypot(lens.p1, lens.p2) * r2) * (1.0 + MARGIN)


def _is_inside(lens: Distortion, x: Array, y: Array) -> BoolArray:
    return np.asarray(x * x + y * y <= lens.radius * lens.radius)


def _missing(lens: Distortion, x: Array, y: Array, x_seen: Array, y_seen: Array) -> tuple[Array, Array]:
    """Return how far the points are from appearing at x_seen, y_seen."""
    x_found, y_found = _distorted(lens, x, y)
    return x_seen - x_found, y_seen - y_found


def _is_solved(lens: Distortion, x: Array, y: Array, dx_seen: Array, dy_seen: Array) -> BoolArray:
    """Return whether the residual is rounding and the point in the range."""
    r2 = x * x + y * y
    terms = 1.0 + r2 * (abs(lens.k1) + r2 * (abs(lens.k2) + r2 * abs(lens.k3)))
    if lens.p1 or lens.p2:
        terms += 3.0 * hypot(lens.p1, lens.p2) * np.sqrt(r2)
    bound = ROUNDING * terms
    solved = dx_seen * dx_seen + dy_seen * dy_seen <= bound * bound * r2
    return np.asarray(solved & (r2 <= lens.radius * lens.radius))


def _guarded(lens: Distortion, x_seen: Array, y_seen: Array) -> tuple[Array, Array]:
    """Return the inverse by damped Newton steps from well inside the range, NaN where they end unsolved.

    A step that leaves the range ends on its edge. It is taken only if it brings the image closer;
    otherwise half of it.
    """
    start, edge = 0.99 * min(lens.radius, TABLE_RADIUS), lens.radius * (1.0 - ROUNDING)
    r_seen = np.sqrt(x_seen * x_seen + y_seen * y_seen)
    shrink = np.interp(r_seen * r_seen, lens.squares, lens.shrinks)
    shrink = np.minimum(shrink, start / np.maximum(r_seen, start * 1e-3))
    x, y = x_seen * shrink, y_seen * shrink
    part = np.ones(len(x))
    dx_seen, dy_seen = _missing(lens, x, y, x_seen, y_seen)
    solved = _is_solved(lens, x, y, dx_seen, dy_seen)
    for _ in range(GUARDED_STEPS):
        xx, xy, yy = inverse_jacobian(lens, x, y)
        x_next = x + part * (xx * dx_seen + xy * dy_seen)
        y_next = y + part * (xy * dx_seen + yy * dy_seen)
        back = np.minimum(edge / np.maximum(np.hypot(x_next, y_next), start), 1.0)
        x_next, y_next = x_next * back, y_next * back
        dx_next, dy_next = _missing(lens, x_next, y_next, x_seen, y_seen)
        closer = dx_next * dx_next + dy_next * dy_next < dx_seen * dx_seen + dy_seen * dy_seen
        taken = closer & ~solved
        x, y = np.where(taken, x_next, x), np.where(taken, y_next, y)
        dx_seen, dy_seen = np.where(taken, dx_next, dx_seen), np.where(taken, dy_next, dy_seen)
        part = np.where(taken, 1.0, 0.5 * part)
        solved = _is_solved(lens, x, y, dx_seen, dy_seen)
        if (solved | (part < 1e-9)).all():
            break
    return np.where(solved, x, np.nan), np.where(solved, y, np.nan)
