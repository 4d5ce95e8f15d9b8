"""The bench's own claims: its scene is as described, its peers see what we see, its parts run."""

import json
import math

import numpy as np
import pytest

from tests import stories
from tests.shared import SHARED_DATA, needs_shared
from tools.bench import errors, frontier, growth, looking, peers, pictures, reference, scans, world
from tools.bench.__main__ import main
from tools.bench.report import markdown
from tools.bench.scene import boxes_in_view, reference_line, ticks_at
from vsensor.error_model import ErrorModelConfig
from vsensor.sensor import SensorConfig
from vsensor.tracker import TrackerConfig
from vsensor.types import Unseen
from vsensor.world.opendrive import load_map


@pytest.fixture(scope="module")
def looks():
    """Outputs of the reference scene over a minute, without errors."""
    at_once = TrackerConfig(confirm_images=1)  # every image here is a first one
    line = reference_line(SensorConfig(error_model=ErrorModelConfig(mode="none"), tracker=at_once))
    return line, [line.compute(line.initial_state(), tick).output for tick in ticks_at(range(0, 1500, 100))]


def test_the_reference_scene_hides_a_third_behind_half_of_its_vehicles(looks):
    line, outputs = looks
    for output in outputs:
        assert len(output.snapshot.scene.obstacles) == 50
        assert boxes_in_view(line.sensor.camera, output.snapshot) >= 25
        assert (output.observation.reason == Unseen.OCCLUDED).mean() >= 0.3
        assert [len(marking.painted) for marking in output.snapshot.scene.markings] == [1000] * 4


def test_all_of_its_vehicles_move(looks):
    _, (first, *_, last) = looks
    for before, after in zip(first.snapshot.scene.obstacles, last.snapshot.scene.obstacles, strict=True):
        assert np.linalg.norm(before.centre_world_m - after.centre_world_m) > 10.0


def test_p1_sees_the_same_points_and_fits_the_same_lines(looks):
    line, outputs = looks
    other = reference.P1Sensor(line.sensor.camera, line.sensor.config.scene.range_m)
    compared = 0
    for output in outputs:
        frame = other.frame(output.snapshot, other.signals(output.frames))
        assert (frame.seen != reference.seen_by_us(output, 1000)).mean() <= 1e-3
        assert len(frame.payloads) == len(output.frames)
        ours = [b for b in output.estimate.boundaries if b.measured and b.quality == 4]
        for boundary in ours:
            closest = min(np.abs(cubic[::-1] - boundary.coefficients).max() for cubic in frame.cubics)
            compared += closest < 1e-3
    assert compared >= len(outputs)


def test_p1_encodes_the_bytes_that_were_sent_but_for_counter_and_crc(looks):
    line, outputs = looks
    other = reference.P1Sensor(line.sensor.camera, 100.2)
    sent = outputs[0].frames
    frame = other.frame(outputs[0].snapshot, other.signals(sent))
    assert frame.payloads == tuple(frame.data for frame in sent)


def test_all_peers_find_the_same_points_hidden():
    found = peers.occlusion(rounds=1)
    assert found["hidden"] > 0.3
    assert all(share <= 1e-3 for share in found["unlike_p1"].values())
    assert {"p1", "trimesh"} <= set(found["times_faster_than"])


def test_a_finer_grid_and_a_higher_order_cost_less_error():
    coarse, fine, straight = (
        frontier.Setting(width_px=320),
        frontier.Setting(width_px=2560),
        frontier.Setting(width_px=2560, order=1),
    )
    found = frontier.frontier(looks=6, chosen=[coarse, fine, straight])
    errors = [point["rms_20m"] for point in found["points"]]
    assert errors[1] < 0.7 * errors[0] < 0.7 * errors[2]
    assert all(point["answered"] > 0.4 for point in found["points"])


def test_the_bypassed_camera_with_dense_points_is_as_near_to_the_truth_as_its_polynomial():
    found = frontier.frontier(looks=6, chosen=[frontier.Setting(width_px=0, order=5)])
    assert found["points"][0]["worst_20m"] < 0.01
    assert found["points"][0]["answered"] > 0.9


def test_a_front_holds_what_no_other_beats():
    points = [
        {"p50_ms": ms, "rms_20m": error} for ms, error in ((1.0, 0.3), (2.0, 0.1), (3.0, 0.2), (2.5, 0.05))
    ]
    frontier.mark_front(points, 20.0, "front")
    assert [point["front_20m"] for point in points] == [True, True, False, True]


def test_growth_by_a_power_is_found():
    sizes = [10, 100, 1000, 10_000]
    assert growth.exponent(sizes, [0.01 * size**1.5 for size in sizes]) == pytest.approx(1.5)


def test_growth_and_its_pictures_are_made(tmp_path):
    grown = growth.growth(points=(400, 4000), boxes=(1, 10), triangles=(100, 400), rounds=1)
    assert all(np.isfinite(list(curves["exponents"].values())).all() for curves in grown.values())
    found = frontier.frontier(looks=2, chosen=[frontier.Setting(), frontier.Setting(width_px=0)])
    pictures.growth(grown, tmp_path / "growth.png")
    pictures.frontier(found, tmp_path / "frontier.png")
    for name in ("growth.png", "frontier.png"):
        assert (tmp_path / name).stat().st_size > 10_000


def test_an_egg_has_about_as_many_triangles_as_asked_for():
    for count in (100, 10_000):
        assert growth.egg(count).faces.shape[0] == pytest.approx(count, rel=0.1)


def test_a_report_holds_what_was_asked_for(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(reference.against_p1, "__defaults__", (1, 5))
    assert main(["--only", "reference", "--out", str(tmp_path)]) == 0
    report = json.loads((tmp_path / "bench.json").read_text())
    assert set(report) == {"machine", "reference", "occlusion"}
    assert "P1's algorithms" in (tmp_path / "bench.md").read_text()


def test_the_bench_of_errors_makes_errors_and_loses_lines_in_every_mode():
    found = errors.errors(images=20)
    assert list(found["modes"]) == ["extreme", "levels", "volume"]
    assert [row[1] for row in errors.targets(found)] == ["150 us"] * 3
    images = errors.Images("volume")
    moved = [images() for _ in range(400)]
    assert np.std([lines.points_ego_m[900, 1] for lines, _ in moved]) > 0.1
    assert {len(estimate.boundaries) for _, estimate in moved} >= {3, 4}


def test_a_missed_target_is_called_missed():
    def page(p50_ms):
        demo = {"p50_ms": p50_ms, "p99_ms": 3.0, "p50_per_yardstick": 1.0, "target_p50_ms": 2.0}
        machine = {"processor": "", "cores": 1, "python": "", "numpy": "", "load_average": 0.0}
        return markdown({"machine": machine, "demo_tick": demo | {"stages_p50_ms": {"camera": 1.0}}})

    assert "1 of 1 targets missed" in page(2.1)
    assert "| no |" in page(2.1)
    assert "0 of 1 targets missed" in page(1.9)


def test_an_unknown_section_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["--only", "demo,nothing"])
    assert "nothing" in capsys.readouterr().err


def test_of_the_examiner_first_view_slider_and_memory_are_judged_each_for_itself():
    found = {"images": 90_000, "first_view_s": 4.9, "slider_p95_ms": 151.0, "memory_gib": 1.49}
    rows = looking.targets(found)
    assert [row[3] for row in rows] == [True, False, True]
    assert rows[1][:3] == ("examiner, 1 h: from slider to picture, p95", "150 ms", "151 ms")


def test_the_bench_of_scans_measures_cost_and_path_and_judges_both():
    found = scans.scans(repeats=(1, 2), base_s=10.0, radii_m=(1000.0,), speeds_mps=(30.0,))
    assert len(found["cost"]["times_real_time"]) == 2
    assert {row["shape"] for row in found["path"]} == {"straight", "bend"}
    speed, straight, bend = scans.targets(found)
    assert speed[1] == "300 x real time"
    assert straight[3]
    assert math.isnan(float(bend[2].split()[0]))  # of R = 250 m nothing was measured here
    assert "| 1000.0 | 30.0 | dithered |" in scans.page(found)


@needs_shared
def test_a_map_side_by_side_is_the_map_so_many_times_over(tmp_path):
    path = tmp_path / "huge.xodr"
    world.side_by_side(SHARED_DATA / "xodr" / "fabriksgatan.xodr", path, 3)
    one, three = load_map(SHARED_DATA / "xodr" / "fabriksgatan.xodr"), load_map(path)
    assert len(three.roads) == 3 * len(one.roads)
    assert three.warnings == ()
    ends = [list(three.roads.values())[k * len(one.roads)].point(0.0, 0.0)[0, 0] for k in range(3)]
    assert np.diff(ends).tolist() == pytest.approx([2000.0, 2000.0])


def test_what_a_cubic_leaves_of_an_arc_is_at_least_its_fourth_power():
    for radius_m in (250.0, 1500.0):
        assert world.arc_limit_m(radius_m, 100.0) > 50.0**4 / (105 * radius_m**3)


def test_in_the_benchs_storyboard_all_vehicles_change_their_lanes_at_once(tmp_path):
    source = stories.drive(tmp_path, world.story_of("change lanes"), rehearsal_s=0.1)
    offsets = [abs(stories.motion(source, 2.0, f"V{k}").across_mps) for k in range(world.VEHICLES)]
    assert min(offsets) > 0.0
    still = stories.drive(tmp_path, world.story_of("keep their lanes"), rehearsal_s=0.1)
    assert stories.motion(still, 2.0, "V7").across_mps == 0.0


def test_the_bench_of_the_world_judges_what_it_measured():
    cost = {"mb": 2.0, "load_s": 1.0, "memory_mb": 20.0, "peak_mb": 99.0, "pose_us": 30.0, "window_us": 9.0}
    huge = {**cost, "copies": 100, "pose_us": 51.0}
    fit = [{"radius_m": 250, "std_m": 0.005, "limit_m": 0.005, "worst_m": 0.016}]
    found = {"largest": cost, "small": cost, "huge": huge, "vehicles": 50, "tick_us": 990.0, "fit": fit}
    found |= {"story_us": {"keep their lanes": 400.0, "change lanes": 1100.0}, "driven_us": 700.0}
    assert [row[3] for row in world.targets(found)] == [True, False, None, True, True, False, None, None]
    assert "| 250 | 5.000 | 5.000 | 16.000 |" in world.page(found)
