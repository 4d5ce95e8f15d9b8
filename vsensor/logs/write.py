"""Writes CAN logs: the format follows from the suffix; times are integer nanoseconds since 1970.

Text and BLF are written here, exact to the nanosecond (.log, .blf) and microsecond (.asc); MF4 by
asammdf at close, since it writes in bulk 100 times faster than frame by frame.
"""

import os
from array import array
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

import numpy as np

from vsensor.errors import LogError
from vsensor.logs.blf import FD_DLC
from vsensor.logs.blf_write import BlfOutput
from vsensor.logs.mf4 import require_asammdf, write_mf4
from vsensor.logs.table import (
    BITRATE_SWITCH,
    CLASSIC_BYTES,
    ERROR,
    ERROR_STATE,
    EXTENDED,
    FD,
    FD_BYTES,
    REMOTE,
    TRANSMITTED,
    Columns,
    LogTable,
    Record,
)
from vsensor.types import Frame


class _Format(Protocol):
    def write(self, record: Record) -> None: ...
    def close(self) -> None: ...


class LogWriter:
    """A CAN log that is open for writing; `close` (or leaving `with`) makes it complete."""

    def __init__(self, path: Path, output: _Format) -> None:
        self.path = path
        self._output = output
        self._closed = False

    def write(self, frame: Frame, epoch_ns: int = 0) -> None:
        """Write a frame that was sent at `epoch_ns + due_ns` since 1970. Raises LogError (disk full)."""
        self.write_record(_record(frame, epoch_ns))

    def write_record(self, record: Record) -> None:
        """Write a frame with all flags, direction included. Raises LogError (disk full)."""
        try:
            self._output.write(record)
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror or error}") from None

    def close(self) -> None:
        """Write what is left; a second call does nothing. Raises LogError (disk full)."""
        if self._closed:
            return
        self._closed = True
        try:
            self._output.close()
        except OSError as error:
            raise LogError(f"{self.path}: cannot be written: {error.strerror or error}") from None

    def __enter__(self) -> "LogWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_log_writer(path: Path | str, channels: tuple[str, ...] = ()) -> LogWriter:
    """Open a log for writing, `.log .asc .blf .mf4`, an existing file is replaced.

    `channels` names the channel numbers of the frames; a channel without a name is `can0`, `can1`, ...
    Raises LogError for an unknown suffix or a path that cannot be written, MissingExtraError for .mf4
    without asammdf.
    """
    path = Path(path)
    output = WRITERS.get(path.suffix.lower())
    if output is None:
        raise LogError(f"{path}: not a log format that can be written: {', '.join(WRITERS)} are")
    try:
        return LogWriter(path, output(path, channels))
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror or error}") from None


def write_log(path: Path | str, table: LogTable) -> None:
    """Write a whole table, its directions, channel names and all flags kept. Raises as `open_log_writer`."""
    raw, width = table.data.tobytes(), table.data.shape[1]
    with open_log_writer(path, table.channel_names) as writer:
        rows = zip(*(column.tolist() for column in table.columns[:5]), strict=True)
        for i, (t_ns, identifier, channel, flags, length) in enumerate(rows):
            data = raw[i * width : i * width + length]
            writer.write_record(Record(t_ns, identifier, channel, flags, data))


def _record(frame: Frame, epoch_ns: int) -> Record:
    flags = TRANSMITTED | frame.is_extended | frame.is_fd << 1 | frame.bitrate_switch << 2
    flags |= frame.error_state_indicator << 3 | frame.is_error << 4 | frame.is_remote << 5
    return Record(frame.due_ns + epoch_ns, frame.arbitration_id, frame.channel, flags, frame.data)


def _name(channels: tuple[str, ...], number: int) -> str:
    """Return a channel's name for candump; plain numbers count from 1 in the other formats."""
    name = channels[number] if number < len(channels) else f"can{number}"
    return f"can{int(name) - 1}" if name.isdigit() else name


def _number(channels: tuple[str, ...], number: int) -> int:
    """Return a channel's number from 1, for the formats that have no names."""
    name = channels[number] if number < len(channels) else ""
    return int(name) if name.isdigit() else number + 1


class _Candump:
    def __init__(self, path: Path, channels: tuple[str, ...]) -> None:
        self._file = path.open("w", encoding="utf-8")
        self._channels = channels

    def write(self, record: Record) -> None:
        seconds, rest = divmod(record.t_ns, 10**9)
        time = f"{seconds}.{rest // 1000:06d}" if rest % 1000 == 0 else f"{seconds}.{rest:09d}"
        flags = record.flags
        if flags & ERROR:
            frame = f"20000080#{record.data.hex().upper()}"
        else:
            digits = 8 if flags & EXTENDED else 3
            frame = f"{record.arbitration_id:0{digits}X}#{self._payload(record)}"
        direction = "T" if flags & TRANSMITTED else "R"
        self._file.write(f"({time}) {_name(self._channels, record.channel)} {frame} {direction}\n")

    @staticmethod
    def _payload(record: Record) -> str:
        flags = record.flags
        if flags & REMOTE:
            return f"R{len(record.data)}" if record.data else "R"
        if flags & FD:
            bits = (1 if flags & BITRATE_SWITCH else 0) | (2 if flags & ERROR_STATE else 0)
            return f"#{bits}{record.data.hex().upper()}"
        return record.data.hex().upper()

    def close(self) -> None:
        self._file.close()


class _Asc:
    """ASC with dates in UTC; times count from the first frame's full millisecond, so none is lost."""

    def __init__(self, path: Path, channels: tuple[str, ...]) -> None:
        self._file = path.open("w", encoding="ascii")
        self._channels = channels
        self._start_ns: int | None = None

    def write(self, record: Record) -> None:
        if self._start_ns is None:
            self._start_ns = self._begin(record.t_ns)
        since_us = max(0, record.t_ns - self._start_ns + 500) // 1000  # ASC knows no time before its start
        channel = _number(self._channels, record.channel)
        text = self._frame(record, channel)
        self._file.write(f"{since_us // 10**6:4d}.{since_us % 10**6:06d} {text}\n")

    def _begin(self, t_ns: int) -> int:
        start_ns = t_ns // 10**6 * 10**6
        moment = datetime.fromtimestamp(start_ns // 10**9, UTC)
        months = "Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec".split()  # noqa: SIM905
        day = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")[moment.weekday()]
        clock = f"{moment:%H:%M:%S}.{start_ns // 10**6 % 1000:03d}"
        date = f"{day} {months[moment.month - 1]} {moment.day:02d} {clock} {moment.year:04d}"
        self._file.write(f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n")
        self._file.write(f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n")
        return start_ns

    @staticmethod
    def _frame(record: Record, channel: int) -> str:
        flags = record.flags
        if flags & ERROR:
            return f"{channel}  ErrorFrame"
        identifier = f"{record.arbitration_id:X}{'x' if flags & EXTENDED else ''}"
        direction = "Tx" if flags & TRANSMITTED else "Rx"
        data = record.data.hex(" ").upper()
        if flags & FD:
            brs, esi = int(bool(flags & BITRATE_SWITCH)), int(bool(flags & ERROR_STATE))
            bits = 0x1000 | brs << 13 | esi << 14
            head = f"CANFD {channel:3d} {direction:<4} {identifier:>8}  {'':32} {brs} {esi}"
            tail = f"{0:8d} {0:4d} {bits:8X} {0:8d} {0:8d} {0:8d} {0:8d} {0:8d}"
            return f"{head} {FD_DLC[len(record.data)]:x} {len(record.data):2d} {data} {tail}"
        kind = f"r {len(record.data):x}" if flags & REMOTE else f"d {len(record.data):x} {data}"
        return f"{channel}  {identifier:<15} {direction:<4} {kind}"

    def close(self) -> None:
        if self._start_ns is None:
            self._begin(0)
        self._file.write("End TriggerBlock\n")
        self._file.close()


class _Blf:
    def __init__(self, path: Path, channels: tuple[str, ...]) -> None:
        self._output = BlfOutput(path)
        self._channels = channels

    def write(self, record: Record) -> None:
        self._output.write(record, _number(self._channels, record.channel))

    def close(self) -> None:
        self._output.close()


class _Mf4:
    def __init__(self, path: Path, channels: tuple[str, ...]) -> None:
        require_asammdf()
        path.write_bytes(b"")  # refuse a path that cannot be written now, not after the drive
        self._path = path
        self._channels = channels
        self._times = array("q")  # arrays, not records: the garbage collector need not look through them
        self._ids = array("I")
        self._rest = bytearray()  # channel, flags, length of each frame
        self._data = bytearray()  # of all frames, one after the other

    def write(self, record: Record) -> None:
        self._times.append(record.t_ns)
        self._ids.append(record.arbitration_id)
        self._rest += bytes((min(record.channel, 255), record.flags, len(record.data)))
        self._data += record.data

    def close(self) -> None:
        columns = self._columns()
        numbers = np.array([_number(self._channels, k) for k in range(256)])[columns.channel]
        part = self._path.with_name(f".{self._path.stem}.{os.getpid()}.mf4")
        try:
            write_mf4(part, columns, numbers.astype(np.uint8))
            part.replace(self._path)
        except OSError:
            self._path.unlink(missing_ok=True)  # the empty file that kept the place
            raise
        finally:
            part.unlink(missing_ok=True)

    def _columns(self) -> Columns:
        rest = np.frombuffer(bytes(self._rest), dtype=np.uint8).reshape(-1, 3)
        length = rest[:, 2]
        width = CLASSIC_BYTES if not len(length) or length.max() <= CLASSIC_BYTES else FD_BYTES
        data = np.zeros((len(length), width), dtype=np.uint8)
        data[np.arange(width) < length[:, None]] = np.frombuffer(bytes(self._data), dtype=np.uint8)
        times, ids = np.array(self._times, dtype=np.int64), np.array(self._ids, dtype=np.uint32)
        return Columns(times, ids, rest[:, 0], rest[:, 1], length, data)


WRITERS: dict[str, Callable[[Path, tuple[str, ...]], _Format]] = {
    ".log": _Candump,
    ".asc": _Asc,
    ".blf": _Blf,
    ".mf4": _Mf4,
}
"""Suffix -> writer."""
