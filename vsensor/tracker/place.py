"""Where each line of an image lies beside the vehicle, and which of them are the same paint.

Fits are compared where they are seen: a polynomial is read at the vehicle only where it begins near.
A line that begins far ahead is placed relative to a line seen both there and near, as lines of one road
run side by side, or to the driven path. Of several such lines, of which one may leave the road, that one
counts which agrees best with the path.

Two lines at one place that do not part are one. Where they part, as at a fork, both are kept: the one that
goes on with the path has the place, the one that leaves it is placed outside.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import copysign, isfinite

from vsensor.tracker.config import TrackerConfig
from vsensor.tracker.moved import aside_m
from vsensor.tracker.state import Track
from vsensor.types import EgoState, Fit

EXTENDED_M = (10.0, 15.0)
"""A polynomial is read at most so far before its first point, the nearest ones of an image (a high camera
sees nothing nearer) up to the second figure: seen from 20 m on, a bend behind it moves a cubic by metres."""
AHEAD_M = 20.0
"""A line that begins farther ahead is not beside the vehicle; nearer, it may be between two dashes."""
COMMON_M = 3.0
"""Two polynomials are compared where both are seen, over at least so much."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """The driven path ahead: the road's slope at the vehicle, and the curvature of the drive."""

    slope: float
    curvature_per_m: float

    def y_at(self, x_m: float) -> float:
        """Return y of the path."""
        return x_m * (self.slope + 0.5 * x_m * self.curvature_per_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """Line `k` of the image, its y at the rear axle, and whether it was read there itself."""

    k: int
    fit: Fit
    position_m: float
    is_near: bool


def placed(fits: Mapping[int, Fit], ego: EgoState, known: Sequence[Track]) -> tuple[list[Seen], Path]:
    """Return every line at the rear axle, however far ahead it begins, and the path.

    Of the slopes of the lines the least counts: a line that leaves the road has a larger one.
    """
    least_m, most_m = EXTENDED_M
    nearest_m = min((fit.x_min_m for fit in fits.values()), default=0.0)
    reach_m = min(max(least_m, nearest_m), most_m)
    near = {k: fit.y_at(0.0) for k, fit in fits.items() if reaches_ego(fit.x_min_m, fit.x_max_m, reach_m)}
    slopes = [float(fits[k].coefficients[1]) for k in near] or [track.slope for track in known]
    path = Path(slope=min(slopes, key=abs, default=0.0), curvature_per_m=_curvature(ego))
    beside = [(fits[k], y) for k, y in near.items()]
    remembered = [track for track in known if track.near_ns >= 0]
    return [
        Seen(
            k=k,
            fit=fit,
            position_m=near[k] if k in near else _placed(fit, beside, remembered, path),
            is_near=k in near,
        )
        for k, fit in fits.items()
    ], path


def reaches_ego(x_min_m: float, x_max_m: float, reach_m: float = EXTENDED_M[0]) -> bool:
    """Whether the polynomial may be read at x = 0: it is at most extended by half its length."""
    return x_min_m <= min(reach_m, 0.5 * (x_max_m - x_min_m)) and x_max_m >= 0.0


def _curvature(ego: EgoState) -> float:
    curvature = ego.yaw_rate_radps / ego.speed_mps if ego.speed_mps > 1.0 else 0.0
    return curvature if isfinite(curvature) else 0.0


def _placed(fit: Fit, near: list[tuple[Fit, float]], known: list[Track], path: Path) -> float:
    """Place a line that begins far ahead: beside one seen there and here, now or before, else the path."""
    x = fit.x_min_m
    y = fit.y_at(x)
    by_path = y - path.y_at(x)
    beside = [y - other.y_at(x) + at_ego for other, at_ego in near if x <= other.x_max_m]
    beside = beside or [
        track.position_m + aside_m(track.last.fit, track.moved, x, y)
        for track in known
        if track.last.fit.x_min_m <= x + track.moved.x_m <= track.last.fit.x_max_m
    ]
    return min(beside, key=lambda position: abs(position - by_path), default=by_path)


def distinct(config: TrackerConfig, lines: list[Seen], path: Path) -> list[Seen]:
    """Return the lines from left to right, of those on the same paint only the better seen one."""

    def seen(line: Seen) -> tuple[float, int]:
        return (line.fit.x_max_m - line.fit.x_min_m, line.fit.points)

    kept: list[Seen] = []
    inside = [line for line in lines if abs(line.position_m) <= config.max_lateral_m]
    for line in sorted(inside, key=seen, reverse=True):
        near_m = config.min_separation_m
        same = [k for k, other in enumerate(kept) if abs(line.position_m - other.position_m) < near_m]
        if not same:
            kept.append(line)
        elif len(same) == 1 and (pair := _parted(config, kept[same[0]], line, path)) is not None:
            kept[same[0] : same[0] + 1] = pair
    return sorted(kept, key=lambda line: -line.position_m)


def _parted(config: TrackerConfig, one: Seen, other: Seen, path: Path) -> tuple[Seen, Seen] | None:
    """Return two lines at one place apart, the one that goes on with the path where it is; None if one."""
    end_m = min(one.fit.x_max_m, other.fit.x_max_m)
    if end_m - max(one.fit.x_min_m, other.fit.x_min_m) < COMMON_M:
        return None
    ends = [line.fit.y_at(end_m) for line in (one, other)]
    if abs(ends[0] - ends[1]) <= config.gate_m:
        return None
    leaves = [abs(y - path.y_at(end_m) - line.position_m) for y, line in zip(ends, (one, other), strict=True)]
    is_ahead = [line.fit.x_min_m > AHEAD_M for line in (one, other)]
    if (is_ahead[0], leaves[0]) > (is_ahead[1], leaves[1]):  # what is ahead takes no place from what is here
        one, other, ends, is_ahead = other, one, ends[::-1], is_ahead[::-1]
    step_m = copysign(config.min_separation_m, ends[1] - ends[0])
    if is_ahead == [False, True] and step_m * one.position_m < 0.0:
        step_m = -step_m  # it parts to the inside, ahead: for now it is the next line
    return one, _at(other, one.position_m + step_m)


def _at(line: Seen, position_m: float) -> Seen:
    return Seen(k=line.k, fit=line.fit, position_m=position_m, is_near=line.is_near)
