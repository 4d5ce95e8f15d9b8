"""The live table: what it shows, and that nothing it does holds up the cycle."""

import io
import os
import signal
import subprocess
import sys
from dataclasses import replace

import pytest

from tests.outputs import Drawn, circle, four_lines, output_of, straight
from vsensor.sinks import table
from vsensor.sinks.table import TableSink
from vsensor.sinks.table_view import (
    ENTER,
    LEAVE,
    RECORD_BYTES,
    TableLine,
    TableRow,
    format_table,
    show,
    unpacked,
)
from vsensor.types import MarkingKind, Side

PIPE_BUF = 4096
LINE = TableLine(1.75, -0.002, 1 / 800, 0.0, 0.6, 87.4, 4, MarkingKind.DASHED, 1)
ROW = TableRow(7, 280_000_000, 35_000, 90_000, 33.3, 2.0, 1, 63, (LINE, None, None, None))


def read_all(descriptor):
    """Return what can be read until the other end is closed (a terminal then says EIO)."""
    chunks = []
    while True:
        try:
            chunk = os.read(descriptor, 65536)
        except OSError:
            chunk = b""
        if not chunk:
            return b"".join(chunks).decode()
        chunks.append(chunk)


@pytest.fixture
def terminal(monkeypatch):
    """Give (master descriptor, text file of the terminal's side); a table may take its time to start."""
    monkeypatch.setattr(table, "_PATIENCE_S", 120.0)
    master, slave = os.openpty()
    with open(slave, "w") as file:
        yield master, file
    os.close(master)


def test_a_row_shows_offset_heading_curvature_range_quality_and_kind_in_readable_units():
    shown = next(line for line in format_table(ROW).splitlines() if line.startswith("left"))
    assert shown.split() == ["left", "+1.750", "-2.00", "+1.250", "1..87", "4", "dashed"]


def test_a_line_that_is_not_reported_is_a_row_of_dashes_of_quality_0():
    shown = next(line for line in format_table(ROW).splitlines() if line.startswith("right"))
    assert shown.split() == ["right", "-", "-", "-", "-", "0"]


def test_a_predicted_line_says_so():
    row = replace(ROW, lines=(replace(LINE, measured=0), None, None, None))
    assert "dashed (predicted)" in format_table(row)


def test_lines_stand_in_the_order_of_the_road_from_left_to_right():
    names = [line[:10].strip() for line in format_table(ROW).splitlines()[2:6]]
    assert names == ["next left", "left", "right", "next right"]


def test_time_state_lateness_and_dropped_slots_are_shown():
    text = format_table(ROW)
    for words in (
        "0.28 s",
        "119.9 km/h",
        "available",
        "35 us, at most 90 us",
        "frames 63",
        "slots dropped 1",
    ):
        assert words in text


def test_an_unknown_sensor_state_is_left_out():
    assert "nan" not in format_table(replace(ROW, sensor_state=float("nan")))


def test_a_row_comes_back_from_its_bytes():
    assert unpacked(ROW.packed()) == ROW


def test_a_record_is_small_enough_to_be_written_whole_or_not_at_all():
    assert len(ROW.packed()) == RECORD_BYTES < PIPE_BUF


def drawn(*records):
    """Return what the table draws for bytes that arrive in these pieces before the pipe is closed."""
    reading, writing = os.pipe()
    for piece in records:
        os.write(writing, piece)
    os.close(writing)
    screen = io.StringIO()
    with open(reading, "rb", buffering=0) as pipe:
        show(pipe, screen)
    return screen.getvalue()


def test_the_terminal_is_given_back_after_the_last_row():
    text = drawn(ROW.packed())
    assert text.startswith(ENTER)
    assert text.endswith(LEAVE)


def test_a_table_without_any_row_changes_nothing():
    assert drawn() == ENTER + LEAVE


def test_of_many_waiting_rows_only_the_newest_is_drawn():
    text = drawn(*(replace(ROW, tick=t).packed() for t in range(50)))
    assert "tick 49" in text
    assert text.count("tick ") == 1


def test_a_piece_of_a_record_at_the_end_is_ignored():
    assert "tick 7 " in drawn(ROW.packed(), ROW.packed()[:20])


def test_the_sink_shows_a_run_on_a_terminal_and_gives_it_back(terminal):
    master, file = terminal
    sink = TableSink(file)
    lines = [Drawn(y=circle(1.8, 800.0), reported=Side.LEFT), Drawn(y=straight(-1.9), reported=Side.RIGHT)]
    for t in (0, 1, 4):
        sink.write(replace(output_of(lines, tick=t), lateness_ns=50_000 + t, values={"sensor.state": 2.0}))
    sink.close()
    file.close()
    text = read_all(master)
    assert "tick 4 " in text
    assert "slots dropped 2" in text
    assert "+1.8" in text
    assert text.endswith(LEAVE)


@pytest.mark.timeout(30)
def test_a_stuck_table_never_holds_up_the_cycle(terminal, monkeypatch):
    monkeypatch.setattr(table, "_PATIENCE_S", 0.05)
    master, file = terminal
    sink = TableSink(file)
    os.kill(sink.pid, signal.SIGSTOP)
    output = output_of(four_lines())
    count = 2 * 65536 // RECORD_BYTES  # twice what a pipe holds
    for _ in range(count):
        sink.write(output)  # would hang here for ever if it blocked
    assert count / 3 < sink.dropped < count
    sink.close()
    file.close()
    assert read_all(master).endswith(LEAVE)


def test_a_table_that_died_does_not_end_the_run(terminal):
    _, file = terminal
    sink = TableSink(file)
    os.kill(sink.pid, signal.SIGKILL)
    os.waitid(os.P_PID, sink.pid, os.WEXITED | os.WNOWAIT)
    for t in range(3):
        sink.write(output_of(four_lines(), tick=t))
    sink.close()


def test_ctrl_c_on_the_terminal_does_not_reach_the_table(terminal):
    master, file = terminal
    sink = TableSink(file)
    sink.write(output_of([], tick=1))
    first = os.read(master, 65536)  # it runs now
    assert os.getsid(sink.pid) != os.getsid(0)  # the terminal signals sessions of its own only
    os.kill(sink.pid, signal.SIGINT)
    sink.write(output_of([], tick=2))
    sink.close()
    file.close()
    assert "tick 2 " in first.decode() + read_all(master)


def test_the_table_gives_way_to_the_cycle(terminal):
    _, file = terminal
    sink = TableSink(file)
    here, there = (os.getpriority(os.PRIO_PROCESS, pid) for pid in (0, sink.pid))
    sink.close()
    assert there == min(here + 10, 19)


def test_the_table_dies_with_its_run():
    program = (
        "import os, sys; from vsensor.sinks.table import TableSink; "
        "from tests.outputs import output_of; TableSink(sys.stdout).write(output_of([])); os._exit(0)"
    )
    ended = subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, timeout=60, check=True)
    assert ended.stdout.decode().endswith(LEAVE)  # the pipe ended, so nobody holds it any more
