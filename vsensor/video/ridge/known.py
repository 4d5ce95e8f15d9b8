"""What is known of a road before a picture is looked at: from the pictures before, moved to now.

It holds the fit where the picture says little: how far a line and the road's direction can go in the time
that has passed is its standard deviation, so what is seen well counts alone and nothing is smoothed.
"""

from dataclasses import dataclass, replace
from math import exp, inf, isfinite

import numpy as np

from vsensor.types import NANOSECONDS_PER_SECOND, Array
from vsensor.video.ridge.search import Shape
from vsensor.video.types import Motion

REST_S = 3.0
"""The body's pitch at rest is the mean of so long."""
KNOWN_S = 1.0
"""A road's shape is of use for the next pictures for so long."""
OFFSET_STD = (0.08, 0.8)
"""Of a line's offset (m), and by how much it grows a second: the vehicle moves aside."""
SLOPE_STD = (0.01, 0.15)
"""Of the road's direction: the vehicle turns."""
BEND_STD = (0.002, 0.02)
"""Of the road's curvature (1/m): it begins to bend, or the vehicle turns off."""
ANY_OFFSET_M, ANY_SLOPE = 10.0, 0.15
"""Standard deviations where nothing is known."""
SAME_M = 0.5
"""A line so near to a known one is that one."""
SAME_STRIPE_M = 0.12
"""So near to a known double marking's outer stripe a line is that stripe."""
DOUBLE_S = 1.0
"""A double marking is taken for one for so long without its inner stripe: paint between two dashes."""
BESIDE_M, LANE_STD_M = 0.8, 0.25
"""A line so near to where the lane's other line is expected is that, and how sure its place is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Double:
    """A double marking: its outer stripe's offset at the camera, how far to the left of it the inner one is.

    `age_s` is the time since the inner one was seen, `pictures` in how many it was.
    """

    outer_m: float
    gap_m: float
    age_s: float = 0.0
    pictures: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """The road as expected: its shape, or None, and the offsets (L,) of its lines at the camera.

    Of its double markings the lines are the inner stripes.
    `rest_rad` is the body's pitch at rest, `age_s` the time since the road was last seen, `lane_m` how wide
    the lane is (inf: not known).
    """

    shape: Shape | None = None
    offsets_m: tuple[float, ...] = ()
    rest_rad: float = 0.0
    age_s: float = 0.0
    lane_m: float = inf
    doubles: tuple[Double, ...] = ()

    def double(self, offset_m: float) -> Double | None:
        """Return the double marking whose outer stripe a line at `offset_m` is, if it is one's."""
        of = (double for double in self.doubles if abs(double.outer_m - offset_m) < SAME_STRIPE_M)
        return next(of, None)

    def near(self, offset_m: float) -> float | None:
        """Return the offset of the known line that a line at `offset_m` may be; None if none is near."""
        stripes = (*self.offsets_m, *(double.outer_m for double in self.doubles))
        nearest = min(stripes, key=lambda other: abs(other - offset_m), default=None)
        return nearest if nearest is not None and abs(nearest - offset_m) < SAME_M else None

    def offsets(self, found_m: Array) -> tuple[Array, Array]:
        """Return where lines found at `found_m` (L,) are expected, and standard deviations (L,)."""
        expected = [self._expected(offset) for offset in found_m.tolist()]
        return np.array([mean for mean, _ in expected]), np.array([std for _, std in expected])

    def _expected(self, found_m: float) -> tuple[float, float]:
        """Return where a line found at `found_m` is expected, and how surely: as it was, or a lane aside."""
        if (near := self.near(found_m)) is not None:
            return near, OFFSET_STD[0] + OFFSET_STD[1] * self.age_s
        places = [at + side * self.lane_m for at in self.offsets_m for side in (-1.0, 1.0)]
        beside = min(places, key=lambda other: abs(other - found_m), default=inf)
        return (beside, LANE_STD_M) if abs(beside - found_m) < BESIDE_M else (found_m, ANY_OFFSET_M)

    def slope_and_bend(self, any_bend_per_m: float) -> tuple[Array, Array]:
        """Return the expected slope and bend (2,) and their standard deviations (2,)."""
        if self.shape is None:
            return np.zeros(2), np.array([ANY_SLOPE, any_bend_per_m])
        std = [SLOPE_STD[0] + SLOPE_STD[1] * self.age_s, BEND_STD[0] + BEND_STD[1] * self.age_s]
        return np.array([self.shape.slope, self.shape.bend_per_m]), np.array(std)


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """The road as last seen, at `t_ns`, the pitch at rest, how wide the lane is (inf: not known yet)."""

    shape: Shape | None = None
    offsets_m: tuple[float, ...] = ()
    t_ns: int = 0
    rest_rad: float = 0.0
    lane_m: float = inf
    doubles: tuple[Double, ...] = ()

    def now(self, motion: Motion, t_ns: int) -> Known:
        """Return what is to be expected of a picture: the vehicle has moved along x and turned."""
        age_s = (t_ns - self.t_ns) / NANOSECONDS_PER_SECOND
        if self.shape is None or not 0.0 <= age_s < KNOWN_S:
            return Known(rest_rad=self.rest_rad)
        way_m = motion.speed_mps * age_s if isfinite(motion.speed_mps) else 0.0
        turned = motion.yaw_rate_radps * age_s if isfinite(motion.yaw_rate_radps) else 0.0
        bent = self.shape.bend_per_m * way_m if isfinite(motion.yaw_rate_radps) else 0.0
        slope = self.shape.slope + bent - turned
        aside_m = 0.5 * (self.shape.slope + slope) * way_m
        return Known(
            shape=replace(self.shape, slope=slope),
            offsets_m=tuple(offset + aside_m for offset in self.offsets_m),
            rest_rad=self.rest_rad,
            age_s=age_s,
            lane_m=self.lane_m,
            doubles=tuple(
                replace(double, outer_m=double.outer_m + aside_m, age_s=double.age_s + age_s)
                for double in self.doubles
                if double.age_s + age_s < DOUBLE_S
            ),
        )

    def after(
        self, shape: Shape, offsets_m: tuple[float, ...], doubles: tuple[Double, ...], t_ns: int
    ) -> "Memory":
        """Return the memory of a picture; two lines or more also say where the body is at rest."""
        rest = self.rest_rad
        if len(offsets_m) >= 2:
            duration_s = (t_ns - self.t_ns) / NANOSECONDS_PER_SECOND if self.shape else REST_S
            rest += (shape.pitch_rad - rest) * (1.0 - exp(-max(duration_s, 0.0) / REST_S))
        return replace(self, shape=shape, offsets_m=offsets_m, doubles=doubles, t_ns=t_ns, rest_rad=rest)
