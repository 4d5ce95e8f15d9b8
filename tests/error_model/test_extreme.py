import numpy as np
import pytest

from tests.error_model.models import (
    SPEED_MPS,
    X_M,
    constant_model,
    flat_model,
    law_of,
    once,
    two_straight_lines,
)
from tests.lines import line_points, points_of
from vsensor.errors import ConfigError


def extreme(model, direction, lines, level=0.95, speed_mps=SPEED_MPS, scale=1.0, seed=1):
    law = law_of(model, "extreme", direction=direction, level=level, scale=scale)
    return once(law, lines, speed_mps, seed)


@pytest.mark.parametrize(
    ("direction", "left_sign", "right_sign"),
    [("left", 1, 1), ("right", -1, -1), ("inward", -1, 1), ("outward", 1, -1)],
)
def test_extreme_moves_a_straight_line_sideways_by_the_surface(direction, left_sign, right_sign):
    moved = extreme(flat_model(), direction, two_straight_lines())
    surface = 2.0 * 0.01 * (X_M + SPEED_MPS)
    np.testing.assert_allclose(points_of(moved, 0)[:, 1], 1.75 + left_sign * surface, atol=1e-12)
    np.testing.assert_allclose(points_of(moved, 1)[:, 1], -1.75 + right_sign * surface, atol=1e-12)
    np.testing.assert_array_equal(moved.points_ego_m[:, 0], two_straight_lines().points_ego_m[:, 0])


def test_extreme_takes_the_surface_of_the_level_that_was_asked_for():
    lines = two_straight_lines()
    low = extreme(flat_model(), "left", lines, level=0.5).points_ego_m - lines.points_ego_m
    high = extreme(flat_model(), "left", lines, level=0.95).points_ego_m - lines.points_ego_m
    np.testing.assert_allclose(high, 2.0 * low, atol=1e-12)


def test_scale_multiplies_the_shift():
    lines = two_straight_lines()
    moved = extreme(constant_model(0.1), "left", lines, scale=3.0)
    np.testing.assert_allclose(moved.points_ego_m[:, 1] - lines.points_ego_m[:, 1], 0.3, atol=1e-12)


def test_an_inclined_line_is_moved_along_its_normal():
    moved = extreme(constant_model(0.5), "left", line_points((X_M, 0.75 * X_M)))
    shift = moved.points_ego_m - line_points((X_M, 0.75 * X_M)).points_ego_m
    np.testing.assert_allclose(shift, np.tile([-0.3, 0.4, 0.0], (len(X_M), 1)), atol=1e-12)


def test_an_arc_moved_to_its_inside_is_an_arc_of_smaller_radius():
    radius, error = 250.0, 0.3
    angle = np.arange(0.0, 100.0, 0.1) / radius
    lines = line_points((radius * np.sin(angle), radius * (1.0 - np.cos(angle))))
    moved = extreme(constant_model(error), "left", lines).points_ego_m
    found = np.hypot(moved[:, 0], moved[:, 1] - radius)
    # the direction is held over the last chord and a half: error * (7.5 m / radius)^2 / 2 = 135 um
    np.testing.assert_allclose(found, radius - error, atol=1.4e-4)


def test_the_pixel_grid_of_a_line_does_not_turn_its_normal():
    x = np.arange(5.0, 100.0, 0.1)
    stairs = np.round((1.75 + 0.01 * x) / 0.04) * 0.04
    moved = extreme(constant_model(0.5), "left", line_points((x, stairs))).points_ego_m
    assert np.abs(moved[:, 0] - x).max() < 0.5 * 0.02
    assert np.all(np.diff(moved[:, 0]) > 0.0)


def test_random_direction_is_the_same_for_a_whole_drive_and_both_occur():
    def sign(seed, index):
        law = law_of(constant_model(0.1), "extreme", direction="random")
        moved = once(law, two_straight_lines(), seed=seed, index=index)
        shift = moved.points_ego_m[:, 1] - two_straight_lines().points_ego_m[:, 1]
        assert np.allclose(shift, shift[0])
        return int(np.sign(shift[0]))

    assert all(len({sign(seed, index) for index in (0, 1, 50)}) == 1 for seed in range(5))
    assert {sign(seed, 0) for seed in range(20)} == {-1, 1}


@pytest.mark.parametrize(("speed_mps", "used_mps"), [(90.0, 40.0), (-3.0, 0.0), (np.nan, 40.0), (13.0, 13.0)])
def test_a_speed_beyond_the_grid_takes_the_nearest_and_an_unknown_one_the_highest(speed_mps, used_mps):
    moved = extreme(flat_model(), "left", line_points((X_M, 0.0 * X_M)), speed_mps=speed_mps)
    np.testing.assert_allclose(moved.points_ego_m[:, 1], 0.02 * (X_M + used_mps), atol=1e-12)


def test_a_range_beyond_the_grid_takes_the_nearest():
    x = np.array([-20.0, -1.0, 150.0, 200.0])
    moved = extreme(flat_model(), "left", line_points((x, 0.0 * x))).points_ego_m
    np.testing.assert_allclose(moved[:, 1], 0.02 * (np.clip(x, 0.0, 120.0) + SPEED_MPS), atol=1e-12)


def test_a_level_that_the_file_does_not_have_is_refused_with_those_it_has():
    with pytest.raises(ConfigError, match=r"level = 0\.94: the file has the levels 0\.5, 0\.95"):
        law_of(flat_model(), "extreme", level=0.94)
