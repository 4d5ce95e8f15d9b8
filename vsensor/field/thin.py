"""Speeds that lack driving, and the drives that fill them (P1 4.2)."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vsensor.field.density import Density
from vsensor.field.table import LogFile, Table
from vsensor.field.tune.grid import MAX_SPEED_MPS, speed_cell
from vsensor.field.tune.reading import Images, read_log
from vsensor.field.tune.region import operating_region
from vsensor.types import Array

GAP_NS = 5_000_000_000
"""Stretches that are less apart are one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Thin:
    """A speed whose driving does not suffice: seconds that it has at the range where it has fewest of them.

    `to_m` is the operating range there: cells beyond it stay empty however far one drives.
    """

    speed_mps: float
    to_m: float
    seconds: float
    missing_s: float


def thin_cells(found: Density, wanted_s: float) -> list[Thin]:
    """Return the speeds with less than `wanted_s` of driving at some range within the operating range.

    From the slowest to the fastest speed at which a line was reported.
    """
    reach = found.survey.reach[0]
    driven = np.flatnonzero(reach.sum(axis=1))
    knots, values = operating_region(reach, found.grid.step_mps, 0.95)
    thin = []
    for place in range(driven[0], min(int(driven[-1]) + 1, found.grid.speeds)) if len(driven) else ():
        speed = float(found.grid.speed_mps[place])
        to_m = float(np.interp(speed, knots, values))
        within = found.grid.range_m <= 0.9 * to_m
        seconds = float(found.seconds[within, place].min()) if within.any() else 0.0
        if seconds < wanted_s:
            thin.append(Thin(speed_mps=speed, to_m=to_m, seconds=seconds, missing_s=wanted_s - seconds))
    return thin


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A stretch of a drive at thin speeds: from and to in s from the log's begin, and what it would fill."""

    log: str
    from_s: float
    to_s: float
    speed_low_mps: float
    speed_high_mps: float
    fills_s: float


def filling_drives(candidates: Table, thin: list[Thin], step_mps: float) -> list[Stretch]:
    """Return the stretches of drives at thin speeds, those that fill most first.

    A second counts by how much of that speed's driving is missing: the emptier, the more.
    """
    worth = np.zeros(round(MAX_SPEED_MPS / step_mps) + 1)
    for one in thin:
        worth[round(one.speed_mps / step_mps)] = one.missing_s / (one.missing_s + one.seconds)
    found = [stretch for file in candidates.files for stretch in _stretches(file, worth, step_mps)]
    return sorted(found, key=lambda one: (-one.fills_s, one.log, one.from_s))


def _stretches(file: LogFile, worth: Array, step_mps: float) -> Iterator[Stretch]:
    images = [part for part in read_log(file, images=True) if isinstance(part, Images)]
    if not images:
        return
    t_ns, first = np.unique(images[0].t_ns, return_index=True)
    speed = images[0].speed_mps[first]
    good = np.isfinite(speed)
    cell = speed_cell(np.where(good, speed, 0.0).astype(np.float32), step_mps, len(worth))
    value = np.where(good, worth[cell], 0.0)
    long = np.diff(t_ns, append=t_ns[-1]) / 1e9
    long = np.where(long < 1.0, long, 0.0)
    for start, stop in _runs(_closed_gaps(value > 0.0, t_ns), t_ns):
        part = slice(start, stop)
        yield Stretch(
            log=file.log,
            from_s=float(t_ns[start] - t_ns[0]) / 1e9,
            to_s=float(t_ns[stop - 1] - t_ns[0]) / 1e9,
            speed_low_mps=float(np.nanmin(speed[part])),
            speed_high_mps=float(np.nanmax(speed[part])),
            fills_s=float((value[part] * long[part]).sum()),
        )


def _runs(inside: np.ndarray, t_ns: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield from and to of the images that are inside without a pause of the log between them."""
    paused = np.diff(t_ns, prepend=t_ns[0]) >= GAP_NS
    begins = inside & (paused | ~np.concatenate([[False], inside[:-1]]))
    ends = inside & (np.concatenate([paused[1:], [True]]) | ~np.concatenate([inside[1:], [False]]))
    yield from zip(np.flatnonzero(begins).tolist(), (np.flatnonzero(ends) + 1).tolist(), strict=True)


def _closed_gaps(inside: np.ndarray, t_ns: np.ndarray) -> np.ndarray:
    """Return `inside` with gaps of less than GAP_NS closed: one stretch, not many."""
    at = np.flatnonzero(inside)
    closed = inside.copy()
    for one, other in pairwise(at):
        if other > one + 1 and (t_ns[other] - t_ns[one]) < GAP_NS:
            closed[one:other] = True
    return closed
