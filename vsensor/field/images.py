"""The lines that a sensor reported in each image of a log, in model signs, from the rear axle."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from vsensor.errors import LogError
from vsensor.field.config import ScanLimits
from vsensor.logs.decode import DecodedFrames, DecodedTable
from vsensor.profile import RAIN_OF_WIPER, Profile, Wiper
from vsensor.signals import columns_from_bus
from vsensor.types import (
    NANOSECONDS_PER_SECOND,
    SIDE_NAMES,
    Array,
    BoolArray,
    IntArray,
    Light,
    SensorMode,
    Side,
)

FARTHEST_M = 50.0
"""An offset beyond it is of no line beside the vehicle: garbage, or a wrong profile."""
ENVELOPE_NS = 60 * NANOSECONDS_PER_SECOND
LONGEST_DELAY_NS = 500_000_000
MOST_RESTARTS = 20
"""Time stamps that fall or stand more often in a log are no clock."""
_RAIN = np.array([RAIN_OF_WIPER[wiper] for wiper in Wiper])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Line:
    """One side over all images (N,): `coefficients` (N, 4) c0..c3, `x_max_m` (inf where the bus has none).

    `reported`; `is_whole`: all of it is there and possible; `quality` 0..4; `measured`.
    """

    coefficients: Array
    x_max_m: Array
    reported: BoolArray
    is_whole: BoolArray
    quality: Array
    measured: BoolArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Images:
    """The images of a log, N in order of time: `t_ns`, lines by side, environment (NaN = unknown).

    `reset`: the first images after the sensor or its image counter began anew. `changes`: a lane change is
    told. `notes` are sentences for the user.
    """

    t_ns: IntArray
    lines: dict[Side, Line]
    reset: BoolArray
    changes: BoolArray
    night: Array
    rain: Array
    lost: int
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.t_ns)


def line_profile(profiles: Sequence[Profile], path: str) -> Profile:
    """Return the profile that carries the left and right line; raises LogError if none does."""
    for profile in profiles:
        if {"left.offset_m", "right.offset_m"} <= profile.quantities():
            return profile
    names = ", ".join(profile.name for profile in profiles)
    raise LogError(
        f"{path}: no signal carries left.offset_m and right.offset_m in the profile {names}; "
        "a profile of a lane camera was expected"
    )


def images_of(
    frames: DecodedFrames, profile: Profile, limits: ScanLimits, sides: Sequence[Side], path: str
) -> Images:
    """Return the images; raises LogError naming the signals that are missing."""
    words = [SIDE_NAMES[side] for side in sides]
    needed = [f"{word}.offset_m" for word in words[:2]]
    missing = [name for name in needed if name not in frames.columns]
    if missing:
        looked = ", ".join(sorted(_carriers(profile, missing)))
        raise LogError(f"{path}: {' and '.join(missing)} not found; looked for in {looked}")
    carried = {name for name in profile.quantities() if name.partition(".")[0] in (*words, "image")}
    table = frames.rows(carried.__contains__)
    rows = _with_a_line(table, words)
    on_bus = {name: values[rows] for name, values in table.columns.items()}
    columns = columns_from_bus(profile.geometry, limits.vehicle, on_bus, limits.camera_x_m)
    recorded = np.maximum.accumulate(table.t_ns[rows])
    stamps = _unwrapped(columns.get("image.timestamp_ms"), _modulus(profile, "image.timestamp_ms"))
    t_ns, note = _image_times(recorded, stamps, limits)
    offsets = {side: on_bus.get(f"{SIDE_NAMES[side]}.offset_m", np.full(len(t_ns), np.nan)) for side in sides}
    lines = {side: _line(columns, SIDE_NAMES[side], offsets[side]) for side in sides}
    index = _unwrapped(columns.get("image.index"), _modulus(profile, "image.index"))
    return Images(
        t_ns=t_ns,
        lines=lines,
        reset=_resets(frames, recorded, columns.get("image.index"), profile),
        changes=np.nan_to_num(_held(frames, "lane.change", recorded)) > 0,
        night=_night(frames, recorded),
        rain=_rain(frames, recorded),
        lost=_lost(index),
        notes=note,
    )


def _carriers(profile: Profile, names: Iterable[str]) -> set[str]:
    return {
        f"{plan.layout.name} 0x{plan.layout.arbitration_id:X}"
        for plan in profile.messages
        for binding in plan.bindings
        if binding.quantity in names
    }


def _with_a_line(table: DecodedTable, words: Sequence[str]) -> IntArray:
    """Return the rows in which anything of a line stands."""
    there = np.zeros(len(table), dtype=bool)
    for name, values in table.columns.items():
        if name.partition(".")[0] in words:
            there |= ~np.isnan(values)
    return np.flatnonzero(there)


def _line(columns: dict[str, Array], word: str, offset_m: Array) -> Line:
    """Return a line of its columns and the offset (N,) as the bus has it, before other columns touch it."""
    count = len(offset_m)

    def column(name: str, default: float) -> Array:
        return np.asarray(np.broadcast_to(columns.get(f"{word}.{name}", default), (count,)))

    names = ("offset_m", "heading", "c2_per_m", "c3_per_m2")
    c = np.column_stack([column(name, np.nan) for name in names])
    x_max = column("x_max_m", np.inf)
    x_max = np.full(count, np.inf) if np.isnan(x_max).all() else x_max
    quality = column("quality", 4.0)
    told_none = (column("available", 1.0) == 0.0) | (quality == 0.0)
    reported = ~np.isnan(offset_m) & ~told_none
    whole = np.isfinite(c).all(axis=1) & (np.abs(c[:, 0]) <= FARTHEST_M) & (x_max > 0.0)
    return Line(
        coefficients=c,
        x_max_m=x_max,
        reported=reported,
        is_whole=reported & whole,
        quality=np.where(reported, np.clip(np.round(np.nan_to_num(quality, nan=1.0)), 1, 4), 0.0),
        measured=reported & (np.nan_to_num(column("measured", 1.0)) > 0.0),
    )


def _modulus(profile: Profile, name: str) -> int:
    """Return what a counting quantity counts modulo, of its widest signal; 0 if it does not wrap."""
    return max((b.wrap for plan in profile.messages for b in plan.told if b.quantity == name), default=0)


def _unwrapped(values: Array | None, modulus: int) -> Array | None:
    """Return a count without its wraps: steps back of more than half of what it holds are wraps."""
    if values is None or not modulus:
        return values
    steps = np.diff(np.nan_to_num(values))
    turns = np.where(steps < -modulus / 2, modulus, np.where(steps > modulus / 2, -modulus, 0))
    unwrapped: Array = values + np.concatenate([[0.0], np.cumsum(turns)])[: len(values)]
    return unwrapped


def _image_times(
    recorded: IntArray, stamps_ms: Array | None, limits: ScanLimits
) -> tuple[IntArray, tuple[str, ...]]:
    """Return the times (N,) of exposure on the recorder's clock, rising, and what was done."""
    latency_ns = round(limits.latency_ms * 1e6)
    if limits.image_clock == "recorder" or stamps_ms is None:
        return recorded - latency_ns, ()
    begins = np.flatnonzero(~(np.diff(stamps_ms) > 0)) + 1  # the sensor began anew, or has no time
    if np.isnan(stamps_ms).any() or len(begins) > MOST_RESTARTS:
        return recorded - latency_ns, (
            "image time stamps missing or standing: the recorder's times are used",
        )
    stamps = np.round(stamps_ms * 1e6).astype(np.int64)
    if limits.image_clock == "sensor":
        return np.maximum.accumulate(stamps), ()
    parts = zip(np.split(recorded, begins), np.split(stamps, begins), strict=True)
    smooth = np.concatenate([_without_delays(*part) for part in parts])
    if np.abs(recorded - smooth).max() > LONGEST_DELAY_NS:
        return recorded - latency_ns, ("image time stamps jump: the recorder's times are used",)
    return np.maximum.accumulate(smooth) - latency_ns, ()


def _without_delays(recorded: IntArray, stamps: IntArray) -> IntArray:
    """Return time stamps (N,) on the recorder's clock, at their least delay in each minute: it may drift."""
    delay = recorded - stamps
    edges = np.flatnonzero(np.diff((recorded - recorded[0]) // ENVELOPE_NS)) + 1
    parts = np.split(np.arange(len(delay)), edges)
    least = [float(delay[part].min() - delay[0]) for part in parts]
    middle = [float(recorded[part].mean()) for part in parts]
    smooth: IntArray = stamps + delay[0] + np.interp(recorded, middle, least).astype(np.int64)
    return smooth


def _resets(frames: DecodedFrames, t_ns: IntArray, index: Array | None, profile: Profile) -> BoolArray:
    state = _held(frames, "sensor.state", t_ns)
    starts = np.isin(state, (SensorMode.INIT, SensorMode.CALIBRATING, SensorMode.BLOCKED, SensorMode.FAILED))
    counted = _unwrapped(index, _modulus(profile, "image.index"))
    if counted is not None:
        back = np.diff(counted) < 0
        starts[1:] |= back
    return starts


def _lost(index: Array | None) -> int:
    """Return how many images the image counter says are missing."""
    if index is None:
        return 0
    steps = np.diff(index)
    return int(np.nansum(np.where((steps > 1) & (steps < 1000), steps - 1, 0)))


def _held(frames: DecodedFrames, name: str, t_ns: IntArray) -> Array:
    """Return the last value of a quantity at the images' times (N,), NaN before the first."""
    times, values = frames.series(name)
    known = ~np.isnan(values)
    times, values = times[known], values[known]
    if not len(times):
        return np.full(len(t_ns), np.nan)
    order = np.argsort(times, kind="stable")
    place = np.searchsorted(times[order], t_ns + 5_000_000, side="right") - 1  # the rest of the burst counts
    return np.where(place >= 0, values[order][np.maximum(place, 0)], np.nan)


def _night(frames: DecodedFrames, t_ns: IntArray) -> Array:
    for name in ("ego.light", "sensor.light"):
        light = _held(frames, name, t_ns)
        if not np.isnan(light).all():
            return np.where(np.isnan(light), np.nan, light == Light.NIGHT)
    return _held(frames, "ego.low_beam", t_ns)


def _rain(frames: DecodedFrames, t_ns: IntArray) -> Array:
    rain = _held(frames, "sensor.rain", t_ns)
    if not np.isnan(rain).all():
        return rain
    wiper = _held(frames, "ego.wiper", t_ns)
    return np.where(np.isnan(wiper), np.nan, _RAIN[np.clip(np.nan_to_num(wiper), 0, 3).astype(int)])
