"""Unevenness as sums of waves: heights, and what a wave lifts a mode by, in closed form.

Over a swell at constant speed v the height is a sum of exp(+-i k v t), so the integral of
exp(p (T - t)) c h(t) that a mode (q' = p q + c h) gathers in a tick has a closed solution: no step size,
nothing between ticks is missed.
"""

from cmath import exp
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.motion.mode import NANOSECONDS_PER_SECOND, Mode
from vsensor.types import Swell, frozen


def bump_swell(at_m: float, length_m: float, height_m: float) -> Swell:
    """Return a bump, h/2 (1 - cos(2 pi s / length)); a negative height is a hole."""
    return Swell(
        from_m=at_m,
        to_m=at_m + length_m,
        wave_radpm=frozen([0.0, 2.0 * pi / length_m]),
        amplitude_m=frozen([height_m / 2.0, -height_m / 2.0], np.complex128),
    )


def swell_height_m(swell: Swell, s_m: float) -> float:
    """Return the height of the road at a place."""
    if not swell.from_m <= s_m < swell.to_m:
        return 0.0
    return float((swell.amplitude_m * np.exp(1j * swell.wave_radpm * (s_m - swell.from_m))).sum().real)


def lifted(mode: Mode, swell: Swell, s_m: float, speed_mps: float, period_ns: int) -> complex:
    """Return what a swell adds to q in a tick that an axle begins at `s_m` and drives at constant speed."""
    end_s = period_ns / NANOSECONDS_PER_SECOND
    to_start_m, to_end_m = swell.from_m - s_m, swell.to_m - s_m
    if speed_mps == 0.0:
        on_s, off_s = (0.0, end_s) if to_start_m < 0.0 < to_end_m else (0.0, 0.0)
    else:
        on_s, off_s = sorted((to_start_m / speed_mps, to_end_m / speed_mps))
    on_s, off_s = max(on_s, 0.0), min(off_s, end_s)
    if off_s <= on_s:
        return 0j
    phases = swell.amplitude_m * np.exp(-1j * swell.wave_radpm * to_start_m)
    rates = 1j * speed_mps * swell.wave_radpm

    def gathered(rate: NDArray[Any]) -> NDArray[Any]:
        """Return the integral of exp(p (T - t) + rate t) from on to off, for each wave."""
        at_off = exp(mode.pole * (end_s - off_s)) * np.exp(rate * off_s)
        at_on = exp(mode.pole * (end_s - on_s)) * np.exp(rate * on_s)
        return np.asarray((at_off - at_on) / (rate - mode.pole))

    both = (phases * gathered(rates)).sum() + (phases.conj() * gathered(rates.conj())).sum()
    return mode.foot * complex(both) / 2.0
