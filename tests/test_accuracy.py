"""Without pixel grid and errors next to nothing is lost, on every real map, in every frame."""

import math

import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.config import load_scenario
from vsensor.line import build_line
from vsensor.profile import quantisation_error_m
from vsensor.types import SIDE_NAMES, Tick
from vsensor.world.truth import line_truths

RANGES_M = (10.0, 20.0, 50.0, 80.0, 100.0)
MAPS = sorted(path.name for path in (SHARED_DATA / "xodr").glob("*.xodr")) or ["absent"]
PERIOD_NS = 40_000_000
MOST_TICKS = 834
"""2 km at the speed of the scenario: an image every 2.4 m."""
EXACT = {
    "camera": {"pixel_grid": False},
    "error_model": {"mode": "none"},
    "region": {"enabled": False},
    "scene": {"range_m": 120.0},
    "state": {"init_s": 0.0},
    "tracker": {"confirm_images": 1},
    "ego": {"speed_kmh": 216},
}


def outputs(scenario, ticks=MOST_TICKS):
    """Yield the outputs of a scenario, computed tick by tick."""
    line = build_line(scenario)
    state = line.initial_state()
    for index in range(ticks):
        computed = line.compute(state, Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS))
        if computed is None:
            return
        state = computed.state_if_sent
        yield line, computed.output


def on_the_bus(line, output):
    """Return the quantities that an ECU decodes from the frames of one image."""
    values = {}
    for frame in output.frames:
        values |= line.profile.decode(frame, check=True)
    return values


@needs_shared
@pytest.mark.parametrize("name", MAPS)
def test_what_is_on_the_bus_is_the_best_cubic_up_to_quantisation_and_a_millimetre(name):
    scenario = load_scenario(str(SHARED_DATA / "xodr" / name), EXACT)
    compared, wheelbase_m = 0, scenario.config.vehicle.wheelbase_m
    for line, output in outputs(scenario):
        rounding_m = quantisation_error_m(line.profile, RANGES_M)
        values = on_the_bus(line, output)
        for side, truth in line_truths(output, wheelbase_m).items():
            word = SIDE_NAMES[side]
            if not values[f"{word}.available"]:
                continue
            reported = (
                values[f"{word}.offset_m"],
                values[f"{word}.heading"],
                values[f"{word}.curvature_per_m"] / 2,
                values[f"{word}.curvature_rate_per_m2"] / 6,
            )
            boundary = output.estimate.on(side)
            if not boundary.measured:  # see tests/tracker/test_in_the_sensor.py
                continue
            for x, true_y in zip(RANGES_M, truth.y_m.tolist(), strict=True):
                if boundary.x_min_m <= x <= boundary.x_max_m and not math.isnan(true_y):
                    best = abs(np.polynomial.polynomial.polyval(x, truth.coefficients) - true_y)
                    error = abs(np.polynomial.polynomial.polyval(x, reported) - true_y)
                    assert error <= best + rounding_m[x] + 1e-3, (output.tick.index, word, x)
                    compared += 1
    assert compared > 0


@needs_shared
@pytest.mark.parametrize("name", ["e6mini.xodr", "curves_elevation.xodr", "velodrome.xodr"])
def test_the_pixel_grid_moves_no_point_farther_than_half_a_pixel_along_a_camera_axis(name):
    scenario = load_scenario(str(SHARED_DATA / "xodr" / name), EXACT | {"camera": {"pixel_grid": True}})
    from vsensor.camera import camera_from_ego
    from vsensor.transforms import transform

    points = 0
    for line, output in outputs(scenario, 200):
        camera, seen = line.sensor.camera, output.observation
        exact = seen.candidates.points_ego_m[seen.reason == 0]
        to_camera = camera_from_ego(camera, output.snapshot.ego)
        before, after = transform(to_camera, exact), transform(to_camera, seen.lines.points_ego_m)
        bound = before[:, 2:] / (2.0 * np.array([camera.fx_px, camera.fy_px]))
        moved = np.abs(after - before)
        assert (moved[:, :2] <= bound * (1 + 1e-9) + 1e-9).all()
        assert (moved[:, 2] <= 1e-9).all()
        points += len(exact)
    assert points > 10_000
