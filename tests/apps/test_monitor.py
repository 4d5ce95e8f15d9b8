"""The terminal monitor: what it says of a bus that is fine, and of each thing that may be wrong on it."""

import os
import re

import pytest
from msgspec.structs import replace

from tests.accept.streams import CYCLE_NS, NATIVE, spoiled
from tests.ecu.streams import IDS, START_NS, crc_wrong, lost, stream
from tests.sinks.test_table import read_all
from tests.vehicle_frames import VEHICLE, Gateway
from vsensor.apps.bus_watch import BusWatch
from vsensor.apps.monitor import monitor_bus
from vsensor.apps.monitor_text import change_text, fitted, frames_text, one_line, screen
from vsensor.bus import open_bus
from vsensor.cli import main
from vsensor.errors import BusError
from vsensor.types import Frame

IMAGES = 60
END_NS = START_NS + IMAGES * CYCLE_NS
CLEAN = stream(IMAGES)
LEFT = "LDS_LeftLine"


def watched(frames, profiles=(NATIVE,), until_ns=END_NS):
    """Return a watch that took the frames and was looked at once, and what had changed."""
    watch = BusWatch(profiles)
    watch.take(sorted(frames, key=lambda frame: frame.due_ns))
    return watch, watch.looked(until_ns)


def row(watch, message, now_ns=END_NS):
    """Return the cells of a message on the screen by the head's words."""
    shown = screen(watch, "bus", START_NS, now_ns)
    head = re.split(r"  +", next(line for line in shown if line.startswith("message")))
    cells = re.split(r"  +", next(line for line in shown if line.startswith(message + " ")))
    return dict(zip(head, cells, strict=True))


def status(watch, message):
    """Return what the watch says of a message."""
    pairs = zip(watch.watches, watch.statuses, strict=True)
    return next(status for one, status in pairs if one.plan.layout.name == message)


def test_of_a_clean_stream_every_message_is_ok_and_trusted():
    watch, _ = watched(CLEAN)
    assert set(watch.statuses) == {"ok"}
    cells = row(watch, LEFT)
    assert (cells["frames"], cells["cycle ms"], cells["of"], cells["longest"]) == ("60", "40.0", "40", "40.0")
    assert (cells["lost"], cells["stood"], cells["CRC wrong"], cells["E2E"]) == ("0", "0", "0", "valid")


def test_the_counter_shown_is_that_of_the_last_frame():
    watch, _ = watched(CLEAN)
    plan = next(plan for plan in NATIVE.messages if plan.layout.name == LEFT)
    last = [frame for frame in CLEAN if frame.arbitration_id == IDS[LEFT]][-1]
    assert row(watch, LEFT)["counter"] == str(plan.guard.counter(last.data))


def test_lines_stand_as_they_were_sent_with_their_quality():
    watch, _ = watched(CLEAN)
    lines = dict(zip(("left", "right", "next_left", "next_right"), watch.lines(END_NS), strict=True))
    for name, y in {"left": 1.75, "right": -1.75, "next_left": 5.25, "next_right": -5.25}.items():
        assert lines[name].offset_m == pytest.approx(y, abs=0.02), name  # they move by 4 mm
    assert row(watch, LEFT)["q"] == str(lines["left"].quality)
    assert lines["left"].quality > 0


@pytest.mark.parametrize(
    ("spoil", "said", "column"),
    [
        (crc_wrong, "wrong CRC", "CRC wrong"),
        (lost, "1 lost", "lost"),
        (lambda frame: [frame, replace(frame, due_ns=frame.due_ns + 1000)], "counter stands", "stood"),
        (lambda frame: [replace(frame, data=frame.data[:5])], "too short", "short"),
    ],
)
def test_each_fault_of_one_frame_is_said_of_its_message_alone(spoil, said, column):
    watch, changes = watched(spoiled(spoil))
    troubled = {change.watch.plan.layout.name: change.status for change in changes if change.status != "ok"}
    assert troubled == {LEFT: said}
    counts = {name: row(watch, LEFT)[name] for name in ("CRC wrong", "lost", "stood", "short", "jumped")}
    assert counts == {**dict.fromkeys(counts, "0"), column: "1"}


def test_what_was_wrong_is_said_once_and_counted_for_good():
    watch, _ = watched(spoiled(crc_wrong))
    (change,) = watch.looked(END_NS)
    assert (change.watch.plan.layout.name, change.status) == (LEFT, "ok")
    assert watch.looked(END_NS) == []
    assert row(watch, LEFT)["CRC wrong"] == "1"


def test_a_stream_of_wrong_checksums_is_no_longer_trusted_and_its_lines_stay_the_old_ones():
    watch, _ = watched(spoiled(crc_wrong, images=range(40, IMAGES)))
    assert row(watch, LEFT)["E2E"] == "invalid"
    assert status(watch, LEFT) == "wrong CRC"
    watch.looked(END_NS)
    assert status(watch, LEFT) == "not trusted"


def test_after_three_cycles_without_a_frame_a_message_is_silent_and_so_are_its_values():
    last_ns = [frame.due_ns for frame in CLEAN if frame.arbitration_id == IDS[LEFT]][-1]
    watch, _ = watched(CLEAN, until_ns=last_ns + 3 * CYCLE_NS)
    assert status(watch, LEFT) == "ok"
    assert watch.value("left.offset_m", last_ns + 3 * CYCLE_NS) > 0
    late_ns = last_ns + 3 * CYCLE_NS + 1
    change = next(c for c in watch.looked(late_ns) if c.watch.plan.layout.name == LEFT)
    assert "silent for 120 ms (cycle 40 ms)" in change_text(change, START_NS)
    assert watch.lines(late_ns)[0] is None


def test_a_cycle_that_is_not_the_declared_one_is_said_with_both_times():
    frames = [replace(frame, due_ns=START_NS + (frame.due_ns - START_NS) * 5 // 4) for frame in CLEAN]
    _, changes = watched(frames, until_ns=max(frame.due_ns for frame in frames))
    assert all(change.status == "cycle off" for change in changes)
    assert "50.0 ms instead of 40 ms" in change_text(changes[0], START_NS)


def test_after_more_lost_frames_than_a_receiver_tolerates_the_counter_has_jumped():
    watch, _ = watched(spoiled(lost, images=range(30, 40)))
    assert (status(watch, LEFT), row(watch, LEFT)["jumped"]) == ("counter jumped", "1")
    watch.looked(END_NS)
    assert status(watch, LEFT) == "ok"  # a pause is none of the cycle


def test_what_a_terminal_has_no_room_for_is_counted():
    assert fitted(["a", "b", "c"], 4) == ["a", "b", "c"]
    assert fitted(["a", "b", "c", "d"], 4) == ["a", "b", "(2 lines more in a taller terminal)"]


def test_a_message_that_never_came_is_said_and_the_ids_that_came_instead_are_shown():
    foreign = [Frame(due_ns=START_NS, arbitration_id=0x1D0, data=bytes(8))] * 7
    watch, changes = watched(foreign)
    assert changes == []
    assert row(watch, LEFT)["status"] == "NEVER HEARD"
    assert frames_text(watch) == "7 frames, 7 of them of other ids: 0x1D0"
    assert "13 of 13 messages not ok" in one_line(watch, START_NS, END_NS)


def test_quantities_beside_lines_are_shown_with_their_units_or_words():
    gateway = Gateway()
    frames = [gateway.motion(START_NS, 20.0, 0.1), gateway.frame("VEH_Body", START_NS + 1, wiper=2.0)]
    watch, _ = watched(frames, (VEHICLE,), START_NS + 2)
    others = dict(watch.others(START_NS + 2))
    assert others["ego.speed_mps"] == "20 m/s"
    assert others["ego.wiper"] == "slow"
    assert others["ego.light"] == "-"


def test_error_and_remote_frames_count_as_none():
    left = next(frame for frame in CLEAN if frame.arbitration_id == IDS[LEFT])
    watch, _ = watched([replace(left, is_remote=True), replace(left, is_error=True)])
    assert (watch.frames, row(watch, LEFT)["frames"]) == (0, "0")


class Sender:
    """Sends an image whenever it is asked whether to stop, and says so after the last."""

    def __init__(self, channel, frames):
        self._bus = open_bus(f"virtual:{channel}")
        self._frames = list(frames)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._bus.close()

    def stopped(self):
        for frame in self._frames[:13]:
            self._bus.send(frame)
        del self._frames[:13]
        return not self._frames


def test_in_a_pipe_it_writes_lines_and_at_the_end_the_tables(tmp_path):
    path = tmp_path / "out.txt"
    with Sender("piped", CLEAN[: 13 * 12]) as sender, path.open("w") as output:
        watch = monitor_bus("virtual:piped", [NATIVE], output, every_s=0.03, stopped=sender.stopped)
    text = path.read_text()
    assert watch.frames == 13 * 11  # the first image was on the bus before it listened
    assert "\x1b" not in text
    assert re.search(r"left \+1\.7\d+ m q\d to \d+ m   right -1\.7\d+ m", text)
    tables = text[text.index("message ") :].splitlines()
    assert [line.split()[0] for line in tables[1:14]] == [plan.layout.name for plan in NATIVE.messages]


def test_on_a_terminal_it_draws_in_place_and_gives_the_cursor_back():
    master, slave = os.openpty()
    with Sender("shown", CLEAN[: 13 * 12]) as sender, open(slave, "w") as terminal:
        monitor_bus("virtual:shown", [NATIVE], terminal, every_s=0.05, stopped=sender.stopped)
    text = read_all(master)
    os.close(master)
    ups = re.findall(r"\x1b\[(\d+)F", text)
    assert len(ups) >= 2
    assert max(map(int, ups)) < 24  # a terminal of unknown size has 24 lines
    assert text.endswith("\x1b[?25h\x1b[?7h")


def test_a_bus_that_is_not_there_is_one_line(capsys):
    with pytest.raises(BusError, match="nothere"):
        monitor_bus("socketcan:nothere", [NATIVE], None)
    assert main(["monitor", "--bus", "socketcan:nothere"]) == 2
    assert "nothere" in capsys.readouterr().err


def test_the_command_ends_after_its_duration(capsys):
    assert main(["monitor", "--bus", "virtual:quiet", "--duration", "0.05"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("NEVER HEARD") == 13
