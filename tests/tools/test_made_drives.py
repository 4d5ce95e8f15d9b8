"""Drives whose error law is known: what stands in their logs, and that the law is the one that is said."""

from math import radians
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.error_model.models import at
from tests.lines import line_points, tick
from tools.made_drives import (
    MOTION_NS,
    YAW_NOISE_DEGPS,
    YAW_OFFSET_DEGPS,
    dashed_map,
    drive_cells,
    drive_frames,
    drive_speeds,
    made,
    scenario_of,
)
from tools.made_law import LEVELS, quantiles_m, reported_errors_m, student_library, student_model
from vsensor.config import SHIPPED, load_scenario
from vsensor.draws import Draws
from vsensor.error_model import (
    ErrorModelConfig,
    apply,
    compile_law,
    initial_state,
    library_of,
    load_library,
    save_library,
)
from vsensor.lanefit import LaneFitConfig, fit_lines
from vsensor.line import build_line
from vsensor.logs import read_log
from vsensor.logs.decode import decode_frames
from vsensor.profile import load_profiles
from vsensor.types import Tick

SECONDS = 2.0


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """The cell of one drive of 2 s, which was made once."""
    folder = tmp_path_factory.mktemp("made")
    (cell,) = drive_cells(folder, SECONDS / 3600.0, drive_s=SECONDS, suffix=".log")
    made(cell)
    return cell


@pytest.fixture
def log(cell):
    """Its log."""
    return Path(cell["path"])


def test_a_drive_is_made_of_its_seed_alone_and_leaves_nothing_beside(cell, log, tmp_path):
    again = tmp_path / "again.log"
    made(cell | {"path": str(again)})
    assert again.read_bytes() == log.read_bytes()
    made(cell | {"path": str(again), "seed": 2})
    assert again.read_bytes() != log.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["again.log"]


def test_frames_are_in_the_order_of_their_times_and_lanes_and_motion_have_their_cycles(log):
    table = read_log(log)
    assert (np.diff(table.t_ns) >= 0).all()
    for arbitration_id, cycle_ns in ((0x320, 40_000_000), (0x32C, 40_000_000), (0x100, MOTION_NS)):
        times = table.t_ns[table.arbitration_id == arbitration_id]
        assert set(np.diff(times).tolist()) == {cycle_ns}


def test_the_yaw_rate_has_the_steps_and_the_offset_of_the_recorded_car_and_poses_are_the_truth(cell, log):
    line = build_line(load_scenario("highway", scenario_of(cell)))
    ego, state = [], line.source.initial_state()
    for index in range(50):
        t = Tick(index=index, t_ns=index * 40_000_000, period_ns=40_000_000)
        state, snapshot = line.source.advance(state, t, ())
        ego.append(snapshot.ego)
    frames = decode_frames(read_log(log), load_profiles(["vehicle"]))
    for name, axis in (("ego.x_m", 0), ("ego.y_m", 1)):
        _, values = frames.series(name)
        truth = [one.position_world_m[axis] for one in ego[: len(values)]]
        np.testing.assert_allclose(values, truth, atol=0.0005 + 1e-9)
    _, rates = frames.series("ego.yaw_rate_radps")
    assert len(np.unique(rates)) <= 6  # 0.244 deg/s apart
    truth = np.mean([one.yaw_rate_radps for one in ego])
    std_degps = np.hypot(YAW_NOISE_DEGPS, 0.244 / np.sqrt(12)) / np.sqrt(len(rates))
    assert abs(rates.mean() - truth - radians(YAW_OFFSET_DEGPS)) < radians(4 * std_degps + 4 * 0.05)


def test_speeds_are_mixed_between_slow_and_fast():
    points = np.array([point for seed in range(50) for point in drive_speeds(seed, 600.0)])
    assert points[:, 1].min() < 30.0
    assert points[:, 1].max() > 125.0
    assert np.std(points[:, 1]) == pytest.approx(105.0 / np.sqrt(12.0), rel=0.1)


def test_both_lines_of_the_driven_lane_are_dashed_all_the_way(tmp_path):
    (tmp_path / "map.xodr").write_bytes(dashed_map(SHIPPED / "highway.xodr"))
    for lane in ElementTree.parse(tmp_path / "map.xodr").iter("lane"):
        if lane.get("id") in ("-2", "-3"):
            assert [mark.get("type") for mark in lane.findall("roadMark")] == ["broken"]
            line = lane.find("roadMark/type/line").attrib
            assert (line["length"], line["space"]) == ("6.0", "12.0")


def test_drives_at_night_are_told_by_the_lamps_and_have_their_own_law(tmp_path):
    save_library(student_library(), tmp_path / "law.npz")
    library = load_library(tmp_path / "law.npz")
    ratio = library.models["night"].absolute_m / library.models["day"].absolute_m
    np.testing.assert_allclose(ratio, 1.5)
    shared = {"seconds": 1.0, "profile": "native", "night": True}
    lamps = []
    for seed in (1, 2):
        cell = shared | {"seed": seed, "map": "highway.xodr", "law": str(tmp_path / "law.npz")}
        line = build_line(load_scenario("highway", scenario_of(cell)))
        body = [frame for frame in drive_frames(line, 3, seed) if frame.arbitration_id == 0x103]
        lamps.append(load_profiles(["vehicle"])[0].decode(body[0])["ego.low_beam"])
    assert lamps == [0.0, 1.0]


def test_what_is_said_to_be_reported_is_what_the_sensors_own_fit_reports():
    model, speed_mps, count = student_model(), 30.0, 3000
    law = compile_law(ErrorModelConfig(), library_of(model, ""))
    x = np.arange(0.25, 100.0, 0.5)
    lines = line_points(*[(x, np.zeros(len(x)))] * count)
    moved = apply(law, initial_state(), Draws(5), tick(0), at(speed_mps), tuple(range(count)), lines)[1]
    fits = fit_lines(LaneFitConfig(), moved, np.zeros(len(moved.points_ego_m)))
    ranges = np.array([5.0, 30.0, 80.0])
    reported = np.array([[fit.y_at(x) for x in ranges] for fit in fits])
    said = quantiles_m(reported_errors_m(model, ranges, speed_mps, count=40_000), LEVELS)
    share = (reported[:, None, :] <= said).mean(axis=0)
    error = 4.5 * np.sqrt(LEVELS * (1 - LEVELS) * (1 / count + 1 / 40_000))
    assert (abs(share - LEVELS[:, None]) < error[:, None]).all()
