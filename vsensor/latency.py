"""From exposure to bus: images wait in a delay line, and their lines move as the vehicle does meanwhile.

           t - latency    image taken                       image of now
    ----|-------x--------------|---------- ... -----------------|---> t = send time
                <-- the rest --|--------- whole ticks ---------->
                pose exposure              pose send

The image taken is whole ticks old. Its lines are moved to where they were at t - latency (and its time stamp
says that), or, motion compensated, to where they are at the send time.

The vehicle moves on arcs: constant speed and yaw rate from each image to the next.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, isfinite, sin
from typing import Literal

import numpy as np

from vsensor.types import Array, Boundary, EgoState, Environment, LaneEstimate, Tick, frozen

Pose = Literal["exposure", "send"]


@dataclass(frozen=True, slots=True)
class Motion:
    """Where the vehicle stands later, in its frame before: metres ahead, to the left, and turned by."""

    x_m: float
    y_m: float
    yaw_rad: float

    def then(self, later: "Motion") -> "Motion":
        """Return this motion and after it `later`."""
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        x_m = self.x_m + c * later.x_m - s * later.y_m
        return Motion(x_m, self.y_m + s * later.x_m + c * later.y_m, self.yaw_rad + later.yaw_rad)


@dataclass(frozen=True, slots=True, kw_only=True)
class Image:
    """What the delay line keeps of one tick."""

    estimate: LaneEstimate
    ego: EgoState
    environment: Environment


NO_IMAGE = Image(
    estimate=LaneEstimate(exposed_at_ns=0, image_index=0, boundaries=()),
    ego=EgoState(t_ns=0, position_world_m=frozen([0.0, 0.0, 0.0]), speed_mps=0.0),
    environment=Environment(),
)
"""What is sent before the first image has come through."""


def arc(ego: EgoState, seconds: float) -> Motion:
    """Return the motion at constant speed and yaw rate; `seconds` below 0 go back. Unknown = none."""
    speed, rate = ego.speed_mps, ego.yaw_rate_radps
    speed, rate = speed if isfinite(speed) else 0.0, rate if isfinite(rate) else 0.0
    turned, length = rate * seconds, speed * seconds
    half = turned / 2
    chord = length * (sin(half) / half if abs(half) > 1e-6 else 1.0 - half * half / 6)
    return Motion(chord * cos(half), chord * sin(half), turned)


def moved(estimate: LaneEstimate, motion: Motion) -> LaneEstimate:
    """Return the estimate with its lines as seen from where `motion` has brought the vehicle.

    Each line is followed exactly at Chebyshev points of its range and fitted again, same order: exact
    without rotation, and for straight lines. Covariances stay as they were: no bus carries them.
    """
    if motion == Motion(0.0, 0.0, 0.0):
        return estimate
    return replace(estimate, boundaries=tuple(_moved(line, motion) for line in estimate.boundaries))


def _moved(line: Boundary, motion: Motion) -> Boundary:
    start, end, order = line.x_min_m, line.x_max_m, len(line.coefficients) - 1
    if not isfinite(start + end) or end <= start:
        return line
    nodes = np.cos(np.pi * (np.arange(order + 4) + 0.5) / (order + 4))
    x: Array = (start + end) / 2 + (end - start) / 2 * np.concatenate([nodes, [-1.0, 1.0]])
    y = np.asarray(np.polynomial.polynomial.polyval(x, line.coefficients), dtype=np.float64)
    there_x, there_y = _seen_from(motion, x, y)
    low, high = float(there_x[-2]), float(there_x[-1])
    if high <= low:  # turned across the line
        return line
    fit = np.polynomial.Polynomial.fit(there_x[:-2], there_y[:-2], order, domain=[low, high])
    coefficients = np.zeros(order + 1)
    found = fit.convert().coef
    coefficients[: len(found)] = found
    return replace(line, coefficients=frozen(coefficients), x_min_m=low, x_max_m=high)


def _seen_from(motion: Motion, x: Array, y: Array) -> tuple[Array, Array]:
    c, s = cos(motion.yaw_rad), sin(motion.yaw_rad)
    ahead, left = x - motion.x_m, y - motion.y_m
    return c * ahead + s * left, c * left - s * ahead


def delayed(
    line: Sequence[Image], newest: Image, latency_ns: int, pose: Pose, tick: Tick
) -> tuple[tuple[Image, ...], Image | None]:
    """Return the delay line after this tick, and the image whose frames leave now.

    `line` holds the images before, oldest first. None while the first image is still on its way. The ego
    state returned is that of the pose; without latency the newest image comes back as it is.
    """
    if latency_ns == 0:
        return (), newest
    whole, rest_ns = divmod(latency_ns, tick.period_ns)
    images = (*line, newest)[-(whole + 1) :]
    if len(images) <= whole or tick.t_ns < latency_ns:
        return images, None
    old, exposed_at_ns = images[0], newest.estimate.exposed_at_ns - latency_ns
    motion = arc(old.ego, -rest_ns / 1e9)
    ego = old.ego
    if pose == "send":
        motion, ego = Motion(0.0, 0.0, 0.0), newest.ego
        for before, after in pairwise(images):
            motion = motion.then(_between(before.ego, after.ego, tick.period_ns / 1e9))
    estimate = replace(moved(old.estimate, motion), exposed_at_ns=exposed_at_ns)
    return images, Image(estimate=estimate, ego=ego, environment=old.environment)


def _between(before: EgoState, after: EgoState, seconds: float) -> Motion:
    """Return the motion from one image to the next, at the mean of speed and yaw rate at both."""
    first, last = (before, after) if isfinite(before.speed_mps) else (after, after)
    last = last if isfinite(last.speed_mps) else first
    mean = replace(
        first,
        speed_mps=(first.speed_mps + last.speed_mps) / 2,
        yaw_rate_radps=(first.yaw_rate_radps + last.yaw_rate_radps) / 2,
    )
    return arc(mean, seconds)
