"""Which line of the image is which of the known ones, moved to now."""

from dataclasses import replace
from itertools import pairwise
from math import isfinite

from vsensor.tracker.config import TrackerConfig
from vsensor.tracker.moved import Moved, aside_m, beside, driven, x_now
from vsensor.tracker.place import COMMON_M, Seen, reaches_ego
from vsensor.tracker.state import Track, TrackerState
from vsensor.types import EgoState, Fit, Tick

WIDEST_GATE_M = 1.5
"""The gate grows up to half of a narrow lane, or it would take the next line for this one."""
FARTHEST_M = 2.5
"""A line farther than that from where one is expected is never compared with it ahead."""


def moved_on(config: TrackerConfig, state: TrackerState, ego: EgoState, tick: Tick) -> TrackerState:
    """Move the remembered lines to the tick; those that are too old or too far aside are forgotten.

    The motion is the mean of the state's and the ego's; what is not finite is held.
    """
    speed_mps = ego.speed_mps if isfinite(ego.speed_mps) else state.speed_mps
    yaw_rate = ego.yaw_rate_radps if isfinite(ego.yaw_rate_radps) else state.yaw_rate_radps
    duration_s = (tick.t_ns - state.t_ns) * 1e-9
    step = driven(0.5 * (speed_mps + state.speed_mps), 0.5 * (yaw_rate + state.yaw_rate_radps), duration_s)
    oldest_ns = tick.t_ns - round(config.memory_s * 1e9) - tick.period_ns
    moved = [_moved(track, step, track.seen_ns == state.t_ns) for track in state.tracks]
    return replace(
        state,
        t_ns=tick.t_ns,
        speed_mps=speed_mps,
        yaw_rate_radps=yaw_rate,
        tracks=tuple(
            track
            for track in moved
            if track.seen_ns >= oldest_ns or (track.is_confirmed and track.used_up(config, tick.t_ns) < 1.0)
        ),
    )


def _moved(track: Track, step: Moved, was_seen: bool) -> Track:
    """Move one line; a vehicle that moves along x meets c0 + c1 x at x.

    That does from one image to the next, and where the line is not known near; else it is read.
    """
    moved = step if was_seen else track.moved.further(step)
    position_m, slope = track.position_m + track.slope * step.x_m, track.slope
    fit = track.last.fit
    if not was_seen and (track.is_near or _reaches_ego(fit, moved)):
        position_m, slope = beside(fit, moved) or (position_m, slope)
    return Track(
        number=track.number,
        last=track.last,
        moved=moved,
        position_m=position_m,
        slope=slope,
        is_near=track.is_near,
        near_ns=track.near_ns,
        is_left=track.is_left,
        side=track.side,
        seen_ns=track.seen_ns,
        images=track.images,
        is_confirmed=track.is_confirmed,
    )


def _reaches_ego(fit: Fit, moved: Moved) -> bool:
    return reaches_ego(x_now(fit, moved, fit.x_min_m), x_now(fit, moved, fit.x_max_m))


def match(config: TrackerConfig, seen: list[Seen], state: TrackerState) -> dict[int, int]:
    """Return place in `seen` -> place in the state's tracks, nearest pairs first, each used once."""
    tracks = state.tracks
    is_crowded = _is_crowded(config, [line.position_m for line in seen]) or _is_crowded(
        config, sorted((track.position_m for track in tracks), reverse=True)
    )
    gates_m = [_gate_m(config, track, state.t_ns) for track in tracks]
    pairs = []
    for n, line in enumerate(seen):
        for place, track in enumerate(tracks):
            rough_m = abs(line.position_m - track.position_m)
            if rough_m > FARTHEST_M:
                continue
            distance = rough_m
            is_placed = rough_m > 0.5 * config.gate_m and not (line.is_near and track.is_near)
            if is_crowded or is_placed:
                ahead_m = distance_ahead(line.fit, track)
                distance = rough_m if ahead_m is None else ahead_m
            if distance <= gates_m[place]:
                pairs.append((distance, rough_m, n, place))
    matched: dict[int, int] = {}
    taken: set[int] = set()
    for _, _, n, place in sorted(pairs):
        if n not in matched and place not in taken:
            matched[n] = place
            taken.add(place)
    return matched


def _is_crowded(config: TrackerConfig, positions_m: list[float]) -> bool:
    """Whether two lines, from left to right, lie so near that a gate could take one for the other."""
    return any(left - right < 2.0 * config.gate_m for left, right in pairwise(positions_m))


def _gate_m(config: TrackerConfig, track: Track, t_ns: int) -> float:
    grown_m = config.gate_m + 2.0 * track.drift_m(t_ns)
    return max(config.gate_m, min(grown_m, WIDEST_GATE_M))


def distance_ahead(fit: Fit, track: Track) -> float | None:
    """Return the mean distance at the begin and in the middle of what both are seen on; None if too short."""
    last, moved = track.last.fit, track.moved
    begin_m = max(fit.x_min_m, x_now(last, moved, last.x_min_m))
    end_m = min(fit.x_max_m, x_now(last, moved, last.x_max_m))
    if end_m - begin_m < COMMON_M:
        return None
    middle_m = 0.5 * (begin_m + end_m)
    return 0.5 * sum(abs(aside_m(last, moved, x, fit.y_at(x))) for x in (begin_m, middle_m))
