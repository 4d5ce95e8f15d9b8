"""Logs written and read again, and read by others."""

import os
import shutil
import subprocess

import can
import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import LogError
from vsensor.logs import Flag, LogTable, open_log_writer, read_log, write_log
from vsensor.logs.report import Notes
from vsensor.logs.table import Record, columns_from, table_from
from vsensor.types import Frame

SUFFIXES = (".log", ".asc", ".blf", ".mf4")
T0 = 1_700_000_000_123_456_000

KINDS = [
    Record(T0, 0x123, 0, 0, b"\x01\x02"),
    Record(T0 + 1_000, 0x18EBFF00, 0, Flag.EXTENDED | Flag.TRANSMITTED, bytes(8)),
    Record(T0 + 1_000, 0x7FF, 1, 0, b""),
    Record(T0 + 500_000_000, 0x200, 0, Flag.FD | Flag.BITRATE_SWITCH | Flag.TRANSMITTED, bytes(range(64))),
    Record(T0 + 600_000_000, 0x201, 0, Flag.FD | Flag.ERROR_STATE | Flag.EXTENDED, bytes(range(12))),
    Record(T0 + 700_000_000, 0x300, 1, Flag.REMOTE, bytes(4)),
    Record(T0 + 3_600_000_000_000, 0, 0, Flag.ERROR, b""),
]


def table_of(records: list[Record]) -> LogTable:
    notes = Notes(channels={"can0": 0, "can1": 1})
    return table_from("made", columns_from([Record(*r[:3], int(r.flags), r.data) for r in records]), notes)


@pytest.fixture(params=SUFFIXES)
def suffix(request):
    return request.param


def test_every_kind_of_frame_comes_back_with_time_id_flags_and_data(tmp_path, suffix):
    written = table_of(KINDS)
    write_log(tmp_path / f"kinds{suffix}", written)
    read = read_log(tmp_path / f"kinds{suffix}")
    assert read.t_ns.tolist() == written.t_ns.tolist()
    assert read.arbitration_id.tolist() == [record.arbitration_id for record in KINDS[:-1]] + [
        0x80 if suffix == ".log" else 0  # candump's error frames carry the error class in place of the id
    ]
    assert (read.flags & ~np.uint8(Flag.TRANSMITTED)).tolist() == [
        int(record.flags) & ~int(Flag.TRANSMITTED) for record in KINDS
    ]
    assert read.length.tolist() == written.length.tolist()
    assert read.data.tolist() == written.data.tolist()
    assert read.channel.tolist() == written.channel.tolist()
    directed = slice(0, -1)  # no format knows who sent an error frame
    assert (read.flags[directed] & Flag.TRANSMITTED).tolist() == (
        written.flags[directed] & Flag.TRANSMITTED
    ).tolist()


def test_python_can_reads_what_was_written(tmp_path, suffix):
    records = KINDS[:-1]  # its own error frames differ from format to format
    write_log(tmp_path / f"kinds{suffix}", table_of(records))
    with can.LogReader(tmp_path / f"kinds{suffix}") as reader:
        messages = list(reader)
    assert [m.arbitration_id for m in messages] == [r.arbitration_id for r in records]
    assert [m.is_fd for m in messages] == [bool(r.flags & Flag.FD) for r in records]
    assert [m.bitrate_switch for m in messages] == [bool(r.flags & Flag.BITRATE_SWITCH) for r in records]
    assert [m.is_extended_id for m in messages] == [bool(r.flags & Flag.EXTENDED) for r in records]
    assert [m.is_remote_frame for m in messages] == [bool(r.flags & Flag.REMOTE) for r in records]
    data = [bytes(m.data) for m in messages if not m.is_remote_frame]
    assert data == [r.data for r in records if not r.flags & Flag.REMOTE]
    steps_us = np.round(np.diff([m.timestamp for m in messages]) * 1e6)
    assert steps_us.tolist() == (np.diff([r.t_ns for r in records]) // 1000).tolist()


@pytest.mark.skipif(
    shutil.which("asc2log") is None and not os.environ.get("CI"), reason="needs asc2log of Debian's can-utils"
)
def test_can_utils_translate_our_asc_into_our_candump_text(tmp_path):
    records = KINDS[:-1]
    write_log(tmp_path / "kinds.asc", table_of(records))
    write_log(tmp_path / "kinds.log", table_of(records))
    theirs = subprocess.run(
        ["asc2log", "-I", tmp_path / "kinds.asc"], capture_output=True, text=True, check=True, timeout=20
    ).stdout
    ours = (tmp_path / "kinds.log").read_text()
    assert [line.split(")")[1] for line in theirs.splitlines()] == [
        line.split(")")[1] for line in ours.splitlines()
    ]
    (tmp_path / "theirs.log").write_text(theirs)
    steps = [np.diff(read_log(tmp_path / name).t_ns).tolist() for name in ("theirs.log", "kinds.log")]
    assert steps[0] == steps[1]


def test_frames_that_were_sent_are_marked_as_sent(tmp_path, suffix):
    path = tmp_path / f"sent{suffix}"
    with open_log_writer(path) as writer:
        writer.write(Frame(due_ns=T0, arbitration_id=0x123, data=b"\x01"))
    table = read_log(path)
    assert (table.flags[0] & Flag.TRANSMITTED) == Flag.TRANSMITTED
    assert table.t_ns[0] == T0


def test_times_since_a_start_come_back_too(tmp_path, suffix):
    path = tmp_path / f"relative{suffix}"
    times = [0, 40_000_000, 80_000_000, 10**12]
    with open_log_writer(path) as writer:
        for t_ns in times:
            writer.write(Frame(due_ns=t_ns, arbitration_id=0x123, data=b""))
    assert read_log(path).t_ns.tolist() == times


@pytest.mark.parametrize("fine_suffix", [".log", ".blf"])
def test_text_and_blf_keep_single_nanoseconds(tmp_path, fine_suffix):
    path = tmp_path / f"fine{fine_suffix}"
    with open_log_writer(path) as writer:
        for k in range(5):
            writer.write(Frame(due_ns=T0 + k * 333_333_333, arbitration_id=k, data=b""))
    assert read_log(path).t_ns.tolist() == [T0 + k * 333_333_333 for k in range(5)]


@needs_shared
def test_the_rav4_drive_survives_every_format(tmp_path, suffix):
    original = read_log(SHARED_DATA / "can/rav4_drive.log")
    write_log(tmp_path / f"rav4{suffix}", original)
    again = read_log(tmp_path / f"rav4{suffix}")
    for before, after in zip(original.columns, again.columns, strict=True):
        np.testing.assert_array_equal(after, before)


def test_a_log_with_no_frame_can_be_closed_and_says_so_when_read(tmp_path, suffix):
    path = tmp_path / f"empty{suffix}"
    open_log_writer(path).close()
    with pytest.raises(LogError):
        read_log(path)


def test_close_twice_is_one_close(tmp_path, suffix):
    path = tmp_path / f"twice{suffix}"
    writer = open_log_writer(path)
    writer.write(Frame(due_ns=T0, arbitration_id=1, data=b""))
    writer.close()
    writer.close()
    assert len(read_log(path)) == 1


@pytest.mark.parametrize("open_suffix", [".log", ".blf"])
def test_a_log_that_was_never_closed_still_gives_its_frames(tmp_path, open_suffix):
    path = tmp_path / f"killed{open_suffix}"
    writer = open_log_writer(path)
    for k in range(5000):
        writer.write(Frame(due_ns=T0 + k * 1000, arbitration_id=1, data=bytes(8)))
    table = read_log(path)  # what a kill leaves: all but the last block
    assert len(table) > 4000
    assert table.t_ns[0] == T0
    writer.close()


@pytest.mark.parametrize("name", ["x.txt", "x", "x.trc", "x.log.gz"])
def test_a_format_that_cannot_be_written_names_those_that_can(tmp_path, name):
    with pytest.raises(LogError, match=r"\.log, \.asc, \.blf, \.mf4 are"):
        open_log_writer(tmp_path / name)


def test_a_folder_that_does_not_exist_is_one_line(tmp_path, suffix):
    with pytest.raises(LogError, match="cannot be written: No such file or directory"):
        open_log_writer(tmp_path / "nowhere" / f"x{suffix}")


def test_a_full_disk_is_a_log_error(tmp_path):
    (tmp_path / "full.log").symlink_to("/dev/full")
    writer = open_log_writer(tmp_path / "full.log")
    writer.write(Frame(due_ns=T0, arbitration_id=1, data=b""))
    with pytest.raises(LogError, match=r"full\.log: cannot be written: .*No space left"):
        writer.close()


def test_an_mf4_log_cut_off_in_its_first_block_says_so(tmp_path):
    noise = np.random.default_rng(5).integers(0, 256, (9000, 8), dtype=np.uint8)
    records = [Record(k * 10**6, 1, 0, 0, data.tobytes()) for k, data in enumerate(noise)]
    write_log(tmp_path / "x.mf4", table_from("x", columns_from(records), Notes(channels={"1": 0})))
    content = (tmp_path / "x.mf4").read_bytes()
    (tmp_path / "x.mf4").write_bytes(content[:20_000])
    with pytest.raises(LogError, match="the file ends before the block"):
        read_log(tmp_path / "x.mf4")
