"""Many logs into one table: what is wrong is said in one line, the rest is scanned; the same scan goes on."""

import re
import sys

import numpy as np
import pytest
from msgspec.structs import replace

from tests.field.made_logs import Drive, Road
from tests.field.sensor_logs import record
from tests.field.test_scan import used
from vsensor.cli import main
from vsensor.config import SHIPPED
from vsensor.errors import ConfigError, LogError
from vsensor.field.scan import ScanOptions, scan_log
from vsensor.field.scan_many import scan_logs
from vsensor.field.table import open_table
from vsensor.logs import iter_frames, open_log_writer
from vsensor.types import Frame

SHORT = Drive(road=Road((200.0, 0.0, 0.0)), seconds=3)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Three good logs, one that is no log, one without the vehicle, one without lines."""
    folder = tmp_path_factory.mktemp("logs")
    frames = SHORT.frames()
    for name in ("one.blf", "two.asc", "three.log"):
        _write(folder / name, frames)
    bad = folder / "bad"
    bad.mkdir()
    (bad / "torn.blf").write_bytes(b"LOGG" + b"\0" * 200)
    _write(bad / "lanes_only.log", [frame for frame in frames if not _is_vehicle(frame)])
    _write(bad / "vehicle_only.log", [frame for frame in frames if _is_vehicle(frame)])
    return folder


def _is_vehicle(frame):
    return 0x100 <= frame.arbitration_id < 0x120


def _write(path, frames):
    with open_log_writer(path) as writer:
        for frame in frames:
            writer.write(frame, 0)


def names(folder):
    return sorted(path.name for path in folder.glob("*.parquet"))


def test_a_folder_of_logs_of_any_format_becomes_a_file_each(logs, tmp_path):
    report = scan_logs([logs], tmp_path, ScanOptions(), workers=1)
    assert names(tmp_path) == ["one.parquet", "three.parquet", "two.parquet"]
    assert not report.failures
    rows = open_table([tmp_path]).scan().collect()
    assert set(rows["log"].to_list()) == {"one", "two", "three"}


def test_the_same_scan_again_does_nothing_and_makes_anew_what_is_gone(logs, tmp_path):
    places = [logs / "one.blf", logs / "three.log"]
    scan_logs(places, tmp_path, ScanOptions(), workers=1)
    kept = (tmp_path / "one.parquet").stat().st_mtime_ns
    (tmp_path / "three.parquet").unlink()
    report = scan_logs(places, tmp_path, ScanOptions(), workers=1)
    assert report.reused == 1
    assert names(tmp_path) == ["one.parquet", "three.parquet"]
    assert (tmp_path / "one.parquet").stat().st_mtime_ns == kept


def test_other_ranges_are_another_scan(logs, tmp_path):
    scan_logs([logs / "one.blf"], tmp_path, ScanOptions(), workers=1)
    report = scan_logs([logs / "one.blf"], tmp_path, ScanOptions(ranges_m=(10.0, 10.0, 30.0)), workers=1)
    assert report.reused == 0
    ranges = open_table([tmp_path]).scan().select("range_m").unique().collect()["range_m"]
    assert sorted(ranges.to_list()) == [10.0, 20.0, 30.0]


def test_bad_logs_are_listed_and_the_others_scanned_with_exit_status_1(logs, tmp_path, capsys):
    command = ["scan", str(logs / "one.blf"), str(logs / "bad"), "--out", str(tmp_path), "--workers", "1"]
    assert main(command) == 1
    out, told = capsys.readouterr()
    assert names(tmp_path) == ["one.parquet"]
    assert "one " in out
    failures = [line for line in told.splitlines() if line.startswith("vsensor: not scanned: ")]
    assert len(failures) == 3
    assert re.search(r"lanes_only.log: ego.speed_mps not found; looked for in VEH_Motion 0x100", told)
    assert re.search(r"vehicle_only.log: left.offset_m and right.offset_m not found; looked for in", told)
    assert re.search(r"torn.blf: ", told)


def test_a_log_that_has_gone_bad_leaves_no_file_of_its_former_self(logs, tmp_path):
    log = tmp_path / "drive.log"
    log.write_bytes((logs / "three.log").read_bytes())
    scan_logs([log], tmp_path / "table", ScanOptions(), workers=1)
    log.write_text("no frame\n")
    report = scan_logs([log], tmp_path / "table", ScanOptions(), workers=1)
    assert len(report.failures) == 1
    assert names(tmp_path / "table") == []


def test_logs_of_one_name_get_their_folders_name_as_well(logs, tmp_path):
    for folder in ("mon", "tue"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "drive.log").write_bytes((logs / "three.log").read_bytes())
    scan_logs([tmp_path / "mon", tmp_path / "tue"], tmp_path / "table", ScanOptions(), workers=1)
    assert names(tmp_path / "table") == ["mon_drive.log.parquet", "tue_drive.log.parquet"]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"profiles": ("nativ",)}, "did you mean native"),
        ({"reference": "nowhere.xodr"}, "nowhere.xodr: no such file"),
        ({"limits": "nowhere.toml"}, "nowhere.toml: no such file"),
    ],
)
def test_what_is_wrong_for_all_logs_is_said_before_the_first(logs, tmp_path, options, told):
    with pytest.raises(ConfigError, match=told):
        scan_logs([logs], tmp_path / "table", ScanOptions(**options), workers=1)
    assert not (tmp_path / "table").exists()


def test_an_unknown_limit_is_named_with_the_nearest_known_one(logs, tmp_path):
    limits = tmp_path / "limits.toml"
    limits.write_text('schema = "vsensor.scan/1"\nlow_speed_kph = 20\n')
    with pytest.raises(ConfigError, match="low_speed_kph: unknown key; did you mean low_speed_kmh"):
        scan_logs([logs], tmp_path, ScanOptions(limits=str(limits)), workers=1)


def test_a_profile_without_lines_is_no_profile_of_a_lane_camera(logs, tmp_path):
    with pytest.raises(LogError, match=r"no signal carries left.offset_m and right.offset_m in the profile"):
        scan_log(logs / "one.blf", "one", tmp_path, ScanOptions(profiles=("vehicle",)))
    assert names(tmp_path) == []


def test_speeds_and_yaw_rates_that_are_not_available_are_counted_and_left_out(tmp_path):
    frames = list(iter_frames(SHORT.write(tmp_path / "whole.blf")))
    motion = [k for k, frame in enumerate(frames) if frame.arbitration_id == 0x100]
    for k in motion[20:30]:
        frames[k] = _without_speed(frames[k])
    _write(tmp_path / "drive.blf", frames)
    scan_log(tmp_path / "drive.blf", "drive", tmp_path / "table", ScanOptions())
    table = open_table([tmp_path / "table"])
    assert "10 speeds and 0 yaw rates that no vehicle has, or not available" in " ".join(
        table.files[0].info["notes"]
    )
    rows = used(table.scan().collect())
    assert rows["speed_mps"].to_numpy() == pytest.approx(20.0, abs=0.01)


def test_frames_of_the_vehicle_with_wrong_checksums_are_told_of(tmp_path):
    frames = [
        replace(frame, data=bytes([frame.data[0] ^ 1]) + frame.data[1:]) if _is_vehicle(frame) else frame
        for frame in SHORT.frames()
    ]
    _write(tmp_path / "drive.log", frames)
    with pytest.raises(LogError, match=r"VEH_Motion 0x100 .*; 250 frames of it are there, none with right"):
        scan_log(tmp_path / "drive.log", "drive", tmp_path / "table", ScanOptions())


def _without_speed(frame):
    from tests.vehicle_frames import PLANS

    plan = PLANS["VEH_Motion"]
    data = bytearray(frame.data)
    data[2:4] = b"\xff\xff"  # SNA
    plan.guard.protect(data, data[1] & 0xF)
    return Frame(due_ns=frame.due_ns, arbitration_id=frame.arbitration_id, data=bytes(data))


# ---- a map as reference -----------------------------------------------------------------------------


def test_against_the_map_the_sensor_without_errors_has_none(tmp_path):
    log = record(
        tmp_path / "drive.blf",
        seconds=6,  # then a double line begins, and with it confusion about its stripes
        traffic=[],
        camera={"model": "none"},
        error_model={"mode": "none"},
    )
    info = scan_log(log, "drive", tmp_path / "table", ScanOptions(reference=str(SHIPPED / "highway.xodr")))
    rows = used(open_table([tmp_path / "table"]).scan().collect())
    assert len(rows) > 0.4 * info["rows"]
    error = np.abs(rows["error_m"].to_numpy())
    assert np.quantile(error, 0.95) < 0.02  # the cubic, and the bus rounding
    assert np.quantile(error, 0.5) < 0.005


def test_a_map_needs_a_pose_in_the_log(logs, tmp_path):
    options = ScanOptions(reference=str(SHIPPED / "highway.xodr"))
    with pytest.raises(LogError, match=r"one.blf: no pose: ego.x_m, ego.y_m and ego.yaw_rad are needed"):
        scan_log(logs / "one.blf", "one", tmp_path, options)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("side,x\nleft,1\n", "column x_m is missing"),
        ("side,x_m,y_m\nmiddle,1,2\n", "line 2: side = 'middle': left, right"),
        ("side,x_m,y_m\nleft,1,2\nleft,two,2\n", "line 3: x_m, y_m = 'two', '2': numbers were expected"),
        ("side,x_m,y_m\n", "holds no point"),
        ("side,x_m,y_m\nleft,1,2\n", "side left has fewer than 2 points"),
    ],
)
def test_a_reference_file_that_is_wrong_is_refused_naming_line_and_column(logs, tmp_path, text, told):
    (tmp_path / "line.csv").write_text(text)
    with pytest.raises(ConfigError, match=re.escape(told)):
        scan_log(logs / "one.blf", "one", tmp_path, ScanOptions(reference=str(tmp_path / "line.csv")))
    assert names(tmp_path) == []


# ---- the command line ---------------------------------------------------------------------------------


def test_scan_and_table_show_hours_rows_and_masks(logs, tmp_path, capsys):
    out = str(tmp_path / "table")
    assert main(["scan", str(logs / "one.blf"), "--out", out, "--plots", "svg", "--workers", "1"]) == 0
    assert (tmp_path / "table" / "one.svg").stat().st_size > 10_000
    capsys.readouterr()
    assert main(["table", out]) == 0
    told = capsys.readouterr().out
    assert re.search(r"one\s+0.00\s+0.1\s+7500\s+\d+\.\d\s+gta\s+3.50\s+80.00\s+80.00", told)
    assert re.search(r"beyond_range\s+1500 rows\s+20.0%", told)


def test_a_reference_that_is_no_map_is_refused(capsys):
    assert main(["scan", "x.blf", "--out", "t", "--reference", "map", "x.csv"]) == 2
    assert "an OpenDRIVE map (.xodr) was expected" in capsys.readouterr().err


def test_without_matplotlib_plots_are_refused_before_the_first_log(logs, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["scan", str(logs / "one.blf"), "--out", str(tmp_path / "table"), "--plots"]) == 2
    assert "pip install 'vsensor[plots]'" in capsys.readouterr().err
    assert not (tmp_path / "table").exists()


def test_without_polars_one_line_says_how_it_is_installed(logs, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "polars", None)
    assert main(["scan", str(logs / "one.blf"), "--out", str(tmp_path / "table")]) == 2
    told = capsys.readouterr().err
    assert "pip install 'vsensor[parquet]'" in told
    assert len(told.splitlines()) == 1
    assert not (tmp_path / "table").exists()
