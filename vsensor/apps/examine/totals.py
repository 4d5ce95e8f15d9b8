"""What is true of the whole drive: distance, time, speeds, how often lines are there, lane changes."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vsensor.accept import LimitsConfig
from vsensor.apps.examine.drive import Drive
from vsensor.field.config import ScanLimits
from vsensor.field.masks import jumps_of, told_changes
from vsensor.types import NANOSECONDS_PER_SECOND, SIDE_NAMES

LANE_M = LimitsConfig().lane_width_m
"""A step of an offset that wide is a lane change, as for `vsensor accept`."""
TOGETHER_S = ScanLimits().lane_change_s


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneChange:
    """A lane change: the image with which it begins, and its direction, "" where that is not known."""

    number: int
    direction: str


def lane_changes(drive: Drive) -> list[LaneChange]:
    """Return the lane changes that the sensor tells, or that an offset shows which steps by a lane."""
    images = drive.images
    found: dict[int, str] = {}
    for side in drive.sides:
        offset = images.lines[side].coefficients[:, 0]
        whole = np.flatnonzero(images.lines[side].is_whole)
        for number in jumps_of(images, side, ScanLimits()).tolist():
            before = whole[np.searchsorted(whole, number) - 1]
            step = float(offset[number] - offset[before])
            if LANE_M[0] <= abs(step) <= LANE_M[1]:
                found[number] = (
                    "left" if step > 0 else "right"
                )  # the line ahead of the wheels comes from there
    moments = sorted({**dict.fromkeys(told_changes(images).tolist(), ""), **found}.items())
    kept: list[LaneChange] = []
    for number, direction in moments:
        if kept and drive.t_s[number] - drive.t_s[kept[-1].number] <= TOGETHER_S:
            if not kept[-1].direction:
                kept[-1] = LaneChange(number=kept[-1].number, direction=direction)
            continue
        kept.append(LaneChange(number=number, direction=direction))
    return kept


def totals(drive: Drive) -> Iterator[tuple[str, str]]:
    """Yield what is known of the whole drive: a name, and its value with its unit."""
    images, motion = drive.images, drive.scanned.work.motion
    yield "images", f"{len(drive)}, lost by their counter {images.lost}"
    yield "duration", clock(float(drive.t_s[-1]))
    yield "distance", f"{motion.path.s_m[-1] / 1000:.2f} km"
    speed = drive.speed_mps[np.isfinite(drive.speed_mps)] * 3.6
    if len(speed):
        yield "speed", f"{speed.min():.0f} to {speed.max():.0f} km/h, mean {speed.mean():.0f}"
    for side in drive.sides:
        yield (
            f"{SIDE_NAMES[side]} line",
            f"reported in {100 * drive.reported(side).mean():.1f} %",
        )
    yield "reference", f"{drive.scanned.info['reference']}".rsplit("/", 1)[-1]
    silent = motion.silent_ns
    if len(silent):
        seconds = float(np.sum(silent[:, 1] - silent[:, 0])) / NANOSECONDS_PER_SECOND
        yield "motion unknown", f"{seconds:.1f} s in {len(silent)} pauses"


def clock(t_s: float) -> str:
    """Return seconds as minutes and seconds, with hours where there are some."""
    hours, rest = divmod(round(t_s, 2), 3600)
    minutes, seconds = divmod(rest, 60)
    return f"{int(hours)}:{int(minutes):02d}:{seconds:05.2f}" if hours else f"{int(minutes)}:{seconds:05.2f}"
