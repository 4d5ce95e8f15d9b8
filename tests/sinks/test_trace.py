"""The trace: what a row says, and that a file comes back as it was written or is refused."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.outputs import Drawn, circle, ego_at, four_lines, output_of, straight
from tests.roads import box
from tests.roads import straight as road_line
from tests.truths import output_at
from vsensor.camera import Camera, CameraConfig
from vsensor.errors import ConfigError
from vsensor.sinks.trace import TraceSink, read_trace, rows
from vsensor.sinks.trace_file import COLUMNS, ROW, read_trace_and_metadata
from vsensor.types import SIDE_NAMES, Environment, Light, MarkingKind, Side, Unseen

AXLE_M = 2.8
P3 = ("offset_m", "heading_rad", "curvature_per_m", "curvature_rate_per_m2")
SUFFIXES = [".npz", ".csv", ".parquet"]


def written(path, outputs, **metadata):
    """Write the outputs to a trace and return its path."""
    sink = TraceSink(path, front_axle_x_m=AXLE_M, metadata=metadata)
    for output in outputs:
        sink.write(output)
    sink.close()
    return path


def traced(tmp_path, *outputs):
    """Return the trace of the outputs, read back."""
    return read_trace(written(tmp_path / "trace.npz", outputs))


def test_the_columns_are_those_of_the_design():
    truth_y = [f"truth_y_{r}m" for r in (10, 20, 50, 80, 100)]
    y = [f"y_{r}m" for r in (10, 20, 50, 80, 100)]
    assert list(COLUMNS) == [
        *["t_ns", "tick", "side", "kind", "quality", "measured", "x_min_m", "x_max_m"],
        *["c0", "c1", "c2", "c3", "truth_c0", "truth_c1", "truth_c2", "truth_c3", *truth_y, *y],
        *["lane_offset_m", "truth_lane_offset_m", "reason_unseen", "speed_mps", "yaw_rate_radps"],
        *["occluded_by", "occluded_share"],
        *[f"map_{name}" for name in P3],
        *[f"fit_{name}" for name in P3],
        *["fit_std_m", "lane_width_m", "truth_lane_width_m", "lateral_speed_mps", "truth_lateral_speed_mps"],
        *["time_to_crossing_s", "truth_time_to_crossing_s"],
        *["ego_x_m", "ego_y_m", "ego_z_m", "ego_roll_rad", "ego_pitch_rad", "ego_yaw_rad"],
        *["acceleration_mps2", "lateral_acceleration_mps2", "light", "rain", "visibility_m"],
    ]


def test_a_tick_of_four_lines_has_a_row_for_each_side(tmp_path):
    trace = traced(tmp_path, output_of(four_lines(), tick=3))
    assert trace["side"].tolist() == [Side.LEFT, Side.RIGHT, Side.NEXT_LEFT, Side.NEXT_RIGHT]
    assert set(trace["tick"]) == {3}
    assert set(trace["t_ns"]) == {120_000_000}


def test_reported_and_true_place_differ_by_the_error_alone(tmp_path):
    line = Drawn(y=circle(1.8, 900.0), reported=Side.LEFT, error=(0.05, 0.001, 0.0, 0.0))
    perfect = traced(tmp_path, output_of([replace(line, error=(0.0,) * 4)]))
    trace = traced(tmp_path, output_of([line]))
    for x in (10, 20, 50, 80):
        assert trace[f"y_{x}m"][0] - perfect[f"y_{x}m"][0] == pytest.approx(0.05 + 0.001 * x, abs=1e-10)
        best = perfect[f"truth_y_{x}m"][0]
        assert perfect[f"y_{x}m"][0] == pytest.approx(best, abs=100**4 / (8 * 900**3) / 64)  # 4th order
    assert trace["c0"][0] - trace["truth_c0"][0] == pytest.approx(0.05, abs=1e-9)
    assert trace["c1"][0] - trace["truth_c1"][0] == pytest.approx(0.001, abs=1e-9)


def test_a_report_is_evaluated_only_within_its_view_range(tmp_path):
    line = Drawn(y=straight(1.8), reported=Side.LEFT, unseen=lambda p: (p[:, 0] < 12) | (p[:, 0] > 60))
    trace = traced(tmp_path, output_of([line]))
    places = [trace[f"y_{x}m"][0] for x in (10, 20, 50, 80, 100)]
    np.testing.assert_array_equal(np.isfinite(places), [False, True, True, False, False])


def test_a_missing_line_has_its_truth_and_the_reason_but_no_report(tmp_path):
    line = Drawn(y=straight(1.8), unseen=lambda p: p[:, 0] > -99)
    trace = traced(tmp_path, output_of([line]))
    assert trace["reason_unseen"].tolist() == [Unseen.OCCLUDED]
    assert trace["truth_y_50m"][0] == pytest.approx(1.8)
    for name in ("c0", "c3", "x_min_m", "x_max_m", "y_10m", "lane_offset_m"):
        assert math.isnan(trace[name][0])
    assert [trace[name][0] for name in ("kind", "quality", "measured")] == [0, 0, 0]


def test_lane_offset_is_what_was_put_on_the_bus(tmp_path):
    output = output_of(four_lines(), values={"left.lane_offset_m": 1.7, "right.lane_offset_m": -1.6})
    trace = traced(tmp_path, output)
    np.testing.assert_array_equal(trace["lane_offset_m"], [1.7, -1.6, math.nan, math.nan])
    assert trace["truth_lane_offset_m"][:2].tolist() == pytest.approx([1.8 - 0.075, -1.9 + 0.075])


def test_a_ghost_has_a_report_without_truth(tmp_path):
    ghost = replace(output_of(four_lines()).estimate.boundaries[0], marking=-1, points=-1)
    trace = traced(tmp_path, output_of([], ghosts=(ghost,)))
    assert trace["c0"][0] == pytest.approx(1.8)
    assert math.isnan(trace["truth_y_10m"][0])


def test_a_line_of_lower_order_has_zeros_and_of_higher_order_keeps_its_place(tmp_path):
    boundary = output_of(four_lines()).estimate.boundaries[0]
    for coefficients in ([1.8, 0.01], [1.8, 0.01, 0.0, 0.0, 1e-8, 1e-10]):
        odd = replace(boundary, coefficients=np.array(coefficients))
        output = output_of([Drawn(y=straight(1.8))], values={"left.available": 1.0})
        trace = traced(tmp_path, replace(output, estimate=replace(output.estimate, boundaries=(odd,))))
        assert [trace[f"c{n}"][0] for n in range(4)] == [1.8, 0.01, 0.0, 0.0]
        expected = np.polynomial.polynomial.polyval(80.0, coefficients)
        assert trace["y_80m"][0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_gives_back_every_bit(tmp_path, suffix):
    outputs = [output_of(four_lines()[: 1 + t % 4], tick=t) for t in range(5)]
    reference = read_trace(written(tmp_path / "reference.npz", outputs))
    found = read_trace(written(tmp_path / f"trace{suffix}", outputs))
    for name in COLUMNS:
        assert found[name].dtype == reference[name].dtype
        np.testing.assert_array_equal(found[name], reference[name])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_run_without_a_tick_leaves_an_empty_trace(tmp_path, suffix):
    trace = read_trace(written(tmp_path / f"trace{suffix}", []))
    assert {len(column) for column in trace.values()} == {0}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_the_run_says_of_itself_comes_back(tmp_path, suffix):
    path = written(tmp_path / f"t{suffix}", [], scenario="highway", quantisation_m={"20": 0.001})
    metadata = read_trace_and_metadata(path)[1]
    assert metadata["scenario"] == "highway"
    assert metadata["quantisation_m"] == {"20": 0.001}
    assert "c0..c3" in metadata["units"]


def test_more_rows_than_a_chunk_are_all_kept_in_order(tmp_path, monkeypatch):
    monkeypatch.setattr("vsensor.sinks.rows._CHUNK_ROWS", 3)
    trace = traced(tmp_path, *(output_of([Drawn(y=straight(1.8))], tick=t) for t in range(10)))
    assert trace["tick"].tolist() == list(range(10))


def test_nothing_stands_under_the_file_name_before_close(tmp_path):
    path = tmp_path / "trace.npz"
    sink = TraceSink(path, front_axle_x_m=AXLE_M)
    sink.write(output_of(four_lines()))
    assert not path.exists()
    sink.close()
    assert [p.name for p in tmp_path.iterdir()] == ["trace.npz"]


def test_a_second_close_does_nothing(tmp_path):
    sink = TraceSink(tmp_path / "trace.csv", front_axle_x_m=AXLE_M)
    sink.close()
    sink.close()
    assert (tmp_path / "trace.csv").exists()


def test_a_folder_that_is_not_there_is_refused_before_the_run(tmp_path):
    with pytest.raises(ConfigError, match=r"none.trace\.npz: cannot be written"):
        TraceSink(tmp_path / "none" / "trace.npz", front_axle_x_m=AXLE_M)


def test_an_unknown_suffix_is_refused_before_the_run(tmp_path):
    with pytest.raises(ConfigError, match=r"t\.xlsx: a trace ends in \.npz, \.csv, \.parquet"):
        TraceSink(tmp_path / "t.xlsx", front_axle_x_m=AXLE_M)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_cut_off_anywhere_is_refused_by_name(tmp_path, suffix):
    whole = written(tmp_path / f"whole{suffix}", [output_of(four_lines(), tick=t) for t in range(3)])
    data = whole.read_bytes()
    cut = tmp_path / f"cut{suffix}"
    for length in (0, 1, 10, *np.linspace(20, len(data) - 2, 40).astype(int)):
        cut.write_bytes(data[:length])
        with pytest.raises(ConfigError, match=f"cut\\{suffix}"):
            read_trace(cut)


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".txt"])
def test_a_foreign_file_is_refused_by_name(tmp_path, suffix):
    path = tmp_path / f"foreign{suffix}"
    path.write_bytes(b"a,b\n1,2\n\xff\xfe")
    with pytest.raises(ConfigError, match="foreign"):
        read_trace(path)
    with pytest.raises(ConfigError, match=r"no such file|a trace ends in"):
        read_trace(tmp_path / f"missing{suffix}")


def test_a_foreign_npz_is_refused(tmp_path):
    np.savez(tmp_path / "a.npz", x=np.arange(3))
    with pytest.raises(ConfigError, match=r"a\.npz"):
        read_trace(tmp_path / "a.npz")
    np.save(tmp_path / "b.npy", np.arange(3))
    (tmp_path / "b.npy").rename(tmp_path / "b.npz")
    with pytest.raises(ConfigError, match=r"b\.npz"):
        read_trace(tmp_path / "b.npz")


def test_a_newer_schema_is_refused_by_version(tmp_path):
    path = written(tmp_path / "t.csv", [])
    path.write_text(path.read_text().replace("vsensor.trace/2", "vsensor.trace/3"))
    with pytest.raises(ConfigError, match=r"vsensor\.trace/3.*vsensor\.trace/2"):
        read_trace(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("speed_mps", "speed_kmh", "column speed_mps is missing"),
        ("\n0,0,0,", "\n0,0.5,0,", "column tick holds values that are not whole"),
        ("\n0,0,0,", "\n0,0,-1,", "column side holds values outside of 0 to 255"),
        ("\n0,0,0,", "\n0,zero,0,", "line 3: .*zero"),
        ("\n0,0,0,", "\n0,0,0,0,", "line 3 has 60 values, 59 were expected"),
        ("# rows 1", "# rows 2", "cut off"),
        ("# {", "{", "its first line"),
        ('# {"schema"', '# {"schema', "no JSON object"),
    ],
)
def test_a_damaged_csv_is_refused_saying_where(tmp_path, old, new, message):
    path = written(tmp_path / "t.csv", [output_of([Drawn(y=straight(1.8), reported=Side.LEFT)])])
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigError, match=message):
        read_trace(path)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
@pytest.mark.parametrize("seed", range(8))
def test_a_file_with_damaged_bytes_is_read_or_refused_but_never_a_crash(tmp_path, suffix, seed):
    random = np.random.default_rng(seed)
    path = written(tmp_path / f"t{suffix}", [output_of(four_lines(), tick=t) for t in range(2)])
    data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    refused = 0
    for _ in range(25):
        damaged = data.copy()
        damaged[random.integers(0, len(data), 3)] = random.integers(0, 256, 3)
        path.write_bytes(damaged.tobytes())
        try:
            read_trace(path)
        except ConfigError:
            refused += 1
    assert refused > 10


def test_a_csv_is_read_by_a_reader_that_knows_nothing_but_its_comment_sign(tmp_path):
    polars = pytest.importorskip("polars")
    path = written(tmp_path / "t.csv", [output_of(four_lines(), tick=t) for t in range(3)])
    frame = polars.read_csv(path, comment_prefix="#")
    assert frame.columns == list(COLUMNS)
    assert len(frame) == 12


def test_the_kind_of_a_report_is_kept(tmp_path):
    trace = traced(tmp_path, output_of(four_lines(kind=MarkingKind.DASHED)))
    assert set(trace["kind"]) == {MarkingKind.DASHED}


def test_the_description_is_plain_json_in_an_npz(tmp_path):
    with np.load(written(tmp_path / "t.npz", [])) as file:
        assert json.loads(str(file["metadata"]))["schema"] == "vsensor.trace/2"


def test_a_line_that_was_fitted_but_not_sent_is_no_report(tmp_path):
    silent = dict.fromkeys((f"{side}.available" for side in SIDE_NAMES.values()), 0.0)
    for number, output in enumerate((output_of(four_lines()), output_of(four_lines(), values=silent))):
        found = list(rows(output, 2.8))
        assert len(found) == 4
        reported = [row[COLUMNS.index("quality")] > 0 for row in found]
        assert reported == [number == 0] * 4


def test_a_file_of_schema_1_still_loads_and_what_it_lacks_is_not_known(tmp_path):
    new = read_trace(written(tmp_path / "new.npz", [output_of(four_lines())]))
    old = {name: new[name] for name in COLUMNS[: COLUMNS.index("yaw_rate_radps") + 1]}
    np.savez(tmp_path / "old.npz", metadata=np.array(json.dumps({"schema": "vsensor.trace/1"})), **old)
    found = read_trace(tmp_path / "old.npz")
    assert list(found) == list(COLUMNS)
    np.testing.assert_array_equal(found["c0"], new["c0"])
    assert set(found["occluded_by"]) == {-1}
    assert set(found["light"]) == {255}
    assert np.isnan(found["map_curvature_per_m"]).all()


def test_a_file_of_schema_2_that_lacks_a_column_is_refused(tmp_path):
    new = read_trace(written(tmp_path / "new.npz", [output_of(four_lines())]))
    del new["fit_std_m"]
    np.savez(tmp_path / "cut.npz", metadata=np.array(json.dumps({"schema": "vsensor.trace/2"})), **new)
    with pytest.raises(ConfigError, match="column fit_std_m is missing"):
        read_trace(tmp_path / "cut.npz")


def test_the_fit_over_all_true_points_is_told_in_the_words_of_p3(tmp_path):
    """A parabola y = 1.8 + 0.02 x + 0.001 x^2: y0, atan of the slope, second and third derivative."""
    trace = traced(tmp_path, output_of([Drawn(y=lambda x: 1.8 + 0.02 * x + 0.001 * x**2)]))
    found = [trace[f"fit_{name}"][0] for name in P3]
    np.testing.assert_allclose(found, [1.8, math.atan(0.02), 0.002, 0.0], atol=1e-9)
    assert trace["fit_std_m"][0] < 1e-9
    assert np.isnan([trace[f"map_{name}"][0] for name in P3]).all()  # drawn by points: no curve is known


def test_pose_and_weather_of_the_tick_stand_in_every_row(tmp_path):
    output = output_of(four_lines(), ego=ego_at(5.0, -7.0, 0.3))
    air = Environment(light=Light.NIGHT, rain=0.5, visibility_m=300.0)
    scene = replace(output.snapshot.scene, environment=air)
    trace = traced(tmp_path, replace(output, snapshot=replace(output.snapshot, scene=scene)))
    for name, value in (
        ("ego_x_m", 5.0),
        ("ego_y_m", -7.0),
        ("ego_yaw_rad", 0.3),
        ("light", 2),
        ("rain", 0.5),
    ):
        assert set(trace[name]) == {value}
    assert set(trace["visibility_m"]) == {300.0}


def test_the_lane_as_sent_stands_beside_the_true_one(tmp_path):
    output = output_of(four_lines(), values={"lane.width_m": 3.6, "lane.time_to_crossing_s": 7.0})
    trace = traced(tmp_path, output)
    assert set(trace["lane_width_m"]) == {3.6}
    np.testing.assert_allclose(trace["truth_lane_width_m"], 3.7 - 0.15, atol=1e-9)
    assert set(trace["time_to_crossing_s"]) == {7.0}


def behind(*boxes):
    """Return the output of two lines that boxes hide, and the camera that looks."""
    camera = Camera.from_config(CameraConfig(pixel_grid=False))
    markings = [road_line(1.8, 0), road_line(-1.8, 1)]
    return output_at(ego_at(), markings, camera=camera, obstacles=boxes), camera


def test_the_object_that_hides_most_of_a_line_is_named():
    output, camera = behind(box(60.0, 3.0, number=9), box(14.0, 1.6, number=7))
    table = np.array(list(rows(output, AXLE_M, camera=camera)), ROW)
    left, right = table[table["side"] == Side.LEFT][0], table[table["side"] == Side.RIGHT][0]
    assert left["occluded_by"] == 7
    assert 0.3 < left["occluded_share"] < 1.0
    assert right["occluded_by"] == -1
    assert right["occluded_share"] == 0.0


def test_without_a_camera_nobody_is_named():
    output, _ = behind(box(14.0, 1.6, number=7))
    table = np.array(list(rows(output, AXLE_M)), ROW)
    assert set(table["occluded_by"]) == {-1}
    assert table["occluded_share"].max() > 0.3
