"""The driven path of a log, and what is wrong with it: silences, clock jumps, coarse yaw rate."""

from dataclasses import dataclass, replace
from math import degrees

import numpy as np

from vsensor.errors import LogError
from vsensor.field.config import ScanLimits
from vsensor.field.images import Images
from vsensor.field.offset import Rates, offset_of
from vsensor.logs import LogTable
from vsensor.logs.decode import DecodedFrames
from vsensor.profile import Profile
from vsensor.sources.drive import LARGEST, SPEED, YAW_RATE
from vsensor.types import NANOSECONDS_PER_SECOND, Array, BoolArray, IntArray
from vsensor.world.dead_reckoning import (
    DrivenPath,
    OffsetEstimate,
    common_times,
    integrated,
    resampled,
)

BACK_NS = 50_000_000
"""Frames of several channels come out of order by less; a longer step back is a clock that was set."""
AHEAD_NS = 86_400 * NANOSECONDS_PER_SECOND
"""So is a longer step ahead: a recorder that began in 1970. A shorter one may be a pause of a recording."""
SHARE_S = 1.0
DITHERED_STEPS = 0.3
"""Noise of 0.3 steps makes the mean of a rounded signal right to 5 % of a step."""
MOVING_MPS = 5.0
TOLD_M = 0.05
"""What a coarse yaw rate costs at 100 m is told from here on."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """`path` of the rear axle; `breaks_ns` (B,): times at which it starts anew, nothing before counts after.

    `known` says where between them. `notes` are sentences for the user.
    """

    path: DrivenPath
    breaks_ns: IntArray
    silent_ns: IntArray
    offset: OffsetEstimate
    dropped: int
    notes: tuple[str, ...]

    def covers(self, t_ns: IntArray) -> BoolArray:
        """Return at which times (N,) the motion is known: within the path, in no silence."""
        inside: BoolArray = (t_ns >= self.path.t_ns[0]) & (t_ns <= self.path.t_ns[-1])
        for start, end in self.silent_ns.reshape(-1, 2):
            inside &= (t_ns <= start) | (t_ns >= end)
        return inside


def with_steady_clock(table: LogTable) -> tuple[LogTable, IntArray, tuple[str, ...]]:
    """Return the log with a clock that never jumps, the times at which it did, and sentences."""
    steps = np.diff(table.t_ns)
    jumps = np.flatnonzero((steps < -BACK_NS) | (steps > AHEAD_NS))
    if not len(jumps):
        return table, np.empty(0, dtype=np.int64), ()
    shift = np.zeros(len(table.t_ns), dtype=np.int64)
    shift[jumps + 1] = -steps[jumps]
    t_ns = table.t_ns + np.cumsum(shift)
    begun_ns = int(table.t_ns[0])
    notes = []
    for word, some in (("back", jumps[steps[jumps] < 0]), ("ahead", jumps[steps[jumps] > 0])):
        if len(some):
            by_s = abs(int(steps[some[0]])) / NANOSECONDS_PER_SECOND
            at_s = (int(t_ns[some[0]]) - begun_ns) / NANOSECONDS_PER_SECOND
            notes.append(
                f"the log's clock jumps {word} {len(some)} times, first by {by_s:.3f} s at {at_s:.3f} s: "
                "counted on"
            )
    return replace(table, t_ns=t_ns), t_ns[jumps + 1], tuple(notes)


def motion_of(
    frames: DecodedFrames,
    profiles: list[Profile],
    images: Images,
    limits: ScanLimits,
    jumps_ns: IntArray,
    path: str,
) -> Motion:
    """Return the motion; raises LogError if speed or yaw rate are not there."""
    speed_ns, speed, bad_speed = _series(frames, profiles, SPEED, path)
    rate_ns, rate, bad_rate = _series(frames, profiles, YAW_RATE, path)
    at_ns = common_times(speed_ns, rate_ns)
    if len(at_ns) < 2:
        raise LogError(f"{path}: {SPEED} and {YAW_RATE} have no time in common")
    speed = speed * limits.speed_factor
    speed_at, rate_at = resampled(speed_ns, speed, at_ns), resampled(rate_ns, rate, at_ns)
    offset = offset_of(Rates(t_ns=at_ns, speed_mps=speed_at, yaw_rate_radps=rate_at), images, limits)
    driven = integrated(at_ns, speed_at, rate_at - offset.offset_radps)
    silent = np.concatenate([_silences(t, limits.silence_s) for t in (speed_ns, rate_ns)])
    notes = [
        f"yaw-rate offset {degrees(offset.offset_radps):+.4f} deg/s removed ({offset.method}, "
        f"{offset.seconds:.0f} s); {driven.s_m[-1]:.0f} m driven",
        *_coarse(rate_ns, rate, resampled(speed_ns, speed, rate_ns), profiles),
    ]
    if len(silent):
        longest = (silent[:, 1] - silent[:, 0]).max() / NANOSECONDS_PER_SECOND
        notes.append(f"vehicle signals silent {len(silent)} times, at most {longest:.1f} s: left out")
    if bad_speed or bad_rate:
        notes.append(
            f"{bad_speed} speeds and {bad_rate} yaw rates that no vehicle has, or not available: left out"
        )
    return Motion(
        path=driven,
        breaks_ns=np.unique(np.concatenate([silent[:, 1], jumps_ns])),
        silent_ns=silent,
        offset=offset,
        dropped=bad_speed + bad_rate,
        notes=tuple(notes),
    )


def _series(
    frames: DecodedFrames, profiles: list[Profile], name: str, path: str
) -> tuple[IntArray, Array, int]:
    """Return times and values of a vehicle signal in order of time, and how many were no such value."""
    times, values = frames.series(name)
    if not len(times):
        looked = [
            f"{plan.layout.name} 0x{plan.layout.arbitration_id:X} (profile {profile.name})"
            for profile in profiles
            for plan in profile.messages
            if any(binding.quantity == name for binding in plan.told)
        ]
        names = ", ".join(profile.name for profile in profiles)
        if not looked:
            raise LogError(
                f"{path}: {name} not found; the profile {names} has none; give the vehicle's too (--profile)"
            )
        raise LogError(
            f"{path}: {name} not found; looked for in {', '.join(looked)}{_why(frames, profiles, name)}"
        )
    good = np.abs(values) <= LARGEST[name]
    if np.count_nonzero(good) < 2:
        raise LogError(f"{path}: {name} is not available in any of its {len(values)} frames")
    times, kept = times[good], values[good]
    order = np.argsort(times, kind="stable")
    return times[order], kept[order], len(values) - len(kept)


def _why(frames: DecodedFrames, profiles: list[Profile], name: str) -> str:
    """Say so if frames are there that should carry a quantity: then none of them was intact."""
    ids = {
        plan.layout.arbitration_id
        for profile in profiles
        for plan in profile.messages
        if any(binding.quantity == name for binding in plan.told)
    }
    count = int(np.isin(frames.used.arbitration_id, list(ids)).sum())
    return f"; {count} frames of it are there, none with right length and CRC" if count else ""


def _silences(t_ns: IntArray, longest_s: float) -> IntArray:
    """Return start and end (M, 2) of pauses that are too long."""
    long = np.flatnonzero(np.diff(t_ns) > longest_s * NANOSECONDS_PER_SECOND)
    return np.column_stack([t_ns[long], t_ns[long + 1]])


def _coarse(t_ns: IntArray, rate: Array, speed: Array, profiles: list[Profile]) -> list[str]:
    """Say how coarse the yaw rate is, and what half a step costs where no noise dithers it."""
    step = _step(rate)
    if not step:
        return []
    moving = speed > MOVING_MPS
    second = ((t_ns - t_ns[0]) // round(SHARE_S * NANOSECONDS_PER_SECOND)).astype(np.int64)
    count = np.bincount(second, weights=moving)
    mean = np.bincount(second, weights=moving * rate) / np.maximum(count, 1)
    noise = np.sqrt(np.bincount(second, weights=moving * (rate - mean[second]) ** 2) / np.maximum(count, 1))
    full = count > 0.5 * np.median(count[count > 0]) if count.any() else count > 0
    if not full.any():
        return []
    bare = float(np.mean(noise[full] < DITHERED_STEPS * step))
    mean_mps = float(speed[moving].mean())
    far_m = step / 2 * 100.0**2 / 2 / mean_mps
    if bare < 0.01 or far_m < TOLD_M:
        return []
    return [
        f"yaw rate in steps of {degrees(step):.3f} deg/s, which no noise blurs for {bare:.0%} of the drive: "
        f"half a step is up to {far_m:.2f} m at 100 m at {mean_mps:.0f} m/s in a reference along the path"
    ]


def _step(values: Array) -> float:
    """Return the step in which a signal comes, the least difference between two of its values; 0: none."""
    levels = np.unique(np.round(values, 9))
    steps = np.diff(levels)
    steps = steps[steps > 1e-7]
    return float(steps[steps < 1.5 * steps.min()].mean()) if len(steps) else 0.0
