"""The live table: one small record per tick into a pipe; a process of its own draws it.

The cycle never waits for the terminal: a record is written whole or, when the pipe is full, dropped
and counted. Writing costs about 20 us a tick.
"""

import contextlib
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import TextIO

from vsensor.sinks.table_view import LEAVE, TableLine, TableRow
from vsensor.types import Boundary, Output, Side

_PROGRAM = "import sys; from vsensor.sinks.table_view import main; sys.exit(main())"
_QUIETER_BY = 10  # niceness: the table gives way to the cycle from its first instruction on
_PATIENCE_S = 10.0
"""How long `close` waits for the last redraw: of a run shorter than the start of the table's process, which
stands back and on a busy machine takes seconds, nothing would be seen otherwise."""


class TableSink:
    """Shows offset, heading, curvature, range, quality per line, and lateness, on a terminal."""

    def __init__(self, terminal: TextIO | None = None) -> None:
        """Start the table's process; it writes to `terminal`, standard output if None."""
        self.dropped = 0
        self._terminal = terminal or sys.stdout
        self._terminal.flush()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", _PROGRAM],  # -P: nothing is imported from the user's folder
            stdin=subprocess.PIPE,
            stdout=self._terminal,
            env={**os.environ, "PYTHONPATH": _python_path()},
            start_new_session=True,  # Ctrl-C goes to the run, which then closes the table
        )
        niceness = os.getpriority(os.PRIO_PROCESS, 0) + _QUIETER_BY
        os.setpriority(os.PRIO_PROCESS, self._process.pid, min(niceness, 19))
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)
        self._alive = True
        self._frames = self._slots_dropped = self._lateness_max_ns = 0
        self._next_tick = 0

    @property
    def pid(self) -> int:
        """Process id of the table's process."""
        return self._process.pid

    def write(self, output: Output) -> None:
        """Hand one tick to the table; never blocks, drops when the table is behind."""
        tick = output.tick.index
        self._slots_dropped += max(tick - self._next_tick, 0)
        self._next_tick = tick + 1
        self._frames += len(output.frames)
        self._lateness_max_ns = max(self._lateness_max_ns, output.lateness_ns)
        if not self._alive:
            return
        try:
            os.write(self._pipe, self._row(output).packed())
        except BlockingIOError:
            self.dropped += 1
        except BrokenPipeError:  # the table's process has gone; the run goes on without it
            self._alive = False

    def close(self) -> None:
        """Let the table draw its last row and end it; gives the terminal back also if it hangs."""
        if self._process.stdin is not None and not self._process.stdin.closed:
            with contextlib.suppress(BrokenPipeError):
                self._process.stdin.close()
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            self._terminal.write(LEAVE)
            self._terminal.flush()

    def _row(self, output: Output) -> TableRow:
        lines: list[TableLine | None] = [None] * len(Side)
        for boundary in output.estimate.boundaries:
            lines[boundary.side] = _line(boundary)
        return TableRow(
            tick=output.tick.index,
            t_ns=output.tick.t_ns,
            lateness_ns=output.lateness_ns,
            lateness_max_ns=self._lateness_max_ns,
            speed_mps=output.snapshot.ego.speed_mps,
            sensor_state=output.values.get("sensor.state", math.nan),
            slots_dropped=self._slots_dropped,
            frames=self._frames,
            lines=tuple(lines),
        )


def _line(boundary: Boundary) -> TableLine:
    c0, c1, c2, c3 = (*boundary.coefficients.tolist(), 0.0, 0.0, 0.0)[:4]
    return TableLine(
        offset_m=c0,
        heading=c1,
        curvature_per_m=2 * c2,
        curvature_rate_per_m2=6 * c3,
        x_min_m=boundary.x_min_m,
        x_max_m=boundary.x_max_m,
        quality=boundary.quality,
        kind=boundary.kind,
        measured=boundary.measured,
    )


def _python_path() -> str:
    """Return a path on which the table's process finds this very package."""
    root = str(Path(__file__).parents[2])
    return os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
