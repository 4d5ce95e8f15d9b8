"""An event's CAN log on the times of its video's frames: the reference, what counts of it, the conditions.

CAN series ──at the frames──► offsets, confidences ──mask──► reliable values ──fill──► LOC
                              yaw rate, acceleration, day light: which condition a value belongs to
"""

from dataclasses import dataclass

import numpy as np

from vsensor.types import Array, BoolArray, Light
from vsensor.video.can_signals import CanSignals
from vsensor.video.evaluate.rules import Rules

SIDES = ("left", "right")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reference:
    """The CAN side of an event at the times `t_s` (N,) of its frames, since the video's first.

    `offset_m` (N, 2) of left and right to the inner edge at the front axle, positive to the left; NaN where
    it does not count. `confidence` (N, 2) as told. `reliable_share` of its values count, before gaps are
    filled. `light` is "day" or "night" where it was that all the time, else "". `is_curvy`, `is_changing`
    (N,) are 1, 0, or NaN where the log says nothing.
    """

    t_s: Array
    offset_m: Array
    confidence: Array
    reliable_share: float
    light: str
    is_curvy: Array
    is_changing: Array


def reference_of(can: CanSignals, t_s: Array, begins_s: float, rules: Rules) -> Reference:
    """Return what the log has at times `t_s` (N,) of a video that began at `begins_s` of the log's time.

    Raises LogError where the two do not overlap.
    """
    can.require_overlap(begins_s + float(t_s[0]), begins_s + float(t_s[-1]))
    at_s = t_s + begins_s
    told = np.column_stack([can.linear(f"{side}.lane_offset_m", at_s) for side in SIDES])
    confidence = np.column_stack([_confidence(can, side, at_s) for side in SIDES])
    counts = np.isfinite(told) & (np.nan_to_num(confidence) >= rules.least_confidence)
    offset = np.where(counts, told, np.nan)
    if rules.fill:
        way = driven_m(at_s, can.linear("ego.speed_mps", at_s))
        offset = np.column_stack([filled(way, offset[:, k], rules.gap_m) for k in range(2)])
    yaw_rate = np.degrees(can.linear("ego.yaw_rate_radps", at_s))
    return Reference(
        t_s=t_s,
        offset_m=offset,
        confidence=confidence,
        reliable_share=float(counts.mean()),
        light=_light(can, at_s),
        is_curvy=_beyond(yaw_rate, rules.curvy_degps),
        is_changing=_beyond(can.linear("ego.acceleration_mps2", at_s), rules.changing_mps2),
    )


def _confidence(can: CanSignals, side: str, at_s: Array) -> Array:
    """Return the lesser confidence (N,) of the two values that an offset lies between."""
    told, values = can.series.get(f"{side}.quality", (np.empty(0), np.empty(0)))
    if not len(told):
        return np.full(len(at_s), np.nan)
    after = np.minimum(np.searchsorted(told, at_s, side="left"), len(told) - 1)
    return np.fmin(can.held(f"{side}.quality", at_s), values[after])


def _light(can: CanSignals, at_s: Array) -> str:
    told = can.held("sensor.light" if "sensor.light" in can.series else "ego.light", at_s)
    known = told[np.isfinite(told)]
    if not len(known):
        return ""
    night = known == Light.NIGHT
    return "night" if night.all() else "" if night.any() else "day"


def _beyond(values: Array, limit: float) -> Array:
    return np.where(np.isfinite(values), (np.abs(values) > limit).astype(np.float64), np.nan)


def driven_m(t_s: Array, speed_mps: Array) -> Array:
    """Return the way (N,) driven by each time; NaN from where the speed is not known on."""
    steps = 0.5 * (speed_mps[1:] + speed_mps[:-1]) * np.diff(t_s)
    return np.concatenate([[0.0], np.cumsum(steps)])


def filled(place: Array, values: Array, limit: float) -> Array:
    """Return values (N,) with gaps shorter than `limit` filled (P2 2.4.2); `place` (N,) is way or time.

    A gap's length is from the last value before it to the first behind it, at the ends from there on. NaN in
    `place` leaves a gap.
    """
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return values
    every = np.arange(len(values))
    before = known[np.maximum(np.searchsorted(known, every, side="right") - 1, 0)]
    after = known[np.minimum(np.searchsorted(known, every), len(known) - 1)]
    first = np.where(every < known[0], 0, before)
    last = np.where(every > known[-1], len(values) - 1, after)
    may: BoolArray = place[last] - place[first] < limit
    gap = place[after] - place[before]
    part = np.where(gap > 0.0, (place - place[before]) / np.where(gap > 0.0, gap, 1.0), 0.0)
    straight = values[before] + np.clip(part, 0.0, 1.0) * (values[after] - values[before])
    return np.where(np.isfinite(values), values, np.where(may, straight, np.nan))
