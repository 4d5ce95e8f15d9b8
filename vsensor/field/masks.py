r"""Which images and rows are not to be learned from, and why (P1 2.3, fig. 2.33 and 2.34).

offset  ____                      the polynomials of images before the jump reach beyond it: there the
            \__  jump             reference is another line (masked row by row, by the number of the line);
               \_____________     around it nothing is learned (lane_change_s, image by image)
"""

from collections.abc import Mapping

import numpy as np

from vsensor.field.config import ScanLimits
from vsensor.field.images import Images
from vsensor.field.motion import Motion
from vsensor.field.table import MASKS, Masked
from vsensor.types import NANOSECONDS_PER_SECOND, Array, BoolArray, CodeArray, IntArray, Side

CODE = {mask: number for number, mask in enumerate(MASKS)}
DRIFT_MPS = 1.5
"""A vehicle that changes lanes moves aside at up to this; an offset that changes faster is another line's."""


def told_changes(images: Images) -> IntArray:
    """Return the images with which the sensor begins to tell of a lane change."""
    return np.flatnonzero(np.diff(images.changes.astype(np.int8), prepend=0) > 0)


def jumps_of(images: Images, side: Side, limits: ScanLimits) -> IntArray:
    """Return the images whose offset is not that of the line reported before."""
    line = images.lines[side]
    used = np.flatnonzero(line.is_whole)
    apart_s = np.diff(images.t_ns[used]) / NANOSECONDS_PER_SECOND
    allowed = limits.offset_jump_m + DRIFT_MPS * np.minimum(apart_s, 1.0)
    jumps: IntArray = used[1:][np.abs(np.diff(line.coefficients[used, 0])) > allowed]
    return jumps


def begins_of(images: Images, motion: Motion, limits: ScanLimits) -> Mapping[Side, IntArray]:
    """Return for each side the images with which another line, or another stretch of path, begins."""
    breaks = np.searchsorted(images.t_ns, motion.breaks_ns)
    told = told_changes(images)
    found = {}
    for side in images.lines:
        all_of_them = np.unique(np.concatenate([jumps_of(images, side, limits), told, breaks]))
        found[side] = all_of_them[(all_of_them > 0) & (all_of_them < len(images))]
    return found


def resets_of(images: Images, motion: Motion, limits: ScanLimits) -> BoolArray:
    """Return the images (N,) in and after a reset of sensor, image counter or clock, or without motion."""
    after_ns = round(limits.reset_s * NANOSECONDS_PER_SECOND)
    moments = np.concatenate([images.t_ns[images.reset], motion.breaks_ns])
    return ~motion.covers(images.t_ns) | _around(images.t_ns, moments, 0, after_ns)


def slow_images(images: Images, speed_mps: Array, limits: ScanLimits) -> BoolArray:
    """Return the images (N,) taken below the least speed."""
    slow: BoolArray = speed_mps < limits.low_speed_kmh / 3.6
    return slow


def image_masks(
    images: Images, side: Side, resets: BoolArray, slow: BoolArray, limits: ScanLimits
) -> CodeArray:
    """Return the reason (N,) why an image's side is left out as a whole, the code of "" if it is not."""
    line = images.lines[side]
    around_ns = round(limits.lane_change_s * NANOSECONDS_PER_SECOND)
    moments = images.t_ns[np.concatenate([jumps_of(images, side, limits), told_changes(images)])]
    codes = np.full(len(images), CODE[Masked.USED], dtype=np.uint8)
    codes[_around(images.t_ns, moments, around_ns, around_ns)] = CODE[Masked.LANE_CHANGE]
    codes[slow] = CODE[Masked.LOW_SPEED]
    codes[resets] = CODE[Masked.RESET]
    codes[line.reported & ~line.is_whole] = CODE[Masked.INVALID]
    codes[~line.reported] = CODE[Masked.NO_LINE]
    return codes


def row_masks(
    image_codes: CodeArray, is_other_line: BoolArray, is_beyond: BoolArray, is_gap: BoolArray
) -> CodeArray:
    """Return the reasons (M, R) of rows from those of their images (M,) and their own (M, R)."""
    codes = np.broadcast_to(image_codes[:, None], is_beyond.shape).copy()
    free = codes == CODE[Masked.USED]
    codes[free & is_gap] = CODE[Masked.REFERENCE_GAP]
    codes[free & is_beyond] = CODE[Masked.BEYOND_RANGE]
    codes[free & is_other_line] = CODE[Masked.LANE_CHANGE]
    return codes


def _around(t_ns: IntArray, moments_ns: IntArray, before_ns: int, after_ns: int) -> BoolArray:
    """Return which times (N,) lie around any of the moments."""
    moments = np.sort(moments_ns)
    if not len(moments):
        return np.zeros(len(t_ns), dtype=bool)
    place = np.searchsorted(moments, t_ns, side="right")
    last, following = moments[np.maximum(place - 1, 0)], moments[np.minimum(place, len(moments) - 1)]
    after = (place > 0) & (t_ns - last <= after_ns)
    near: BoolArray = after | ((place < len(moments)) & (following - t_ns <= before_ns))
    return near
