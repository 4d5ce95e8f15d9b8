"""The driven path from speed and yaw rate (P1 eq. 2.24-2.27, as ERRATA corrects them).

Between two samples the vehicle runs on an arc of constant turn rate, exact for constant inputs:

    psi' = psi + w dt,   chord = v dt sin(w dt / 2) / (w dt / 2)   in direction psi + w dt / 2

with v and w the means over the step. The angle is never wrapped, so it can be interpolated.
"""

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from vsensor.types import NANOSECONDS_PER_SECOND, Array, BoolArray, IntArray, frozen

STANDING_MPS = 0.1
"""Below this a vehicle stands: wheel speed sensors give no pulses (commonly 0.1 to 0.3 m/s)."""
STANDING_S = 1.0
"""Standstill must last this long in total before its yaw rate is taken as the sensor's offset."""
WINDOW_S = 2.0
"""Yaw rate is averaged over this before the median: long against the dither of a coarse signal step."""

DRIVEN_S = 30.0
"""A shorter drive may be one bend, which must not be taken for an offset."""
LARGEST_OFFSET_RADPS = 0.05
"""Nor must more than this (2.9 deg/s): offsets of automotive yaw-rate sensors stay within 3 deg/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetEstimate:
    """A yaw-rate sensor's offset (what it reads while going straight), how it was found, from how much."""

    offset_radps: float
    method: str
    seconds: float


def yaw_rate_offset(t_ns: IntArray, yaw_rate_radps: Array, speed_mps: Array) -> OffsetEstimate:
    """Return the yaw-rate offset of a drive; all arrays (N,), speed at the times of the yaw rate.

    Where the vehicle stands, whatever the sensor reads is offset: the mean over standstill, if that
    lasts long enough. Otherwise the median of 2 s means while driving: bends and lane changes lie to
    both sides or are the smaller part of a drive, and the mean over 2 s resolves what is finer than
    the signal's step. It errs on a drive that bends one way for most of its time; a drive of less than
    30 s, or an offset that no sensor has, is left alone.
    """
    step_s = _steps_s(t_ns)
    standing = np.abs(speed_mps) < STANDING_MPS
    standing_s = float(step_s[standing].sum())
    if standing_s >= STANDING_S:
        mean = float(np.average(yaw_rate_radps[standing], weights=step_s[standing]))
        return OffsetEstimate(offset_radps=mean, method="standstill", seconds=standing_s)
    means = _window_means(t_ns, yaw_rate_radps, step_s, ~standing)
    driven_s = float(step_s[~standing].sum())
    median = float(np.median(means)) if len(means) else 0.0
    method = "median of 2 s means while driving"
    if driven_s < DRIVEN_S:
        median, method = 0.0, f"none: less than {DRIVEN_S:.0f} s of driving"
    elif abs(median) > LARGEST_OFFSET_RADPS:
        median, method = 0.0, "none: it would be more than any sensor has"
    return OffsetEstimate(offset_radps=median, method=method, seconds=driven_s)


def _steps_s(t_ns: IntArray) -> Array:
    """Return the time that each sample stands for (N,): half the way to both neighbours."""
    between = np.diff(t_ns) / NANOSECONDS_PER_SECOND
    steps: Array = np.zeros(len(t_ns))
    steps[:-1] += between / 2
    steps[1:] += between / 2
    return steps


def _window_means(t_ns: IntArray, values: Array, step_s: Array, used: BoolArray) -> Array:
    """Return the means over windows of 2 s that slide by 0.1 s, those that are fully used."""
    edges_s = (t_ns - t_ns[0]) / NANOSECONDS_PER_SECOND
    starts = np.arange(0.0, edges_s[-1] - WINDOW_S + 1e-9, 0.1)
    sums = np.concatenate([[0.0], np.cumsum(np.where(used, values * step_s, 0.0))])
    times = np.concatenate([[0.0], np.cumsum(np.where(used, step_s, 0.0))])
    first, last = np.searchsorted(edges_s, starts), np.searchsorted(edges_s, starts + WINDOW_S)
    covered = times[last] - times[first]
    full = covered > 0.9 * WINDOW_S
    means: Array = (sums[last] - sums[first])[full] / covered[full]
    return means


def common_times(first_ns: IntArray, second_ns: IntArray) -> IntArray:
    """Return all sample times of two signals where both are known, sorted, each once."""
    both: IntArray = np.unique(np.concatenate([first_ns, second_ns]))
    first = np.searchsorted(both, max(first_ns[0], second_ns[0]))
    last = np.searchsorted(both, min(first_ns[-1], second_ns[-1]), side="right")
    return both[first:last]


def resampled(t_ns: IntArray, values: Array, at_ns: IntArray) -> Array:
    """Return a signal (N,) at other times (M,), linear between samples (P1 eq. 2.27), constant outside.

    `t_ns` must not fall; of samples with equal times their mean counts. Times are taken relative to
    the first one, so that float64 keeps nanoseconds.
    """
    times, place, count = np.unique(t_ns, return_inverse=True, return_counts=True)
    means = np.bincount(place, weights=values) / count
    origin = times[0]
    values_at: Array = np.interp((at_ns - origin).astype(float), (times - origin).astype(float), means)
    return values_at


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """A point of the path: position, heading (unwrapped), distance driven, speed, yaw rate, acceleration."""

    x_m: float
    y_m: float
    yaw_rad: float
    s_m: float
    speed_mps: float
    yaw_rate_radps: float
    acceleration_mps2: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Poses:
    """Many points of the path, all arrays (M,); see Pose."""

    x_m: Array
    y_m: Array
    yaw_rad: Array
    s_m: Array
    speed_mps: Array
    yaw_rate_radps: Array
    acceleration_mps2: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenPath:
    """The path of the rear axle, all arrays (N,), times strictly rising; it starts at (0, 0), heading 0.

    `yaw_rad` is not wrapped; `s_m` is the distance driven, backwards counting too.
    """

    t_ns: IntArray
    x_m: Array
    y_m: Array
    yaw_rad: Array
    s_m: Array
    speed_mps: Array
    yaw_rate_radps: Array
    acceleration_mps2: Array

    def at(self, t_ns: int) -> Pose:
        """Return the pose at a time within the path, on the arc between its two samples."""
        k = min(max(int(np.searchsorted(self.t_ns, t_ns, side="right")) - 1, 0), len(self.t_ns) - 2)
        step_s = int(self.t_ns[k + 1] - self.t_ns[k]) / NANOSECONDS_PER_SECOND
        part = (t_ns - int(self.t_ns[k])) / NANOSECONDS_PER_SECOND / step_s
        turn = float(self.yaw_rad[k + 1] - self.yaw_rad[k])
        speed0, speed1 = float(self.speed_mps[k]), float(self.speed_mps[k + 1])
        rate0, rate1 = float(self.yaw_rate_radps[k]), float(self.yaw_rate_radps[k + 1])
        travelled = part * step_s * (speed0 + speed1) / 2
        chord = travelled * float(np.sinc(turn * part / 2 / np.pi))
        heading = float(self.yaw_rad[k]) + turn * part / 2
        return Pose(
            x_m=float(self.x_m[k]) + chord * cos(heading),
            y_m=float(self.y_m[k]) + chord * sin(heading),
            yaw_rad=float(self.yaw_rad[k]) + turn * part,
            s_m=float(self.s_m[k]) + abs(travelled),
            speed_mps=speed0 + part * (speed1 - speed0),
            yaw_rate_radps=rate0 + part * (rate1 - rate0),
            acceleration_mps2=float(self.acceleration_mps2[k]),
        )

    def poses(self, t_ns: IntArray) -> "Poses":
        """Return the poses at times (M,) within the path, as `at` does."""
        k = np.clip(np.searchsorted(self.t_ns, t_ns, side="right") - 1, 0, len(self.t_ns) - 2)
        step_s = (self.t_ns[k + 1] - self.t_ns[k]) / NANOSECONDS_PER_SECOND
        part = (t_ns - self.t_ns[k]) / NANOSECONDS_PER_SECOND / step_s
        turn = (self.yaw_rad[k + 1] - self.yaw_rad[k]) * part
        travelled = part * step_s * (self.speed_mps[k] + self.speed_mps[k + 1]) / 2
        chord = travelled * np.sinc(turn / 2 / np.pi)
        heading = self.yaw_rad[k] + turn / 2
        return Poses(
            x_m=self.x_m[k] + chord * np.cos(heading),
            y_m=self.y_m[k] + chord * np.sin(heading),
            yaw_rad=self.yaw_rad[k] + turn,
            s_m=self.s_m[k] + np.abs(travelled),
            speed_mps=self.speed_mps[k] + part * (self.speed_mps[k + 1] - self.speed_mps[k]),
            yaw_rate_radps=self.yaw_rate_radps[k]
            + part * (self.yaw_rate_radps[k + 1] - self.yaw_rate_radps[k]),
            acceleration_mps2=self.acceleration_mps2[k],
        )


def integrated(t_ns: IntArray, speed_mps: Array, yaw_rate_radps: Array) -> DrivenPath:
    """Integrate speed and yaw rate (N,), N >= 2, at strictly rising times, on constant-turn-rate arcs.

    Where the vehicle stands it does not turn, whatever the yaw-rate sensor's noise says.
    """
    step_s = np.diff(t_ns) / NANOSECONDS_PER_SECOND
    speed = (speed_mps[1:] + speed_mps[:-1]) / 2
    rate = np.where(np.abs(speed_mps) < STANDING_MPS, 0.0, yaw_rate_radps)
    turn = (rate[1:] + rate[:-1]) / 2 * step_s
    travelled = speed * step_s
    yaw = _summed(turn)
    chord = travelled * np.sinc(turn / 2 / np.pi)  # sin(h) / h, exact down to h = 0
    heading = yaw[:-1] + turn / 2
    return DrivenPath(
        t_ns=frozen(t_ns, np.int64),
        x_m=frozen(_summed(chord * np.cos(heading))),
        y_m=frozen(_summed(chord * np.sin(heading))),
        yaw_rad=frozen(yaw),
        s_m=frozen(_summed(np.abs(travelled))),
        speed_mps=frozen(speed_mps),
        yaw_rate_radps=frozen(rate),
        acceleration_mps2=frozen(_acceleration(t_ns, speed_mps)),
    )


def _acceleration(t_ns: IntArray, speed_mps: Array) -> Array:
    """Return the slope of the speed (N,) over 0.2 s: from one sample to the next it is all signal step."""
    reach_ns = 100_000_000
    before, after = np.maximum(t_ns - reach_ns, t_ns[0]), np.minimum(t_ns + reach_ns, t_ns[-1])
    rise = resampled(t_ns, speed_mps, after) - resampled(t_ns, speed_mps, before)
    slope: Array = rise / ((after - before) / NANOSECONDS_PER_SECOND)
    return slope


def _summed(steps: Array) -> Array:
    """Return the running sum from 0, one longer than `steps`."""
    return np.concatenate([[0.0], np.cumsum(steps)])
