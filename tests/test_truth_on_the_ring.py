"""The sensor without pixel grid and errors, all around the shipped map: it reports the best cubic."""

from pathlib import Path

import numpy as np
import pytest

from vsensor.camera import CameraConfig
from vsensor.error_model import ErrorModelConfig
from vsensor.region import RegionConfig
from vsensor.scene import SceneConfig
from vsensor.sensor import Sensor, SensorConfig, initial_state, sense
from vsensor.sinks.trace import TraceSink, read_trace
from vsensor.tracker import TrackerConfig
from vsensor.types import SIDE_NAMES, EgoState, MarkingKind, Output, Scene, Side, Snapshot, Tick
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map
from vsensor.world.route import CorridorConfig
from vsensor.world.truth import RANGES_M, true_sides

MAP = Path(__file__).parents[1] / "vsensor" / "scenarios" / "highway.xodr"
CONFIG = SensorConfig(
    camera=CameraConfig(pixel_grid=False),
    error_model=ErrorModelConfig(mode="none"),
    region=RegionConfig(enabled=False),
    scene=SceneConfig(range_m=101.0, lateral_m=10.0),
    tracker=TrackerConfig(confirm_images=1),
)
ROUNDING_M = 1e-9  # float64 of a fit over 100 m


def snapshots(lane, step_m):
    """Yield the truth at places all around the ring, in the middle of a lane."""
    corridor = Corridor(load_map(MAP), CorridorConfig(road="1", lane=lane))
    for number, s in enumerate(np.arange(25.0, 8300.0, step_m)):
        pose = corridor.pose(float(s))
        ego = EgoState(
            t_ns=number * 40_000_000,
            position_world_m=pose.position_world_m[0],
            roll_rad=float(pose.roll_rad[0]),
            pitch_rad=float(pose.pitch_rad[0]),
            yaw_rad=float(pose.yaw_rad[0]),
            speed_mps=30.0,
        )
        markings = corridor.markings_window(float(s) - 20.0, float(s) + 150.0)
        yield Snapshot(t_ns=ego.t_ns, ego=ego, scene=Scene(markings=markings))


@pytest.fixture(scope="module")
def outputs():
    sensor, found = Sensor.of(CONFIG), []
    for number, snapshot in enumerate(snapshots(-3, 90.0)):
        tick = Tick(index=number, t_ns=snapshot.t_ns, period_ns=40_000_000)
        _, sensed = sense(sensor, initial_state(), snapshot, tick)
        found.append(
            Output(
                tick=tick,
                snapshot=snapshot,
                observation=sensed.observation,
                detections=sensed.detections,
                estimate=sensed.estimate,
                values=dict.fromkeys((f"{side}.available" for side in SIDE_NAMES.values()), 1.0),
                frames=(),
            )
        )
    return found


@pytest.fixture(scope="module")
def trace(outputs, tmp_path_factory):
    path = tmp_path_factory.mktemp("ring") / "trace.npz"
    sink = TraceSink(path, front_axle_x_m=2.8)
    for output in outputs:
        sink.write(output)
    sink.close()
    return read_trace(path)


def test_the_middle_lane_has_four_true_lines_but_where_paint_is_missing(outputs):
    counts = [len(true_sides(o.observation.candidates, o.snapshot)) for o in outputs]
    assert min(counts) >= 3
    assert np.mean(np.array(counts) == 4) > 0.95


def test_from_the_middle_of_a_lane_its_lines_stand_half_a_width_to_each_side(outputs):
    checked = 0
    for output in outputs:
        candidates, scene = output.observation.candidates, output.snapshot.scene
        sides = true_sides(candidates, output.snapshot)
        for side, k in sides.items() if len(sides) == 4 else ():  # no line is missing
            part = slice(candidates.starts[k], candidates.starts[k + 1])
            marking = scene.markings[candidates.marking[k]]
            kind = marking.kind[candidates.index[part][0]]
            if side in (Side.LEFT, Side.RIGHT) and kind in (MarkingKind.DASHED, MarkingKind.SOLID):
                _, y, _ = candidates.points_ego_m[part][0]
                assert abs(y) == pytest.approx(3.75 / 2, abs=1e-5)  # 0.1^2 / (2 * 600) m
                checked += 1
    assert checked > len(outputs)


def test_what_is_reported_is_the_best_cubic_through_the_true_points(trace):
    for power, reach in enumerate((1.0, 100.0, 100.0**2, 100.0**3)):
        difference = (trace[f"c{power}"] - trace[f"truth_c{power}"]) * reach
        known = np.isfinite(trace["c0"])
        assert known.sum() > 300
        np.testing.assert_allclose(difference[known], 0.0, atol=ROUNDING_M)


@pytest.mark.parametrize("x", [int(x) for x in RANGES_M])
def test_the_error_is_no_larger_than_that_of_the_best_cubic(trace, x):
    best = sum(trace[f"truth_c{power}"] * x**power for power in range(4))
    truth, reported = trace[f"truth_y_{x}m"], trace[f"y_{x}m"]
    both = np.isfinite(reported) & np.isfinite(truth)
    assert both.sum() > 50
    assert (np.abs(reported - truth) - np.abs(best - truth))[both].max() < ROUNDING_M


def test_a_cubic_over_a_hundred_metres_is_within_decimetres_of_the_ring(trace):
    reported = np.isfinite(trace["c0"])
    errors = [np.abs(trace[f"y_{x}m"] - trace[f"truth_y_{x}m"])[reported] for x in (20, 50, 80)]
    assert max(np.nanmax(e) for e in errors) < 0.1


def test_each_side_is_reported_where_it_truly_is(outputs):
    for output in outputs:
        candidates = output.observation.candidates
        true = {
            side: int(candidates.marking[k]) for side, k in true_sides(candidates, output.snapshot).items()
        }
        for line in output.estimate.boundaries:
            assert true[line.side] == line.marking
