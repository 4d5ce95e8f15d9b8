"""The yaw-rate sensor's offset, from how polynomials of the same line, seen from two places, fit together.

    image i   vehicle o------------ d ------------>. the line's direction there, as image i has it:
                                                     yaw_i + atan(y_i'(d))
    image j, d further on     vehicle o              the same direction, as image j has it: yaw_j + atan(c1_j)

So yaw_j - yaw_i is known from the lines alone, whatever the road does and however the camera is turned on the
vehicle; what the integrated yaw rate says more, divided by the time between, is its offset.
"""

from dataclasses import dataclass
from math import degrees, radians

import numpy as np

from vsensor.field.config import ScanLimits
from vsensor.field.images import Images, Line
from vsensor.types import NANOSECONDS_PER_SECOND, Array, BoolArray, IntArray, Side
from vsensor.world.dead_reckoning import OffsetEstimate, integrated, resampled, yaw_rate_offset

AHEAD_M = 20.0
"""Near enough that polynomials are good there, far enough (about 1 s) that an offset has had time to tell."""
MOVING_MPS = 5.0
MILD_PER_M = 1 / 800
"""In a tighter bend a cubic is not the line's shape: at R = 250 m its slope is off by up to 1 mrad."""
TIGHT_PER_M = 1 / 100
ENOUGH_S = 5.0
SURE_RADPS = radians(0.03)
"""A less certain offset is not taken: at 20 m/s it would be 0.13 m at 100 m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """Speed and yaw rate at the same times (N,), strictly rising."""

    t_ns: IntArray
    speed_mps: Array
    yaw_rate_radps: Array


def offset_of(rates: Rates, images: Images, limits: ScanLimits) -> OffsetEstimate:
    """Return the offset: as given, else from standstill, from the lines, or from the yaw rate alone."""
    if limits.yaw_rate_offset_degps != "auto":
        seconds = int(rates.t_ns[-1] - rates.t_ns[0]) / NANOSECONDS_PER_SECOND
        given = radians(limits.yaw_rate_offset_degps)
        return OffsetEstimate(offset_radps=given, method="given", seconds=seconds)
    plain = yaw_rate_offset(rates.t_ns, rates.yaw_rate_radps, rates.speed_mps)
    if plain.method == "standstill":
        return plain
    for bend_per_m in (MILD_PER_M, TIGHT_PER_M):
        samples, seconds = _from_lines(rates, images, bend_per_m)
        if seconds >= ENOUGH_S and _uncertainty(samples) < SURE_RADPS:
            break
    else:
        return plain
    where = "" if bend_per_m == MILD_PER_M else " in bends, where a cubic errs by up to 0.15"
    return OffsetEstimate(
        offset_radps=float(np.median(samples)),
        method=f"lines seen again further on{where}, +- {degrees(_uncertainty(samples)):.4f}",
        seconds=seconds,
    )


def _uncertainty(samples: Array) -> float:
    """Return the standard deviation of the median, from those of 8 parts: neighbours are alike."""
    medians = [np.median(part) for part in np.array_split(samples, 8)]
    return float(np.std(medians, ddof=1) / np.sqrt(8))


def _from_lines(rates: Rates, images: Images, bend_per_m: float) -> tuple[Array, float]:
    """Return an offset for each pair of images of a line, and how many seconds of driving they come from."""
    path = integrated(rates.t_ns, rates.speed_mps, rates.yaw_rate_radps)
    inside = (images.t_ns > path.t_ns[0]) & (images.t_ns < path.t_ns[-1])
    s_m = resampled(path.t_ns, path.s_m, images.t_ns)
    yaw = resampled(path.t_ns, path.yaw_rad, images.t_ns)
    speed = resampled(path.t_ns, path.speed_mps, images.t_ns)
    later = np.searchsorted(s_m, s_m + AHEAD_M)
    here = np.flatnonzero(inside & (later < len(s_m)) & (speed > MOVING_MPS))
    there = later[here]
    apart_m = s_m[there] - s_m[here]
    apart_s = (images.t_ns[there] - images.t_ns[here]) / NANOSECONDS_PER_SECOND
    steady = (apart_m < 1.5 * AHEAD_M) & (apart_s < AHEAD_M / MOVING_MPS) & inside[there]
    found, used = [], np.zeros(len(images), dtype=bool)
    for side in (Side.LEFT, Side.RIGHT):
        line = images.lines[side]
        good = steady & _is_mild(line, bend_per_m)[here] & line.measured[there] & line.is_whole[there]
        i, j, d = here[good], there[good], apart_m[good]
        _, c1, c2, c3 = line.coefficients[i].T
        turn = np.arctan(c1 + d * (2 * c2 + d * 3 * c3)) - np.arctan(line.coefficients[j, 1])
        found.append((yaw[j] - yaw[i] - turn) / apart_s[good])
        used[i] = True
    samples = np.concatenate(found)
    return samples, float(np.count_nonzero(used)) * _cycle_s(images)


def _is_mild(line: Line, bend_per_m: float) -> BoolArray:
    """Return the images (N,) that show a good line without a tighter bend at either end of it."""
    c2, c3 = line.coefficients[:, 2], line.coefficients[:, 3]
    far = np.where(np.isfinite(line.x_max_m), line.x_max_m, 0.0)
    bend = np.maximum(np.abs(2 * c2), np.abs(2 * c2 + 6 * c3 * far))
    mild: BoolArray = line.is_whole & line.measured & (bend < bend_per_m) & (far > AHEAD_M)
    return mild


def _cycle_s(images: Images) -> float:
    return float(np.median(np.diff(images.t_ns))) / NANOSECONDS_PER_SECOND
