"""Writes text logs line by line: candump (.log), Vector ASC, PEAK TRC 2.1, python-can's CSV.

.log  nanoseconds     everything
.csv  nanoseconds     neither FD, channel nor direction
.asc  microseconds    names of channels become numbers
.trc  microseconds    the same; neither FD (readers disagree about its flags) nor error frames
"""

from base64 import b64encode
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vsensor.logs.blf import FD_DLC
from vsensor.logs.output import BLOCK_BYTES, BlockFile, GzipFile
from vsensor.logs.table import (
    BITRATE_SWITCH,
    ERROR,
    ERROR_STATE,
    EXTENDED,
    FD,
    REMOTE,
    TRANSMITTED,
    Columns,
    Record,
    records_of,
)

_UNKNOWN_ERROR = 0x80  # CAN_ERR_BUSERROR of the Linux kernel
_ERROR_BIT = 0x2000_0000
_TRC_DAY_NS = 86_400 * 10**9
_TRC_STEP_NS = _TRC_DAY_NS // 10**5
"""A start time of five decimals of a day is exact: 0.864 s."""
_TRC_EPOCH_DAYS = 25_569  # from 1899-12-30 to 1970-01-01


class TextOutput:
    """An open text log; `line(record, channel)` makes one line of it. Every method raises OSError."""

    encoding = "utf-8"

    def __init__(self, path: Path) -> None:
        self._file = GzipFile(path) if path.suffix.lower() == ".gz" else BlockFile(path)
        self._lines: list[str] = []
        self._waiting = 0
        self._begun = False

    def begin(self, t_ns: int) -> str:
        """Return what stands before the first line, a frame at `t_ns`."""
        return ""

    def line(self, record: Record, channel: int | str) -> str:
        """Return the line of a frame."""
        raise NotImplementedError

    def end(self) -> str:
        """Return what stands behind the last line."""
        return ""

    def write(self, record: Record, channel: int | str) -> None:
        """Write one frame."""
        if not self._begun:
            self._begun = True
            self._lines.append(self.begin(record.t_ns))
        line = self.line(record, channel)
        self._lines.append(line)
        self._waiting += len(line)
        if self._waiting >= BLOCK_BYTES:
            self._flush()

    def write_columns(self, columns: Columns, channels: NDArray[np.uint8] | list[str]) -> None:
        """Write many frames; `channels` (N,): a number or name of each."""
        write = self.write
        names = channels if isinstance(channels, list) else channels.tolist()
        for record, channel in zip(records_of(columns), names, strict=True):
            write(record, channel)

    def _flush(self) -> None:
        block = "".join(self._lines).encode(self.encoding)
        self._lines.clear()
        self._waiting = 0
        self._file.write(block)

    def close(self) -> None:
        """Write what waits and close the file, also when the disk is full."""
        try:
            if not self._begun:
                self._lines.append(self.begin(0))
            self._lines.append(self.end())
            self._flush()
        finally:
            self._file.close()


def _seconds(t_ns: int) -> str:
    seconds, rest = divmod(t_ns, 10**9)
    return f"{seconds}.{rest // 1000:06d}" if rest % 1000 == 0 else f"{seconds}.{rest:09d}"


class Candump(TextOutput):
    """`candump -L`, with the direction that newer versions write."""

    def line(self, record: Record, channel: int | str) -> str:
        """Return the line of a frame; an error frame has its class in place of the id."""
        flags, identifier = record.flags, record.arbitration_id
        if flags & ERROR:
            frame = f"{_ERROR_BIT | (identifier or _UNKNOWN_ERROR):08X}#{record.data.hex().upper()}"
        elif flags & (REMOTE | FD):
            frame = f"{identifier:0{8 if flags & EXTENDED else 3}X}#{_marked(record)}"
        elif flags & EXTENDED:
            frame = f"{identifier:08X}#{record.data.hex().upper()}"
        else:
            frame = f"{identifier:03X}#{record.data.hex().upper()}"
        return f"({_seconds(record.t_ns)}) {channel} {frame} {'T' if flags & TRANSMITTED else 'R'}\n"


def _marked(record: Record) -> str:
    """Return the data of a remote frame or of an FD frame, with its mark."""
    flags = record.flags
    if flags & REMOTE:
        return f"R{len(record.data)}" if record.data else "R"
    bits = (1 if flags & BITRATE_SWITCH else 0) | (2 if flags & ERROR_STATE else 0)
    return f"#{bits}{record.data.hex().upper()}"


class Asc(TextOutput):
    """ASC with dates in UTC; times count from the first frame's full millisecond, so none is lost."""

    encoding = "ascii"
    _start_ns = 0

    def begin(self, t_ns: int) -> str:
        """Return the header."""
        self._start_ns = t_ns // 10**6 * 10**6
        moment = datetime.fromtimestamp(self._start_ns // 10**9, UTC)
        months = "Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec".split()  # noqa: SIM905
        day = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")[moment.weekday()]
        clock = f"{moment:%H:%M:%S}.{self._start_ns // 10**6 % 1000:03d}"
        date = f"{day} {months[moment.month - 1]} {moment.day:02d} {clock} {moment.year:04d}"
        head = f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n"
        return f"{head}Begin Triggerblock {date}\n   0.000000 Start of measurement\n"

    def line(self, record: Record, channel: int | str) -> str:
        """Return the line of a frame; ASC knows no time before its start."""
        since_us = max(0, record.t_ns - self._start_ns + 500) // 1000
        return f"{since_us // 10**6:4d}.{since_us % 10**6:06d} {self._frame(record, channel)}\n"

    @staticmethod
    def _frame(record: Record, channel: int | str) -> str:
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

    def end(self) -> str:
        """Return the footer."""
        return "End TriggerBlock\n"


class Trc(TextOutput):
    """PEAK's TRC, version 2.1; offsets in milliseconds of three decimals, no time before its start."""

    encoding = "ascii"
    _start_ns = 0
    _count = 0

    def begin(self, t_ns: int) -> str:
        """Return the header."""
        steps = max(0, t_ns // _TRC_STEP_NS)
        self._start_ns = steps * _TRC_STEP_NS
        days = _TRC_EPOCH_DAYS + steps // 10**5
        columns = ";   Number  Offset [ms]  Type  Bus  ID  Rx/Tx  Reserved  Length  Data"
        return (
            f";$FILEVERSION=2.1\n;$STARTTIME={days}.{steps % 10**5:05d}\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
            f";\n;   Generated by vsensor\n{columns}\n;{'-' * 78}\n"
        )

    def line(self, record: Record, channel: int | str) -> str:
        """Return the line of a frame."""
        self._count += 1
        flags, data = record.flags, record.data
        since_us = max(0, record.t_ns - self._start_ns + 500) // 1000
        offset = f"{since_us // 1000}.{since_us % 1000:03d}"
        identifier = f"{record.arbitration_id:0{8 if flags & EXTENDED else 4}X}"
        kind = "RR" if flags & REMOTE else "DT"
        direction = "Tx" if flags & TRANSMITTED else "Rx"
        text = "" if flags & REMOTE else data.hex(" ").upper()
        head = f"{self._count:7d} {offset:>13} {kind} {channel:>2} {identifier:>8} {direction}"
        return f"{head} -  {len(data):<4} {text}".rstrip() + "\n"


class Csv(TextOutput):
    """The columns of python-can's CSVWriter."""

    encoding = "ascii"

    def begin(self, t_ns: int) -> str:
        """Return the header."""
        return "timestamp,arbitration_id,extended,remote,error,dlc,data\n"

    def line(self, record: Record, channel: int | str) -> str:
        """Return the line of a frame."""
        flags, data = record.flags, record.data
        kinds = f"{flags & EXTENDED},{int(bool(flags & REMOTE))},{int(bool(flags & ERROR))}"
        text = "" if flags & REMOTE else b64encode(data).decode("ascii")
        return f"{_seconds(record.t_ns)},{record.arbitration_id:#x},{kinds},{len(data)},{text}\n"


TEXTS: dict[str, Callable[[Path], TextOutput]] = {".log": Candump, ".asc": Asc, ".trc": Trc, ".csv": Csv}
"""Suffix -> text output."""
