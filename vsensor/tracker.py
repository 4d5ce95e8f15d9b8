"""Which line is left, right, next left, next right; and when the vehicle crosses one.

    next left   left      right   next right        position = y of the line at the rear axle, left +
        |         |    ^    |         |
        |         |   [ ]   |         |             a line keeps its side until it is `hysteresis_m`
       5.2       1.7   0  -1.8      -5.3  m         past the vehicle's centre on the other one

Fits are compared where they are seen: a polynomial is read at the vehicle only where it begins near.
A line that begins far ahead is placed relative to a line seen both there and near, as lines of one road
run side by side, or to the driven path. Of several such lines, of which one may leave the road, that one
counts which agrees best with the path.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Annotated

import msgspec

from vsensor.schema import Config
from vsensor.types import EgoState, Fit, Side, Tick

EXTENDED_M = (10.0, 15.0)
"""A polynomial is read at most so far before its first point, the nearest ones of an image (a high camera
sees nothing nearer) up to the second figure: seen from 20 m on, a bend behind it moves a cubic by metres."""


class TrackerConfig(Config, frozen=True, kw_only=True):
    """How lines are told apart.

    Farther than `max_lateral_m` from the vehicle is no line of interest, farther than `max_own_m` none
    of the own lane; two fits nearer to each other than `min_separation_m` are the same paint. `gate_m`
    is how far a line may be from where it was expected and still be the same one. The place of a line
    that is not seen is remembered for `memory_s`; if it was seen in `confirm_images` images, no other
    line takes its side meanwhile.
    """

    max_lateral_m: Annotated[float, msgspec.Meta(gt=0.0, le=30.0)] = 8.0
    max_own_m: Annotated[float, msgspec.Meta(gt=0.0, le=30.0)] = 4.5
    min_separation_m: Annotated[float, msgspec.Meta(ge=0.0, le=2.0)] = 0.3
    hysteresis_m: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.2
    gate_m: Annotated[float, msgspec.Meta(gt=0.0, le=3.0)] = 1.0
    memory_s: Annotated[float, msgspec.Meta(ge=0.0, le=10.0)] = 0.5
    confirm_images: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A line that was seen: its position and the road's slope at the rear axle, when, in how many images."""

    position_m: float
    slope: float
    is_left: bool
    side: Side | None
    seen_at_ns: int
    images: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerState:
    """The lines of the last image, as of `t_ns`."""

    t_ns: int = 0
    tracks: tuple[Track, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """`sides` maps a side to the line's number k; `lane_change` is 1 to the left, -1 to the right."""

    sides: Mapping[Side, int]
    lane_change: int = 0


def initial_state() -> TrackerState:
    """Return the state before the first image."""
    return TrackerState()


def assign(
    config: TrackerConfig, state: TrackerState, fits: tuple[Fit | None, ...], ego: EgoState, tick: Tick
) -> tuple[TrackerState, Assignment]:
    """Give every side its line; a side without a line is absent from the mapping."""
    expected = _predict(config, state, ego, tick)
    positions, slope = _positions(fits, ego, expected)
    seen = _distinct(config, fits, positions)
    matched = _match(config, seen, expected)
    is_left = _split(config, seen, expected, matched)
    unseen = [track for place, track in enumerate(expected) if place not in matched.values()]
    sides = _sides(config, seen, is_left, unseen)
    side_of = {k: side for side, k in sides.items()}
    tracks = [
        Track(
            position_m=position,
            slope=slope,
            is_left=is_left[k],
            side=side_of.get(k),
            seen_at_ns=tick.t_ns,
            images=expected[matched[k]].images + 1 if k in matched else 1,
        )
        for k, position in seen
    ]
    change = _lane_change(expected, matched, is_left)
    return TrackerState(t_ns=tick.t_ns, tracks=(*tracks, *unseen)), Assignment(
        sides=sides, lane_change=change
    )


def _predict(config: TrackerConfig, state: TrackerState, ego: EgoState, tick: Tick) -> list[Track]:
    """Move the remembered lines to now; a vehicle that moves along x meets c0 + c1 x at x."""
    travel_m = ego.speed_mps * (tick.t_ns - state.t_ns) * 1e-9
    travel_m = travel_m if isfinite(travel_m) else 0.0
    oldest = tick.t_ns - round(config.memory_s * 1e9) - tick.period_ns
    return [
        replace(track, position_m=track.position_m + track.slope * travel_m)
        for track in state.tracks
        if track.seen_at_ns >= oldest
    ]


def _positions(
    fits: tuple[Fit | None, ...], ego: EgoState, expected: list[Track]
) -> tuple[dict[int, float], float]:
    """Return each fitted line's y at the rear axle, however far ahead it begins, and the road's slope there.

    Of the slopes of the lines the least counts: a line that leaves the road has a larger one.
    """
    found = {k: fit for k, fit in enumerate(fits) if fit is not None}
    least_m, most_m = EXTENDED_M
    nearest_m = min((fit.x_min_m for fit in found.values()), default=0.0)
    reach_m = min(max(least_m, nearest_m), most_m)
    near = {k: fit.y_at(0.0) for k, fit in found.items() if _reaches_ego(fit, reach_m)}
    slopes = [float(found[k].coefficients[1]) for k in near] or [track.slope for track in expected]
    slope = min(slopes, key=abs, default=0.0)
    beside = [(found[k], y) for k, y in near.items()]
    positions = {k: near[k] if k in near else _placed(fit, beside, slope, ego) for k, fit in found.items()}
    return positions, slope


def _reaches_ego(fit: Fit, reach_m: float) -> bool:
    """Whether the polynomial may be read at x = 0: it is at most extended by half its length."""
    return fit.x_min_m <= min(reach_m, 0.5 * (fit.x_max_m - fit.x_min_m)) and fit.x_max_m >= 0.0


def _placed(fit: Fit, near: list[tuple[Fit, float]], slope: float, ego: EgoState) -> float:
    """Place a line that begins far ahead: beside a line seen there and here, else beside the path."""
    x = fit.x_min_m
    y = fit.y_at(x)
    curvature = ego.yaw_rate_radps / ego.speed_mps if ego.speed_mps > 1.0 else 0.0
    by_path = y - x * (slope + 0.5 * x * (curvature if isfinite(curvature) else 0.0))
    beside = [y - other.y_at(x) + at_ego for other, at_ego in near if x <= other.x_max_m]
    return min(beside, key=lambda position: abs(position - by_path), default=by_path)


def _distinct(
    config: TrackerConfig, fits: tuple[Fit | None, ...], positions: Mapping[int, float]
) -> list[tuple[int, float]]:
    """Return (k, position) from left to right, of lines on the same paint only the better seen one."""

    def seen(k: int) -> tuple[float, int]:
        fit = fits[k]
        return (fit.x_max_m - fit.x_min_m, fit.points) if fit else (0.0, 0)

    kept: list[tuple[int, float]] = []
    inside = [(k, y) for k, y in positions.items() if abs(y) <= config.max_lateral_m]
    for k, y in sorted(inside, key=lambda item: seen(item[0]), reverse=True):
        if all(abs(y - other) >= config.min_separation_m for _, other in kept):
            kept.append((k, y))
    return sorted(kept, key=lambda item: -item[1])


def _match(config: TrackerConfig, seen: list[tuple[int, float]], expected: list[Track]) -> dict[int, int]:
    """Return line k -> place in `expected`, nearest pairs first, each used once."""
    pairs = sorted(
        (abs(y - track.position_m), k, place) for k, y in seen for place, track in enumerate(expected)
    )
    matched: dict[int, int] = {}
    for distance, k, place in pairs:
        if distance <= config.gate_m and k not in matched and place not in matched.values():
            matched[k] = place
    return matched


def _split(
    config: TrackerConfig, seen: list[tuple[int, float]], expected: list[Track], matched: Mapping[int, int]
) -> dict[int, bool]:
    """Say for each line whether it is on the left; a known one changes only past the hysteresis."""
    is_left: dict[int, bool] = {}
    for k, y in seen:
        known = expected[matched[k]].is_left if k in matched else None
        limit = 0.0 if known is None else -config.hysteresis_m if known else config.hysteresis_m
        is_left[k] = y >= limit
    for (k, _), (right_k, _) in zip(reversed(seen[:-1]), reversed(seen[1:]), strict=True):
        is_left[k] = is_left[k] or is_left[right_k]  # what lies left of a left line is left
    return is_left


def _sides(
    config: TrackerConfig, seen: list[tuple[int, float]], is_left: Mapping[int, bool], unseen: list[Track]
) -> dict[Side, int]:
    """Give lines their sides, outwards; a remembered line that is not seen (None) keeps its place."""
    lines: list[tuple[float, int | None, bool]] = [(abs(y), k, is_left[k]) for k, y in seen]
    lines += [
        (abs(track.position_m), None, track.is_left)
        for track in unseen
        if track.images >= config.confirm_images and abs(track.position_m) <= config.max_lateral_m
    ]
    sides: dict[Side, int] = {}
    for on_left, own, beyond in ((True, Side.LEFT, Side.NEXT_LEFT), (False, Side.RIGHT, Side.NEXT_RIGHT)):
        outwards = sorted((line for line in lines if line[2] is on_left), key=lambda line: line[0])
        if outwards and outwards[0][0] > config.max_own_m:
            outwards.insert(0, (0.0, None, on_left))
        for side, (_, k, _) in zip((own, beyond), outwards, strict=False):
            if k is not None:
                sides[side] = k
    return sides


def _lane_change(expected: list[Track], matched: Mapping[int, int], is_left: Mapping[int, bool]) -> int:
    """Return 1 if the left line now is right of the vehicle, -1 if the right one now is left."""
    for k, place in matched.items():
        track = expected[place]
        if track.side is Side.LEFT and not is_left[k]:
            return 1
        if track.side is Side.RIGHT and is_left[k]:
            return -1
    return 0
