"""Writes CAN logs: the format follows from the suffix; times are integer nanoseconds since 1970.

All formats are written here, block by block, so that what a full disk or a kill leaves can be read:
exact to the nanosecond (.log, .blf, .mf4, .csv) or the microsecond (.asc, .trc).
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from vsensor.errors import LogError
from vsensor.logs.blf_write import BlfOutput
from vsensor.logs.mf4_write import Mf4Output
from vsensor.logs.table import ERROR, FD, REMOTE, TRANSMITTED, Columns, LogTable, Record
from vsensor.logs.text_write import TEXTS
from vsensor.types import Frame


class _Output(Protocol):
    def write(self, record: Record, channel: Any) -> None: ...
    def write_columns(self, columns: Columns, channels: Any) -> None: ...
    def close(self) -> None: ...


class LogWriter:
    """A CAN log that is open for writing; `close` (or leaving `with`) makes it complete.

    After an error nothing more is written: what the file has by then can be read.
    """

    def __init__(self, path: Path, output: _Output, names: "ChannelNames") -> None:
        self.path = path
        self.failed = False
        self._output = output
        self._names = names
        self._closed = False

    def write(self, frame: Frame, epoch_ns: int = 0) -> None:
        """Write a frame that was sent at `epoch_ns + due_ns` since 1970. Raises LogError (disk full)."""
        self.write_record(_record(frame, epoch_ns))

    def write_record(self, record: Record) -> None:
        """Write a frame with all flags, direction included. Raises LogError (disk full)."""
        try:
            self._output.write(record, self._names.of(record.channel))
        except OSError as error:
            raise self._fault(error) from None

    def write_columns(self, columns: Columns) -> None:
        """Write many frames. Raises LogError (disk full)."""
        try:
            self._output.write_columns(columns, self._names.of_all(columns))
        except OSError as error:
            raise self._fault(error) from None

    def name_channels(self, names: tuple[str, ...]) -> None:
        """Give the names of channels that turned up since the log was opened."""
        self._names.add(names)

    def close(self) -> None:
        """Write what is left; a second call does nothing. Raises LogError (disk full)."""
        if self._closed:
            return
        self._closed = True
        try:
            self._output.close()
        except OSError as error:
            if not self.failed:
                raise self._fault(error) from None

    def _fault(self, error: OSError) -> LogError:
        self.failed = True
        return LogError(f"{self.path}: cannot be written: {error.strerror or error}")

    def __enter__(self) -> "LogWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class ChannelNames:
    """What a channel is called in a file: a name in candump's text, a number from 1 elsewhere.

    A plain number n and the name can(n - 1) are the same. Any other name has the number of its place.
    """

    def __init__(self, names: tuple[str, ...], *, as_text: bool) -> None:
        self._as_text = as_text
        self._names = names
        self._given: dict[int, str | int] = {}

    def add(self, names: tuple[str, ...]) -> None:
        """Set the names; those given before stay."""
        self._names = names

    def of(self, channel: int) -> str | int:
        """Return the name or number of a channel."""
        given = self._given.get(channel)
        if given is None:
            given = self._given[channel] = self._text(channel) if self._as_text else self._number(channel)
        return given

    def of_all(self, columns: Columns) -> Any:
        """Return the names (list) or numbers (array) of all frames."""
        there = np.unique(columns.channel).tolist()
        if self._as_text:
            table = {channel: self.of(channel) for channel in there}
            return [table[channel] for channel in columns.channel.tolist()]
        numbers = np.zeros(256, dtype=np.uint8)
        for channel in there:
            numbers[channel] = self.of(channel)
        return numbers[columns.channel]

    def _text(self, channel: int) -> str:
        name = self._names[channel] if channel < len(self._names) else f"can{channel}"
        return f"can{int(name) - 1}" if name.isdecimal() and int(name) else name

    def _number(self, channel: int) -> int:
        name = self._names[channel] if channel < len(self._names) else ""
        wanted = channel + 1
        if name.isdecimal():
            wanted = int(name)
        elif name.startswith("can") and name[3:].isdecimal():
            wanted = int(name[3:]) + 1
        taken = set(self._given.values())
        if wanted in taken or wanted > 255:
            wanted = next((number for number in range(1, 256) if number not in taken), 255)
        return wanted


def open_log_writer(path: Path | str, channels: tuple[str, ...] = ()) -> LogWriter:
    """Open a log for writing, `.log .asc .blf .mf4`, an existing file is replaced.

    `channels` names the channel numbers of the frames; a channel without a name is `can0`, `can1`, ...
    Raises LogError for an unknown suffix or a path that cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in WRITERS:
        raise LogError(f"{path}: not a log format that can be written: {', '.join(WRITERS)} are")
    return open_output(path, path, channels)


def open_output(path: Path, part: Path, channels: tuple[str, ...] = ()) -> LogWriter:
    """Open `part` for what shall become `path`, of any of OUTPUTS, also those that do not hold all.

    Raises LogError, which names `path`, for an unknown suffix or a path that cannot be written.
    """
    suffix = output_format(path)
    try:
        output = OUTPUTS[suffix](part)
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror or error}") from None
    return LogWriter(path, output, ChannelNames(channels, as_text=suffix.startswith(".log")))


def output_format(path: Path) -> str:
    """Return the suffix that says the format, .gz with it; raises LogError if it is not one of OUTPUTS."""
    suffix = "".join(path.suffixes[-2:] if path.suffix.lower() == ".gz" else path.suffixes[-1:]).lower()
    if suffix not in OUTPUTS:
        known = ", ".join(name for name in OUTPUTS if not name.endswith(".gz"))
        raise LogError(f"{path}: not a format that can be written: {known} are, text also with .gz")
    return suffix


def write_log(path: Path | str, table: LogTable) -> None:
    """Write a whole table, its directions, channel names and all flags kept. Raises as `open_log_writer`."""
    with open_log_writer(path, table.channel_names) as writer:
        writer.write_columns(table.columns)


def _record(frame: Frame, epoch_ns: int) -> Record:
    flags = TRANSMITTED | frame.is_extended | (FD if frame.is_fd else 0) | frame.bitrate_switch << 2
    flags |= frame.error_state_indicator << 3
    flags |= (ERROR if frame.is_error else 0) | (REMOTE if frame.is_remote else 0)
    return Record(frame.due_ns + epoch_ns, frame.arbitration_id, frame.channel, flags, frame.data)


WRITERS: dict[str, Callable[[Path], _Output]] = {
    ".log": TEXTS[".log"],
    ".asc": TEXTS[".asc"],
    ".blf": BlfOutput,
    ".mf4": Mf4Output,
}
"""Suffix -> writer of every kind of frame, for recording."""

OUTPUTS: dict[str, Callable[[Path], _Output]] = {
    **WRITERS,
    **TEXTS,
    **{f"{suffix}.gz": output for suffix, output in TEXTS.items()},
}
"""Suffix -> writer, for `vsensor convert`."""
