"""What the tracker remembers from image to image: a value, bounded in size."""

from dataclasses import dataclass

from vsensor.tracker.config import TrackerConfig
from vsensor.tracker.moved import Moved, drift_std_m, x_now
from vsensor.types import Side, Sighting

MOST_TRACKS = 24
"""Lines remembered at once; a road that shows more loses those that are not seen, the oldest first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A line that was seen, as of the state's time.

    `number` is its own for the whole run. `last` is how it was seen last, `moved` how the vehicle moved
    since. `position_m` is its y at the rear axle, `slope` the road's there; `is_near` if the line was
    seen near enough to be read there itself, `near_ns` when it last was (-1 never). `images` it was
    seen in, less those it was missed in until it `is_confirmed`, which it stays.
    """

    number: int
    last: Sighting
    moved: Moved
    position_m: float
    slope: float
    is_near: bool
    near_ns: int
    is_left: bool
    side: Side | None
    seen_ns: int
    images: int
    is_confirmed: bool

    def age_s(self, t_ns: int) -> float:
        """Return the seconds since it was seen."""
        return (t_ns - self.seen_ns) * 1e-9

    def drift_m(self, t_ns: int) -> float:
        """Return the standard deviation that the motion since then adds to its position."""
        return drift_std_m(self.moved, self.age_s(t_ns))

    def used_up(self, config: TrackerConfig, t_ns: int) -> float:
        """Return the share of its prediction that is used up: time, distance, or length; 1 = all."""
        age_s, seen_to_m = self.age_s(t_ns), self.last.fit.x_max_m
        if not (age_s < config.coast_s and self.moved.path_m < config.coast_m and seen_to_m > 0.0):
            return 1.0
        left_m = x_now(self.last.fit, self.moved, seen_to_m)
        return min(max(age_s / config.coast_s, self.moved.path_m / config.coast_m, 1 - left_m / seen_to_m), 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerState:
    """The lines as of `t_ns`, the motion known then, and the number of the next new line."""

    t_ns: int = 0
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    next_number: int = 0
    tracks: tuple[Track, ...] = ()


def initial_state() -> TrackerState:
    """Return the state before the first image."""
    return TrackerState()
