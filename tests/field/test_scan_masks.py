"""What a scan leaves out, and why."""

import numpy as np
import polars
import pytest

from tests.field.made_logs import HALF_LANE_M, Drive, Road
from tests.field.test_scan import ROUNDING_M, scanned, used
from vsensor.field.scan import ScanOptions, scan_log
from vsensor.field.table import open_table
from vsensor.logs import iter_frames, open_log_writer
from vsensor.profile import load_profile
from vsensor.types import SensorMode, Side

LONG = Road((700.0, 0.0, 0.0))


def masks(rows, *where):
    return set(rows.filter(*where)["masked"].to_list())


def at(low_s, high_s):
    return polars.col("t_ns").is_between(int(low_s * 1e9), int(high_s * 1e9))


def changing(t_s):
    """Return the lane change of 4 s from one lane's middle to that of the one to the left, from 8 s on."""
    part = np.clip((t_s - 8.0) / 4.0, 0.0, 1.0)
    return 3.5 * (part - np.sin(2.0 * np.pi * part) / (2.0 * np.pi))


def lines_of_own_lane(t_s):
    """Return the lines' offsets: those of the lane to the left from half the change on."""
    lane = 3.5 if t_s >= 10.0 else 0.0
    return lane + HALF_LANE_M, lane - HALF_LANE_M


@pytest.fixture(scope="module")
def change(tmp_path_factory):
    drive = Drive(road=LONG, seconds=22, beside=changing, lines=lines_of_own_lane)
    limits = "lane_change_s = 1.0\nyaw_rate_offset_degps = 0.0\n"
    rows, _ = scanned(tmp_path_factory.mktemp("change"), drive, limits=limits)
    return rows


def test_a_lane_change_leaves_no_error_in_the_rows_that_are_used(change):
    assert used(change)["error_m"].abs().max() < 2 * ROUNDING_M


def test_images_around_a_lane_change_are_left_out_as_a_whole(change):
    assert masks(change, at(9.1, 10.9)) == {"lane_change"}
    near = polars.col("range_m") < 15.0
    assert masks(change, at(6.0, 8.5), near) == {""}
    assert masks(change, at(11.1, 14.0), near) == {""}


def test_polynomials_from_before_a_lane_change_are_left_out_where_they_reach_beyond_it(change):
    before = at(7.9, 8.1)  # the change is 38 to 42 m ahead
    assert masks(change, before, polars.col("range_m") < 37.0) == {""}
    assert masks(change, before, polars.col("range_m").is_between(43.0, 79.0)) == {"lane_change"}


def test_a_line_that_jumps_on_one_side_is_masked_on_that_side_only(tmp_path):
    drive = Drive(road=LONG, seconds=12, lines=lambda t_s: (1.75 if t_s < 6.0 else 3.0, -1.75))
    rows, _ = scanned(tmp_path, drive, limits="lane_change_s = 1.0\nyaw_rate_offset_degps = 0.0\n")
    assert masks(rows, at(5.2, 6.8), polars.col("side") == 0) == {"lane_change"}
    assert "lane_change" not in masks(rows, polars.col("side") == 1)
    assert used(rows)["error_m"].abs().max() < 2 * ROUNDING_M


def test_below_the_least_speed_rows_are_masked_and_make_no_reference(tmp_path):
    def speed(t_s):
        return np.where(t_s < 5.0, 20.0, np.where(t_s < 10.0, 3.0, 20.0))

    rows, _ = scanned(tmp_path, Drive(road=LONG, seconds=16, speed_mps=speed))
    assert masks(rows, at(5.3, 9.7)) == {"low_speed"}
    assert masks(rows, at(4.0, 4.5), polars.col("range_m").is_between(10.0, 20.0)) <= {"", "reference_gap"}


def test_where_the_line_is_lost_there_is_one_row_without_a_range(tmp_path):
    def seen(side, t_s):
        return not (side is Side.LEFT and 3.0 <= t_s < 6.0)

    rows, info = scanned(tmp_path, Drive(road=LONG, seconds=12, seen=seen))
    lost = rows.filter(at(3.1, 5.9), polars.col("side") == 0)
    assert masks(lost) == {"no_line"}
    assert len(lost) == lost["t_ns"].n_unique()
    assert lost.select("range_m", "error_m", "x_max_m").null_count().row(0) == (len(lost),) * 3
    assert set(lost["quality"].to_list()) == {0}
    assert info["sides"]["left"]["reported"] == pytest.approx(0.75, abs=0.01)


def test_a_long_loss_is_a_gap_of_the_reference_for_images_before_it(tmp_path):
    def seen(side, t_s):
        return not 5.0 <= t_s < 7.0  # 40 m

    rows, _ = scanned(tmp_path, Drive(road=LONG, seconds=14, seen=seen))
    before = at(3.9, 4.1)  # 20 m before the gap
    assert masks(rows, before, polars.col("range_m") < 17.0) == {""}
    assert masks(rows, before, polars.col("range_m").is_between(24.0, 56.0)) == {"reference_gap"}
    assert masks(rows, before, polars.col("range_m").is_between(64.0, 79.0)) == {""}


def test_a_restart_of_the_sensor_is_a_reset_for_a_while(tmp_path):
    def mode(t_s):
        return SensorMode.INIT if 4.0 <= t_s < 5.0 else SensorMode.AVAILABLE

    drive = Drive(road=LONG, seconds=12, mode=mode)
    rows, _ = scanned(tmp_path, drive, limits="reset_s = 1.5\n")
    assert masks(rows, at(4.1, 4.9)) == {"no_line"}
    assert masks(rows, at(5.1, 6.4)) == {"reset"}
    assert masks(rows, at(6.6, 7.0), polars.col("range_m") < 60.0) == {""}


def test_an_image_of_which_a_frame_is_missing_is_invalid(tmp_path):
    log = Drive(road=LONG, seconds=6).write(tmp_path / "whole.blf")
    frames = list(iter_frames(log))
    messages = {plan.layout.name: plan.layout.arbitration_id for plan in load_profile("native").messages}
    curve = [k for k, frame in enumerate(frames) if frame.arbitration_id == messages["LDS_LeftCurve"]]
    gone = set(curve[50:60])
    with open_log_writer(tmp_path / "drive.blf") as writer:
        for k, frame in enumerate(frames):
            if k not in gone:
                writer.write(frame, 0)
    rows, _ = _scan(tmp_path)
    low, high = (frames[curve[k]].due_ns / 1e9 for k in (50, 59))
    inside = at(low - 0.01, high + 0.01)
    assert masks(rows, inside, polars.col("side") == 0) == {"invalid"}
    assert "invalid" not in masks(rows, polars.col("side") == 1)


def test_a_clock_that_jumps_back_is_counted_on_and_nothing_is_compared_across_the_jump(tmp_path):
    frames = Drive(road=LONG, seconds=12).frames()
    with open_log_writer(tmp_path / "drive.blf") as writer:
        for frame in frames:
            writer.write(frame, 0 if frame.due_ns < 6_000_000_000 else -3_000_000_000)
    rows, info = _scan(tmp_path)
    assert "jumps back 1 times, first by 2.9" in " ".join(info["notes"])
    assert rows["t_ns"].is_sorted()
    assert masks(rows, at(6.1, 7.9)) == {"reset"}
    across = rows.filter(at(5.0, 5.2), polars.col("range_m").is_between(24.0, 79.0))
    assert masks(across) == {"lane_change", "reference_gap"}  # another line, as far as anybody knows
    assert used(rows)["error_m"].abs().max() < 2 * ROUNDING_M


def test_a_clock_that_jumps_ahead_by_years_is_counted_on_likewise(tmp_path):
    frames = Drive(road=LONG, seconds=12).frames()
    with open_log_writer(tmp_path / "drive.blf") as writer:
        for frame in frames:
            writer.write(frame, 0 if frame.due_ns < 6_000_000_000 else 1_700_000_000 * 10**9)
    rows, info = _scan(tmp_path)
    assert "jumps ahead 1 times, first by 1700000000.0" in " ".join(info["notes"])
    assert "at 5.988 s" in " ".join(info["notes"])
    assert rows["t_ns"].is_sorted()
    assert masks(rows, at(6.1, 7.9)) == {"reset"}
    assert info["seconds"] == pytest.approx(12.0, abs=0.1)
    assert used(rows)["error_m"].abs().max() < 2 * ROUNDING_M


def test_a_silence_of_the_vehicle_is_told_and_left_out(tmp_path):
    frames = Drive(road=LONG, seconds=14).frames()
    with open_log_writer(tmp_path / "drive.blf") as writer:
        for frame in frames:
            if not (frame.arbitration_id == 0x100 and 5e9 < frame.due_ns < 8e9):
                writer.write(frame, 0)
    rows, info = _scan(tmp_path)
    assert "vehicle signals silent" in " ".join(info["notes"])
    assert masks(rows, at(5.1, 9.9)) == {"reset"}
    assert rows.filter(at(5.1, 7.9))["speed_mps"].null_count() == len(rows.filter(at(5.1, 7.9)))


def _scan(folder):
    info = scan_log(folder / "drive.blf", "drive", folder / "table", ScanOptions())
    return open_table([folder / "table"]).scan().collect(), info


def test_a_log_of_which_nothing_can_be_used_says_why(tmp_path):
    rows, info = scanned(tmp_path, Drive(road=LONG, seconds=3, speed_mps=2.0))
    assert len(used(rows)) == 0
    assert info["notes"][-1] == f"none of its rows can be used: low_speed {len(rows)}"
