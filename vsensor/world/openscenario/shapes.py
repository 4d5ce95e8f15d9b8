"""How a value gets from one to another: step, linear, cubic, sinusoidal, in closed form.

cubic p^2 (3 - 2 p), sinusoidal (1 - cos(pi p)) / 2, both level at their ends. A *rate* is the largest
slope on the way, as esmini has it: 3/2 of the mean one (cubic), pi/2 (sinusoidal).
"""

from math import cos, inf, pi, sin, sqrt

from msgspec import Struct

PEAK_SLOPE = {"step": inf, "linear": 1.0, "cubic": 1.5, "sinusoidal": pi / 2}
PEAK_BEND = {"step": inf, "linear": inf, "cubic": 6.0, "sinusoidal": pi**2 / 2}


def share(shape: str, p: float) -> tuple[float, float, float]:
    """Return how much of the way is done at p in [0, 1], and its first and second derivative by p."""
    if p <= 0.0 and shape != "step":
        return 0.0, _START[shape][0], _START[shape][1]
    if p >= 1.0 or shape == "step":
        return 1.0, 0.0, 0.0
    if shape == "linear":
        return p, 1.0, 0.0
    if shape == "cubic":
        return p * p * (3.0 - 2.0 * p), 6.0 * p * (1.0 - p), 6.0 - 12.0 * p
    return (1.0 - cos(pi * p)) / 2.0, pi / 2 * sin(pi * p), pi**2 / 2 * cos(pi * p)


_START = {"linear": (1.0, 0.0), "cubic": (0.0, 6.0), "sinusoidal": (0.0, pi**2 / 2)}


def integral(shape: str, p: float) -> float:
    """Return the integral of the share from 0 to p in [0, 1]."""
    if shape == "step":
        return p
    if shape == "linear":
        return p * p / 2.0
    if shape == "cubic":
        return p**3 * (1.0 - p / 2.0)
    return p / 2.0 - sin(pi * p) / (2.0 * pi)


class Speed(Struct, frozen=True):
    """A speed over time: from `start` to `end` in `seconds` from `from_s` on, then constant."""

    start_mps: float = 0.0
    end_mps: float = 0.0
    shape: str = "step"
    from_s: float = 0.0
    seconds: float = 0.0

    def value(self, t_s: float) -> float:
        """Return the speed."""
        if t_s - self.from_s >= self.seconds:
            return self.end_mps
        done = share(self.shape, (t_s - self.from_s) / self.seconds)[0]
        return self.start_mps + (self.end_mps - self.start_mps) * done

    def slope(self, t_s: float) -> float:
        """Return the acceleration (from the right at either end)."""
        if t_s - self.from_s >= self.seconds:
            return 0.0
        slope = share(self.shape, (t_s - self.from_s) / self.seconds)[1]
        return (self.end_mps - self.start_mps) * slope / self.seconds

    def way(self, t_s: float) -> float:
        """Return the way driven since `from_s`."""
        gone = t_s - self.from_s
        if gone >= self.seconds:
            return self._whole() + (gone - self.seconds) * self.end_mps
        change = (self.end_mps - self.start_mps) * self.seconds * integral(self.shape, gone / self.seconds)
        return self.start_mps * gone + change

    def _whole(self) -> float:
        if self.seconds == 0.0:
            return 0.0
        change = self.end_mps - self.start_mps
        return self.seconds * (self.start_mps + change * integral(self.shape, 1.0))

    @property
    def until_s(self) -> float:
        """When the change is done."""
        return self.from_s + self.seconds


class Lateral(Struct, frozen=True):
    """An offset over time, or over the distance along the track (`by_distance`)."""

    start_m: float = 0.0
    end_m: float = 0.0
    shape: str = "step"
    begin: float = 0.0
    length: float = 0.0
    by_distance: bool = False

    def at(self, time_or_distance: float) -> tuple[float, float, float]:
        """Return the offset and its first and second derivative by time or by distance."""
        gone = time_or_distance - self.begin
        if gone >= self.length:
            return self.end_m, 0.0, 0.0
        done, slope, bend = share(self.shape, gone / self.length)
        change = self.end_m - self.start_m
        return (
            self.start_m + change * done,
            change * slope / self.length,
            change * bend / self.length**2,
        )

    def is_done(self, t_s: float, s_m: float) -> bool:
        """Return whether the end is reached."""
        return (s_m if self.by_distance else t_s) - self.begin >= self.length - 1e-9


def seconds_for(shape: str, dimension: str, value: float, change: float) -> float:
    """Return how long a change takes, given the time, or the largest rate."""
    if shape == "step" or change == 0.0:
        return value if dimension == "time" and shape != "step" else 0.0
    return value if dimension == "time" else PEAK_SLOPE[shape] * abs(change) / value


def seconds_within(shape: str, change_m: float, acceleration_mps2: float) -> float:
    """Return the shortest time of a lateral change that stays within an acceleration.

    A linear one bends at its ends alone: it gets the time of the sinusoidal one.
    """
    bend = PEAK_BEND[shape] if PEAK_BEND[shape] < inf else PEAK_BEND["sinusoidal"]
    return sqrt(bend * abs(change_m) / acceleration_mps2)
