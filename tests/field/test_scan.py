"""What a scan finds in logs whose errors are known: closed forms first."""

import math
import re

import numpy as np
import polars
import pytest

from tests.field.made_logs import RAV4_STEP_DEGPS, Drive, Road, write_lines
from tests.shared import SHARED_DATA, needs_shared
from vsensor.cli import main
from vsensor.field.scan import ScanOptions, scan_log
from vsensor.field.table import open_table
from vsensor.logs import open_log_writer
from vsensor.types import Side

ROUNDING_M = 0.01
"""What the native bus adds at most at 80 m."""
HONDA = SHARED_DATA / "dbc" / "honda_bosch_lane_lines_extract.dbc"
ARC = Road((700.0, 1 / 250.0, 1 / 250.0))
WINDING = Road(
    (150.0, 0.0, 0.0),
    (60.0, 0.0, 1 / 250),
    (260.0, 1 / 250, 1 / 250),
    (60.0, 1 / 250, 0.0),
    (300.0, 0.0, 0.0),
)


def weaving(t_s):
    return 0.2 * np.sin(2.0 * np.pi * t_s / 9.0)


def swaying(t_s):
    return 0.5 * np.sin(2.0 * np.pi * t_s / 20.0)


def scanned(folder, drive, log_id="drive", limits=None, **options):
    """Write the drive's log, scan it; return the rows as a polars frame and the metadata."""
    log = drive.write(folder / f"{log_id}.blf")
    if limits is not None:
        (folder / "limits.toml").write_text('schema = "vsensor.scan/1"\n' + limits)
        options["limits"] = str(folder / "limits.toml")
    info = scan_log(log, log_id, folder / "table", ScanOptions(**options))
    return open_table([folder / "table"]).scan().collect(), info


def used(rows):
    return rows.filter((polars.col("masked") == "") & polars.col("error_m").is_not_null())


def by_range(rows, statistic):
    """Return ranges and a statistic of the error at each."""
    found = used(rows).group_by("range_m").agg(statistic.alias("figure")).sort("range_m")
    return found["range_m"].to_numpy(), found["figure"].to_numpy()


ERROR = polars.col("error_m")


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A straight road, driven for 12 s with the pose in the log, no error."""
    return scanned(tmp_path_factory.mktemp("plain"), Drive(seconds=12, beside=weaving, pose=True))


def test_a_straight_drive_without_errors_has_none_but_the_bus_rounding(plain):
    rows, _ = plain
    assert used(rows)["error_m"].abs().max() < ROUNDING_M


def test_there_is_a_row_for_each_image_side_and_range_in_that_order(plain):
    rows, info = plain
    assert rows.select("t_ns", "side", "range_m").equals(
        rows.select("t_ns", "side", "range_m").sort("t_ns", "side", "range_m")
    )
    assert len(rows) == info["rows"] == 300 * 2 * 50
    assert rows["range_m"].unique().sort().to_list() == [1.0 + 2.0 * k for k in range(50)]


def test_rows_beyond_the_reported_range_have_no_error_and_say_so(plain):
    rows, _ = plain
    far = rows.filter(polars.col("range_m") > 80.0)
    assert set(far["masked"].to_list()) == {"beyond_range"}
    assert far["error_m"].null_count() == len(far)


def test_rows_whose_reference_lies_beyond_the_end_of_the_drive_are_a_gap(plain):
    rows, _ = plain
    last = rows.filter((polars.col("t_ns") > 11_500_000_000) & polars.col("range_m").is_between(20, 80))
    assert set(last["masked"].to_list()) == {"reference_gap"}
    assert last["error_m"].null_count() == len(last)


def test_the_metadata_say_lane_width_and_range(plain):
    _, info = plain
    assert info["width_m"][1] == pytest.approx(3.5, abs=0.01)
    assert info["sides"]["left"]["x_max_m"] == [80.0, 80.0, 80.0]
    assert info["profile"] == ["native", "vehicle"]


@pytest.mark.parametrize("side", [Side.LEFT, Side.RIGHT])
def test_a_bent_report_on_a_straight_road_has_its_bend_as_error(tmp_path, side):
    bend_per_m = 1e-4

    def error(reported, t_s, x_m):
        return bend_per_m * x_m**2 if reported is side else np.zeros_like(x_m)

    drive = Drive(seconds=8, error=error)
    rows, _ = scanned(tmp_path, drive, limits="yaw_rate_offset_degps = 0.0\n")
    x, mean = by_range(rows.filter(polars.col("side") == int(side)), ERROR.mean())
    np.testing.assert_allclose(mean, bend_per_m * x**2, atol=ROUNDING_M)
    assert used(rows.filter(polars.col("side") != int(side)))["error_m"].abs().max() < ROUNDING_M


def test_on_an_arc_a_shifted_report_has_its_shift_along_the_lines_normal_as_error(tmp_path):
    radius, shift = 250.0, 0.3
    reference = write_lines(tmp_path / "lines.csv", ARC, every=2)
    drive = Drive(road=ARC, seconds=8, error=lambda side, t_s, x: np.full_like(x, shift), pose=True)
    left, _ = scanned(tmp_path, drive, reference=str(reference))
    x, mean = by_range(left.filter(polars.col("side") == 0), ERROR.mean())
    inner = radius - 1.75
    exact = shift * np.cos(np.arcsin(x / inner))  # the shift is along y, the error across the line
    misfit = 0.012  # of a cubic through 80 m of an arc of R = 250 m
    np.testing.assert_allclose(mean, exact, atol=ROUNDING_M + misfit)


def test_a_line_file_finds_the_shift_that_the_driven_path_cannot_see(tmp_path):
    drive = Drive(seconds=8, error=lambda side, t_s, x: np.full_like(x, 0.2), pose=True)
    reference = write_lines(tmp_path / "lines.csv", drive.road)
    found, _ = scanned(tmp_path, drive, reference=str(reference))
    _, mean = by_range(found, ERROR.mean())
    np.testing.assert_allclose(mean, 0.2, atol=ROUNDING_M)
    by_path, _ = scanned(tmp_path, drive)
    assert used(by_path)["error_m"].abs().max() < ROUNDING_M


def test_without_a_pose_a_line_file_is_taken_from_where_the_motion_begins(tmp_path):
    drive = Drive(seconds=6, start_m=10.0, error=lambda side, t_s, x: np.full_like(x, 0.2))
    reference = tmp_path / "lines.csv"
    reference.write_text("side,x_m,y_m\nleft,-10,1.75\nleft,500,1.75\nright,-10,-1.75\nright,500,-1.75\n")
    rows, info = scanned(tmp_path, drive, reference=str(reference), limits="yaw_rate_offset_degps = 0.0\n")
    _, mean = by_range(rows, ERROR.mean())
    np.testing.assert_allclose(mean, 0.2, atol=ROUNDING_M)
    assert "by dead reckoning" in " ".join(info["notes"])


@needs_shared
def test_a_profile_with_origin_at_the_camera_angles_and_no_cubic_gives_the_same_errors(tmp_path):
    drive = Drive(seconds=8, profile="honda", dbc=HONDA, order=2, beside=weaving, pose=True)
    drive.error = lambda side, t_s, x: np.full_like(x, 0.2)
    reference = write_lines(tmp_path / "lines.csv", drive.road)
    options = {"profiles": ("honda", "vehicle"), "dbc": str(HONDA)}
    rows, info = scanned(tmp_path, drive, reference=str(reference), **options)
    x, mean = by_range(rows, ERROR.mean())
    np.testing.assert_allclose(mean, 0.2, atol=0.02)  # its step of 0.5 mrad is 4 cm at 80 m, to either side
    assert x[-1] == 79.0
    assert info["profile"] == ["honda", "vehicle"]


# ---- the vehicle, and what is ahead of it -----------------------------------------------------------


def test_curvature_and_future_yaw_rate_are_those_where_the_vehicle_comes_to_the_range(tmp_path):
    road = Road((120.0, 0.0, 0.0), (400.0, 1 / 200, 1 / 200))
    drive = Drive(road=road, seconds=16, start_m=10.0)
    rows, _ = scanned(tmp_path, drive, limits="yaw_rate_offset_degps = 0.0\n")
    early = rows.filter(polars.col("t_ns") == 1_000_000_000).filter(polars.col("side") == 0)  # at 30 m
    far = early.filter(polars.col("range_m") > 100.0 - 1.0 - 2.0)
    near = early.filter(polars.col("range_m") < 80.0)
    assert far["curvature_per_m"].to_list() == pytest.approx([1 / 200], rel=0.02)
    assert far["future_yaw_rate_radps"].to_list() == pytest.approx([20.0 / 200], rel=0.02)
    assert near["curvature_per_m"].abs().max() < 1e-5
    assert near["future_yaw_rate_radps"].abs().max() < 1e-3
    assert early["yaw_rate_radps"].abs().max() < 1e-4
    assert early["speed_mps"].to_list() == pytest.approx([20.0] * 50, abs=0.01)
    end = rows.filter(polars.col("t_ns") > 15_900_000_000)
    assert end["future_yaw_rate_radps"].null_count() > 0.9 * len(end)


@needs_shared
def test_night_and_rain_come_from_the_vehicle_where_the_sensor_says_nothing(tmp_path):
    drive = Drive(seconds=3, profile="honda", dbc=HONDA, body={"wiper": 2.0, "light": 2.0})
    rows, _ = scanned(tmp_path, drive, profiles=("honda", "vehicle"), dbc=str(HONDA))
    late = rows.filter(polars.col("t_ns") > 200_000_000)
    assert late["night"].to_list() == [True] * len(late)
    assert set(late["rain"].to_list()) == {0.5}


# ---- the yaw rate -----------------------------------------------------------------------------------


def test_a_yaw_rate_offset_is_found_on_a_road_that_bends_one_way_only(tmp_path):
    drive = Drive(road=Road((1000.0, 1 / 1500, 1 / 1500)), seconds=30, yaw_offset_degps=-0.41, beside=weaving)
    rows, info = scanned(tmp_path, drive)
    (told,) = re.findall(r"yaw-rate offset (\S+) deg/s removed", " ".join(info["notes"]))
    assert float(told) == pytest.approx(-0.41, abs=0.005)
    assert used(rows)["error_m"].abs().max() < 0.03


@pytest.mark.parametrize(("what", "bound_m"), [("straight", 0.02), ("bend", 0.05)])
def test_with_the_noisy_coarse_yaw_rate_of_a_car_the_path_is_good_to_30_m(coarse, what, bound_m):
    difference = coarse.filter(
        polars.col("curvature_per_m").abs() < 1e-4
        if what == "straight"
        else polars.col("curvature_per_m").abs() > 0.0035
    ).filter(polars.col("range_m") <= 30.0)
    by_x = difference.group_by("range_m").agg(polars.col("added_m").std())
    assert len(by_x) == 15
    assert by_x["added_m"].max() < bound_m
    assert abs(difference["added_m"].mean()) < bound_m


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """Errors against the path less those against the true lines, of the same log: what the path adds."""
    folder = tmp_path_factory.mktemp("coarse")
    drive = Drive(
        road=WINDING,
        seconds=36,
        beside=weaving,
        x_max_m=40.0,  # so far a cubic is the line to 2 mm in these bends: what is left is the path's
        pose=True,
        yaw_step_degps=RAV4_STEP_DEGPS,
        yaw_noise_degps=0.12,
        yaw_offset_degps=-0.41,
        jitter_ns=4e6,
    )
    by_path, _ = scanned(folder, drive)
    by_line, _ = scanned(folder, drive, reference=str(write_lines(folder / "lines.csv", WINDING)))
    keys = ["t_ns", "side", "range_m"]
    both = used(by_path).join(used(by_line).select(*keys, polars.col("error_m").alias("true_m")), on=keys)
    return both.with_columns((polars.col("error_m") - polars.col("true_m")).alias("added_m"))


def test_a_coarse_yaw_rate_without_noise_is_told_with_what_half_a_step_costs(tmp_path):
    drive = Drive(road=ARC, seconds=10, yaw_step_degps=RAV4_STEP_DEGPS, beside=swaying)
    _, info = scanned(tmp_path, drive)
    told = " ".join(info["notes"])
    assert "steps of 0.24" in told
    half_a_step_m = math.radians(RAV4_STEP_DEGPS) / 2 * 100.0**2 / 2 / 20.0
    assert half_a_step_m == pytest.approx(0.53, abs=0.005)
    assert "up to 0.5" in told
    assert "100 m at 20 m/s" in told


def test_noise_of_half_a_step_is_no_trouble_and_not_told(tmp_path):
    drive = Drive(road=ARC, seconds=10, yaw_step_degps=RAV4_STEP_DEGPS, yaw_noise_degps=0.12)
    _, info = scanned(tmp_path, drive)
    assert "steps of" not in " ".join(info["notes"])


@needs_shared
def test_the_offset_of_a_real_cars_yaw_rate_is_found_from_16_s_of_its_drive(tmp_path):
    log, dbc = (
        SHARED_DATA / "can" / "rav4_drive.log",
        SHARED_DATA / "dbc" / "toyota_rav4_2017_pt_generated.dbc",
    )
    (tmp_path / "car.toml").write_text(
        f'schema = "vsensor.scenario/1"\nsource = "{log}"\n[drive]\nprofile = ["toyota_rav4"]\n'
        f'dbc = "{dbc}"\n[error_model]\nmode = "none"\n[camera]\nmodel = "none"\n'
    )
    laid_over, scenario = tmp_path / "drive.blf", tmp_path / "car.toml"
    words = ["replay", str(log), "--overlay", str(scenario), "--as-fast-as-possible", "--stop", "16"]
    assert main([*words, "--log", str(laid_over), "--quiet"]) == 0
    options = ScanOptions(profiles=("native", "toyota_rav4"), dbc=str(dbc))
    info = scan_log(laid_over, "drive", tmp_path / "table", options)
    (told,) = re.findall(r"yaw-rate offset (\S+) deg/s removed", " ".join(info["notes"]))
    assert float(told) == pytest.approx(-0.41, abs=0.02)  # data/SOURCES.md of the shared data
    error = used(open_table([tmp_path / "table"]).scan().collect())["error_m"].abs()
    assert error.quantile(0.95) < 0.06


# ---- when an image was taken --------------------------------------------------------------------------


@pytest.mark.parametrize("limits", ["latency_ms = 120.0\n", 'image_clock = "sensor"\n'])
def test_what_is_known_of_the_latency_is_taken_off(tmp_path, limits):
    def swinging(t_s):
        return 0.5 * np.sin(2.0 * np.pi * t_s / 6.0)

    drive = Drive(seconds=8, latency_ns=120_000_000, beside=swinging)
    far = (polars.col("t_ns") > 500_000_000) & (polars.col("range_m") == 51.0)
    late, _ = scanned(tmp_path, drive, limits="yaw_rate_offset_degps = 0.0\n")
    right, _ = scanned(tmp_path, drive, limits="yaw_rate_offset_degps = 0.0\n" + limits)
    turned = 0.12 * 0.5 * (2.0 * np.pi / 6.0) ** 2 / 20.0  # rad, at most, in the 0.12 s of the latency
    assert used(late.filter(far))["error_m"].abs().max() == pytest.approx(51.0 * turned, rel=0.2)
    assert used(right.filter(far))["error_m"].abs().max() < 0.02


def test_delays_on_the_bus_are_taken_out_by_the_images_time_stamp(tmp_path):
    frames = Drive(seconds=8, beside=weaving).frames()
    random = np.random.default_rng(5)
    delays = random.integers(0, 15_000_000, 400)
    with open_log_writer(tmp_path / "drive.blf") as writer:
        for frame in frames:
            is_lane = frame.arbitration_id >= 0x300
            writer.write(frame, int(delays[frame.due_ns // 40_000_000]) if is_lane else 0)
    scan_log(tmp_path / "drive.blf", "drive", tmp_path / "table", ScanOptions())
    times = open_table([tmp_path / "table"]).scan().select("t_ns").unique().collect()["t_ns"].sort()
    np.testing.assert_allclose(np.diff(times.to_numpy()), 40_000_000, atol=1_000_000)  # its time stamp's ms
