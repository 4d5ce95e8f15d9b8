"""The examiner without a browser: P1's functions in closed form, totals, causes, raw signals, decimation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.apps.examined import BEND_PER_M, HIT_M, HIT_S, ROUNDING_M, loaded
from tests.field.made_logs import Drive as Made
from tests.field.made_logs import Road
from tests.field.sensor_logs import record
from vsensor.apps.examine.analysis import (
    error_over_range_m,
    lane_error_m,
    largest_error,
    reported_range_m,
    road_width_m,
)
from vsensor.apps.examine.causes import cause_name, causes_of, stretches
from vsensor.apps.examine.decimate import decimated
from vsensor.apps.examine.drive import load_drive
from vsensor.apps.examine.raw import signal_names, signal_series
from vsensor.apps.examine.totals import LaneChange, clock, lane_changes, totals
from vsensor.errors import ConfigError, LogError
from vsensor.field.scan import ScanOptions
from vsensor.logs import open_log_writer
from vsensor.sinks.trace import TraceSink
from vsensor.types import Side, Unseen


def test_the_road_is_as_wide_as_its_lines_are_apart(drive):
    np.testing.assert_allclose(road_width_m(drive), 3.5, atol=ROUNDING_M)


def test_the_reported_range_is_that_on_the_bus(drive):
    np.testing.assert_allclose(reported_range_m(drive, Side.LEFT), 80.0, atol=0.1)


@pytest.mark.parametrize("range_m", [10.0, 33.0, 50.0])
def test_the_error_at_a_range_is_the_bend_there_in_every_image(drive, range_m):
    error = lane_error_m(drive, Side.LEFT, range_m)
    known = np.isfinite(error) & (np.abs(drive.t_s - HIT_S) > 0.01)
    assert known.sum() > 100
    np.testing.assert_allclose(error[known], BEND_PER_M * range_m**2, atol=ROUNDING_M)
    right = lane_error_m(drive, Side.RIGHT, range_m)
    assert np.nanmax(np.abs(right)) < ROUNDING_M


def test_the_error_over_range_of_one_image_is_its_parabola_up_to_the_reported_range(drive):
    ranges = drive.scanned.work.ranges_m
    error = error_over_range_m(drive, Side.LEFT, 50)
    assert np.isnan(error[ranges > 80]).all()
    np.testing.assert_allclose(error[ranges <= 80], BEND_PER_M * ranges[ranges <= 80] ** 2, atol=ROUNDING_M)


def test_both_functions_agree_where_they_meet(drive):
    place = int(np.flatnonzero(drive.scanned.work.ranges_m == 49.0)[0])
    at_range = lane_error_m(drive, Side.LEFT, 49.0)
    for number in (20, 100, 150):
        assert error_over_range_m(drive, Side.LEFT, number)[place] == at_range[number]


def test_the_largest_error_is_found_with_its_image_and_side(drive):
    found = largest_error(drive, 50.0)
    assert (found.side, found.number) == (Side.LEFT, drive.number_at(HIT_S))
    assert found.error_m == pytest.approx(HIT_M + BEND_PER_M * 50**2, abs=ROUNDING_M)


def test_beyond_what_is_reported_there_is_no_largest_error(drive):
    assert largest_error(drive, 95.0) is None


def test_speed_and_yaw_rate_are_those_of_the_drive(tmp_path):
    arc = Road((400.0, 1 / 250.0, 1 / 250.0))
    drive = loaded(tmp_path, Made(road=arc, seconds=5))
    known = np.isfinite(drive.speed_mps) & (drive.t_s > 0.5) & (drive.t_s < 4.5)
    np.testing.assert_allclose(drive.speed_mps[known], 20.0, atol=0.05)
    np.testing.assert_allclose(drive.yaw_rate_radps[known], 20.0 / 250.0, atol=1e-3)


def test_totals_say_images_duration_distance_and_how_often_lines_are_there(tmp_path):
    made = Made(seconds=10, seen=lambda side, t_s: side is Side.LEFT or t_s < 5.0)
    said = dict(totals(loaded(tmp_path, made)))
    assert said["images"] == "250, lost by their counter 0"
    assert said["duration"] == "0:09.96"
    assert said["distance"] == "0.20 km"
    assert said["left line"] == "reported in 100.0 %"
    assert said["right line"] == "reported in 50.0 %"


def test_an_hour_is_shown_with_hours():
    assert (clock(59.996), clock(61.5), clock(3661.25)) == ("1:00.00", "1:01.50", "1:01:01.25")


@pytest.mark.parametrize(("step_m", "direction"), [(3.5, "left"), (-3.5, "right")])
def test_offsets_that_step_by_a_lane_are_one_lane_change_with_its_direction(tmp_path, step_m, direction):
    def lines(t_s):
        moved = step_m if t_s > 3.0 else 0.0
        return 1.75 + moved, -1.75 + moved

    drive = loaded(tmp_path, Made(seconds=6, lines=lines))
    (change,) = lane_changes(drive)
    assert change == LaneChange(number=drive.number_at(3.04), direction=direction)


def test_around_a_lane_change_there_is_no_error(tmp_path):
    drive = loaded(
        tmp_path, Made(seconds=6, lines=lambda t_s: (1.75 + 3.5 * (t_s > 3), 3.5 * (t_s > 3) - 1.75))
    )
    error = lane_error_m(drive, Side.LEFT, 5.0)
    assert np.isnan(error[np.abs(drive.t_s - 3.04) < 1.9]).all()
    assert np.isfinite(error[(drive.t_s > 0.1) & (drive.t_s < 0.9)]).all()


def test_a_drive_in_one_lane_has_no_lane_change(drive):
    assert lane_changes(drive) == []


def test_a_raw_signal_is_there_under_its_message_with_unit_and_all_frames(drive):
    name = next(name for name in signal_names(drive) if name.startswith("VEH_Motion.") and "peed" in name)
    t_s, values, unit = signal_series(drive, name)
    assert len(t_s) == 10_000 // 12
    factor = {"km/h": 3.6, "m/s": 1.0}[unit]
    np.testing.assert_allclose(values, 20.0 * factor, atol=0.1)


def test_a_signal_that_no_message_has_is_refused(drive):
    with pytest.raises(LogError, match="no profile has a signal Nothing\\.Here"):
        signal_series(drive, "Nothing.Here")


def test_a_log_without_motion_and_one_without_lines_are_refused_in_one_line(tmp_path):
    whole = Made(seconds=2).frames()
    for name, keep, said in (
        ("lanes", lambda frame: 0x320 <= frame.arbitration_id <= 0x32C, "ego.speed_mps not found"),
        (
            "motion",
            lambda frame: not 0x320 <= frame.arbitration_id <= 0x32C,
            "holds no intact frame of LDS_Image|left.offset_m and right.offset_m not found",
        ),
    ):
        path = tmp_path / f"{name}.blf"
        with open_log_writer(path) as writer:
            for frame in filter(keep, whole):
                writer.write(frame, 0)
        with pytest.raises(LogError, match=said):
            load_drive(path, ScanOptions())


def test_a_log_whose_lines_are_never_reported_is_refused(tmp_path):
    with pytest.raises(LogError, match="no line is reported"):
        loaded(tmp_path, Made(seconds=2, seen=lambda side, t_s: False))


def test_reading_tells_how_far_it_is(drive):
    told = []
    load_drive(drive.log, ScanOptions(), told.append)
    assert 0 < told[0] <= told[-1] <= drive.log.stat().st_size
    assert told == sorted(told)


@pytest.fixture(scope="module")
def traced(tmp_path_factory):
    """A run of 2 s with its log and its trace, and the log as the examiner has it."""
    folder = tmp_path_factory.mktemp("traced")
    trace = TraceSink(folder / "run.npz", front_axle_x_m=2.8)
    log = record(folder / "run.blf", seconds=2, sink=trace, start_ns=10**18)
    trace.close()
    return load_drive(log, ScanOptions()), folder / "run.npz"


def test_the_causes_are_those_of_the_trace_image_by_image(traced):
    drive, path = traced
    causes = causes_of(path, drive)
    with np.load(path) as file:
        for side in drive.sides:
            rows = file["side"] == side
            assert causes[side][file["tick"][rows]].tolist() == file["reason_unseen"][rows].tolist()


def test_the_trace_of_another_run_is_refused(traced, drive):
    with pytest.raises(ConfigError, match="is no trace of the run"):
        causes_of(traced[1], drive)


def test_stretches_cover_all_images_and_join_equal_ones():
    values = np.array([0.0, 0.0, np.nan, np.nan, 5.0, 0.0])
    runs = [(run.first, run.last) for run in stretches(values)]
    assert runs == [(0, 1), (2, 3), (4, 4), (5, 5)]
    assert cause_name(Unseen.OCCLUDED) == "occluded"


@given(
    values=st.lists(st.one_of(st.floats(-5, 5), st.just(np.nan)), min_size=1, max_size=400),
    bins=st.integers(1, 20),
)
@settings(max_examples=60)
def test_decimation_keeps_the_least_and_largest_value_and_the_order(values, bins):
    y = np.array(values)
    x = np.arange(len(y), dtype=float)
    kept = decimated(x, y, bins=bins)
    assert (np.diff(kept) > 0).all()
    assert len(kept) <= max(4 * bins, 1)
    if np.isfinite(y).any():
        assert np.nanmin(y[kept]) == np.nanmin(y)
        assert np.nanmax(y[kept]) == np.nanmax(y)


def test_decimation_of_a_part_shows_that_part_with_all_its_points():
    x = np.linspace(0.0, 10.0, 100_001)
    kept = decimated(x, np.sin(x), 2.0, 2.0100001, bins=50)
    assert (x[kept].min(), x[kept].max()) == (pytest.approx(2.0, abs=1e-4), pytest.approx(2.01, abs=1e-4))
    assert len(kept) == 101


def test_a_single_spike_among_a_million_points_is_shown():
    y = np.zeros(1_000_000)
    y[654_321] = 1.0
    assert 654_321 in decimated(np.arange(len(y), dtype=float), y)
