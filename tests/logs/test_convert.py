"""From one log format into another: what both hold comes back bit for bit, what one does not is said."""

import gzip
from itertools import product

import can
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import LogError
from vsensor.logs import read_log
from vsensor.logs.convert import convert_log
from vsensor.logs.table import BITRATE_SWITCH as BRS
from vsensor.logs.table import ERROR, EXTENDED, FD, FD_LENGTHS, REMOTE, Record, columns_from
from vsensor.logs.table import ERROR_STATE as ESI
from vsensor.logs.table import TRANSMITTED as SENT
from vsensor.logs.write import OUTPUTS, open_output

SUFFIXES = (".log", ".asc", ".blf", ".mf4", ".trc", ".csv")
T0 = 1_700_000_000_123_456_789
EVERYTHING = settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def expected(record: Record, suffix: str) -> Record | None:
    """What a format gives back of a frame, as the tables of formats in README say it; None: no frame."""
    t_ns, identifier, channel, flags, data = record
    if suffix in (".asc", ".trc"):
        t_ns = (t_ns + 500) // 1000 * 1000
    if flags & FD and (suffix in (".trc", ".csv") or (flags & REMOTE and suffix in (".log", ".asc"))):
        return None
    if flags & ERROR:
        if suffix == ".trc":
            return None
        if suffix in (".asc", ".blf"):
            identifier, flags, data = 0, ERROR, b""
        if suffix == ".log":
            identifier = identifier or 0x80
    if suffix == ".csv":
        channel, flags = 0, flags & ~SENT
    return Record(t_ns, identifier, channel, flags, data)


@st.composite
def a_record(draw, t_ns: int) -> Record:
    kind = draw(st.sampled_from(["classic", "fd", "remote", "fd remote", "error"]))
    flags = draw(st.sampled_from([0, SENT]))
    if kind == "error":
        return Record(
            t_ns, draw(st.sampled_from([0, 4, 0x1FF])), 0, flags | ERROR, bytes(draw(st.sampled_from([0, 8])))
        )
    flags |= draw(st.sampled_from([0, EXTENDED]))
    identifier = draw(st.integers(0, 0x1FFFFFFF if flags & EXTENDED else 0x7FF))
    if "fd" in kind:
        flags |= FD | draw(st.sampled_from([0, BRS])) | draw(st.sampled_from([0, ESI]))
    length = draw(st.sampled_from(sorted(FD_LENGTHS)) if kind == "fd" else st.integers(0, 8))
    if "remote" in kind:
        return Record(t_ns, identifier, draw(st.integers(0, 1)), flags | REMOTE, bytes(length))
    data = draw(st.binary(min_size=length, max_size=length))
    return Record(t_ns, identifier, draw(st.integers(0, 1)), flags, data)


@st.composite
def drives(draw) -> list[Record]:
    """Frames at increasing times, the first on the first channel."""
    records, t_ns = [Record(T0, 0x100, 0, 0, b"\x01")], T0
    for _ in range(draw(st.integers(0, 12))):
        t_ns += draw(st.integers(2_000, 10**12))
        records.append(draw(a_record(t_ns)))
    return records


def write(path, records, names=("can0", "can1")):
    with open_output(path, path, names) as writer:
        writer.write_columns(columns_from(records))


def records_in(path) -> list[Record]:
    """The frames of a log; channels by their number, whatever their name is."""
    table = read_log(path)
    number = [int(name.removeprefix("can")) - (not name.startswith("can")) for name in table.channel_names]
    rows = zip(*(column.tolist() for column in table.columns), strict=True)
    return [Record(t, i, number[c], f, bytes(d[:n])) for t, i, c, f, n, d in rows]


@pytest.mark.parametrize(("first", "second"), list(product(SUFFIXES, SUFFIXES)), ids="".join)
@EVERYTHING
@given(records=drives())
def test_a_log_comes_back_from_any_format_made_of_any_other_as_both_hold_it(tmp_path, first, second, records):
    held = [one for record in records if (one := expected(record, first)) is not None]
    write(tmp_path / f"one{first}", held)
    done = convert_log(tmp_path / f"one{first}", tmp_path / f"two{second}", lossy=True)
    again = [one for record in held if (one := expected(record, second)) is not None]
    assert records_in(tmp_path / f"two{second}") == again
    assert done.frames == len(again)
    assert bool(done.lost) == any(
        one is None or one._replace(t_ns=0, arbitration_id=0) != record._replace(t_ns=0, arbitration_id=0)
        for record in held
        for one in [expected(record, second)]
    ) or second in (".asc", ".blf")  # an id in an error frame is a detail of its own


@pytest.mark.parametrize("suffix", SUFFIXES)
@EVERYTHING
@given(records=drives())
def test_frame_by_frame_and_in_bulk_the_same_is_written(tmp_path, suffix, records):
    held = [one for record in records if (one := expected(record, suffix)) is not None]
    write(tmp_path / f"bulk{suffix}", held)
    with open_output(tmp_path / f"each{suffix}", tmp_path / f"each{suffix}", ("can0", "can1")) as writer:
        for record in held:
            writer.write_record(record)
    assert records_in(tmp_path / f"each{suffix}") == records_in(tmp_path / f"bulk{suffix}") == held


FRAME = Record(T0, 0x100, 0, 0, b"\x01")
LOSSES = {
    (".csv", "1 CAN FD frames"): Record(T0 + 10**9, 0x100, 0, FD | BRS, bytes(12)),
    (".trc", "1 CAN FD frames"): Record(T0 + 10**9, 0x100, 0, FD, bytes(64)),
    (".csv", "1 directions (sent)"): Record(T0 + 10**9, 0x100, 0, SENT, b""),
    (".csv", "1 channels beside the first"): Record(T0 + 10**9, 0x100, 1, 0, b""),
    (".trc", "1 error frames"): Record(T0 + 10**9, 0, 0, ERROR, b""),
    (".asc", "1 details of error frames"): Record(T0 + 10**9, 4, 0, ERROR, bytes(8)),
    (".blf", "1 times before the first frame's"): Record(T0 - 10**9, 0x100, 0, 0, b""),
    (".mf4", "1 frames in an order other than that of time"): Record(T0 - 10**9, 0x100, 0, 0, b""),
}


@pytest.mark.parametrize(("suffix", "said"), LOSSES, ids=str)
def test_what_a_format_cannot_hold_is_refused_by_name_and_number(tmp_path, suffix, said):
    write(tmp_path / "x.log", [FRAME, LOSSES[suffix, said]])
    with pytest.raises(LogError) as caught:
        convert_log(tmp_path / "x.log", tmp_path / f"y{suffix}")
    assert f"{suffix} cannot hold {said}; --lossy" in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.log"]


@pytest.mark.parametrize(("suffix", "said"), LOSSES, ids=str)
def test_with_lossy_it_is_left_out_and_listed(tmp_path, suffix, said):
    write(tmp_path / "x.log", [FRAME, LOSSES[suffix, said]])
    done = convert_log(tmp_path / "x.log", tmp_path / f"y{suffix}", lossy=True)
    assert done.lost == (said,)
    assert f"left out: {said}" in done.lines()
    kept = 2 - said.endswith(("FD frames", "1 error frames"))
    assert len(read_log(tmp_path / f"y{suffix}")) == done.frames == kept


def test_what_a_format_does_hold_is_not_refused(tmp_path):
    write(tmp_path / "x.log", [FRAME, Record(T0 + 5000, 0x101, 1, SENT | EXTENDED, bytes(8))])
    for suffix in (".asc", ".blf", ".mf4", ".trc"):
        assert convert_log(tmp_path / "x.log", tmp_path / f"y{suffix}").lost == ()


def test_frames_whose_time_runs_backwards_come_sorted_into_mf4(tmp_path):
    steps = [5, 1, 4, 2, 3]
    write(tmp_path / "x.log", [Record(T0 + k * 10**9, k, 0, 0, b"") for k in steps])
    convert_log(tmp_path / "x.log", tmp_path / "y.mf4", lossy=True)
    assert read_log(tmp_path / "y.mf4").arbitration_id.tolist() == [1, 2, 3, 4, 5]


def test_times_finer_than_the_format_are_said_to_be_rounded(tmp_path):
    write(tmp_path / "x.log", [FRAME, Record(T0 + 211, 0x100, 0, 0, b"")])  # the second one is a full us
    done = convert_log(tmp_path / "x.log", tmp_path / "y.asc")
    assert done.notes == ("1 times rounded to 1 us",)
    assert convert_log(tmp_path / "x.log", tmp_path / "y.blf").notes == ()


def test_names_that_become_numbers_are_said(tmp_path):
    write(tmp_path / "x.log", [FRAME], names=("body",))
    assert "body became numbers" in convert_log(tmp_path / "x.log", tmp_path / "y.blf").notes[0]
    assert convert_log(tmp_path / "x.log", tmp_path / "y.log").notes == ()


@pytest.mark.parametrize("names", [("can3", "can1"), ("4", "2")])
@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".mf4", ".trc"])
def test_the_number_of_a_channel_survives_and_can0_is_1(tmp_path, names, suffix):
    write(tmp_path / f"x{suffix}", [FRAME, Record(T0 + 5000, 1, 1, 0, b"")], names=names)
    convert_log(tmp_path / f"x{suffix}", tmp_path / "y.log")
    assert read_log(tmp_path / "y.log").channel_names == ("can3", "can1")


def test_two_channels_never_become_one(tmp_path):
    write(tmp_path / "x.blf", [FRAME, Record(T0 + 5000, 1, 1, 0, b"")], names=("body", "can0"))
    assert len(read_log(tmp_path / "x.blf").channel_names) == 2


@pytest.mark.parametrize("suffix", [".log", ".asc", ".trc", ".csv"])
def test_text_is_packed_where_the_name_says_so(tmp_path, suffix):
    write(tmp_path / "x.log", [FRAME])
    convert_log(tmp_path / "x.log", tmp_path / f"y{suffix}.gz")
    convert_log(tmp_path / "x.log", tmp_path / f"y{suffix}")
    assert (
        gzip.decompress((tmp_path / f"y{suffix}.gz").read_bytes()) == (tmp_path / f"y{suffix}").read_bytes()
    )


@pytest.mark.parametrize("suffix", [".trc", ".csv"])
def test_python_can_reads_trc_and_csv_as_we_do(tmp_path, suffix):
    records = [FRAME, Record(T0 + 4 * 10**9, 0x1ABCDEF0, 0, EXTENDED, bytes(range(8)))]
    write(tmp_path / f"x{suffix}", records)
    with can.LogReader(tmp_path / f"x{suffix}") as reader:
        messages = list(reader)
    assert [(m.arbitration_id, bool(m.is_extended_id), bytes(m.data)) for m in messages] == [
        (r.arbitration_id, bool(r.flags & EXTENDED), r.data) for r in records
    ]
    assert [m.timestamp for m in messages] == pytest.approx([r.t_ns / 1e9 for r in records], abs=1.5e-6)


def test_frames_without_times_get_them_from_the_rate(tmp_path):
    (tmp_path / "x.log").write_text("can0 123#11\n  can0  124   [2]  22 33\ncan0 125#R\n")
    convert_log(tmp_path / "x.log", tmp_path / "y.blf", rate_hz=100.0)
    table = read_log(tmp_path / "y.blf")
    assert table.t_ns.tolist() == [0, 10_000_000, 20_000_000]
    assert table.arbitration_id.tolist() == [0x123, 0x124, 0x125]


def test_frames_without_times_are_refused_with_what_gives_them(tmp_path):
    (tmp_path / "x.log").write_text("can0 123#11\ncan0 124#22\n")
    with pytest.raises(LogError, match="--rate"):
        convert_log(tmp_path / "x.log", tmp_path / "y.blf")


def test_the_good_frames_before_a_fault_are_converted_and_the_fault_is_told(tmp_path):
    write(tmp_path / "x.blf", [Record(T0 + k * 10**6, 1, 0, 0, bytes([k & 255] * 8)) for k in range(9000)])
    whole = (tmp_path / "x.blf").read_bytes()
    (tmp_path / "cut.blf").write_bytes(whole[: len(whole) * 2 // 3])
    done = convert_log(tmp_path / "cut.blf", tmp_path / "y.mf4")
    assert 2000 < done.frames < 9000
    assert done.frames == len(read_log(tmp_path / "y.mf4"))
    assert "cut off" in done.notes[0]


@pytest.mark.parametrize("bad", ["x.txt", "missing.log", "empty.log"])
def test_a_source_or_target_that_is_none_leaves_the_old_file_as_it_was(tmp_path, bad):
    (tmp_path / "empty.log").write_text("")
    (tmp_path / "y.blf").write_bytes(b"old")
    with pytest.raises(LogError):
        convert_log(tmp_path / bad, tmp_path / "y.blf")
    assert (tmp_path / "y.blf").read_bytes() == b"old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty.log", "y.blf"]


def test_a_target_that_is_no_file_or_no_log_is_refused(tmp_path):
    write(tmp_path / "x.log", [FRAME])
    for target, reason in (("/dev/full", "not a format"), (tmp_path, "not a format")):
        with pytest.raises(LogError, match=reason):
            convert_log(tmp_path / "x.log", tmp_path / target)
    (tmp_path / "y.log").symlink_to("/dev/full")
    with pytest.raises(LogError, match="is no file"):
        convert_log(tmp_path / "x.log", tmp_path / "y.log")


def test_a_log_can_be_converted_onto_itself(tmp_path):
    write(tmp_path / "x.log", [FRAME])
    before = (tmp_path / "x.log").read_bytes()
    convert_log(tmp_path / "x.log", tmp_path / "x.log")
    assert (tmp_path / "x.log").read_bytes() == before


def test_progress_ends_at_the_size_of_the_file(tmp_path):
    write(tmp_path / "x.blf", [Record(T0 + k * 10**6, 1, 0, 0, b"") for k in range(5000)])
    told = []
    convert_log(tmp_path / "x.blf", tmp_path / "y.log", progress=told.append)
    assert told == sorted(told)
    assert told[-1] == (tmp_path / "x.blf").stat().st_size


@needs_shared
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_rav4_drive_goes_into_every_format_and_back(tmp_path, suffix):
    original = read_log(SHARED_DATA / "can/rav4_drive.log")
    convert_log(SHARED_DATA / "can/rav4_drive.log", tmp_path / f"a{suffix}")
    convert_log(tmp_path / f"a{suffix}", tmp_path / "b.log")
    for before, after in zip(original.columns, read_log(tmp_path / "b.log").columns, strict=True):
        np.testing.assert_array_equal(after, before)


def test_every_output_is_in_these_tests():
    assert {name.removesuffix(".gz") for name in OUTPUTS} == set(SUFFIXES)
