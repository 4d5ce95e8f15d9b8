"""What each log format holds; what it does not is counted, and left out of what is written.

    format  times   does not hold
    .log    1 ns    remote CAN FD frames
    .asc    1 us    remote CAN FD frames; names of channels; of an error frame, more than when and where
    .blf    1 ns    names of channels; of an error frame, more than when and where
    .mf4    1 ns    names of channels; the order of frames whose time runs backwards
    .trc    1 us    names of channels; CAN FD (readers disagree about its flags); error frames
    .csv    1 ns    CAN FD; channels; directions

In none but .mf4 is there a time before 1970, in .asc, .blf and .trc none before the first frame's.
"""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from vsensor.logs.table import (
    BITRATE_SWITCH,
    ERROR,
    ERROR_STATE,
    FD,
    REMOTE,
    TRANSMITTED,
    Columns,
)
from vsensor.types import BoolArray

_UNKNOWN_ERROR = 0x80  # candump's class of an error frame of which nothing more is known


@dataclass(frozen=True, slots=True)
class Format:
    """What a format can say."""

    resolution_ns: int = 1
    fd: bool = True
    fd_remote: bool = True
    errors: bool = True
    error_details: bool = True
    direction: bool = True
    channels: bool = True
    names: bool = False
    order: bool = True
    from_start: bool = False
    negative: bool = False


FORMATS: dict[str, Format] = {
    ".log": Format(fd_remote=False, names=True),
    ".asc": Format(resolution_ns=1000, fd_remote=False, error_details=False, from_start=True),
    ".blf": Format(error_details=False, from_start=True),
    ".mf4": Format(order=False, negative=True),
    ".trc": Format(resolution_ns=1000, fd=False, fd_remote=False, errors=False, from_start=True),
    ".csv": Format(fd=False, fd_remote=False, direction=False, channels=False, names=True),
}
"""Suffix -> what it holds."""

DISORDER = "frames in an order other than that of time"
"""Name of the loss that sorting mends."""


@dataclass(slots=True)
class Sieve:
    """Leaves out what a format does not hold, run by run; `lost` counts it by name."""

    format: Format
    lost: Counter[str] = field(default_factory=Counter[str])
    rounded: int = 0
    start_ns: int | None = None
    last_ns: int | None = None

    def held(self, columns: Columns) -> Columns:
        """Return what the format holds of a run of frames."""
        columns = self._whole_frames(_meaningful(columns))
        if len(columns.t_ns):
            columns = self._details(columns)
            self._times(columns)
        return columns

    def _whole_frames(self, columns: Columns) -> Columns:
        form, flags = self.format, columns.flags
        remote_fd = flags & (FD | REMOTE) == FD | REMOTE
        lost: BoolArray = np.zeros(len(flags), dtype=np.bool_)
        for name, rows in (
            ("CAN FD frames", flags & FD != 0 if not form.fd else None),
            ("remote CAN FD frames", remote_fd if form.fd and not form.fd_remote else None),
            ("error frames", flags & ERROR != 0 if not form.errors else None),
            ("frames before 1970", columns.t_ns < 0 if not form.negative else None),
        ):
            if rows is not None:
                self._count(name, rows & ~lost)
                lost |= rows
        return columns.taken(~lost) if lost.any() else columns

    def _details(self, columns: Columns) -> Columns:
        form, flags = self.format, columns.flags
        if not form.direction:
            self._count("directions (sent)", flags & TRANSMITTED != 0)
            columns = columns._replace(flags=flags & np.uint8(0xFF - TRANSMITTED))
        if not form.channels:
            self._count("channels beside the first", columns.channel != 0)
            columns = columns._replace(channel=np.zeros_like(columns.channel))
        errors = columns.flags & ERROR != 0
        if not form.error_details and errors.any():
            known = (columns.arbitration_id != 0) & (columns.arbitration_id != _UNKNOWN_ERROR)
            known |= (columns.length > 0) | (columns.flags & TRANSMITTED != 0)
            self._count("details of error frames", errors & known)
            columns = columns._replace(
                arbitration_id=np.where(errors, np.uint32(0), columns.arbitration_id),
                length=np.where(errors, np.uint8(0), columns.length),
                flags=np.where(errors, np.uint8(ERROR), columns.flags),
                data=np.where(errors[:, None], np.uint8(0), columns.data),
            )
        return columns

    def _times(self, columns: Columns) -> None:
        form, times = self.format, columns.t_ns
        self.rounded += int(np.count_nonzero(times % form.resolution_ns))
        if form.from_start:
            if self.start_ns is None:
                self.start_ns = int(times[0])
            self._count("times before the first frame's", times < self.start_ns)
        if not form.order:
            before = times[:1] if self.last_ns is None else np.array([self.last_ns])
            self._count(DISORDER, np.diff(times, prepend=before) < 0)
        self.last_ns = int(times[-1])

    def _count(self, name: str, rows: BoolArray) -> None:
        count = int(np.count_nonzero(rows))
        if count:
            self.lost[name] += count


def _meaningful(columns: Columns) -> Columns:
    """Return the frames without flags that say nothing of their kind, such as a BRS bit of a classic one."""
    flags = columns.flags
    kept = np.where(flags & FD, np.uint8(0xFF), np.uint8(0xFF - BITRATE_SWITCH - ERROR_STATE))
    kept = np.where(flags & ERROR, np.uint8(ERROR | TRANSMITTED), kept)
    return columns._replace(flags=flags & kept)
