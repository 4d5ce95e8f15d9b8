"""Rough roads of ISO 8608: a sum of sines with seeded phases whose spectrum is that of a class.

The standard's displacement spectrum is Gd(n) = Gd(n0) (n / n0)^-2 over the spatial frequency n (cycles/m),
n0 = 0.1; a class is known by Gd(n0), of which the geometric mean is taken. The band from 0.011 to 2.83
cycles/m is cut into WAVES parts, equal in the logarithm. Each gets one sine, somewhere in its part, with the
whole variance of the part, so the variance of every part is exactly the integral of Gd over it.
"""

from math import pi

import numpy as np

from vsensor.types import Array, ComplexArray, Swell, frozen

REFERENCE_PER_M = 0.1
EXPONENT = 2.0
LOWEST_PER_M, HIGHEST_PER_M = 0.011, 2.83
"""The band that the standard fits and classifies in."""

WAVES = 128
FADE_M = 2.0
"""Over so much it rises from the even road and goes back to it, on a cosine."""

CLASSES = {grade: 16e-6 * 4.0**place for place, grade in enumerate("ABCDEFGH")}
"""Geometric mean of Gd(n0) in m^3, ISO 8608 table C.1: 16 for A, four times as much for each class on."""


def spectrum_m3(grade: str, frequency_per_m: Array) -> Array:
    """Return Gd(n) in m^3 at spatial frequencies (N,) in cycles/m."""
    return np.asarray(CLASSES[grade] * (frequency_per_m / REFERENCE_PER_M) ** -EXPONENT)


def band_variance_m2(grade: str, low_per_m: Array, high_per_m: Array) -> Array:
    """Return the integral of Gd from `low` to `high`: the variance of the height in the band."""
    return np.asarray(CLASSES[grade] * REFERENCE_PER_M**2 * (1.0 / low_per_m - 1.0 / high_per_m))


def waves(grade: str, seed: int) -> tuple[Array, ComplexArray]:
    """Return wave numbers (WAVES,) in rad/m and complex amplitudes in m."""
    edges = np.geomspace(LOWEST_PER_M, HIGHEST_PER_M, WAVES + 1)
    draws = np.random.Generator(np.random.Philox(key=seed)).random((2, WAVES))
    frequency = edges[:-1] * (edges[1:] / edges[:-1]) ** draws[0]
    amplitude = np.sqrt(2.0 * band_variance_m2(grade, edges[:-1], edges[1:]))
    return 2.0 * pi * frequency, amplitude * np.exp(2j * pi * draws[1])


def rough_swells(grade: str, from_m: float, to_m: float, seed: int) -> tuple[Swell, ...]:
    """Return a rough stretch: it fades in, goes on, fades out."""
    wave, amplitude = waves(grade, seed)
    fade = min(FADE_M, (to_m - from_m) / 2.0)
    parts = [_faded(wave, amplitude, from_m, fade, rises=True)]
    if to_m - from_m > 2.0 * fade:
        there = amplitude * np.exp(1j * wave * fade)
        parts.append(_swell(from_m + fade, to_m - fade, wave, there))
    there = amplitude * np.exp(1j * wave * (to_m - fade - from_m))
    parts.append(_faded(wave, there, to_m - fade, fade, rises=False))
    return tuple(parts)


def _faded(wave: Array, amplitude: ComplexArray, from_m: float, fade_m: float, *, rises: bool) -> Swell:
    """Return waves times (1 -+ cos(pi x / fade)) / 2: each becomes three."""
    sign = -0.25 if rises else 0.25
    turn = pi / fade_m
    waves_ = np.concatenate([wave, wave + turn, wave - turn])
    amplitudes = np.concatenate([0.5 * amplitude, sign * amplitude, sign * amplitude])
    return _swell(from_m, from_m + fade_m, waves_, amplitudes)


def _swell(from_m: float, to_m: float, wave: Array, amplitude: ComplexArray) -> Swell:
    return Swell(
        from_m=from_m, to_m=to_m, wave_radpm=frozen(wave), amplitude_m=frozen(amplitude, np.complex128)
    )
