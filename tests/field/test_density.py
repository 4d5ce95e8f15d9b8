"""Density, thin cells with the drives that fill them, and what the error depends on."""

import csv
import sys

import numpy as np
import pytest

from tests.field.made_tables import Law, columns_of, made_table, write_log
from vsensor.cli import main
from vsensor.errors import TableError
from vsensor.field.density import density_of
from vsensor.field.influence import influence_of, principal_components, published_lines, shapley
from vsensor.field.table import open_table
from vsensor.field.thin import filling_drives, thin_cells

LAW = Law(ranges_m=np.array([5.0, 25.0, 45.0, 65.0]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("table")
    made_table(path, LAW, [300.0, 240.0, 180.0], seed=6)
    return path


@pytest.fixture(scope="module")
def found(folder):
    return density_of(open_table([folder]))


def used(folder):
    return open_table([folder]).scan(used_only=True).collect()


def test_every_used_row_is_in_one_sub_cube_and_the_shares_sum_to_one(folder, found):
    assert found.cube.sum() == len(used(folder))
    assert found.share.sum() == pytest.approx(1.0)


def test_the_sub_cubes_hold_what_a_plain_histogram_holds(folder, found):
    rows = used(folder)
    size = np.abs(rows["error_m"].to_numpy()).astype(float)
    speed = rows["speed_mps"].to_numpy()
    plain, _ = np.histogramdd(
        [rows["range_m"].to_numpy(), np.rint(speed), np.minimum(size, found.error_edges_m[-1] * 0.9999)],
        [found.range_edges_m, found.speed_edges_mps, found.error_edges_m],
    )
    # speeds of x.5 and sizes on an edge may fall to either side in float32
    assert np.abs(plain - found.cube).sum() <= 20


def test_the_seconds_of_a_cell_are_those_of_driving(found):
    seen = LAW.seen_s / (LAW.seen_s + LAW.lost_s)
    np.testing.assert_allclose(found.seconds[0].sum(), 720.0 * seen, rtol=0.05)


def test_speeds_without_enough_driving_are_thin_within_the_operating_range_only(found):
    thin = thin_cells(found, 1000.0)
    assert {one.speed_mps for one in thin} == set(np.arange(5.0, 36.0))
    assert thin_cells(found, 1.0) == []
    for one in thin:
        assert one.seconds + one.missing_s == pytest.approx(1000.0)
        np.testing.assert_allclose(one.to_m, LAW.reach_m(one.speed_mps), atol=3.0)


def test_the_drive_at_the_thin_speeds_is_found_with_its_time(found, tmp_path):
    columns = columns_of(np.random.default_rng(7), LAW, 100.0, low=10.0, high=10.0)
    late = columns["t_ns"] - columns["t_ns"][0] > 60e9
    columns["speed_mps"] = np.where(late, 33.0, 10.0)
    write_log(tmp_path, "other", columns)
    thin = [one for one in thin_cells(found, 1e4) if one.speed_mps == 33.0]
    best = filling_drives(open_table([tmp_path]), thin, 1.0)[0]
    assert best.log == "other"
    assert best.from_s == pytest.approx(60.0, abs=0.1)
    assert best.to_s == pytest.approx(100.0, abs=1.0)
    assert 30.0 < best.fills_s <= 40.0


def test_the_command_writes_arrays_tables_and_pictures(folder, tmp_path, capsys):
    assert main(["density", str(folder), "--out", str(tmp_path / "d"), "--quiet"]) == 0
    names = {path.name for path in (tmp_path / "d").iterdir()}
    assert {"density.npz", "cells.csv", "distributions.csv", "thin.csv", "fill.csv"} <= names
    pictures = ("distributions", "error_density", "cube", "blind_spots", "profile")
    assert {f"{name}.png" for name in pictures} <= names
    with (tmp_path / "d" / "cells.csv").open() as file:
        cells = list(csv.DictReader(file))
    with np.load(tmp_path / "d" / "density.npz") as arrays:
        assert sum(int(cell["rows"]) for cell in cells) == arrays["rows"].sum()
        assert arrays["share"].sum() == pytest.approx(1.0)
    assert "drives that have most of it" in capsys.readouterr().out


def test_without_matplotlib_density_says_so_before_it_counts(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.setattr("vsensor.field.density.density_of", None)  # nobody gets so far
    assert main(["density", str(folder), "--out", str(tmp_path / "d"), "--quiet"]) == 2
    told = capsys.readouterr().err
    assert "--no-pictures" in told
    assert "pip install 'vsensor[plots]'" in told


def test_a_stretch_whose_speed_is_unknown_for_a_moment_has_its_speeds(found, tmp_path):
    columns = columns_of(np.random.default_rng(7), LAW, 30.0, low=33.0, high=33.0)
    since_s = (columns["t_ns"] - columns["t_ns"][0]) / 1e9
    columns["speed_mps"] = np.where((since_s > 10.0) & (since_s < 11.0), np.nan, columns["speed_mps"])
    write_log(tmp_path, "other", columns)
    thin = [one for one in thin_cells(found, 1e4) if one.speed_mps == 33.0]
    (stretch,) = filling_drives(open_table([tmp_path]), thin, 1.0)
    assert (stretch.speed_low_mps, stretch.speed_high_mps) == pytest.approx((33.0, 33.0), abs=0.1)


def test_a_pause_of_a_log_is_in_no_stretch(found, tmp_path):
    columns = columns_of(np.random.default_rng(7), LAW, 30.0, low=33.0, high=33.0)
    late = columns["t_ns"] - columns["t_ns"][0] > 10e9
    columns["t_ns"] = columns["t_ns"] + late * 3600 * 10**9
    write_log(tmp_path, "other", columns)
    thin = [one for one in thin_cells(found, 1e4) if one.speed_mps == 33.0]
    best = filling_drives(open_table([tmp_path]), thin, 1.0)
    assert [(round(one.from_s), round(one.to_s)) for one in best] == [(3610, 3630), (0, 10)]


# --- influence --------------------------------------------------------------------------------------------


def test_range_and_speed_explain_the_error_and_noise_explains_nothing(folder):
    found = {one.dimension: one for one in influence_of(open_table([folder])).influences}
    for name in ("yaw_rate_radps", "curvature_per_m", "acceleration_mps2"):
        assert found[name].shared[0] < 0.01
    value, low, high = found["range_m"].shared
    assert 0.05 < low < value < high
    assert found["speed_mps"].shared[1] > found["acceleration_mps2"].shared[2]


def test_no_unit_changes_what_explains_the_error(folder, tmp_path):
    from tests.field.made_tables import write_log as write

    for k, file in enumerate(sorted(folder.iterdir())):
        frame = open_table([file]).scan().collect()
        columns = {name: frame[name].to_numpy() for name in frame.columns if name not in ("log", "masked")}
        columns["masked"] = frame["masked"].to_physical().to_numpy()
        columns["speed_mps"] = columns["speed_mps"] * 3.6
        write(tmp_path, f"drive_{k}", columns)
    one, other = (influence_of(open_table([place])) for place in (folder, tmp_path))
    for a, b in zip(one.influences, other.influences, strict=True):
        np.testing.assert_allclose(a.shared, b.shared, atol=1e-9)


def test_the_published_table_gives_the_variances_of_the_inputs_in_their_units(folder):
    rows = used(folder)
    found = influence_of(open_table([folder]))
    first = found.components[0]
    assert first.dimension == "range_m"
    assert first.variance >= rows["range_m"].to_numpy().astype(float).var()
    assert sum(one.share for one in found.components) == pytest.approx(1.0)
    assert published_lines(found)[1].startswith("Range")


def test_independent_inputs_are_their_own_principal_components():
    random = np.random.default_rng(1)
    stds = {"range_m": 25.0, "speed_mps": 6.0, "acceleration_mps2": 0.4, "yaw_rate_radps": 0.01}
    columns = {name: std * random.standard_normal(200_000) for name, std in stds.items()}
    columns |= {"night": np.zeros(200_000), "rain": np.full(200_000, np.nan)}
    found = {one.dimension: one.variance for one in principal_components(columns)}
    for name, std in stds.items():
        np.testing.assert_allclose(found[name], std**2, rtol=0.02)
    assert found["rain"] == pytest.approx(0.0, abs=1e-12)


def test_shapley_values_share_what_two_equal_inputs_explain_together():
    rho = np.array([[1.0, 1.0, 0.0, 0.6], [1.0, 1.0, 0.0, 0.6], [0.0, 0.0, 1.0, 0.3], [0.6, 0.6, 0.3, 1.0]])
    np.testing.assert_allclose(shapley(rho), [0.18, 0.18, 0.09], atol=1e-6)


def test_a_log_that_was_interrupted_for_years_has_the_blocks_that_it_has(tmp_path):
    columns = columns_of(np.random.default_rng(7), LAW, 180.0)
    late = columns["t_ns"] - columns["t_ns"][0] > 90e9
    columns["t_ns"] = columns["t_ns"] + late * (40 * 365 * 86_400 * 10**9)
    write_log(tmp_path, "other", columns)
    found = influence_of(open_table([tmp_path]))
    assert found.units == 4
    assert found.rows > 10_000


def test_one_block_alone_gives_no_interval_and_is_refused(tmp_path):
    table = made_table(tmp_path, LAW, [30.0])
    with pytest.raises(TableError, match="no interval"):
        influence_of(table)


def test_the_command_prints_both_tables(folder, capsys):
    assert main(["influence", str(folder), "--as-published", "--quiet"]) == 0
    told = capsys.readouterr().out
    assert "Explanation (%)" in told
    assert "together" in told
