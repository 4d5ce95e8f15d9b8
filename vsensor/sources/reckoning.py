"""A pose from speed and yaw rate as they come from the bus, sample by sample.

samples of speed     |    |    |    |              anchor: up to here both are known and the pose is
samples of yaw rate  |      |      |               final, integrated by the trapezoidal rule over exact
anchor               -------------->               arcs, so of second order whatever the two rates are
pose of this tick                  ........> tick  predicted from it: last values held, thrown away
                                                   once more is known
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite, nan

from vsensor.sources.control import (
    ACCELERATION,
    FOR_EVER_NS,
    SPEED,
    YAW_RATE,
    Motion,
    Pose,
    hold_ns,
)
from vsensor.sources.listening import ListenConfig, Listened, Listener, News
from vsensor.types import Tick
from vsensor.world.vehicle import Tilt, moved

Samples = tuple[tuple[int, float], ...]
"""(t_ns, value), in order of time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """The pose at `t_ns`, and the samples of speed and yaw rate from there on."""

    pose: Pose
    t_ns: int = 0
    speeds: Samples = ()
    rates: Samples = ()


class MotionControl:
    """Speed and yaw rate are integrated from the start; acceleration helps to predict, if it is there."""

    needs = senses = (SPEED, YAW_RATE)
    wanted = (SPEED, YAW_RATE, ACCELERATION)

    def __init__(self, config: ListenConfig, listener: Listener) -> None:
        self._listener = listener
        self._hold_ns = hold_ns(config)

    def initial(self, start: Pose) -> Course:
        """Return the course of a vehicle that stands at the start."""
        return Course(pose=start)

    def advance(
        self, state: Course, listened: Listened, news: Sequence[News], tick: Tick, tilt: Tilt
    ) -> tuple[Course, Motion]:
        """Return the course, its anchor brought as far as both are known, and the prediction from there."""
        course = _with(state, news)
        if not started(course):
            waiting = replace(standing(course, tick.t_ns), speeds=course.speeds[-1:], rates=course.rates[-1:])
            return waiting, Motion(pose=course.pose)
        if not started(state):
            course = replace(course, t_ns=min(tick.t_ns, max(course.speeds[0][0], course.rates[0][0])))
        known_ns = min(
            listened.now_ns if self._listener.is_missing(listened, name) else samples[-1][0]
            for name, samples in ((SPEED, course.speeds), (YAW_RATE, course.rates))
        )
        course = settled(course, known_ns, self._hold_ns, tilt)
        slope = self._slope(listened)
        return course, Motion(
            pose=predicted(course, tick.t_ns, self._hold_ns, tilt, slope),
            speed_mps=value_at(course.speeds, tick.t_ns, self._hold_ns, slope),
            yaw_rate_radps=value_at(course.rates, tick.t_ns, self._hold_ns),
            acceleration_mps2=slope,
        )

    def remarks(self, state: Course) -> tuple[str, ...]:
        """Return nothing."""
        return ()

    def _slope(self, listened: Listened) -> float:
        """Return the acceleration with which the speed goes on, 0 where one of them is missing."""
        names = (SPEED, ACCELERATION)
        if any(name not in self._listener.channels for name in names):
            return 0.0
        if any(self._listener.is_missing(listened, name) for name in names):
            return 0.0
        return listened.value(ACCELERATION, 0.0)


def _with(course: Course, news: Sequence[News]) -> Course:
    """Return the course with the samples that the frames brought."""
    speeds, rates = course.speeds, course.rates
    for item in news:
        if isfinite(item.values.get(SPEED, nan)):
            speeds = heard(speeds, item.t_ns, item.values[SPEED])
        if isfinite(item.values.get(YAW_RATE, nan)):
            rates = heard(rates, item.t_ns, item.values[YAW_RATE])
    return replace(course, speeds=speeds, rates=rates)


def heard(samples: Samples, t_ns: int, value: float) -> Samples:
    """Return the samples with one more; one at the same time as the last replaces it."""
    kept = samples[:-1] if samples and samples[-1][0] >= t_ns else samples
    return (*kept, (t_ns, value))


def value_at(samples: Samples, t_ns: int, hold_ns: int = FOR_EVER_NS, slope_per_s: float = 0.0) -> float:
    """Return the value between samples on the line; the first one before, the last one held after them.

    After the last it goes on with `slope_per_s`, not through 0; after `hold_ns` it is 0. 0 without samples.
    """
    if not samples:
        return 0.0
    last_ns, last = samples[-1]
    if t_ns >= last_ns:
        if t_ns - last_ns > hold_ns:
            return 0.0
        further = last + slope_per_s * (t_ns - last_ns) * 1e-9
        return further if further * last > 0.0 else 0.0
    after = bisect_right(samples, t_ns, key=lambda sample: sample[0])
    if after == 0:
        return samples[0][1]
    (t0, v0), (t1, v1) = samples[after - 1], samples[after]
    return v0 + (v1 - v0) * (t_ns - t0) / (t1 - t0)


def started(course: Course) -> bool:
    """Return whether there is a speed and a yaw rate."""
    return bool(course.speeds and course.rates)


def settled(course: Course, known_ns: int, hold_ns: int, tilt: Tilt) -> Course:
    """Return the course with its anchor brought to `known_ns`; what lies before is forgotten."""
    if known_ns <= course.t_ns:
        return course
    pose = _driven(course, known_ns, hold_ns, tilt, 0.0)
    return Course(
        pose=pose,
        t_ns=known_ns,
        speeds=_from(course.speeds, known_ns),
        rates=_from(course.rates, known_ns),
    )


def predicted(course: Course, t_ns: int, hold_ns: int, tilt: Tilt, acceleration_mps2: float) -> Pose:
    """Return the pose at `t_ns`, from the anchor on with what is known and the last values held."""
    return _driven(course, t_ns, hold_ns, tilt, acceleration_mps2)


def standing(course: Course, t_ns: int) -> Course:
    """Return the course of a vehicle that has stood until `t_ns`."""
    return replace(course, t_ns=max(t_ns, course.t_ns))


def _driven(course: Course, end_ns: int, hold_ns: int, tilt: Tilt, slope: float) -> Pose:
    """Return the pose after the arcs between all the sample times up to `end_ns`."""
    inside = {t for t, _ in (*course.speeds, *course.rates) if course.t_ns < t < end_ns}
    for samples in (course.speeds, course.rates):
        if samples and course.t_ns < samples[-1][0] + hold_ns < end_ns:
            inside |= {samples[-1][0] + hold_ns, samples[-1][0] + hold_ns + 1}
    pose = course.pose
    for start, end in pairwise(sorted({course.t_ns, *inside, max(end_ns, course.t_ns)})):
        v0, v1 = (value_at(course.speeds, t, hold_ns, slope) for t in (start, end))
        r0, r1 = (value_at(course.rates, t, hold_ns) for t in (start, end))
        seconds = (end - start) * 1e-9
        distance, turn = (v0 + v1) / 2.0 * seconds * tilt.run, (r0 + r1) / 2.0 * seconds * tilt.turn
        x, y, yaw = moved(pose.x_m, pose.y_m, pose.yaw_rad, distance, turn)
        pose = Pose(x_m=x, y_m=y, yaw_rad=yaw)
    return pose


def _from(samples: Samples, t_ns: int) -> Samples:
    """Return the samples from the last one at or before a time on."""
    first = max(0, bisect_right(samples, t_ns, key=lambda sample: sample[0]) - 1)
    return samples[first:]
