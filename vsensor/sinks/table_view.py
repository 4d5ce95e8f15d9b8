"""The live table's own process: reads rows from standard input, redraws the terminal ten times a second.

Run as a program by `vsensor.sinks.table.TableSink`. It ends when its standard input ends, that is when
the run closes the table or dies; Ctrl-C does not reach it.
"""

import math
import os
import select
import signal
import struct
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from operator import attrgetter
from typing import BinaryIO, TextIO

from vsensor.types import SIDE_NAMES, MarkingKind, SensorMode, Side

REDRAW_S = 0.1
ENTER = "\x1b[?25l\x1b[?7l"  # hide the cursor, no wrapping of long lines
LEAVE = "\x1b[?25h\x1b[?7h"

_LINE = struct.Struct("<6d3B")
_HEAD = struct.Struct("<4q2dqq")
RECORD_BYTES = _HEAD.size + len(Side) * _LINE.size
"""Far below PIPE_BUF (4096 on Linux), so a write to the pipe is whole or refused."""


@dataclass(frozen=True, slots=True)
class TableLine:
    """One reported line: c0 in m, c1, 2 c2 and 6 c3 in 1/m and 1/m^2, view range in m."""

    offset_m: float
    heading: float
    curvature_per_m: float
    curvature_rate_per_m2: float
    x_min_m: float
    x_max_m: float
    quality: int
    kind: int
    measured: int


@dataclass(frozen=True, slots=True)
class TableRow:
    """What the table shows of one tick; `lines` in the order of Side, None = not reported."""

    tick: int
    t_ns: int
    lateness_ns: int
    lateness_max_ns: int
    speed_mps: float
    sensor_state: float
    slots_dropped: int
    frames: int
    lines: tuple[TableLine | None, ...]

    def packed(self) -> bytes:
        """Return the row as RECORD_BYTES bytes."""
        lines = (_NOTHING if line is None else _LINE.pack(*_line_values(line)) for line in self.lines)
        return _HEAD.pack(*_head_values(self)) + b"".join(lines)


_line_values = attrgetter(*(field.name for field in fields(TableLine)))
_head_values = attrgetter(*(field.name for field in fields(TableRow) if field.name != "lines"))
_NOTHING = _LINE.pack(*(math.nan,) * 6, 0, 0, 0)


def unpacked(record: bytes) -> TableRow:
    """Return the row of `TableRow.packed`."""
    lines = (TableLine(*values) for values in _LINE.iter_unpack(record[_HEAD.size :]))
    known = tuple(None if math.isnan(line.offset_m) else line for line in lines)
    tick, t_ns, lateness_ns, lateness_max_ns, speed_mps, state, dropped, frames = _HEAD.unpack_from(record)
    return TableRow(tick, t_ns, lateness_ns, lateness_max_ns, speed_mps, state, dropped, frames, known)


def format_table(row: TableRow) -> str:
    """Return the table as text, one line per line of the road; no terminal codes."""
    lateness = f"lateness {row.lateness_ns / 1e3:7.0f} us, at most {row.lateness_max_ns / 1e3:.0f} us"
    return "\n".join(
        [
            f"{row.t_ns / 1e9:9.2f} s   tick {row.tick}   {3.6 * row.speed_mps:5.1f} km/h   {_state(row)}",
            *line_texts(row.lines),
            f"{lateness}   frames {row.frames}   slots dropped {row.slots_dropped}",
        ]
    )


def line_texts(lines: Sequence[TableLine | None]) -> list[str]:
    """Return a header and the lines (in the order of Side) from left to right, None = not reported."""
    return [
        f"{'':10}  {'offset m':>9} {'heading mrad':>12} {'curvature 1/km':>14} {'range m':>11}  q  kind",
        *(_line_text(SIDE_NAMES[side], lines[side]) for side in _LEFT_TO_RIGHT),
    ]


_LEFT_TO_RIGHT = (Side.NEXT_LEFT, Side.LEFT, Side.RIGHT, Side.NEXT_RIGHT)


def _state(row: TableRow) -> str:
    known = row.sensor_state in set(SensorMode)
    return SensorMode(int(row.sensor_state)).name.lower() if known else ""


def _line_text(name: str, line: TableLine | None) -> str:
    label = name.replace("_", " ")
    if line is None:
        return f"{label:10}  {'-':>9} {'-':>12} {'-':>14} {'-':>11}  0"
    view = f"{line.x_min_m:.0f}..{line.x_max_m:.0f}"
    kind = MarkingKind(line.kind).name.lower().replace("_", " ")
    return (
        f"{label:10}  {line.offset_m:+9.3f} {1e3 * line.heading:+12.2f} {1e3 * line.curvature_per_m:+14.3f} "
        f"{view:>11}  {line.quality}  {kind}{'' if line.measured else ' (predicted)'}"
    )


def latest_records(pipe: BinaryIO, period_s: float) -> Iterator[bytes]:
    """Yield the newest whole record at most every `period_s`, until the pipe's other end is closed."""
    pending, newest, due = b"", b"", 0.0
    while True:
        wait_s = max(0.0, due - time.monotonic()) if newest else None
        if select.select([pipe], [], [], wait_s)[0]:
            data = os.read(pipe.fileno(), 65536)
            if not data:
                break
            pending += data
            whole = len(pending) // RECORD_BYTES * RECORD_BYTES
            newest = pending[whole - RECORD_BYTES : whole] or newest
            pending = pending[whole:]
        if newest and time.monotonic() >= due:
            yield newest
            newest, due = b"", time.monotonic() + period_s
    if newest:
        yield newest


def show(pipe: BinaryIO, terminal: TextIO) -> None:
    """Draw the table in place until the pipe ends; the last table stays, the terminal is as before."""
    with InPlace(terminal) as drawn:
        for record in latest_records(pipe, REDRAW_S):
            drawn.show(format_table(unpacked(record)).split("\n"))


class InPlace:
    """Lines on a terminal that are drawn over again; the last ones stay, the terminal is as before."""

    def __init__(self, terminal: TextIO) -> None:
        self._terminal = terminal
        self._drawn = 0

    def __enter__(self) -> "InPlace":
        """Hide the cursor; leaving the block shows it again."""
        self._terminal.write(ENTER)
        return self

    def __exit__(self, *_: object) -> None:
        self._terminal.write(LEAVE)
        self._terminal.flush()

    def show(self, lines: Sequence[str]) -> None:
        """Draw the lines where those before stand, and clear what is left of these."""
        up = f"\x1b[{self._drawn}F" if self._drawn else ""
        self._terminal.write(up + "".join(f"{line}\x1b[K\n" for line in lines) + "\x1b[J")
        self._terminal.flush()
        self._drawn = len(lines)


def main() -> int:
    """Show what comes on standard input; leaves quietly when the terminal goes away."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # a real-time run hands its own on
    try:
        show(sys.stdin.buffer, sys.stdout)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


if __name__ == "__main__":
    sys.exit(main())
