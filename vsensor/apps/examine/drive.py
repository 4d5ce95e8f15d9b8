"""A recorded drive as the examiner has it: what a scan prepares, and what is looked up again and again."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from vsensor.errors import LogError
from vsensor.field.images import Images
from vsensor.field.rows import yaw_rate_radps
from vsensor.field.scan import Scanned, ScanOptions, prepare
from vsensor.types import NANOSECONDS_PER_SECOND, Array, BoolArray, Side


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A drive of N images, its left and right line compared with a reference; `causes` from a trace.

    `causes`: side -> codes of `types.Unseen` (N,), why a true line was not seen; 0 seen, NaN not known.
    `other` is a drive that is laid over it, from its own first image on.
    """

    log: Path
    scanned: Scanned
    causes: Mapping[Side, Array] = field(default_factory=dict[Side, Array])
    other: "Drive | None" = None

    @property
    def images(self) -> Images:
        """The images, in order of time."""
        return self.scanned.work.images

    @property
    def sides(self) -> tuple[Side, ...]:
        """The sides that are compared."""
        return tuple(self.images.lines)

    def __len__(self) -> int:
        return len(self.images)

    @cached_property
    def t_s(self) -> Array:
        """Seconds since the first image (N,)."""
        since: Array = (self.images.t_ns - self.images.t_ns[0]) / NANOSECONDS_PER_SECOND
        return since

    @cached_property
    def speed_mps(self) -> Array:
        """Speed at the images (N,), NaN where the motion is not known."""
        motion = self.scanned.work.motion
        speed = motion.path.poses(self.images.t_ns).speed_mps
        return np.where(motion.covers(self.images.t_ns), speed, np.nan)

    @cached_property
    def yaw_rate_radps(self) -> Array:
        """Yaw rate at the images (N,) without the sensor's offset, left positive, NaN where not known."""
        rate = yaw_rate_radps(self.scanned.work, self.images.t_ns)
        return np.where(self.scanned.work.motion.covers(self.images.t_ns), rate, np.nan)

    def reported(self, side: Side) -> BoolArray:
        """Return in which images (N,) a line is reported on a side."""
        return self.images.lines[side].reported

    def number_at(self, t_s: float) -> int:
        """Return the image nearest to a time."""
        return int(np.argmin(np.abs(self.t_s - t_s)))


def load_drive(log: Path, options: ScanOptions, progress: Callable[[int], None] | None = None) -> Drive:
    """Read a log, lay its reference; `progress` is told how many bytes are read.

    Raises LogError where lines or motion are missing, or no image has a line; other VsensorError subclasses.
    """
    drive = Drive(log=log, scanned=prepare(log, log.stem, options, progress))
    if not any(drive.reported(side).any() for side in drive.sides):
        raise LogError(f"{log}: {len(drive)} images, but no line is reported in any of them")
    return drive
