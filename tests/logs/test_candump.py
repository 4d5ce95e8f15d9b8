"""Text logs of candump: exact times, every kind of frame, garbage counted."""

import io

import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import LogError
from vsensor.logs import Flag, Notes, iter_frames, read_log
from vsensor.logs.candump import read_candump

LOG = """\
(1533224087.000013) can0 2C1#0014DF14BBCA3A91
(1533224087.123456789) can1 18EBFF00#01A0
(1533224087.5) can0 123##3112233 R
(1533224088.000000) can0 123#R4 T
(1533224088.000000) vcan0 20000080#0000000000000000
(1533224088.100000) can0 7FF#
(1533224088.200000) can0 001#0102030405060708_9
"""


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "all.log"
    path.write_text(LOG)
    return read_log(path)


def test_times_are_the_digits_of_the_text_as_integer_nanoseconds(table):
    assert table.t_ns.tolist() == [
        1533224087_000013000,
        1533224087_123456789,
        1533224087_500000000,
        1533224088_000000000,
        1533224088_000000000,
        1533224088_100000000,
        1533224088_200000000,
    ]


def test_every_kind_of_frame_has_its_flags(table):
    assert table.flags.tolist() == [
        0,
        Flag.EXTENDED,
        Flag.FD | Flag.BITRATE_SWITCH | Flag.ERROR_STATE,
        Flag.REMOTE | Flag.TRANSMITTED,
        Flag.ERROR,
        0,
        0,
    ]


def test_data_are_padded_with_zeros_beyond_their_length(table):
    assert table.length.tolist() == [8, 2, 3, 4, 8, 0, 8]
    assert table.data[2].tolist() == [0x11, 0x22, 0x33, 0, 0, 0, 0, 0]


def test_ids_lose_the_kernels_flag_bits(table):
    assert table.arbitration_id.tolist() == [0x2C1, 0x18EBFF00, 0x123, 0x123, 0x80, 0x7FF, 1]


def test_channels_are_numbered_in_order_of_appearance(table):
    assert table.channel_names == ("can0", "can1", "vcan0")
    assert table.channel.tolist() == [0, 1, 0, 0, 2, 0, 0]


def test_the_arrays_are_read_only(table):
    assert not any(column.flags.writeable for column in table.columns)


def test_frames_of_a_table_carry_the_same(table):
    frame = list(table.frames())[2]
    assert (frame.due_ns, frame.arbitration_id, frame.data) == (1533224087_500000000, 0x123, b"\x11\x22\x33")
    assert frame.is_fd
    assert frame.bitrate_switch
    assert frame.error_state_indicator
    assert not frame.is_extended


@pytest.mark.parametrize(
    "line",
    [
        "garbage",
        "(1533224087.000013) can0 2C1#0014D",  # half a byte
        "(1533224087.000013) can0 800#00",  # beyond 11 bits
        "(1533224087.000013) can0 FFFFFFFFF#00",
        "(1533224087.000013) can0 80000000#00",  # beyond 29 bits and no error frame
        "(1533224087.000013) can0 123#010203040506070809",  # nine bytes on classic CAN
        "(1533224087.000013) can0 123##1010203040506070809",  # no FD frame has nine bytes
        "(1533224087.000013) can0 123#R9",
        "(1533224087) can0 123#00",
        "(nan) can0 123#00",
        "(1533224087.000013) can0 123#0G",
        "(1533224087.000013) can0 123#00 trailing words",
        "(99999999999.000000) can0 123#00",  # nanoseconds beyond 63 bits
        "(1533224087.000013) can0 12#00",
    ],
)
def test_a_garbage_line_is_counted_with_its_number_and_the_good_ones_used(tmp_path, line):
    path = tmp_path / "mixed.log"
    path.write_text(f"(1.0) can0 123#00\n\n{line}\n(2.0) can0 124#00\n")
    table = read_log(path)
    assert table.t_ns.tolist() == [1_000_000_000, 2_000_000_000]
    assert table.report.garbage_lines == 1
    assert table.report.first_garbage == ((3, line[:60]),)


def test_line_numbers_go_on_over_blocks():
    text = b"(1.0) can0 123#00\n" * 20 + b"oops\n" + b"(2.0) can0 124#00\n" * 20 + b"oops"
    notes = Notes()
    blocks = list(read_candump(io.BytesIO(text), notes, chunk=1))
    assert len(blocks) > 10
    assert sum(len(block.t_ns) for block in blocks) == 40
    assert notes.first_garbage == [(21, "oops"), (42, "oops")]


def test_windows_line_ends_are_read(tmp_path):
    path = tmp_path / "crlf.log"
    path.write_bytes(b"(1.0) can0 123#00\r\n(2.0) can0 123#01\r\n")
    assert read_log(path).report.garbage_lines == 0


def test_repeated_and_backward_timestamps_are_counted_and_kept_in_order(tmp_path):
    path = tmp_path / "order.log"
    path.write_text("(2.0) can0 001#\n(2.0) can0 002#\n(1.0) can0 003#\n(3.0) can0 004#\n")
    table = read_log(path)
    assert table.arbitration_id.tolist() == [1, 2, 3, 4]
    assert (table.report.repeated_timestamps, table.report.backward_timestamps) == (1, 1)
    assert (table.report.first_ns, table.report.last_ns) == (1_000_000_000, 3_000_000_000)


def test_a_log_without_a_good_line_is_refused_naming_the_first(tmp_path):
    path = tmp_path / "bad.log"
    path.write_text("\nhello\nworld\n")
    with pytest.raises(
        LogError, match=r"bad\.log: holds no CAN frame; 2 lines are none, first line 2: 'hello'"
    ):
        read_log(path)


@needs_shared
def test_the_rav4_drive_is_read_as_its_description_says():
    table = read_log(SHARED_DATA / "can/rav4_drive.log")
    report = table.report
    assert (len(table), report.ids, report.garbage_lines, report.fault) == (53_800, 90, 0, None)
    assert report.repeated_timestamps == 11_090  # 20.6 % of the intervals
    assert report.backward_timestamps == 0
    counts = np.unique(table.t_ns, return_counts=True)[1]
    assert counts[counts > 1].sum() / len(table) == pytest.approx(0.278, abs=5e-4)
    assert (report.last_ns - report.first_ns) / 1e9 == pytest.approx(59.99, abs=0.005)


@needs_shared
def test_streaming_gives_the_same_frames_as_the_table():
    path = SHARED_DATA / "can/rav4_drive.log"
    table = read_log(path)
    notes = Notes()
    frames = list(iter_frames(path, notes))
    assert [frame.due_ns for frame in frames] == table.t_ns.tolist()
    assert [frame.arbitration_id for frame in frames] == table.arbitration_id.tolist()
    assert frames[7].data == table.data[7, : table.length[7]].tobytes()
    assert list(notes.channels) == ["can0"]
