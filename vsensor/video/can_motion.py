"""How the vehicle moved when the pictures were taken, as a CAN log says it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vsensor.errors import LogError
from vsensor.profile import Profile
from vsensor.types import NANOSECONDS_PER_SECOND, Array
from vsensor.video.can_signals import read_can
from vsensor.video.types import Motion

QUANTITIES = {
    "speed_mps": "ego.speed_mps",
    "yaw_rate_radps": "ego.yaw_rate_radps",
    "acceleration_mps2": "ego.acceleration_mps2",
}


class CanMotion:
    """The motion of a log in the time of a video that began `begins_s` after the log's first frame."""

    def __init__(self, log: Path, profiles: Sequence[Profile], begins_s: float, lasts_s: float) -> None:
        """Read the log; raises LogError where it says nothing of the motion, or not of this time."""
        self._signals, self._begins_s = read_can(log, profiles), begins_s
        self._signals.require_overlap(begins_s, begins_s + lasts_s)
        if not set(QUANTITIES.values()) & set(self._signals.series):
            names = ", ".join(profile.name for profile in profiles)
            raise LogError(f"{log}: has none of {', '.join(QUANTITIES.values())} as profile {names} reads it")

    def at(self, t_ns: int) -> Motion:
        """Return the motion at a time of the video."""
        return self.during(np.array([t_ns / NANOSECONDS_PER_SECOND]))[0]

    def during(self, t_s: Array) -> list[Motion]:
        """Return the motion at times (N,) of the video."""
        found = [self._signals.linear(name, t_s + self._begins_s).tolist() for name in QUANTITIES.values()]
        return [Motion(**dict(zip(QUANTITIES, row, strict=True))) for row in zip(*found, strict=True)]


def read_motions(log: Path, profiles: Sequence[Profile], t_s: Array) -> list[Motion]:
    """Return the motion at times (N,), ascending, of a log; raises as CanMotion."""
    begins_s = float(t_s[0])
    return CanMotion(log, profiles, begins_s, float(t_s[-1]) - begins_s).during(t_s - begins_s)
