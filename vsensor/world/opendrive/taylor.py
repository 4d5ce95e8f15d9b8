"""Taylor series at many places at once: derivatives up to the third, exact in what is composed of them.

A series is an array (TERMS, N): f, f', f''/2, f'''/6 over the distance s, at N places. Sums are sums of
arrays; products, roots, sines and cosines are here.
"""

import numpy as np

from vsensor.types import Array
from vsensor.world.opendrive.polynomial import Cubics

TERMS = 4


def constant(value: Array) -> Array:
    """Return the series of what does not change, `value` (N,)."""
    series = np.zeros((TERMS, *np.shape(value)))
    series[0] = value
    return series


def product(a: Array, b: Array) -> Array:
    """Return the series of a b: term k is the sum of a_i b_(k - i), a diagonal at a time."""
    out: Array = a[0] * b
    for k in range(1, TERMS):
        out[k:] += a[k] * b[: TERMS - k]
    return out


def power(a: Array, exponent: float) -> Array:
    """Return the series of a^exponent, a > 0."""
    out = np.empty_like(a)
    out[0] = a[0] ** exponent
    for k in range(1, TERMS):
        terms = [(i * exponent - (k - i)) * a[i] * out[k - i] for i in range(1, k + 1)]
        out[k] = sum(terms) / (k * a[0])
    return out


def sine_cosine(angle: Array) -> tuple[Array, Array]:
    """Return the series of sine and cosine."""
    s, c = np.sin(angle[0]), np.cos(angle[0])
    _, first, second, third = angle
    square = first * first / 2
    # sin(a + d) = s (1 - d^2 / 2) + c (d - d^3 / 6), d = first h + second h^2 + third h^3
    odd, both = third - first * square / 3, first * second
    sine = np.array((s, c * first, c * second - s * square, c * odd - s * both))
    cosine = np.array((c, -s * first, -s * second - c * square, -s * odd - c * both))
    return sine, cosine


def integral(start: Array, rate: Array) -> Array:
    """Return the series of the integral of `rate` that is `start` (N,) here."""
    return np.array((start, rate[0], rate[1] / 2, rate[2] / 3))


def polynomial(coefficients: tuple[float, ...] | Array, x: Array) -> Array:
    """Return the series of c0 + c1 x + ... of a series x; each coefficient is a number or (N,)."""
    out = np.zeros_like(x)
    for coefficient in reversed(tuple(coefficients)):
        out = product(out, x)
        out[0] += coefficient
    return out


def of_cubics(cubics: Cubics, s_m: Array) -> Array:
    """Return the series of a piecewise cubic at s (N,): of its record there, so it is exact."""
    if cubics.is_zero:
        return np.zeros((TERMS, len(s_m)))
    if len(cubics.starts_m) == 1 and cubics.starts_m[0] <= 0.0:
        a, b, c, d = cubics.coefficients[0]
        ds = s_m - cubics.starts_m[0]
    else:
        place = np.searchsorted(cubics.starts_m, s_m, side="right") - 1
        first = np.maximum(place, 0)
        a, b, c, d = np.where(place < 0, 0.0, cubics.coefficients[first].T)
        ds = s_m - cubics.starts_m[first]
    series = np.empty((TERMS, len(s_m)))
    series[0] = a + ds * (b + ds * (c + ds * d))
    series[1] = b + ds * (2 * c + ds * 3 * d)
    series[2] = c + ds * 3 * d
    series[3] = d
    return series


def slope_of(cubic: Array) -> Array:
    """Return the series of the derivative of a cubic, whose fourth derivative is 0."""
    return np.array((cubic[1], 2 * cubic[2], 3 * cubic[3], np.zeros_like(cubic[0])))


def shifted(series: Array, step: Array) -> Array:
    """Return the series about places (N,) further on, of a cubic."""
    a, b, c, d = series
    return np.array(
        (a + step * (b + step * (c + step * d)), b + step * (2 * c + step * 3 * d), c + step * 3 * d, d)
    )


def over(x: Array, y: Array) -> Array:
    """Return the series of y over x of a curve whose x and y are series over the same parameter, x' not 0."""
    first = 1.0 / x[1]
    second = -x[2] * first**3
    third = (2 * x[2] ** 2 - x[1] * x[3]) * first**5
    return np.array(
        (
            y[0],
            y[1] * first,
            y[2] * first**2 + y[1] * second,
            y[3] * first**3 + 2 * y[2] * first * second + y[1] * third,
        )
    )
