"""Logs that are cut off, damaged, or no logs: good frames before the fault are used, one line says what."""

import contextlib
import gzip
import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vsensor.errors import LogError
from vsensor.logs import iter_frames, open_log_writer, read_log
from vsensor.types import Frame

T0 = 1_700_000_000_000_000_000


def write(path, count: int, fd: bool = False):
    with open_log_writer(path) as writer:
        for k in range(count):
            writer.write(
                Frame(
                    due_ns=T0 + k * 1_000_000, arbitration_id=k & 0x7FF, data=bytes([k & 255] * 8), is_fd=fd
                )
            )
    return path.read_bytes()


@pytest.fixture(params=[".log", ".asc", ".blf", ".mf4"])
def suffix(request):
    return request.param


def test_frames_before_the_cut_of_a_blf_are_used_and_the_cut_is_reported(tmp_path):
    path = tmp_path / "cut.blf"
    whole = write(path, 3000)
    path.write_bytes(whole[: len(whole) * 2 // 3])
    table = read_log(path)
    assert 1000 < len(table) < 3000
    assert table.t_ns.tolist() == [T0 + k * 1_000_000 for k in range(len(table))]
    assert "cut off" in table.report.fault
    assert any("reading ended early" in line for line in table.report.lines())


def test_frames_before_a_damaged_container_of_a_blf_are_used(tmp_path):
    path = tmp_path / "damaged.blf"
    whole = bytearray(write(path, 3000))
    second = whole.index(b"LOBJ", whole.index(b"LOBJ") + 4)
    whole[second + 40 : second + 60] = bytes(20)
    path.write_bytes(whole)
    table = read_log(path)
    assert len(table) == 342  # the first container: 16 KiB of 48-byte objects
    assert "damaged" in table.report.fault


def test_a_blf_object_of_size_0_ends_the_reading_instead_of_looping(tmp_path):
    path = tmp_path / "zero.blf"
    whole = bytearray(write(path, 1))
    head = whole[:144]
    frame = struct.pack("<4sHHLL", b"LOBJ", 32, 1, 0, 1) + bytes(32)
    path.write_bytes(head + struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(frame), 10, 0, 48) + frame)
    with pytest.raises(LogError, match="an object of size 0"):
        read_log(path)


def test_an_fd_blf_that_spans_containers_reads_whole(tmp_path):
    path = tmp_path / "fd.blf"
    write(path, 2000, fd=True)
    table = read_log(path)
    assert len(table) == 2000
    assert table.report.fault is None


def test_frames_before_the_cut_of_a_gzip_are_used(tmp_path):
    packed = gzip.compress(write(tmp_path / "x.log", 3000))
    path = tmp_path / "cut.log.gz"
    path.write_bytes(packed[: len(packed) // 2])
    table = read_log(path)
    assert 1000 < len(table) < 2000
    assert table.report.fault == "the gzip file is cut off"


def test_a_gzip_that_is_damaged_in_the_middle_gives_what_stands_before(tmp_path):
    packed = bytearray(gzip.compress(write(tmp_path / "x.log", 20_000)))
    half = len(packed) // 2
    packed[half : half + 50] = b"\xff" * 50
    path = tmp_path / "damaged.log.gz"
    path.write_bytes(packed)
    table = read_log(path)
    assert 5000 < len(table) < 20_000
    assert "the gzip file is damaged" in table.report.fault


def test_gzip_files_that_were_appended_to_each_other_are_read_through(tmp_path):
    packed = gzip.compress(b"(1.0) can0 001#\n") + gzip.compress(b"(2.0) can0 002#\n")
    (tmp_path / "two.log.gz").write_bytes(packed)
    table = read_log(tmp_path / "two.log.gz")
    assert table.arbitration_id.tolist() == [1, 2]
    assert table.report.fault is None


def test_the_last_line_of_a_cut_text_log_is_garbage_and_the_rest_is_used(tmp_path):
    path = tmp_path / "cut.log"
    path.write_bytes(write(path, 10)[:-8])
    report = read_log(path).report
    assert (report.frames, report.garbage_lines) == (9, 1)


@pytest.mark.parametrize("content", [b"", b"no such thing", bytes(500), b"\xff" * 500], ids=repr)
def test_a_file_that_is_no_log_is_refused_in_one_line(tmp_path, suffix, content):
    path = tmp_path / f"nothing{suffix}"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"nothing\.") as caught:
        read_log(path)
    assert "\n" not in str(caught.value)
    with pytest.raises(LogError):
        list(iter_frames(path))


def test_a_blf_under_the_name_of_text_is_refused(tmp_path):
    write(tmp_path / "x.blf", 100)
    (tmp_path / "x.blf").rename(tmp_path / "x.log")
    with pytest.raises(LogError, match="holds no CAN frame"):
        read_log(tmp_path / "x.log")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("missing.log", "no such file"),
        ("x.txt", "not a log format"),
        ("x", "not a log format"),
        ("x.gz", "known"),
    ],
)
def test_a_name_that_cannot_be_read_says_why(tmp_path, name, reason):
    with pytest.raises(LogError, match=reason):
        read_log(tmp_path / name)


def test_a_folder_is_not_a_log(tmp_path):
    (tmp_path / "x.log").mkdir()
    with pytest.raises(LogError, match="is a folder"):
        read_log(tmp_path / "x.log")


def test_a_log_error_comes_from_streaming_too_when_nothing_is_there(tmp_path):
    path = tmp_path / "bad.log"
    path.write_text("nothing\n")
    with pytest.raises(LogError, match="holds no CAN frame"):
        next(iter_frames(path))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), name=st.sampled_from([".log", ".asc", ".blf"]))
def test_any_bytes_cut_or_changed_give_a_table_or_a_log_error(tmp_path, data, name):
    path = tmp_path / f"fuzz{name}"
    whole = bytearray(write(path, 40, fd=data.draw(st.booleans())))
    for _ in range(data.draw(st.integers(0, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole)))])
    with contextlib.suppress(LogError):  # anything else fails the test
        table = read_log(path)
        assert (table.length <= table.data.shape[1]).all()
        assert (table.data[np.arange(table.data.shape[1]) >= table.length[:, None]] == 0).all()
