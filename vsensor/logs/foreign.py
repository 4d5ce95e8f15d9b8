"""Text logs that python-can reads (ASC, TRC, CSV), line by line, so that a bad line costs one line.

python-can's readers end at the first line they cannot parse; here such a line is counted and the
reader is set going again behind it. Lines that it skips in silence are told apart: headers and
comments, events by right, and frames that are broken.
"""

import logging
import math
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from decimal import Decimal, InvalidOperation
from typing import TYPE_CHECKING, Any, TextIO

from vsensor.logs.report import Notes
from vsensor.logs.table import (
    CLASSIC_BYTES,
    FD_LENGTHS,
    MAX_EXTENDED_ID,
    MAX_STANDARD_ID,
    Columns,
    Flag,
    Grain,
    Record,
    columns_from,
    frames_at_a_time,
)

if TYPE_CHECKING:
    import can

logging.getLogger("can.io").addHandler(logging.NullHandler())  # its warnings are counted here instead

BATCH = 4096
BAD_LINE = (ValueError, IndexError, KeyError, TypeError, OverflowError)
"""What python-can's text readers raise on a line they cannot parse (tried by cutting and flipping)."""

_MONTHS = {"mär": 3, "mã¤r": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12} | {
    "jan feb mar apr may jun jul aug sep oct nov dec"[4 * k : 4 * k + 3]: k + 1 for k in range(12)
}
"""English and German names, also UTF-8 read as Latin-1."""
_DATE = re.compile(
    r"(?:date|begin\s+triggerblock)\s+\S+\s+(\S+)\s+(\d+)\s+(\d+):(\d+):(\d+)(?:\.(\d{1,6}))?\s*(am|pm)?\s+(\d{4})",
    re.IGNORECASE,
)
_ASC_HEADER = re.compile(
    r"//|date\b|base\b|(no\s+)?internal events|begin\b|end\b|previous log file", re.IGNORECASE
)
_ASC_EVENT = re.compile(r"\d+\.\d+\s+\S")
_ASC_FRAME = re.compile(r"\d+\.\d+\s+(CANFD\s+)?\d+\s+\S+\s+[RT]x\b")


class _Lines:
    """A text file for python-can's readers that numbers its lines and can be read on after a fault."""

    def __init__(self, stream: TextIO, restart: tuple[str, ...]) -> None:
        self._stream = stream
        self._restart = restart
        self._pushed: list[str] = []
        self.number = 0
        self.pending: list[tuple[int, str]] = []

    def __iter__(self) -> "_Lines":
        return self

    def __next__(self) -> str:
        if self._pushed:
            return self._pushed.pop()
        line = next(self._stream)
        self.number += 1
        while not line.strip():
            line = next(self._stream)
            self.number += 1
        self.pending.append((self.number, line))
        return self.changed(line)

    def changed(self, line: str) -> str:
        return line

    def restart(self) -> None:
        """Give the header again that the reader wants to see before it reads on."""
        self._pushed = list(self._restart)

    def close(self) -> None:
        """Do nothing: who opened the file closes it."""


class _AscLines(_Lines):
    """Finds the date of the header (read as UTC: the file names no time zone) and sums relative times."""

    epoch_ns = 0
    _relative = False
    _now_s = 0.0

    def changed(self, line: str) -> str:
        first = line.lstrip()[:5].lower()
        if first in ("date ", "begin"):
            self.epoch_ns = _epoch_ns(line.strip(), self.epoch_ns)
        elif first.startswith("base"):
            self._relative = "relative" in line.lower()
        elif self._relative and _ASC_EVENT.match(line.lstrip()):
            step, rest = line.split(None, 1)
            self._now_s += float(step)
            return f"{self._now_s:.9f} {rest}"
        return line


def _epoch_ns(line: str, otherwise: int) -> int:
    found = _DATE.match(line)
    month = _MONTHS.get(found[1].lower()) if found else None
    if found is None or month is None:
        return otherwise
    hour = int(found[3])
    if found[7]:
        hour = hour % 12 + (12 if found[7].lower() == "pm" else 0)
    try:
        start = datetime(int(found[8]), month, int(found[2]), hour, int(found[4]), int(found[5]), tzinfo=UTC)
    except ValueError:
        return otherwise
    return int(start.timestamp()) * 10**9 + int((found[6] or "0").ljust(9, "0"))


def read_asc(stream: TextIO, notes: Notes, chunk: Grain = BATCH) -> Iterator[Columns]:
    """Yield the frames of a Vector ASC log; times are absolute where the header has a date, as UTC."""
    import can

    lines = _AscLines(stream, ("internal events logged\n",))
    reader = can.ASCReader(lines, relative_timestamp=True)  # type: ignore[arg-type]

    def record(message: "can.Message") -> Record | None:
        if message.dlc > CLASSIC_BYTES and not message.is_fd and _asc_length(lines.pending) > 15:
            return None
        if message.is_fd and message.dlc == 0:
            message.is_remote_frame = False  # to python-can every FD frame without data is a remote frame
        name = str(message.channel + 1) if isinstance(message.channel, int) else "1"
        return _record(message, notes.channel(name), lines.epoch_ns + round(message.timestamp * 1e9))

    return _columns(_records(reader, lines, record, _asc_line, notes), chunk)


def _asc_length(pending: list[tuple[int, str]]) -> int:
    """Return the length digits of the classic frame read last: python-can folds all above 8 into one."""
    found = re.search(r"\sd\s+([0-9A-Fa-f]+)\s", pending[-1][1]) if pending else None
    return int(found[1], 16) if found else 0


def _asc_line(text: str) -> str:
    if _ASC_HEADER.match(text):
        return "header"
    return "event" if _ASC_EVENT.match(text) and not _ASC_FRAME.match(text) else "garbage"


class _TrcLines(_Lines):
    """Finds the start time, days since 1899-12-30: a float keeps 0.6 us of it."""

    start_ns = 0

    def changed(self, line: str) -> str:
        if line.startswith(";$STARTTIME="):
            with suppress(InvalidOperation, OverflowError):  # python-can says what is wrong with it
                days = Decimal(line.split("=")[1].strip()) - 25_569  # from then to 1970
                self.start_ns = round(days * 86_400 * 10**6) * 1000 if days.is_finite() else 0
        return line


def read_trc(stream: TextIO, notes: Notes, chunk: Grain = BATCH) -> Iterator[Columns]:
    """Yield the frames of a PEAK TRC log, versions 1.0 to 2.1; version 1.0 has times from its start."""
    import can

    lines = _TrcLines(stream, ())
    reader = can.TRCReader(lines)  # type: ignore[arg-type]

    def record(message: "can.Message") -> Record | None:
        offset_ms = Decimal(lines.pending[-1][1].split()[reader.columns.get("O", 1)])
        t_ns = lines.start_ns + round(offset_ms * 10**6)
        return _record(message, notes.channel(str(message.channel)), t_ns)

    return _columns(_records(reader, lines, record, _trc_line, notes), chunk)


_TRC_EVENTS = frozenset(("FFFFFFFF", "Warng", "Error", "ST", "ER", "EC", "EV"))
"""What marks a line of bus states, error counters or user events, from version 1.0 to 2.1."""


def _trc_line(text: str) -> str:
    if text.startswith(";"):
        return "header"
    return "event" if _TRC_EVENTS.intersection(text.split()[:5]) else "garbage"


def read_csv(stream: TextIO, notes: Notes, chunk: Grain = BATCH) -> Iterator[Columns]:
    """Yield the frames of a CSV log as python-can writes it; it has neither channel nor FD."""
    import can

    lines = _Lines(stream, ("header\n",))
    reader = can.CSVReader(lines)  # type: ignore[arg-type]

    def record(message: "can.Message") -> Record | None:
        text = lines.pending[-1][1].partition(",")[0].strip()
        t_ns = _written_ns(text) if _NANOSECONDS.fullmatch(text) else _microseconds(message.timestamp)
        return _record(message, notes.channel("1"), t_ns)

    return _columns(_records(reader, lines, record, _csv_line, notes), chunk)


def _csv_line(text: str) -> str:
    return "header" if text.startswith("timestamp,") else "garbage"


_NANOSECONDS = re.compile(r"\d{1,10}\.\d{9}")
"""A time as we write it; python-can writes all digits of a float."""


def _written_ns(text: str) -> int:
    seconds, fraction = text.split(".")
    return int(seconds) * 10**9 + int(fraction)


def _microseconds(seconds: float) -> int:
    """Return nanoseconds at the microsecond that a float of today's epoch can still tell (0.24 us)."""
    return round(seconds * 1e6) * 1000


def _record(message: "can.Message", channel: int, t_ns: int) -> Record | None:
    """Return a plain record; None for what no bus can carry."""
    flags = int(message.is_extended_id and not message.is_error_frame)
    flags |= Flag.FD * message.is_fd | Flag.BITRATE_SWITCH * message.bitrate_switch
    flags |= Flag.ERROR_STATE * message.error_state_indicator | Flag.TRANSMITTED * (not message.is_rx)
    flags |= Flag.ERROR * message.is_error_frame | Flag.REMOTE * message.is_remote_frame
    data = bytes(message.dlc) if message.is_remote_frame else bytes(message.data)
    limit = MAX_EXTENDED_ID if message.is_extended_id else MAX_STANDARD_ID
    if not 0 <= message.arbitration_id <= limit or len(data) not in FD_LENGTHS or abs(t_ns) >> 62:
        return None
    if len(data) > CLASSIC_BYTES and not message.is_fd:
        return None
    return Record(t_ns, message.arbitration_id, channel, int(flags), data)


def _records(
    reader: Any,
    lines: _Lines,
    record: Callable[["can.Message"], Record | None],
    kind_of_line: Callable[[str], str],
    notes: Notes,
) -> Iterator[Record]:
    """Yield what the reader finds; every line it did not turn into a frame is counted by its kind."""
    messages = iter(reader)
    while True:
        try:
            message = next(messages, None)
            found = None if message is None or not math.isfinite(message.timestamp) else record(message)
        except BAD_LINE as error:
            if not lines.pending:  # it fails without reading on: not a line, but the header is at fault
                notes.fault = f"line {lines.number}: {error}"
                return
            _note_lines(lines.pending[:-1], kind_of_line, notes)
            notes.garbage(*lines.pending[-1])
            lines.pending.clear()
            lines.restart()
            messages = iter(reader)
            continue
        if message is None:
            _note_lines(lines.pending, kind_of_line, notes)
            return
        _note_lines(lines.pending[:-1], kind_of_line, notes)
        if found is None:
            notes.garbage(*lines.pending[-1])
        lines.pending.clear()
        if found is not None:
            yield found


def _note_lines(skipped: list[tuple[int, str]], kind_of_line: Callable[[str], str], notes: Notes) -> None:
    for number, text in skipped:
        kind = kind_of_line(text.strip())
        if kind == "garbage":
            notes.garbage(number, text)
        elif kind == "event":
            notes.other_lines += 1


def _columns(records: Iterator[Record], chunk: Grain) -> Iterator[Columns]:
    batch: list[Record] = []
    for record in records:
        batch.append(record)
        if len(batch) >= frames_at_a_time(chunk):
            yield columns_from(batch)
            batch = []
    if batch:
        yield columns_from(batch)
