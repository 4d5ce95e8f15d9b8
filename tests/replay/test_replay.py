"""`vsensor replay` as a tester calls it: what is on the bus, what is recorded, what is refused and how."""

import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from tests.accept.streams import found
from tests.bus_frames import content
from tests.ecu.streams import stream, write
from tests.full_disk import no_file_longer_than
from tests.replay.playing import write_log
from tests.shared import SHARED_DATA, needs_shared
from vsensor.bus import open_bus
from vsensor.cli import main
from vsensor.errors import BusError, ConfigError, LogError
from vsensor.logs import Flag, frames_of, open_log_writer, read_log
from vsensor.replay import ReplayOptions, replay_log
from vsensor.types import Frame

T0 = 1_700_000_000_000_000_000
FORMATS = SHARED_DATA / "can/formats"


@pytest.fixture
def log(tmp_path):
    """Ten frames, one every 10 ms."""
    return write_log(tmp_path / "a.log", [5000 + 10 * k for k in range(10)])


@pytest.fixture
def channels(tmp_path):
    """A log of three channels, 1 to 3, in turn."""
    path = tmp_path / "three.blf"
    with open_log_writer(path) as writer:
        for k in range(30):
            writer.write(Frame(due_ns=T0 + k * 10**6, arbitration_id=k, data=b"", channel=k % 3))
    return path


def replay(path, *words):
    """Replay without waiting; returns the exit status."""
    return main(["replay", str(path), "--as-fast-as-possible", *map(str, words)])


def heard(*buses):
    return [[frame.arbitration_id for frame in bus.drain()] for bus in buses]


def test_every_frame_is_on_the_bus_bit_for_bit(tmp_path):
    kinds = [
        Frame(due_ns=T0, arbitration_id=0x123, data=bytes(range(8))),
        Frame(due_ns=T0 + 1, arbitration_id=0x18FF1234, data=b"\x01", is_extended=True),
        Frame(due_ns=T0 + 2, arbitration_id=0x7FF, data=b""),
        Frame(due_ns=T0 + 3, arbitration_id=0x321, data=bytes(5), is_remote=True),
        Frame(due_ns=T0 + 4, arbitration_id=0x200, data=bytes(32), is_fd=True, bitrate_switch=True),
    ]
    with open_log_writer(tmp_path / "a.blf") as writer:
        for frame in kinds:
            writer.write(frame)
    with open_bus("virtual:bits") as bus:
        assert replay(tmp_path / "a.blf", "--bus", "virtual:bits") == 0
        seen = [content(frame) for frame in bus.drain()]
    assert seen == [content(frame) for frame in kinds]


def test_a_recording_has_the_intervals_of_the_log_and_is_dated_now(log, tmp_path):
    assert replay(log, "--log", tmp_path / "out.log") == 0
    table = read_log(tmp_path / "out.log")
    assert (table.t_ns - table.t_ns[0]).tolist() == [10_000_000 * k for k in range(10)]
    assert table.arbitration_id.tolist() == list(range(10))
    assert abs(int(table.t_ns[0]) - time.time_ns()) < 60 * 10**9


def test_channels_go_to_the_buses_that_they_are_mapped_to(channels):
    with open_bus("virtual:m1") as one, open_bus("virtual:m2") as two:
        assert replay(channels, "--map", "1=virtual:m1", "--map", "3=virtual:m1", "--bus", "virtual:m2") == 0
        assert heard(one, two) == [[k for k in range(30) if k % 3 != 1], [k for k in range(30) if k % 3 == 1]]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--map", "1=virtual:x"), r"channel 2 has no bus: --map 2=INTERFACE:CHANNEL, --bus for all others"),
        (("--map", "9=virtual:x", "--bus", "virtual:y"), r"--map 9=virtual:x: no such channel; .* 1, 2, 3"),
        (("--bus", "nosuch:x"), "no interface 'nosuch'"),
        (("--include", "0x700"), "none of its frames is chosen"),
        (("--start", "99"), r"none of its frames is chosen.*; its frames were looked at from 0 to 0\.\d+ s"),
        (("--include", "channel:can7"), r"--include channel:can7: no such channel; .* 1, 2, 3"),
        (("--exclude", "0x1,channel:4"), r"--exclude channel:4: no such channel; .* 1, 2, 3"),
        (("--start", "5", "--stop", "4"), "--stop 4: lies before what is to be played begins"),
        (("--speed", "2"), "--speed and --as-fast-as-possible exclude each other"),
        (("--loop", "0"), "--loop 0 plays for ever"),
        (("--wait-for", "0x1", "--start-at", "2030-01-01"), "--wait-for and --start-at exclude each other"),
        (("--start-at", "2020-01-01"), "--start-at 2020-01-01: has passed"),
        (("--start-at", "noon"), "--start-at noon: s, or a time such as"),
        (("--wait-for", "noon"), "--wait-for noon: an id was expected"),
        (
            ("--wait-for", "0x1", "--log", "x.log"),
            "--wait-for: a frame is heard on a bus, and --log alone has",
        ),
        (("--rename", "0x1=0x2,0x1=0x3"), "--rename 0x1=0x3: 0x1 is renamed twice"),
        (("--dbc", "nosuch.dbc"), "nosuch.dbc: no such file"),
        (("--log", "nosuch/out.log"), "nosuch/out.log: cannot be written"),
        (("--log", "out.txt"), "not a log format that can be written"),
    ],
)
def test_what_cannot_be_played_is_refused_in_one_line_before_anything_is_sent(channels, words, said, capsys):
    with open_bus("virtual:x") as x, open_bus("virtual:y") as y:
        assert replay(channels, *words) == 2
        assert heard(x, y) == [[], []]
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert re.match("vsensor: .*" + said, error), error


def test_what_has_no_bus_is_left_out_and_counted_when_that_is_wanted(channels, capsys):
    with open_bus("virtual:s") as bus:
        assert replay(channels, "--map", "2=virtual:s", "--skip-unsendable") == 0
        assert heard(bus) == [[k for k in range(30) if k % 3 == 1]]
    printed = capsys.readouterr().out
    assert "left out: 10 frames of channel 1, which has no bus" in printed
    assert "left out: 10 frames of channel 3, which has no bus" in printed


@pytest.fixture
def classic(monkeypatch):
    """A virtual bus that cannot be opened for CAN FD, as a classic interface."""
    real = open_bus

    def opened(name, fd=False, echo=True):
        if fd:
            raise BusError(f"bus {name}: can0 carries classic CAN only")
        bus = real("virtual:classic")
        bus.name = "socketcan:can0"
        return bus

    monkeypatch.setattr("vsensor.replay.open_outputs.open_bus", opened)


def mixed(path, count=10, fd_from=0):
    """A log in which every other frame from `fd_from` on is CAN FD."""
    with open_log_writer(path) as writer:
        for k in range(count):
            is_fd = k >= fd_from and k % 2 == 1
            writer.write(Frame(due_ns=T0 + k, arbitration_id=k % 0x700, data=b"", is_fd=is_fd))
    return path


@pytest.mark.usefixtures("classic")
def test_can_fd_frames_on_a_classic_bus_are_refused_with_what_helps(tmp_path, capsys):
    assert replay(mixed(tmp_path / "fd.log"), "--bus", "socketcan:can0") == 2
    said = capsys.readouterr().err
    assert "can0 carries classic CAN only; " in said
    assert "fd.log has CAN FD frames: --skip-unsendable leaves them out" in said


@pytest.mark.usefixtures("classic")
def test_can_fd_frames_on_a_classic_bus_are_left_out_when_that_is_wanted(tmp_path, capsys):
    with open_bus("virtual:classic") as bus:
        assert replay(mixed(tmp_path / "fd.log"), "--bus", "socketcan:can0", "--skip-unsendable") == 0
        assert heard(bus) == [[0, 2, 4, 6, 8]]
    assert (
        "left out: 5 CAN FD frames for socketcan:can0, which carries classic CAN" in capsys.readouterr().out
    )


@pytest.mark.usefixtures("classic")
def test_can_fd_frames_that_come_late_in_a_log_are_left_out_and_counted(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("vsensor.replay.reading.SURVEY", 4)
    assert replay(mixed(tmp_path / "fd.log", fd_from=4), "--bus", "socketcan:can0") == 0
    assert "left out: 3 CAN FD frames" in capsys.readouterr().out


@pytest.mark.usefixtures("classic")
def test_can_fd_frames_that_are_not_chosen_do_no_harm(tmp_path):
    path = mixed(tmp_path / "fd.log", 2)
    assert replay(path, "--bus", "socketcan:can0", "--exclude", "0x001") == 0


def test_error_frames_are_left_out_and_counted(tmp_path, capsys):
    with open_log_writer(tmp_path / "e.blf") as writer:
        for k in range(6):
            writer.write(Frame(due_ns=T0 + k, arbitration_id=k, data=b"", is_error=k == 3))
    with open_bus("virtual:err") as bus:
        assert replay(tmp_path / "e.blf", "--bus", "virtual:err") == 0
        assert heard(bus) == [[0, 1, 2, 4, 5]]
    assert "left out: 1 error frames" in capsys.readouterr().out


def test_the_frames_before_a_fault_are_played_then_one_line_tells_and_the_status_is_2(tmp_path, capsys):
    path = tmp_path / "cut.blf"
    with open_log_writer(path) as writer:
        for k in range(2000):
            writer.write(Frame(due_ns=T0 + k, arbitration_id=k % 0x700, data=bytes(8)))
    path.write_bytes(path.read_bytes()[:-1000])
    assert replay(path, "--log", tmp_path / "out.log") == 2
    said = capsys.readouterr()
    assert re.search(r"^vsensor: \S*cut\.blf: reading ended early: .*cut off", said.err, re.MULTILINE)
    assert len(read_log(tmp_path / "out.log")) == len(read_log(path)) > 1000
    assert f"frames sent {len(read_log(path))}" in said.out


def test_a_full_disk_ends_it_in_one_line(tmp_path, capsys):
    path = write_log(tmp_path / "a.log", range(20_000), ids=[1] * 20_000)
    (tmp_path / "full.log").symlink_to("/dev/full")
    assert replay(path, "--log", tmp_path / "full.log") == 2
    assert "full.log: cannot be written: No space left" in capsys.readouterr().err


@pytest.mark.parametrize("suffix", ["log", "asc", "blf", "mf4"])
def test_what_was_sent_before_the_disk_was_full_can_be_read(tmp_path, capsys, suffix):
    path = write_log(tmp_path / "a.log", range(20_000), ids=[k % 0x700 for k in range(20_000)])
    out = tmp_path / f"out.{suffix}"
    with open_bus("virtual:full", echo=False) as bus, no_file_longer_than(30_000):
        assert replay(path, "--bus", "virtual:full", "--log", out) == 2
        sent = [frame.arbitration_id for frame in bus.drain()]
    assert f"out.{suffix}: cannot be written: File too large" in capsys.readouterr().err
    kept = read_log(out).arbitration_id.tolist()
    assert 300 < len(kept) <= len(sent)
    assert kept == sent[: len(kept)] == [k % 0x700 for k in range(len(kept))]


def test_a_channel_that_turns_up_late_has_its_name_in_the_recording(tmp_path, monkeypatch):
    monkeypatch.setattr("vsensor.replay.reading.SURVEY", 4)
    names = ["body"] * 300 + ["chassis"] * 2
    lines = [f"({k / 1000:.3f}) {name} {k:03X}#" for k, name in enumerate(names)]
    (tmp_path / "a.log").write_text("".join(line + "\n" for line in lines))
    assert replay(tmp_path / "a.log", "--log", tmp_path / "b.log") == 0
    assert read_log(tmp_path / "b.log").channel_names == ("body", "chassis")


def test_the_log_that_is_played_is_not_written_over(log):
    before = log.read_bytes()
    assert replay(log, "--log", log) == 2
    assert log.read_bytes() == before


def test_a_log_without_times_says_what_gives_them_and_then_plays(tmp_path, capsys):
    path = tmp_path / "bare.log"
    path.write_text("  can0  123   [2]  11 22\n" * 5)
    assert replay(path, "--bus", "virtual:bare") == 2
    assert "bare.log: its frames have no times; --rate FRAMES_PER_S gives them" in capsys.readouterr().err
    assert replay(path, "--rate", "100", "--log", tmp_path / "out.log") == 0
    times = read_log(tmp_path / "out.log").t_ns
    assert (times - times[0]).tolist() == [k * 10**7 for k in range(5)]


def test_a_replay_in_real_time_keeps_the_order_and_tells_how_late_it_was(log, capsys):
    with open_bus("virtual:rt") as bus:
        assert main(["replay", str(log), "--bus", "virtual:rt", "--loop", "2"]) == 0
        frames = bus.drain()
    assert [frame.arbitration_id for frame in frames] == [*range(10), *range(10)]
    said = capsys.readouterr().out
    assert re.search(r"frames sent 20 in 0\.\d+ s, refused by the bus 0, reordered 0", said)
    assert re.search(r"lateness of the first frame: p50 [\d.]+, p99 [\d.]+", said)
    assert re.search(r"duration 0\.190 s as planned, error -?[\d.]+ ms", said)
    assert "at each seam 10.000 ms" in said


def test_a_replay_begins_when_the_frame_it_waits_for_is_heard(log):
    with open_bus("virtual:wait") as other:
        asked = []

        def stopped():
            asked.append(len(other.drain()))
            if len(asked) == 5:
                other.send(Frame(due_ns=0, arbitration_id=0x100, data=b""))
                other.send(Frame(due_ns=0, arbitration_id=0x321, data=b""))
            return len(asked) > 10_000

        report = replay_log(
            ReplayOptions(path=log, bus="virtual:wait", wait_for="0x321", fast=True), print, stopped
        )
    assert (report.frames_sent, report.interrupted) == (10, False)
    assert sum(asked[:5]) == 0


def test_a_replay_that_waits_in_vain_sends_nothing(log):
    with open_bus("virtual:vain") as other:
        calls = iter(range(10))
        options = ReplayOptions(path=log, bus="virtual:vain", wait_for="0x321x")
        other.send(Frame(due_ns=0, arbitration_id=0x321, data=b""))  # the id in 11 bits is another
        report = replay_log(options, lambda text: None, lambda: next(calls, None) is None)
        assert heard(other) == [[0x321]]
    assert (report.frames_sent, report.interrupted) == (0, True)


def test_the_key_q_ends_a_replay_that_waits(log):
    typed = iter([[], [" "], ["q"]])
    options = ReplayOptions(path=log, bus="virtual:q", wait_for="0x321")
    report = replay_log(options, lambda text: None, keys=lambda: next(typed))
    assert (report.frames_sent, report.interrupted) == (0, False)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({}, "no frame for 60 s from 0.010 s of the log on; --max-gap S cuts such gaps"),
        ({"include": ("0x002",)}, "the first frame leaves in 60 s"),
        ({"speed": "0.1", "start": "0.01"}, "no frame for 600 s from 0.000 s of the log on; --max-gap S"),
    ],
)
def test_who_waits_long_for_a_frame_is_told_once_for_how_long(tmp_path, words, said):
    path = write_log(tmp_path / "gap.log", [0, 10, 60_010])
    told, asked = [], []

    def stopped():
        asked.append(1)
        return len(asked) > 12

    replay_log(ReplayOptions(path=path, bus="virtual:gap", **words), told.append, stopped)
    assert [line for line in told if "frame" in line] == [line for line in told if said in line]
    assert sum(said in line for line in told) == 1


def test_who_cannot_keep_up_is_told_so_while_it_plays(tmp_path, monkeypatch):
    monkeypatch.setattr("vsensor.replay.session.BEHIND_NS", 50_000_000)
    path, told = write_log(tmp_path / "a.log", [k / 100 for k in range(20_000)], ids=[1] * 20_000), []
    options = ReplayOptions(path=path, bus="virtual:slow", speed="100")
    replay_log(options, told.append, lambda: any("behind" in line for line in told))
    assert told[-1].endswith(" s behind: frames are due faster than they can be sent here")


def test_a_clock_that_jumps_ahead_by_years_is_told_in_days(tmp_path):
    path = write_log(tmp_path / "gap.log", [0, 10, 1_700_000_000_000])
    told = []
    stopped = iter([False] * 10 + [True] * 10)
    replay_log(ReplayOptions(path=path, bus="virtual:far"), told.append, lambda: next(stopped))
    assert any(line.startswith("no frame for 19676 days from 0.010 s") for line in told)


def test_two_players_begin_at_the_time_that_both_are_told(log, tmp_path):
    at = datetime.now(UTC) + timedelta(seconds=1.5)
    outs = [tmp_path / "one.log", tmp_path / "other.blf"]
    options = [ReplayOptions(path=log, bus="virtual:at", start_at=at.isoformat(), log=out) for out in outs]
    with ThreadPoolExecutor() as pool:
        list(pool.map(lambda one: replay_log(one, lambda text: None), options))
    firsts_ns = [int(read_log(out).t_ns[0]) for out in outs]
    assert firsts_ns == pytest.approx([at.timestamp() * 1e9] * 2, abs=2e6)


def test_batches_are_spread_by_the_cycle_that_the_database_tells(tmp_path):
    path = write_log(tmp_path / "a.log", [30 * (k // 3 + 1) for k in range(300)], ids=[0x123] * 300)
    signal = ' SG_ A : 0|8@1+ (1,0) [0|0] "" X\n'
    cycle = 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 9;\nBA_DEF_DEF_ "GenMsgCycleTime" 0;\n'
    (tmp_path / "m.dbc").write_text(
        f'VERSION ""\nBO_ 291 M: 8 X\n{signal}{cycle}BA_ "GenMsgCycleTime" BO_ 291 10;\n'
    )
    assert replay(path, "--smooth", "--dbc", tmp_path / "m.dbc", "--log", tmp_path / "b.log") == 0
    steps_ms = np.diff(read_log(tmp_path / "b.log").t_ns)[100:] / 1e6
    assert steps_ms.min() > 5
    assert steps_ms.mean() == pytest.approx(10, abs=0.1)
    assert replay(path, "--smooth", "--log", tmp_path / "c.log") == 0  # the median interval of batches is 0
    assert np.diff(read_log(tmp_path / "c.log").t_ns)[100:].min() == 0


def test_keys_hold_it_step_it_and_end_it(log):
    typed = iter([[" "], ["s"], ["s"], ["x"], ["right"], [], ["left"], [" "], ["q"]])
    said = []
    options = ReplayOptions(path=log, bus="virtual:keys", speed="0.1")
    report = replay_log(options, said.append, keys=lambda: next(typed, []))
    assert [line.split(" at ")[0] for line in said if " at " in line] == [
        "held",
        "held",
        "held",
        "held",
        "held",
        "going on",
    ]
    assert 2 <= report.frames_sent < 10
    assert not report.interrupted


def test_without_waiting_no_real_bus_is_flooded(log, monkeypatch):
    def opened(name, fd=False, echo=True):
        bus = open_bus("virtual:real")
        bus.is_simulated = False
        return bus

    monkeypatch.setattr("vsensor.replay.open_outputs.open_bus", opened)
    with pytest.raises(BusError, match="--as-fast-as-possible would flood a real bus"):
        replay_log(ReplayOptions(path=log, bus="socketcan:can0", fast=True), print)


def test_realtime_without_time_is_refused(log):
    with pytest.raises(ConfigError, match="exclude each other"):
        replay_log(ReplayOptions(path=log, fast=True, realtime=True), print)


def is_a_frame(flags):
    return not flags & Flag.ERROR and flags & (Flag.FD | Flag.REMOTE) != Flag.FD | Flag.REMOTE


@needs_shared
@pytest.mark.parametrize("path", sorted(FORMATS.iterdir()) if FORMATS.is_dir() else [], ids=lambda p: p.name)
def test_every_shared_format_plays_or_is_refused_for_the_reason_that_its_reader_gives(path, tmp_path, capsys):
    out = tmp_path / "out.blf"
    try:
        table, said = read_log(path), ""
    except LogError as error:
        table, said = None, " ".join(str(error).split())
    sendable = 0 if table is None else sum(map(is_a_frame, table.flags))
    assert replay(path, "--log", out) == (0 if sendable else 2)
    assert said in capsys.readouterr().err
    assert not sendable or len(read_log(out)) == sendable


def test_a_repaired_recording_of_a_loop_is_accepted(tmp_path, capsys):
    write(stream(28), tmp_path / "a.log")
    words = ("--loop", 2, "--start", 0, "--repair", "native", "--log", tmp_path / "b.blf")
    assert replay(tmp_path / "a.log", *words) == 0
    assert "repair native: 728 frames of 13 messages" in capsys.readouterr().out
    frames = frames_of(read_log(tmp_path / "b.blf").columns)
    assert found(list(frames)) == {}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--repair", "nativ"], "did you mean native"),
        (["--repair", "honda"], "not shipped; give it with --dbc"),
        (["--repair", "honda="], "NAME or NAME=DATABASE"),
        (["--repair", "native", "--repair", "native"], "both in"),
        (["--keep-wrong"], "--repair, which is not given"),
    ],
)
def test_a_repair_that_cannot_be_meant_is_refused(log, words, said, capsys):
    assert replay(log, *words) == 2
    assert said in capsys.readouterr().err


def test_a_log_is_played_without_what_only_profiles_and_scenarios_need(log):
    heavy = "scipy cantools lxml asammdf pandas polars vsensor.config vsensor.profile vsensor.codec"
    loaded = f"[name for name in '{heavy}'.split() if sys.modules.get(name)]"
    code = f"from vsensor.cli import main; print(main(), {loaded})"
    words = ["replay", str(log), "--bus", "virtual:light", "--quiet"]
    command = [sys.executable, "-c", f"import sys; {code}", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"
