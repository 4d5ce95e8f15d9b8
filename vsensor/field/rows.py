"""The rows of a log's table, some images at a time: errors of all sides at all ranges, and the vehicle."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsensor.field.foot import feet
from vsensor.field.images import Images
from vsensor.field.masks import row_masks
from vsensor.field.motion import Motion
from vsensor.field.reference import Reference
from vsensor.field.table import Rows
from vsensor.types import NANOSECONDS_PER_SECOND, Array, BoolArray, CodeArray, IntArray, Side
from vsensor.world.dead_reckoning import DrivenPath

CHUNK = 2048
"""Images at a time: with two sides and 50 ranges 0.2 million rows, arrays of 1.6 MB."""
WIDTH_LIMITS_M = (1.0, 10.0)
MEAN_S = 0.4
"""Yaw rate is the turn over this time: a coarse signal's steps, and the body's sway, average out."""
COURSE_M = 0.5
BEND_M = 5.0
"""The path's curvature at a range is its turn from this far before to as far behind."""
REACH_M = 10.0
REACH_SHARE = 0.35
"""How far along the line, and by which share of the range, the foot may be from where it is expected."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Work:
    """All that rows are made of; `codes`: side -> why its images (N,) are masked; `width_m` (N,) of lane."""

    images: Images
    motion: Motion
    reference: Reference
    codes: Mapping[Side, CodeArray]
    course: "Course"
    width_m: Array
    ranges_m: Array
    beyond_range: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """One side of some images: error and masks (M, R)."""

    error_m: Array
    masked: CodeArray


def rows_of(work: Work) -> Iterator[Rows]:
    """Yield the rows in order of time, side and range."""
    for start in range(0, len(work.images), CHUNK):
        stop = min(start + CHUNK, len(work.images))
        blocks = [block_of(work, side, start, stop) for side in work.images.lines]
        yield _columns(work, list(work.images.lines), blocks, start, stop)


def block_of(work: Work, side: Side, start: int, stop: int, chosen: IntArray | None = None) -> Block:
    """Return the errors of one side in images start to stop, or (M, R) of the `chosen` (M,) among them."""
    line, ranges = work.images.lines[side], work.ranges_m
    part = slice(start, stop)
    shape = (stop - start, len(ranges))
    is_beyond = ranges[None, :] > line.x_max_m[part, None]
    wanted = line.is_whole[part, None] & (~is_beyond if not work.beyond_range else np.ones(shape, dtype=bool))
    if chosen is not None:
        wanted[np.setdiff1d(np.arange(stop - start), chosen - start)] = False
    error = np.full(shape, np.nan)
    is_gap, is_other = np.ones(shape, dtype=bool), np.zeros(shape, dtype=bool)
    for near in work.reference.near(start, stop, side):
        rows, columns = np.nonzero(wanted[near.images - start])
        image = near.images[rows]
        x = ranges[columns]
        c0, c1, c2, c3 = line.coefficients[image].T
        y = c0 + x * (c1 + x * (c2 + x * c3))
        poses = work.reference.poses
        cos, sin = np.cos(poses.yaw_rad[image]), np.sin(poses.yaw_rad[image])
        spacing = near.line.spacing_m
        found = feet(
            near.line,
            poses.x_m[image] + x * cos - y * sin,
            poses.y_m[image] + x * sin + y * cos,
            near.place[rows] + x / spacing,
            (REACH_M + REACH_SHARE * x) / spacing,
        )
        at = image - start, columns
        piece = np.nan_to_num(found.place).astype(np.int64)
        piece = np.minimum(piece, len(near.line.gap) - 1)
        is_gap[at] = near.line.gap[piece] | np.isnan(found.place)
        error[at] = np.where(near.line.gap[piece], np.nan, found.error_m)
        is_other[at] = ~np.isnan(found.place) & (near.line.lane[piece] != near.lane[rows])
    error[is_other] = np.nan
    masked = row_masks(work.codes[side][part], is_other, is_beyond, is_gap)
    if chosen is not None:
        error, masked = error[chosen - start], masked[chosen - start]
    return Block(error_m=error, masked=masked)


def _columns(work: Work, sides: Sequence[Side], blocks: Sequence[Block], start: int, stop: int) -> Rows:
    images, part = work.images, slice(start, stop)
    shape = (stop - start, len(sides), len(work.ranges_m))
    reported = np.stack([images.lines[side].reported[part] for side in sides], axis=1)
    keep = np.repeat(reported[:, :, None], shape[2], axis=2)
    keep[:, :, 0] = True  # a line that is not reported has one row, without a range

    def spread(values: Any, axes: tuple[int, ...]) -> Any:
        """Return values over (image,), (image, side) or (range,) in the rows that are kept."""
        index = tuple(slice(None) if axis in axes else None for axis in range(3))
        return np.broadcast_to(values[index], shape)[keep]

    def of_lines(name: str) -> Array:
        return np.stack([getattr(images.lines[side], name)[part] for side in sides], axis=1)

    vehicle = _vehicle(work, start, stop)
    is_there = spread(reported, (0, 1))
    range_m = np.where(is_there, spread(work.ranges_m, (2,)), np.nan)
    x_max = of_lines("x_max_m")
    return {
        "t_ns": spread(images.t_ns[part], (0,)),
        "side": spread(np.array([int(side) for side in sides], dtype=np.int8), (1,)),
        "range_m": range_m,
        "error_m": np.stack([block.error_m for block in blocks], axis=1)[keep],
        "masked": np.stack([block.masked for block in blocks], axis=1)[keep],
        **{name: spread(vehicle[name], (0,)) for name in _OF_IMAGE},
        "future_yaw_rate_radps": np.where(is_there, spread(vehicle["future"], (0, 2)), np.nan),
        "curvature_per_m": np.where(is_there, spread(vehicle["curvature"], (0, 2)), np.nan),
        "night": spread(images.night[part], (0,)),
        "rain": spread(images.rain[part], (0,)),
        "x_max_m": spread(np.where(reported & np.isfinite(x_max), x_max, np.nan), (0, 1)),
        "quality": spread(of_lines("quality"), (0, 1)),
        "measured": spread(of_lines("measured"), (0, 1)),
        "lane_width_m": spread(work.width_m[part], (0,)),
    }


_OF_IMAGE = ("speed_mps", "acceleration_mps2", "yaw_rate_radps")


def _vehicle(work: Work, start: int, stop: int) -> dict[str, Array]:
    """Return what the vehicle does at the images (M,), and where it comes to the ranges (M, R)."""
    t_ns = work.images.t_ns[start:stop]
    here = work.motion.path.poses(t_ns)
    ahead = here.s_m[:, None] + work.ranges_m
    found = {
        "speed_mps": here.speed_mps,
        "acceleration_mps2": here.acceleration_mps2,
        "yaw_rate_radps": yaw_rate_radps(work, t_ns),
        "future": work.course.at(work.course.yaw_rate_radps, ahead),
        "curvature": work.course.at(work.course.curvature_per_m, ahead),
    }
    unknown = ~work.motion.covers(t_ns)
    for values in found.values():
        values[unknown] = np.nan
    return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """What the vehicle does at distances along its path, every COURSE_M from 0 on (K,); NaN: not known."""

    yaw_rate_radps: Array
    curvature_per_m: Array

    def at(self, values: Array, s_m: Array) -> Array:
        """Return one of the two at distances of any shape, linear between those that are kept."""
        place = s_m / COURSE_M
        number = place.astype(np.int64)
        low = np.minimum(number, len(values) - 2)
        part = place - low
        return np.where(
            number > len(values) - 2, np.nan, values[low] + part * (values[low + 1] - values[low])
        )


def course_of(path: DrivenPath) -> Course:
    """Return the course of a path."""
    s = np.arange(0.0, max(float(path.s_m[-1]), 2 * COURSE_M), COURSE_M)
    since_s = (path.t_ns - path.t_ns[0]) / NANOSECONDS_PER_SECOND
    when_s = np.interp(s, path.s_m, since_s, right=np.nan)
    turn = np.interp(s + BEND_M, path.s_m, path.yaw_rad) - np.interp(s - BEND_M, path.s_m, path.yaw_rad)
    inside = (s >= BEND_M) & (s + BEND_M <= path.s_m[-1])
    return Course(
        yaw_rate_radps=_turn_rate(path, when_s),
        curvature_per_m=np.where(inside, turn / (2 * BEND_M), np.nan),
    )


def yaw_rate_radps(work: Work, t_ns: IntArray) -> Array:
    """Return the yaw rate (M,) at times (M,): the turn over MEAN_S."""
    path = work.motion.path
    return _turn_rate(path, (t_ns - path.t_ns[0]) / NANOSECONDS_PER_SECOND)


def _turn_rate(path: DrivenPath, at_s: Array) -> Array:
    """Return the turn over MEAN_S per second at seconds after the path's start (M,)."""
    since_s = (path.t_ns - path.t_ns[0]) / NANOSECONDS_PER_SECOND
    low = np.maximum(at_s - MEAN_S / 2, 0.0)
    high = np.minimum(at_s + MEAN_S / 2, since_s[-1])
    turn = np.interp(high, since_s, path.yaw_rad) - np.interp(low, since_s, path.yaw_rad)
    rate: Array = turn / np.maximum(high - low, 1e-3)
    return rate


def lane_width_m(images: Images) -> Array:
    """Return the distance (N,) of the own lane's lines across it, at the rear axle; NaN without both."""
    left, right = images.lines[Side.LEFT], images.lines[Side.RIGHT]
    heading = np.arctan((left.coefficients[:, 1] + right.coefficients[:, 1]) / 2)
    width = (left.coefficients[:, 0] - right.coefficients[:, 0]) * np.cos(heading)
    both: BoolArray = (
        left.is_whole & right.is_whole & (width > WIDTH_LIMITS_M[0]) & (width < WIDTH_LIMITS_M[1])
    )
    return np.where(both, width, np.nan)
