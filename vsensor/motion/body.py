r"""The body on its springs: pitch and roll from acceleration, pitch and heave from bumps under each axle.

            heave                 bump, seen by an axle that rolls over it
      pitch  ^                       _
    (__ .----|----. roll           /   \       h/2 (1 - cos(2 pi s / length))
       (o)       (o)           ___/     \___
     front       rear

Each is z'' + 2 d w z' + w^2 z = w^2 u, where an acceleration is the force u = gain * a, and
... = w^2 u + 2 d w u' where the road is what lifts the springs' and dampers' feet (the axles follow
the road: wheels hop at 10 Hz or more). Of the two conjugate poles one is kept, so a mode is one
complex number q with z = Re q, q' = p q + c u, which has a closed solution for a force that is linear
between ticks and for a (1 - cos) bump anywhere in a tick: no step size, stable for every tick.
"""

from bisect import bisect_left
from cmath import exp
from dataclasses import dataclass
from functools import lru_cache
from math import pi, sqrt

from vsensor.motion.config import BumpConfig

NANOSECONDS_PER_SECOND = 1e9


@dataclass(frozen=True, slots=True)
class Mode:
    """A damped oscillation: its upper pole and what a lifted foot drives it with, both in 1/s.

    `settle` is -q / u of a force that lasts; its real part is -1.
    """

    pole: complex
    settle: complex
    foot: complex

    @classmethod
    def of(cls, frequency_hz: float, damping: float) -> "Mode":
        """Return the mode of an undamped natural frequency and a damping ratio below 1."""
        w = 2.0 * pi * frequency_hz
        damped = w * sqrt(1.0 - damping**2)
        pole = complex(-damping * w, damped)
        force = complex(0.0, -(w**2) / damped)  # twice the residue of w^2 / ((s - p)(s - p*)) at p
        foot = (w**2 + 2.0 * damping * w * pole) / complex(0.0, damped)
        return cls(pole, force / pole, foot)


@lru_cache(maxsize=64)
def _step(mode: Mode, period_ns: int) -> tuple[complex, complex]:
    """Return what a tick leaves of a mode, and what it adds per change of the force."""
    turn = mode.pole * (period_ns / NANOSECONDS_PER_SECOND)
    decay = exp(turn)
    return decay, mode.settle * (decay - 1.0) / turn


def ring(mode: Mode, deviation: complex, change: float, period_ns: int) -> complex:
    """Return the deviation from the settled state after a tick in which the force changed linearly.

    The mode stands at force + Re(deviation), so the settled lean is exactly the force.
    """
    decay, added = _step(mode, period_ns)
    return decay * deviation + added * change


@dataclass(frozen=True, slots=True)
class Bumps:
    """The bumps of a drive in driven order, and the longest one's length."""

    starts_m: tuple[float, ...]
    bumps: tuple[BumpConfig, ...]
    longest_m: float

    @classmethod
    def of(cls, bumps: tuple[BumpConfig, ...]) -> "Bumps":
        """Put the bumps in order."""
        ordered = tuple(sorted(bumps, key=lambda bump: bump.at_m))
        longest_m = max((bump.length_m for bump in ordered), default=0.0)
        return cls(tuple(bump.at_m for bump in ordered), ordered, longest_m)

    def near(self, from_m: float, to_m: float) -> tuple[BumpConfig, ...]:
        """Return those that may be touched between two places."""
        first = bisect_left(self.starts_m, from_m - self.longest_m)
        return self.bumps[first : bisect_left(self.starts_m, to_m)]


def bump_height_m(bump: BumpConfig, s_m: float) -> float:
    """Return the height of the road at a place."""
    along = (s_m - bump.at_m) / bump.length_m
    return bump.height_m * (1.0 - exp(2j * pi * along).real) / 2.0 if 0.0 < along < 1.0 else 0.0


def lifted(mode: Mode, bump: BumpConfig, s_m: float, speed_mps: float, period_ns: int) -> complex:
    """Return what a bump adds to q in a tick that an axle begins at `s_m` and drives at constant speed.

    The integral of exp(p (T - t)) c h(t) over the time on the bump, h split into 1, exp(+iwt), exp(-iwt).
    """
    end_s = period_ns / NANOSECONDS_PER_SECOND
    to_start_m, to_end_m = bump.at_m - s_m, bump.at_m + bump.length_m - s_m
    if speed_mps == 0.0:
        on_s, off_s = (0.0, end_s) if to_start_m < 0.0 < to_end_m else (0.0, 0.0)
    else:
        on_s, off_s = sorted((to_start_m / speed_mps, to_end_m / speed_mps))
    on_s, off_s = max(on_s, 0.0), min(off_s, end_s)
    if off_s <= on_s:
        return 0j
    rate = 2j * pi * speed_mps / bump.length_m
    phase = exp(-2j * pi * to_start_m / bump.length_m)

    def integral(k: complex) -> complex:
        at_end = exp(mode.pole * (end_s - off_s) + k * off_s)
        return (at_end - exp(mode.pole * (end_s - on_s) + k * on_s)) / (k - mode.pole)

    swing = phase * integral(rate) + phase.conjugate() * integral(-rate)
    return mode.foot * (bump.height_m / 2.0) * (integral(0j) - swing / 2.0)
