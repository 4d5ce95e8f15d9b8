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
between ticks and for waves of the road (`swell`): no step size, stable for every tick.
"""

from cmath import exp
from dataclasses import dataclass
from functools import lru_cache
from math import pi, sqrt

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
