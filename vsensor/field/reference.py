"""The line that a report is compared with: along the driven path, from a file, or on a map.

Whatever it is made of, a reference answers one question for some images in turn: on which polyline, and where
on it, does the line of this side stand beside the vehicle (`Near`)?
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from vsensor.errors import LogError
from vsensor.field.config import ScanLimits
from vsensor.field.foot import Polyline, feet
from vsensor.field.images import Images
from vsensor.field.motion import Motion
from vsensor.logs.decode import DecodedFrames
from vsensor.types import Array, BoolArray, IntArray, Side
from vsensor.world.dead_reckoning import resampled

STEP_M = 0.5
"""Between vertices of the line along the path: at R = 250 m the chord is 0.1 mm off the arc."""
BESIDE_M = 30.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Poses:
    """Where the vehicle stands at each image (N,), in the frame of the reference; NaN = not known."""

    x_m: Array
    y_m: Array
    yaw_rad: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Near:
    """Images (M,), numbers of them, whose line of one side is `line` at `place` (M,) beside the vehicle.

    `lane` (M,): which of the lines on that polyline (`Polyline.lane`) each image shows.
    """

    images: IntArray
    line: Polyline
    place: Array
    lane: IntArray


class Reference(Protocol):
    """A reference for a whole log; `kind` names it in the table's metadata, `poses` are in its frame."""

    kind: str
    poses: Poses
    notes: tuple[str, ...]

    def near(self, start: int, stop: int, side: Side) -> Iterator[Near]:
        """Yield the lines of images start to stop; images without any are in none."""
        ...


class PathReference:
    """P1's GTA: each side's offset at range 0 placed along the driven path.

    Only images in which the line is measured, well seen and `usable` (N,) make it. It begins anew where the
    line is another one (a lane change, an offset that jumps, a break of the path).
    """

    kind = "gta"
    notes: tuple[str, ...] = ()

    def __init__(
        self,
        images: Images,
        motion: Motion,
        usable: BoolArray,
        begins: Mapping[Side, IntArray],
        limits: ScanLimits,
    ) -> None:
        """Lay the lines of all sides.

        `usable` (N,): images of a moving vehicle, no reset; `begins`: images with which another line begins.
        """
        unknown = ~motion.covers(images.t_ns)
        poses = motion.path.poses(images.t_ns)
        x, y, yaw = (np.where(unknown, np.nan, v) for v in (poses.x_m, poses.y_m, poses.yaw_rad))
        self.poses = Poses(x_m=x, y_m=y, yaw_rad=yaw)
        self._s_m = np.where(unknown, np.nan, poses.s_m)
        self._begins = begins
        self._lines: dict[Side, tuple[Polyline, float]] = {}
        for side, line in images.lines.items():
            good = usable & ~unknown & line.is_whole & line.measured
            used = np.flatnonzero(good & (line.quality >= limits.reference_quality))
            if len(used) > 2 and poses.s_m[used[-1]] - poses.s_m[used[0]] > 2 * STEP_M:
                run = np.searchsorted(begins[side], used, side="right")
                offset = line.coefficients[used, 0]
                self._lines[side] = _laid(motion, poses.s_m[used], offset, run, limits)

    def near(self, start: int, stop: int, side: Side) -> Iterator[Near]:
        """Yield the one line of the side."""
        if side in self._lines:
            line, first_m = self._lines[side]
            images = np.arange(start, stop)
            place = (self._s_m[start:stop] - first_m) / STEP_M
            lane = np.searchsorted(self._begins[side], images, side="right")
            yield Near(images=images, line=line, place=place, lane=lane)


def _laid(
    motion: Motion, s_m: Array, offset_m: Array, run: IntArray, limits: ScanLimits
) -> tuple[Polyline, float]:
    """Return the line with a vertex every STEP_M of the path, and the path's distance at its first vertex.

    `s_m`, `offset_m`, `run` (U,) of the images that make it: where, how far to the left, number of the line.
    """
    first = float(s_m[0])
    grid: Array = first + STEP_M * np.arange(int((s_m[-1] - first) / STEP_M) + 1, dtype=np.float64)
    edges = [0, *(np.flatnonzero(np.diff(run)) + 1).tolist(), len(s_m)]
    lane = np.zeros(len(grid), dtype=np.int64)
    offset, known = np.full(len(grid), np.nan), np.zeros(len(grid), dtype=bool)
    for a, b in pairwise(edges):
        low, high = np.searchsorted(grid, (s_m[a], s_m[b - 1] + 1e-9))
        lane[low:] = run[a]
        if high > low:
            at, values = _distinct(s_m[a:b], offset_m[a:b])
            offset[low:high] = _smoothed(np.interp(grid[low:high], at, values), limits.smooth_m)
            known[low:high] = _within(grid[low:high], at, limits.reference_gap_m)
    where = ~np.isnan(offset)
    offset = np.interp(grid, grid[where], offset[where]) if where.any() else np.zeros(len(grid))
    path = motion.path
    x, y, yaw = (np.interp(grid, path.s_m, values) for values in (path.x_m, path.y_m, path.yaw_rad))
    line = Polyline(
        x_m=x - offset * np.sin(yaw),
        y_m=y + offset * np.cos(yaw),
        gap=~(known[1:] & known[:-1]) | (lane[1:] != lane[:-1]),
        lane=lane,
    )
    return line, first


def _distinct(s_m: Array, values: Array) -> tuple[Array, Array]:
    """Return distances that rise and the values there; of several at one distance the mean."""
    at, place, count = np.unique(s_m, return_inverse=True, return_counts=True)
    return at, np.bincount(place, weights=values) / count


def _within(grid: Array, at: Array, gap_m: float) -> BoolArray:
    """Return which grid points lie between two measured ones that are not farther apart than the gap."""
    place = np.searchsorted(at, grid, side="right")
    after, before = np.minimum(place, len(at) - 1), np.maximum(place - 1, 0)
    close: BoolArray = at[after] - at[before] <= gap_m
    return close


def _smoothed(offset: Array, smooth_m: float) -> Array:
    """Return offsets on the grid, each the middle of the parabola through those around it."""
    from scipy.signal import savgol_filter

    window = min(int(smooth_m / STEP_M) // 2 * 2 + 1, (len(offset) - 1) // 2 * 2 + 1)
    if window < 5:
        return offset
    smooth: Array = savgol_filter(offset, window, 2)
    return smooth


def poses_in_log(frames: DecodedFrames, t_ns: IntArray, silence_s: float) -> Poses | None:
    """Return the vehicle's pose at the images (N,) as the log has it, None if it has none."""
    found = []
    for name in ("ego.x_m", "ego.y_m", "ego.yaw_rad"):
        times, values = frames.series(name)
        known = np.isfinite(values)
        order = np.argsort(times[known], kind="stable")
        times, values = times[known][order], values[known][order]
        if len(times) < 2:
            return None
        values = np.unwrap(values) if name == "ego.yaw_rad" else values
        after = np.clip(np.searchsorted(times, t_ns), 1, len(times) - 1)
        inside = (t_ns >= times[0]) & (t_ns <= times[-1])
        inside &= times[after] - times[after - 1] <= silence_s * 1e9
        found.append(np.where(inside, resampled(times, values, t_ns), np.nan))
    bad = np.isnan(found).any(axis=0)
    x, y, yaw = (np.where(bad, np.nan, values) for values in found)
    return Poses(x_m=x, y_m=y, yaw_rad=yaw)


def need_poses(frames: DecodedFrames, t_ns: IntArray, silence_s: float, path: str) -> Poses:
    """Return the poses in the log; raises LogError if it has none."""
    poses = poses_in_log(frames, t_ns, silence_s)
    if poses is None or np.isnan(poses.x_m).all():
        raise LogError(
            f"{path}: no pose: ego.x_m, ego.y_m and ego.yaw_rad are needed for a map as reference; "
            "give the profile that carries them (--profile)"
        )
    return poses


def place_beside(line: Polyline, x_m: Array, y_m: Array, place: Array) -> tuple[Array, Array]:
    """Return offset (left of the vehicle positive) and place of a line beside poses (N,)."""
    found = feet(line, x_m, y_m, place, np.full(len(x_m), BESIDE_M / line.spacing_m))
    return -found.error_m, found.place
