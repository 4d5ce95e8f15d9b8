"""The points of the true lines: what a row says, and that the file is whole."""

from dataclasses import replace

import numpy as np
import pytest

from tests.maps import geometry, lane, loaded, road, section
from tests.outputs import ego_at
from tests.roads import box, straight
from tests.truths import output_at, output_on
from vsensor.camera import Camera, CameraConfig
from vsensor.errors import ConfigError
from vsensor.sinks.truth_points import ROW, TruthSink, points
from vsensor.types import Side, Unseen
from vsensor.world.corridor import Corridor
from vsensor.world.route import CorridorConfig

CAMERA = Camera.from_config(CameraConfig(pixel_grid=False))
DASHED = '<roadMark sOffset="0" type="broken"/>'


def test_the_points_of_an_arc_lie_on_its_circles_a_tenth_of_a_metre_apart(tmp_path):
    plan = geometry('<arc curvature="0.004"/>', 300.0)
    lanes = section(left=[lane(1)], right=[lane(-1, marks=DASHED)])
    corridor = Corridor(loaded(tmp_path, road(plan, lanes, length=300.0)), CorridorConfig(road="1", lane=-1))
    found = points(output_on(corridor, 60.0), CAMERA)
    radii = {Side.LEFT: 250.0, Side.RIGHT: 253.5, Side.NEXT_LEFT: 246.5}
    assert set(found["side"]) == set(radii)
    for side, radius in radii.items():
        mine = found[found["side"] == side]
        distance = np.hypot(mine["x_m"], mine["y_m"] - 251.75)
        np.testing.assert_allclose(distance, radius, atol=1e-9)
        step = np.hypot(np.diff(mine["x_m"]), np.diff(mine["y_m"]))
        np.testing.assert_allclose(step, 0.1 * radius / 251.75, atol=1e-6)
        assert mine["x_m"][0] < 0.1
        assert mine["x_m"][-1] > 100.0


def test_every_point_says_why_it_was_not_seen_and_which_object_hid_it():
    markings = [straight(1.8, 0, painted=np.arange(1401) % 120 < 60), straight(-1.8, 1)]
    output = output_at(ego_at(), markings, camera=CAMERA, obstacles=(box(14.0, 1.6, number=7),))
    found = points(output, CAMERA)
    reasons = set(found["reason"].tolist())
    assert {Unseen.SEEN, Unseen.NO_PAINT, Unseen.OUTSIDE_IMAGE, Unseen.OCCLUDED} <= reasons
    hidden = found["reason"] == Unseen.OCCLUDED
    assert set(found["occluded_by"][hidden]) == {7}
    assert set(found["occluded_by"][~hidden]) == {-1}


@pytest.mark.parametrize("suffix", [".npz", ".parquet"])
def test_a_file_holds_every_tick_in_order(tmp_path, suffix):
    outputs = [output_at(ego_at(), [straight(y)], camera=CAMERA) for y in (1.8, 1.7)]
    path = tmp_path / f"truth{suffix}"
    sink = TruthSink(path, camera=CAMERA)
    for output in outputs:
        sink.write(output)
    sink.close()
    expected = np.concatenate([points(output, CAMERA) for output in outputs])
    if suffix == ".npz":
        columns = dict(np.load(path))
    else:
        import polars

        columns = {name: polars.read_parquet(path)[name].to_numpy() for name in ROW.names}
    for name in ROW.names:
        np.testing.assert_array_equal(columns[name], expected[name])
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_only_every_n_th_tick_is_kept_when_asked(tmp_path):
    output = output_at(ego_at(), [straight(1.8)], camera=CAMERA)
    sink = TruthSink(tmp_path / "truth.npz", camera=CAMERA, every=3)
    for index in range(7):
        sink.write(replace(output, tick=replace(output.tick, index=index)))
    sink.close()
    assert set(np.load(tmp_path / "truth.npz")["tick"]) == {0, 3, 6}


def test_a_csv_of_a_thousand_rows_a_tick_and_line_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"truth\.csv: a trace ends in \.npz, \.parquet"):
        TruthSink(tmp_path / "truth.csv", camera=CAMERA)
