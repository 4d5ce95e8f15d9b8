"""Rows of lane offsets: what they say of an estimate, and their files."""

import math

import numpy as np
import pytest

from vsensor.errors import ConfigError, TableError
from vsensor.signals import VehicleConfig
from vsensor.types import Boundary, Colour, LaneEstimate, MarkingKind, Side, frozen
from vsensor.video.rows import COLUMNS, read_rows, require_writable, rows_from, rows_of, write_rows

VEHICLE = VehicleConfig(wheelbase_m=3.0)


def line(side, *coefficients, x_min_m=3.0, width_m=0.2, quality=3):
    return Boundary(
        side=side,
        coefficients=frozen(coefficients),
        covariance=frozen(np.zeros((len(coefficients),) * 2)),
        x_min_m=x_min_m,
        x_max_m=60.0,
        quality=quality,
        kind=MarkingKind.SOLID,
        colour=Colour.WHITE,
        width_m=width_m,
        measured=True,
        marking=-1,
        points=-1,
    )


def estimate(*lines, t_ns=40_000_000):
    return LaneEstimate(exposed_at_ns=t_ns, image_index=1, boundaries=lines)


def test_offsets_are_to_the_inner_edges_at_the_front_axle_left_positive():
    rows = rows_of(VEHICLE, [estimate(line(Side.LEFT, 1.8), line(Side.RIGHT, -1.7))])
    np.testing.assert_allclose(
        [rows.t_s[0], rows.left_offset_m[0], rows.right_offset_m[0], rows.lane_width_m[0]],
        [0.04, 1.7, -1.6, 3.3],
    )


def test_the_heading_is_that_of_the_lines_at_the_front_axle():
    bent = (1.0, 0.02, 0.001)
    rows = rows_of(VEHICLE, [estimate(line(Side.LEFT, *bent))])
    assert rows.heading_rad[0] == pytest.approx(math.atan(0.02 + 2 * 0.001 * 3.0))


def test_a_line_that_is_not_there_is_nan_with_confidence_0():
    rows = rows_of(VEHICLE, [estimate(line(Side.LEFT, 1.8, quality=4)), estimate()])
    assert np.isnan(rows.right_offset_m).all()
    assert np.isnan(rows.lane_width_m).all()
    np.testing.assert_array_equal(rows.left_confidence, [4, 0])
    np.testing.assert_array_equal(rows.right_confidence, [0, 0])
    assert np.isnan(rows.heading_rad[1])


def test_a_line_seen_only_far_ahead_says_nothing_of_the_offset():
    rows = rows_of(VEHICLE, [estimate(line(Side.LEFT, 1.8, x_min_m=23.5))])
    assert np.isnan(rows.left_offset_m[0])
    assert rows.left_confidence[0] == 0


SOME = rows_from([(0.0, 1.5, -1.25, 2.75, 0.01, 3, 2), (0.1, math.nan, -1.2, math.nan, -0.02, 0, 4)])


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_what_is_written_is_read_again(tmp_path, suffix):
    path = tmp_path / f"rows{suffix}"
    write_rows(path, SOME)
    found = read_rows(path)
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(found, name), getattr(SOME, name))


def test_in_a_csv_nothing_is_an_empty_place(tmp_path):
    write_rows(tmp_path / "rows.csv", SOME)
    lines = (tmp_path / "rows.csv").read_text().splitlines()
    assert lines[0] == ",".join(COLUMNS)
    assert lines[2] == "0.1,,-1.2,,-0.02,0,4"


def test_in_parquet_nothing_is_null(tmp_path):
    import polars

    write_rows(tmp_path / "rows.parquet", SOME)
    frame = polars.read_parquet(tmp_path / "rows.parquet")
    assert frame["left_offset_m"].to_list() == [1.5, None]
    assert frame["left_confidence"].to_list() == [3, 0]


def test_a_column_of_nothing_is_still_one_of_numbers(tmp_path):
    import polars

    write_rows(tmp_path / "rows.parquet", rows_from([(0.0, *[math.nan] * 4, 0, 0)]))
    assert polars.read_parquet(tmp_path / "rows.parquet")["lane_width_m"].dtype == polars.Float64


def test_another_program_reads_the_mf4(tmp_path):
    from asammdf import MDF

    write_rows(tmp_path / "rows.mf4", SOME)
    with MDF(tmp_path / "rows.mf4") as file:
        signal = file.get("left_offset_m")
        np.testing.assert_array_equal(signal.samples, SOME.left_offset_m)
        np.testing.assert_array_equal(signal.timestamps, SOME.t_s)
        assert signal.unit == "m"
        assert {"right_offset_m", "heading_rad", "right_confidence"} <= set(file.channels_db)


@pytest.mark.parametrize(
    ("name", "said"), [("rows.xlsx", r"\.parquet, \.csv, \.mf4"), ("no/rows.csv", "no folder")]
)
def test_a_file_that_cannot_be_written_is_refused_before(tmp_path, name, said):
    with pytest.raises(ConfigError, match=said):
        require_writable(tmp_path / name)


def test_a_table_of_something_else_is_refused_by_its_columns(tmp_path):
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(TableError, match=r"other\.csv: has no column t_s"):
        read_rows(tmp_path / "other.csv")
