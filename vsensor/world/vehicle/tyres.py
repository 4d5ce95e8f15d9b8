"""Side force of an axle's tyres that ends where their grip does: Pacejka's magic formula.

    force ^      ______ peak: friction * load, less what braking takes
          |    .'      ''---
          |  /                 F = D sin(C atan(B a - E (B a - atan(B a))))
          |/ stiffness = B C D
          +------------------> slip angle a

Smooth everywhere, so a Runge-Kutta step keeps its order. H. B. Pacejka, Tyre and Vehicle Dynamics: the
formula, and the stiffness over the load (6 % more for 10 % more load).
"""

from dataclasses import dataclass
from math import atan, pi, sin, sqrt

GRAVITY_MPS2 = 9.81

USUAL_OF_STIFFEST = 0.5
"""Share of the load at which an axle would be stiffest, standing: sin(2 atan(load / stiffest))."""

LEAST_GRIP = 0.05
"""What braking at the limit leaves of the side force: no axle is ever without any."""

LEAST_LOAD = 0.05
"""What is left of an axle's standing load when the other one carries it all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tyres:
    """An axle's tyres: `stiffness` N/rad at the standing `load` N; `peak_x`: B a of the largest force."""

    stiffness: float
    load: float
    friction: float
    shape: float
    curvature: float
    peak_x: float

    @classmethod
    def of(cls, stiffness: float, load: float, friction: float, shape: float, curvature: float) -> "Tyres":
        """Compile."""
        low, high = 0.0, 1e6
        for _ in range(100):
            x = (low + high) / 2.0
            is_before = shape * atan(x - curvature * (x - atan(x))) < pi / 2
            low, high = (x, high) if is_before else (low, x)
        return cls(
            stiffness=stiffness,
            load=load,
            friction=friction,
            shape=shape,
            curvature=curvature,
            peak_x=high,
        )

    def grip(self, load: float, along: float) -> tuple[float, float]:
        """Return B (1/rad) and D (N) under a load, when `along` of the grip (-1 to 1) is taken lengthwise.

        The friction circle: what is left across is sqrt(1 - along^2).
        """
        ratio = max(load / self.load, LEAST_LOAD)
        left = sqrt(max(1.0 - along * along, LEAST_GRIP * LEAST_GRIP))
        peak = self.friction * ratio * self.load * left
        squared = USUAL_OF_STIFFEST * USUAL_OF_STIFFEST
        stiffness = self.stiffness * ratio * (1.0 + squared) / (1.0 + squared * ratio * ratio)
        return stiffness / (self.shape * peak), peak

    def force(self, slope: float, peak: float, slip_rad: float) -> float:
        """Return the side force, N, at a slip angle; `slope` and `peak` as `grip` gives them."""
        x = slope * slip_rad
        return peak * sin(self.shape * atan(x - self.curvature * (x - atan(x))))
