"""Small logs of every format: each reads, or is refused for the right reason."""

import gzip
import shutil

import can
import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import LogError
from vsensor.logs import Flag, read_log, write_log

FORMATS = SHARED_DATA / "can/formats"

READS = {
    # file: frames, remote, error, events that are no frames by right, what is special
    "issue_1256.asc": (1457, 0, 0, 0),  # no trigger block
    "issue_1299.asc": (4, 0, 0, 1),  # DLC 13 on classic CAN means 8 bytes
    "issue_1905.blf": (22, 0, 0, 0),  # FD objects shorter than the length they claim
    "logfile.asc": (20, 4, 4, 12),  # statistics, J1939 transport, FD
    "logfile_errorframes.asc": (12, 2, 3, 3),
    "single_frame_us_locale.asc": (1, 0, 0, 1),
    "test_CanErrorFrameExt.blf": (2, 0, 2, 0),
    "test_CanErrorFrames.asc": (4, 0, 4, 1),
    "test_CanFdMessage.asc": (3, 0, 0, 1),
    "test_CanFdMessage64.asc": (2, 0, 0, 1),
    "test_CanFdRemoteMessage.asc": (1, 1, 0, 1),
    "test_CanMessage.asc": (2, 0, 0, 1),
    "test_CanMessage.asc.gz": (2, 0, 0, 1),
    "test_CanMessage.trc": (2, 0, 0, 0),
    "test_CanMessage_V1_0_BUS1.trc": (11, 1, 0, 1),  # the event: bus heavy
    "test_CanMessage_V1_1.trc": (11, 1, 0, 1),
    "test_CanMessage_V1_3.trc": (11, 1, 0, 1),
    "test_CanMessage_V2_0_BUS1.trc": (11, 1, 0, 1),
    "test_CanMessage_V2_1.trc": (11, 1, 0, 1),
    "test_CanRemoteMessage.asc": (3, 3, 0, 1),
}

REFUSED = {
    "single_frame.asc": r"holds no CAN frame; 1 lines are none, first line 6: .*d 40 00",  # 64 bytes, not FD
    "test_CanFdMessage.blf": "holds no frame that a bus can carry: id 0x4444444 in 11 bits",
    "test_CanFdMessage64.blf": "holds no frame that a bus can carry: id 0x15555555 in 11 bits",
    "test_CanMessage.blf": "holds no frame that a bus can carry: id 0x4444444 in 11 bits",
    "test_CanMessage2.blf": "holds no frame that a bus can carry: id 0x4444444 in 11 bits",
}


@needs_shared
@pytest.mark.parametrize("name", READS)
def test_a_good_file_gives_all_its_frames_and_no_garbage(name):
    report = read_log(FORMATS / name).report
    found = (report.frames, report.remote_frames, report.error_frames, report.other_lines)
    assert found == READS[name]
    assert (report.garbage_lines, report.impossible_frames, report.fault) == (0, 0, None)


@needs_shared
@pytest.mark.parametrize("name", REFUSED)
def test_a_file_of_impossible_frames_is_refused_for_that_reason(name):
    with pytest.raises(LogError, match=REFUSED[name]) as caught:
        read_log(FORMATS / name)
    assert "\n" not in str(caught.value)


@needs_shared
def test_every_shared_file_stands_in_one_of_the_tables():
    assert {path.name for path in FORMATS.iterdir()} == READS.keys() | REFUSED.keys()


@needs_shared
def test_asc_dates_are_read_as_utc_on_every_machine():
    times = read_log(FORMATS / "test_CanMessage.asc").t_ns  # Sat Sep 30 10:06:13.191 PM 2017, + 2.501 s
    assert times[0] == (1_506_809_173_191 + 2_501) * 10**6


@needs_shared
def test_german_and_english_dates_are_the_same():
    german = read_log(FORMATS / "test_CanFdMessage.asc").t_ns[0]  # Sam Sep 30 15:06:13.191 2017
    assert german == 1_506_783_973_191 * 10**6 + 30_005_021 * 1000


@needs_shared
def test_fd_flags_of_asc_are_kept():
    flags = read_log(FORMATS / "test_CanFdMessage.asc").flags.tolist()
    assert flags == [
        Flag.FD | Flag.BITRATE_SWITCH,
        Flag.FD | Flag.ERROR_STATE | Flag.EXTENDED | Flag.TRANSMITTED,
        Flag.FD | Flag.BITRATE_SWITCH | Flag.ERROR_STATE,
    ]


@needs_shared
def test_the_trc_versions_that_hold_the_same_drive_agree_to_their_resolution():
    one = read_log(FORMATS / "test_CanMessage_V1_1.trc")
    two = read_log(FORMATS / "test_CanMessage_V2_1.trc")
    assert one.arbitration_id.tolist() == two.arbitration_id.tolist()
    assert np.abs((one.t_ns - one.t_ns[0]) - (two.t_ns - two.t_ns[0])).max() <= 1000


def test_relative_asc_timestamps_are_summed(tmp_path):
    path = tmp_path / "relative.asc"
    path.write_text(
        "date Sat Sep 30 10:06:13.000 2017\nbase hex  timestamps relative\ninternal events logged\n"
        "   0.100000 1  123  Rx d 1 01\n   0.200000 1  Statistic: D 0\n   0.300000 1  124  Rx d 1 02\n"
    )
    times = read_log(path).t_ns
    assert (times - times[0]).tolist() == [0, 500_000_000]


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("x.asc", "   1.000000 1  123  Rx   d 2 01 02\n", "   1.000000 1  123  Rx   d 2 0Z 02\n"),
        ("x.asc", "   1.000000 1  123  Rx   d 2 01 02\n", "what is this\n"),
        ("x.asc", "   1.000000 1  123  Rx   d 2 01 02\n", "   1.000000 1  FFF  Rx   d 2 01 02\n"),
        ("x.asc", "   1.000000 1  123  Rx   d 2 01 02\n", "   1.000000 CANFD 1 Rx 123\n"),
        ("x.trc", "     1)     17535  00000100  2  00 01\n", "     2)     17540  0000ZZZZ  2  00 01\n"),
        ("x.trc", "     1)     17535  00000100  2  00 01\n", "     2)     17540  00000100  8  00 01\n"),
        ("x.csv", "1.5,0x123,0,0,0,2,AQI=\n", "1.5,0x123,0,0\n"),
        ("x.csv", "1.5,0x123,0,0,0,2,AQI=\n", "np.float64(1.5),0x123,0,0,0,2,AQI=\n"),
        ("x.csv", "1.5,0x123,0,0,0,2,AQI=\n", "nan,0x123,0,0,0,2,AQI=\n"),
    ],
)
def test_a_bad_line_costs_that_line_and_no_other(tmp_path, name, good, bad):
    headers = {
        "x.asc": "date Sat Sep 30 10:06:13.000 2017\nbase hex  timestamps absolute\ninternal events logged\n",
        "x.trc": ";   comment\n",
        "x.csv": "timestamp,arbitration_id,extended,remote,error,dlc,data\n",
    }
    path = tmp_path / name
    path.write_text(headers[name] + good + bad + bad + good)
    table = read_log(path)
    assert len(table) == 2
    assert table.report.garbage_lines == 2
    assert table.report.first_garbage[0][0] == headers[name].count("\n") + 2


def test_a_trc_file_without_its_columns_is_refused_by_one_line(tmp_path):
    path = tmp_path / "x.trc"
    path.write_text(";$FILEVERSION=2.1\n 1 17535.400 DT 1 0100 Rx - 1 00\n 2 17536.4 DT 1 0100 Rx - 1 00\n")
    with pytest.raises(LogError, match="column"):
        read_log(path)


@needs_shared
def test_mf4_of_another_drive_reads_whole():
    table = read_log(SHARED_DATA / "can/3BA199E2_drive_00000164_1.MF4")
    assert len(table) == 65_296
    assert table.channel_names == ("1", "2")
    assert set(np.unique(table.arbitration_id[table.channel == 1])) == set(range(1, 10))
    assert (table.flags[table.arbitration_id == 401_604_624] & Flag.EXTENDED).all()
    assert table.report.backward_timestamps == 0


@needs_shared
def test_gzip_around_any_format_gives_the_same(tmp_path):
    for name in ("logfile.asc", "issue_1905.blf", "test_CanMessage_V2_1.trc"):
        packed = tmp_path / f"{name}.gz"
        packed.write_bytes(gzip.compress((FORMATS / name).read_bytes()))
        assert read_log(packed).t_ns.tolist() == read_log(FORMATS / name).t_ns.tolist()


@needs_shared
def test_upper_case_suffixes_are_known(tmp_path):
    shutil.copy(FORMATS / "logfile.asc", tmp_path / "LOGFILE.ASC")
    assert len(read_log(tmp_path / "LOGFILE.ASC")) == 20


@needs_shared
def test_python_can_reads_the_same_from_every_good_blf():
    for name in ("issue_1905.blf",):
        theirs = list(can.LogReader(FORMATS / name))
        ours = list(read_log(FORMATS / name).frames())
        assert [bytes(message.data) for message in theirs] == [frame.data for frame in ours]
        assert [round(m.timestamp * 1e6) for m in theirs] == [round(f.due_ns / 1e3) for f in ours]


@needs_shared
def test_mf4_is_written_and_read_without_asammdf(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "asammdf", None)
    write_log(tmp_path / "x.mf4", read_log(FORMATS / "logfile.asc"))
    assert len(read_log(tmp_path / "x.mf4")) == 20
