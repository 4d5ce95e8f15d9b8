"""P1's four functions (2.2.1.1 to 2.2.1.4) over a drive, and where an error is largest.

Errors are those of the table that `vsensor scan` writes: reported line minus reference along its normal, left
positive. Masked images (lane changes, resets, low speed) have none, nor has what lies beyond the range.
"""

from dataclasses import dataclass, replace

import numpy as np

from vsensor.apps.examine.drive import Drive
from vsensor.field.masks import CODE
from vsensor.field.rows import Block, block_of
from vsensor.field.table import Masked
from vsensor.types import Array, Side

CHUNK = 4096


def road_width_m(drive: Drive) -> Array:
    """Return the distance of the own lane's lines (N,), NaN where one is not reported."""
    return drive.scanned.work.width_m


def reported_range_m(drive: Drive, side: Side) -> Array:
    """Return how far a line is reported (N,), NaN where it is not, or the bus has no range."""
    line = drive.images.lines[side]
    return np.where(line.reported & np.isfinite(line.x_max_m), line.x_max_m, np.nan)


def lane_error_m(drive: Drive, side: Side, range_m: float) -> Array:
    """Return the error (N,) at one range, NaN where there is none."""
    found = [
        _used(_block(drive, side, start, min(start + CHUNK, len(drive)), np.array([range_m])))[:, 0]
        for start in range(0, len(drive), CHUNK)
    ]
    return np.concatenate(found)


def error_over_range_m(drive: Drive, side: Side, number: int) -> Array:
    """Return the errors (R,) of one image at the ranges of the scan, NaN where there is none."""
    error: Array = _used(_block(drive, side, number, number + 1, drive.scanned.work.ranges_m))[0]
    return error


@dataclass(frozen=True, slots=True, kw_only=True)
class Largest:
    """The image with the largest error at a range, on which side, and the error."""

    number: int
    side: Side
    error_m: float


def largest_error(drive: Drive, range_m: float) -> Largest | None:
    """Return where the error at a range is largest, None where there is no error at all."""
    found = None
    for side in drive.sides:
        error = lane_error_m(drive, side, range_m)
        if np.isnan(error).all():
            continue
        number = int(np.nanargmax(np.abs(error)))
        if found is None or abs(error[number]) > abs(found.error_m):
            found = Largest(number=number, side=side, error_m=float(error[number]))
    return found


def _block(drive: Drive, side: Side, start: int, stop: int, ranges_m: Array) -> Block:
    return block_of(replace(drive.scanned.work, ranges_m=ranges_m), side, start, stop)


def _used(block: Block) -> Array:
    """Return the errors (M, R), NaN where they are masked."""
    return np.where(block.masked == CODE[Masked.USED], block.error_m, np.nan)
