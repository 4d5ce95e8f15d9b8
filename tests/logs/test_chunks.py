"""A log in runs: the same frames as in one piece, from any format, however small the runs."""

import gzip
import itertools

import can
import numpy as np
import pytest

from vsensor.errors import LogError
from vsensor.logs import Columns, Flag, Notes, iter_chunks, open_log_writer, read_log
from vsensor.logs.table import joined
from vsensor.logs.untimed import timed
from vsensor.types import Frame

T0 = 1_700_000_000_000_000_000
STEP_NS = 1_000_000


def frames(count):
    """Frames of every kind, one a millisecond."""
    for k in range(count):
        kind = k % 5
        yield Frame(
            due_ns=T0 + k * STEP_NS,
            arbitration_id=0x18FF0000 + k if kind == 1 else k % 0x700,
            data=bytes([k & 255]) * (24 if kind == 2 else 4),
            is_extended=kind == 1,
            is_fd=kind == 2,
            channel=k % 2,
            is_remote=kind == 3,
        )


@pytest.fixture(params=[".log", ".asc", ".blf", ".log.gz", ".mf4"])
def log(request, tmp_path):
    """A log of 1000 frames in one of the formats."""
    if request.param == ".mf4":
        pytest.importorskip("asammdf")
    packed = request.param.endswith(".gz")
    path = tmp_path / f"a{request.param.removesuffix('.gz')}"
    with open_log_writer(path) as writer:
        for frame in frames(1000):
            writer.write(frame)
    if packed:
        (tmp_path / "a.log.gz").write_bytes(gzip.compress(path.read_bytes()))
        path = tmp_path / "a.log.gz"
    return path


@pytest.fixture(params=[".log", ".blf", ".mf4", "can.blf"])
def plain(request, tmp_path):
    """6000 classic frames: several containers; those of python-can's BLF cut frames in two."""
    path = tmp_path / f"plain.{request.param[-3:]}"
    if request.param == "can.blf":
        with can.BLFWriter(path) as writer:
            writer.max_container_size = 50_000
            for k in range(6000):
                writer(can.Message(arbitration_id=k % 0x700, data=[k & 255], timestamp=1.7e9 + k / 1000))
        return path
    with open_log_writer(path) as writer:
        for k in range(6000):
            writer.write(Frame(due_ns=T0 + k * STEP_NS, arbitration_id=k % 0x700, data=bytes([k & 255])))
    return path


def assert_same(one, other):
    for name, a, b in zip(Columns._fields, one, other, strict=True):
        np.testing.assert_array_equal(a, b, err_msg=name)


@pytest.mark.parametrize("chunk", [7, 100, 65536])
def test_the_runs_of_a_log_are_the_log_whatever_their_size(log, chunk):
    runs = list(iter_chunks(log, chunk=chunk))
    assert all(0 < len(run.t_ns) <= chunk for run in runs)
    assert_same(joined(runs), read_log(log).columns)


def test_a_run_starts_with_the_first_frame_that_is_not_before_the_start(log):
    for start_ns, skipped in ((T0 + 300 * STEP_NS, 300), (T0 + 300 * STEP_NS + 1, 301), (T0 - 1, 0)):
        runs = joined(list(iter_chunks(log, start_ns=start_ns, chunk=64)))
        assert_same(runs, read_log(log).columns.taken(slice(skipped, None)))


def test_a_start_after_the_last_frame_gives_no_frame_and_is_no_fault(log):
    assert list(iter_chunks(log, start_ns=T0 + 1000 * STEP_NS)) == []


def test_frames_behind_a_start_that_lie_before_it_are_kept(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("(1.0) can0 001#\n(3.0) can0 002#\n(2.0) can0 003#\n(4.0) can0 004#\n")
    assert joined(list(iter_chunks(path, start_ns=3 * 10**9))).arbitration_id.tolist() == [2, 3, 4]


def test_the_frames_before_a_fault_come_before_the_error(tmp_path):
    path = tmp_path / "cut.blf"
    with open_log_writer(path) as writer:
        for frame in frames(3000):
            writer.write(frame)
    path.write_bytes(path.read_bytes()[:-3000])
    given = []
    with pytest.raises(LogError, match=r"cut\.blf: reading ended early: the file is cut off"):
        given.extend(len(run.t_ns) for run in iter_chunks(path, chunk=50))
    assert sum(given) == len(read_log(path)) > 500


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "holds no CAN frame$"),
        ("oops\n", "holds no CAN frame; 1 lines are none, first line 1: 'oops'"),
        ("  can0  123   [2]  11 22\n", "its frames have no times; --rate FRAMES_PER_S gives them"),
        ("can0 123#1122\n", "its frames have no times; --rate FRAMES_PER_S gives them"),
    ],
)
def test_a_log_without_frames_says_why(tmp_path, text, said):
    path = tmp_path / "none.log"
    path.write_text(text)
    with pytest.raises(LogError, match=said):
        list(iter_chunks(path))


@pytest.mark.parametrize(
    ("line", "same"),
    [
        ("  can0  123   [3]  11 22 33", "123#112233"),
        ("  vcan1  18EBFF00   [0]  remote request", "18EBFF00#R0"),
        ("  can0  123  [12]  " + "AB " * 12, "123##0" + "AB" * 12),
        ("can0 123#1122 ", "123#1122"),
        ("123#R", "123#R"),
        ("123##3112233", "123##3112233"),
        ("  can0  7FF   [0]", "7FF#"),
        ("  can0  123   [2]  41 42   'AB'", "123#4142"),
    ],
)
def test_a_frame_without_a_time_is_read_when_that_is_asked_for(tmp_path, line, same):
    bare, known = tmp_path / "bare.log", tmp_path / "known.log"
    bare.write_text(line + "\n")
    known.write_text(f"(0.0) can0 {same}\n")
    assert_same(joined(list(iter_chunks(bare, untimed=True))), read_log(known).columns)


@pytest.mark.parametrize("line", ["(1.0) can0 123#11", "  can0  123   [8]  11 22", "", "# 123", "oops"])
def test_a_line_that_is_no_frame_without_a_time_stays_as_it_is(line):
    assert timed(line.encode()) == line.encode()


def test_garbage_between_frames_without_times_is_counted_with_its_line(tmp_path):
    path = tmp_path / "bare.log"
    path.write_text("can0 123#11\noops\ncan0 124#11\n")
    notes = Notes()
    runs = joined(list(iter_chunks(path, untimed=True, notes=notes, chunk=1)))
    assert runs.arbitration_id.tolist() == [0x123, 0x124]
    assert notes.first_garbage == [(2, "oops")]


def test_error_frames_keep_their_place_in_small_runs(tmp_path):
    path = tmp_path / "error.blf"
    with open_log_writer(path) as writer:
        for k in range(40):
            writer.write(Frame(due_ns=T0 + k, arbitration_id=k % 3, data=b"", is_error=k % 3 == 0))
    runs = joined(list(iter_chunks(path, chunk=3)))
    assert ((runs.flags & Flag.ERROR) != 0).tolist() == [k % 3 == 0 for k in range(40)]


def test_the_first_run_of_a_long_log_is_there_before_the_rest_is_read(tmp_path):
    path = tmp_path / "long.log"
    path.write_text("".join(f"({k}.0) can0 123#11\n" for k in range(20_000)) + "oops\n")
    notes = Notes()
    list(itertools.islice(iter_chunks(path, chunk=100, notes=notes), 3))
    assert notes.garbage_lines == 0


def test_reading_goes_on_from_any_place_at_which_it_stood(plain):
    notes, done, places = Notes(), 0, []
    for run in iter_chunks(plain, chunk=450, notes=notes):
        done += len(run.t_ns)
        if notes.place is not None and done < 6000:
            places.append((done, notes.place))
    assert len(places) >= 5
    whole = read_log(plain).columns
    for done, place in places:
        assert_same(joined(list(iter_chunks(plain, chunk=700, place=place))), whole.taken(slice(done, None)))


def test_a_log_that_is_packed_or_has_several_tables_tells_no_place(log):
    notes = Notes()
    places = [notes.place for _ in iter_chunks(log, chunk=100, notes=notes)]
    is_plain = log.suffixes in ([".log"], [".blf"])
    assert any(place is not None for place in places) == is_plain


def test_line_numbers_go_on_from_a_place(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("(1.000000) can0 123#11\n" * 500 + "oops\n")
    notes = Notes()
    next(iter_chunks(path, chunk=100, notes=notes))
    behind = Notes()
    list(iter_chunks(path, place=notes.place, notes=behind))
    assert behind.first_garbage == [(501, "oops")]


def test_how_much_is_read_at_a_time_may_change_with_every_run(log):
    sizes = itertools.cycle([1, 40, 7])
    assert_same(joined(list(iter_chunks(log, chunk=lambda: next(sizes)))), read_log(log).columns)
