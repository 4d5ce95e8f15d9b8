"""Events in long logs by P2's criteria (1.2): where a video and its lane offsets are worth comparing.

images of the log ──criteria──► stretches where all hold ──at least 1 s──► 15 s | 1 s | 15 s
                                                                           before core after
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from vsensor.errors import LogError
from vsensor.profile.quantities import Indicator
from vsensor.schema import Config, check_schema, convert, read_toml
from vsensor.types import Array, BoolArray
from vsensor.video.can_signals import STALE_S, CanSignals

SCHEMA = "vsensor.events/1"
Metres = Annotated[float, msgspec.Meta(gt=0.0, le=100.0)]
Rate = Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]
Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=3600.0)]


class EventCriteria(Config, frozen=True, kw_only=True):
    """When a moment belongs to an event; defaults are P2's (1.2).

    `max_lane_width_m` between the insides of the markings; `max_lateral_speed_mps` of the vehicle in its
    lane, so that a line that jumps is none; `near_m`: from the outer edge of a front wheel to the nearer
    marking's inside, negative beyond it; `max_yaw_rate_degps`; `least_s` that all of it lasts, `before_s` and
    `after_s` are added.
    """

    max_lane_width_m: Metres = 4.0
    max_lateral_speed_mps: Rate = 2.5
    near_m: Metres = 0.7
    max_yaw_rate_degps: Rate = 10.0
    least_s: Annotated[float, msgspec.Meta(gt=0.0, le=3600.0)] = 1.0
    before_s: Seconds = 15.0
    after_s: Seconds = 15.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A piece of a log, in s since its first frame: the core with what was added before and after."""

    begins_s: float
    ends_s: float
    core_begins_s: float
    core_ends_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """The events of a log, how long each criterion held (s of `looked_s`), and sentences for the user."""

    events: tuple[Event, ...]
    held_s: dict[str, float]
    looked_s: float
    notes: tuple[str, ...]


def find_events(can: CanSignals, criteria: EventCriteria, vehicle_width_m: float) -> Found:
    """Return the events of a log in order; they do not overlap. Raises LogError where no lane is told."""
    times, _ = can.series.get("left.lane_offset_m", (np.empty(0), np.empty(0)))
    if len(times) < 2:
        raise LogError(f"{can.path}: tells no lane offsets: a profile with left.lane_offset_m was expected")
    met = criteria_met(can, times, criteria, vehicle_width_m)
    steps = np.minimum(np.diff(times, append=times[-1]), STALE_S)
    found = tuple(
        event
        for begin, end in _unbroken(times)
        for event in _events(times[begin:end], _all(met)[begin:end], criteria)
    )
    notes = () if "no indicator" in met else (f"{can.path}: tells no indicator: none is taken to be used",)
    return Found(
        events=found,
        held_s={name: float(steps[mask].sum()) for name, mask in met.items()},
        looked_s=float(steps.sum()),
        notes=notes,
    )


def criteria_met(
    can: CanSignals, t_s: Array, criteria: EventCriteria, vehicle_width_m: float
) -> dict[str, BoolArray]:
    """Return where (N,) each criterion holds; what is not known does not hold, an indicator is left out."""
    left, right = (can.linear(f"{side}.lane_offset_m", t_s) for side in ("left", "right"))
    width = can.linear("lane.width_m", t_s) if "lane.width_m" in can.series else left - right
    met = {
        "lane width": width <= criteria.max_lane_width_m,
        "lateral speed": _lateral_speed(can, t_s, left, right) < criteria.max_lateral_speed_mps,
        "near to a marking": np.fmin(left, -right) - 0.5 * vehicle_width_m < criteria.near_m,
        "yaw rate": np.abs(np.degrees(can.linear("ego.yaw_rate_radps", t_s))) <= criteria.max_yaw_rate_degps,
    }
    if "ego.indicator" in can.series:
        met["no indicator"] = can.held("ego.indicator", t_s) == Indicator.OFF
    return met


def _lateral_speed(can: CanSignals, t_s: Array, left: Array, right: Array) -> Array:
    """Return the size (N,) of the speed across the lane: as told, or of the offset that changes faster."""
    if "lane.lateral_speed_mps" in can.series:
        return np.abs(can.linear("lane.lateral_speed_mps", t_s))
    step = np.maximum(np.diff(t_s, prepend=t_s[0] - 1.0), 1e-3)
    changes = [np.abs(np.diff(offset, prepend=offset[0])) / step for offset in (left, right)]
    return np.asarray(np.fmax(*changes))


def _all(met: dict[str, BoolArray]) -> BoolArray:
    return np.asarray(np.logical_and.reduce(list(met.values())))


def _unbroken(t_s: Array) -> Iterator[tuple[int, int]]:
    """Yield the parts [begin, end) of a log between pauses of its lane messages."""
    cuts = [0, *(np.flatnonzero(np.diff(t_s) > STALE_S) + 1).tolist(), len(t_s)]
    yield from pairwise(cuts)


def _events(t_s: Array, holds: BoolArray, criteria: EventCriteria) -> Iterator[Event]:
    """Yield the events of one unbroken part; each begins where the one before has ended at the earliest."""
    free_s = float(t_s[0])
    edges = np.flatnonzero(np.diff(holds.astype(np.int8), prepend=0, append=0))
    for first, beyond in edges.reshape(-1, 2).tolist():
        end_s = float(t_s[beyond - 1])
        core_s = max(float(t_s[first]), free_s + criteria.before_s)
        while core_s + criteria.least_s <= end_s + 1e-9:
            ends_s = core_s + criteria.least_s + criteria.after_s
            if ends_s > float(t_s[-1]) + 1e-9:
                return
            yield Event(
                begins_s=core_s - criteria.before_s,
                ends_s=ends_s,
                core_begins_s=core_s,
                core_ends_s=core_s + criteria.least_s,
            )
            free_s = ends_s
            core_s = free_s + criteria.before_s


def read_criteria(path: Path | None) -> EventCriteria:
    """Read a file of criteria, the published ones without one; raises ConfigError."""
    if path is None:
        return EventCriteria()
    return convert(check_schema(read_toml(path), SCHEMA, str(path)), EventCriteria, str(path))


def event_lines(found: Found) -> list[str]:
    """Return what was found, as text."""
    whole = max(found.looked_s, 1e-9)
    held = ", ".join(f"{name} {100.0 * held_s / whole:.0f} %" for name, held_s in found.held_s.items())
    lines = [f"{len(found.events)} events in {found.looked_s:.1f} s; criteria hold: {held}"]
    if found.events:
        lines.append(f"{'event':>5} {'from s':>9} {'to s':>9} {'core s':>9}")
    lines += [
        f"{k:5d} {one.begins_s:9.2f} {one.ends_s:9.2f} {one.core_begins_s:9.2f}"
        for k, one in enumerate(found.events)
    ]
    return lines
