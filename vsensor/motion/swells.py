"""The swells of a drive: which of them an axle may touch."""

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass

from vsensor.motion.config import BumpConfig
from vsensor.motion.swell import bump_swell
from vsensor.types import Swell


@dataclass(frozen=True, slots=True)
class Swells:
    """Swells in driven order, and the longest one's length."""

    starts_m: tuple[float, ...]
    swells: tuple[Swell, ...]
    longest_m: float

    @classmethod
    def of(cls, swells: Iterable[Swell]) -> "Swells":
        """Put the swells in order."""
        ordered = tuple(sorted(swells, key=lambda swell: swell.from_m))
        longest_m = max((swell.to_m - swell.from_m for swell in ordered), default=0.0)
        return cls(tuple(swell.from_m for swell in ordered), ordered, longest_m)

    @classmethod
    def of_bumps(cls, bumps: Iterable[BumpConfig]) -> "Swells":
        """Return the bumps of a scenario."""
        return cls.of(bump_swell(bump.at_m, bump.length_m, bump.height_m) for bump in bumps)

    def near(self, from_m: float, to_m: float) -> tuple[Swell, ...]:
        """Return those that may be touched between two places."""
        first = bisect_left(self.starts_m, from_m - self.longest_m)
        return self.swells[first : bisect_left(self.starts_m, to_m)]
