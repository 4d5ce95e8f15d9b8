"""A CAN log as columns."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntFlag
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vsensor.logs.report import LogReport, Notes
from vsensor.types import BoolArray, Frame, IntArray

CLASSIC_BYTES = 8
FD_BYTES = 64
FD_LENGTHS = frozenset((0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64))
"""Data lengths that a CAN FD frame can have (ISO 11898-1, DLC 0..15)."""
MAX_STANDARD_ID = 0x7FF
MAX_EXTENDED_ID = 0x1FFF_FFFF


class Flag(IntFlag):
    """Bits of the `flags` column."""

    EXTENDED = 1
    FD = 2
    BITRATE_SWITCH = 4
    ERROR_STATE = 8
    ERROR = 16
    REMOTE = 32
    TRANSMITTED = 64  # sent by the recorder, not received


EXTENDED, FD, BITRATE_SWITCH, ERROR_STATE = 1, 2, 4, 8
ERROR, REMOTE, TRANSMITTED = 16, 32, 64
"""The same bits as plain integers, for loops over frames: `int & IntFlag` takes 0.5 us."""


class Columns(NamedTuple):
    """A run of frames as arrays of one length N; `data` is (N, 8) or (N, 64), zero beyond `length`."""

    t_ns: IntArray
    arbitration_id: NDArray[np.uint32]
    channel: NDArray[np.uint8]
    flags: NDArray[np.uint8]
    length: NDArray[np.uint8]
    data: NDArray[np.uint8]

    def taken(self, rows: BoolArray | IntArray | slice) -> "Columns":
        """Return the chosen rows, by mask or index."""
        return Columns(
            self.t_ns[rows],
            self.arbitration_id[rows],
            self.channel[rows],
            self.flags[rows],
            self.length[rows],
            self.data[rows],
        )


Grain = int | Callable[[], int]
"""How many frames are read at a time: always as many, or as many as is said each time."""


def frames_at_a_time(grain: Grain) -> int:
    """Return how many frames are to be read now."""
    return grain if isinstance(grain, int) else grain()


class Record(NamedTuple):
    """One frame of a log in plain values; `data` of a remote frame is zero bytes, as many as asked for."""

    t_ns: int
    arbitration_id: int
    channel: int
    flags: int
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class LogTable:
    """A whole log: the columns of `Columns` in file order, channel names, and the report.

    `channel` numbers index `channel_names`; `flags` are bits of `Flag`; times are integer nanoseconds
    of the log's own clock, exact where the file writes them as text.
    """

    t_ns: IntArray
    arbitration_id: NDArray[np.uint32]
    channel: NDArray[np.uint8]
    flags: NDArray[np.uint8]
    length: NDArray[np.uint8]
    data: NDArray[np.uint8]
    channel_names: tuple[str, ...]
    report: LogReport

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def columns(self) -> Columns:
        """The six columns alone."""
        return Columns(self.t_ns, self.arbitration_id, self.channel, self.flags, self.length, self.data)

    def data_frames(self) -> BoolArray:
        """Return a mask (N,) of the frames that carry data: neither error nor remote."""
        mask: BoolArray = (self.flags & (Flag.ERROR | Flag.REMOTE)) == 0
        return mask

    def frames(self) -> Iterator[Frame]:
        """Yield every row as a Frame."""
        return frames_of(self.columns)


def frames_of(columns: Columns) -> Iterator[Frame]:
    """Yield the rows as Frames; `due_ns` is the log's time."""
    raw = columns.data.tobytes()
    width = columns.data.shape[1]
    rows = zip(*(column.tolist() for column in columns[:5]), strict=True)
    for i, (t_ns, arbitration_id, channel, flags, length) in enumerate(rows):
        start = i * width
        yield Frame(
            due_ns=t_ns,
            arbitration_id=arbitration_id,
            data=raw[start : start + length],
            is_extended=bool(flags & 1),
            is_fd=bool(flags & 2),
            bitrate_switch=bool(flags & 4),
            channel=channel,
            error_state_indicator=bool(flags & 8),
            is_remote=bool(flags & 32),
            is_error=bool(flags & 16),
        )


def records_of(columns: Columns) -> Iterator[Record]:
    """Yield the rows as plain records."""
    raw, width = columns.data.tobytes(), columns.data.shape[1]
    rows = zip(*(column.tolist() for column in columns[:5]), strict=True)
    for start, (t_ns, identifier, channel, flags, length) in zip(
        range(0, len(raw), width), rows, strict=True
    ):
        yield Record(t_ns, identifier, channel, flags, raw[start : start + length])


def columns_from(records: list[Record]) -> Columns:
    """Return plain records as columns."""
    if not records:
        return no_columns()
    times, ids, channels, flags, datas = zip(*records, strict=True)
    lengths = [len(data) for data in datas]
    width = CLASSIC_BYTES if max(lengths) <= CLASSIC_BYTES else FD_BYTES
    raw = b"".join([data.ljust(width, b"\0") for data in datas])
    return Columns(
        np.array(times, dtype=np.int64),
        np.array(ids, dtype=np.uint32),
        np.array(channels, dtype=np.uint8),
        np.array(flags, dtype=np.uint8),
        np.array(lengths, dtype=np.uint8),
        np.frombuffer(raw, dtype=np.uint8).reshape(-1, width),
    )


def no_columns() -> Columns:
    """Return columns of length 0."""
    return Columns(
        np.empty(0, np.int64),
        np.empty(0, np.uint32),
        np.empty(0, np.uint8),
        np.empty(0, np.uint8),
        np.empty(0, np.uint8),
        np.empty((0, CLASSIC_BYTES), np.uint8),
    )


def joined(parts: list[Columns]) -> Columns:
    """Return the parts one after the other; data is as wide as the widest part."""
    if not parts:
        return no_columns()
    width = max(part.data.shape[1] for part in parts)
    data = [np.pad(part.data, ((0, 0), (0, width - part.data.shape[1]))) for part in parts]
    return Columns(
        np.concatenate([part.t_ns for part in parts]),
        np.concatenate([part.arbitration_id for part in parts]),
        np.concatenate([part.channel for part in parts]),
        np.concatenate([part.flags for part in parts]),
        np.concatenate([part.length for part in parts]),
        np.concatenate(data),
    )


_DATA_LENGTHS = np.isin(np.arange(256), sorted(FD_LENGTHS))


def possible(columns: Columns, notes: Notes) -> BoolArray:
    """Return a mask (N,) of the frames that a bus can carry; the others are counted in `notes`."""
    narrow = (columns.flags & Flag.EXTENDED != 0) | (columns.arbitration_id <= MAX_STANDARD_ID)
    notes.impossible(int(np.count_nonzero(~narrow)), _first("id 0x{0:X} in 11 bits", columns, ~narrow))
    fd = columns.flags & Flag.FD != 0
    fits = np.where(fd, _DATA_LENGTHS[columns.length], columns.length <= CLASSIC_BYTES) | ~narrow
    notes.impossible(int(np.count_nonzero(~fits)), _first("id 0x{0:X} with {1} data bytes", columns, ~fits))
    mask: BoolArray = narrow & fits
    return mask


def _first(text: str, columns: Columns, rows: BoolArray) -> str:
    found = np.flatnonzero(rows)[:1].tolist()
    return "".join(text.format(int(columns.arbitration_id[at]), int(columns.length[at])) for at in found)


def table_from(path: str, columns: Columns, notes: Notes) -> LogTable:
    """Return the table of a log that was read to its end (or fault)."""
    for column in columns:
        column.flags.writeable = False
    steps = np.diff(columns.t_ns)
    times = columns.t_ns
    report = LogReport(
        path=path,
        frames=len(times),
        channels=tuple(notes.channels),
        ids=len(np.unique(columns.arbitration_id)),
        first_ns=int(times.min()) if len(times) else 0,
        last_ns=int(times.max()) if len(times) else 0,
        repeated_timestamps=int(np.count_nonzero(steps == 0)),
        backward_timestamps=int(np.count_nonzero(steps < 0)),
        error_frames=int(np.count_nonzero(columns.flags & Flag.ERROR)),
        remote_frames=int(np.count_nonzero(columns.flags & Flag.REMOTE)),
        garbage_lines=notes.garbage_lines,
        first_garbage=tuple(notes.first_garbage),
        other_lines=notes.other_lines,
        impossible_frames=notes.impossible_frames,
        first_impossible=notes.first_impossible,
        fault=notes.fault,
    )
    return LogTable(**columns._asdict(), channel_names=tuple(notes.channels), report=report)
