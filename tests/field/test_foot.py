"""The error of a point against a line: closed forms, and what must not change it."""

import numpy as np
import pytest

from vsensor.field.foot import Polyline, feet, nearest_places, resampled_line

SPACING_M = 0.5


def polyline(x, y, **more):
    given = {"gap": np.zeros(len(x) - 1, dtype=bool), "lane": np.zeros(len(x), dtype=np.int64)}
    return Polyline(x_m=np.asarray(x, float), y_m=np.asarray(y, float), **(given | more))


def arc(radius_m, angle_rad, spacing_m=SPACING_M):
    """Return an arc to the left from the origin to the east."""
    turn = np.linspace(0.0, angle_rad, int(radius_m * angle_rad / spacing_m) + 1)
    return polyline(radius_m * np.sin(turn), radius_m * (1.0 - np.cos(turn)))


def errors(line, x, y, place, reach=20.0):
    x, y, place = (np.array(v, float).ravel() for v in np.broadcast_arrays(x, y, place))
    return feet(line, x, y, place, np.full(len(x), reach))


def test_left_of_a_straight_line_is_positive_and_as_far_as_it_is():
    line = polyline(np.arange(0.0, 50.0, SPACING_M), np.zeros(100))
    found = errors(line, [10.2, 10.2], [0.7, -0.7], 18.0)
    np.testing.assert_allclose(found.error_m, [0.7, -0.7], atol=1e-12)
    np.testing.assert_allclose(found.place, 10.2 / SPACING_M, atol=1e-12)


@pytest.mark.parametrize("shift_m", [-1.0, -0.05, 0.05, 1.0])
def test_points_beside_an_arc_are_their_distance_from_it_up_to_the_sagitta_of_its_chords(shift_m):
    radius, angle = 250.0, np.linspace(0.05, 0.55, 200)
    line = arc(radius, 0.6)
    x, y = (radius - shift_m) * np.sin(angle), radius - (radius - shift_m) * np.cos(angle)
    found = errors(line, x, y, radius * angle / SPACING_M)
    np.testing.assert_allclose(found.error_m, shift_m, atol=SPACING_M**2 / (8 * radius))


def test_beyond_either_end_there_is_no_error():
    line = polyline([0.0, 1.0, 2.0], [0.0, 0.0, 0.0])
    found = errors(line, [-0.1, 2.1, 1.0], [0.3, 0.3, 0.3], 1.0)
    np.testing.assert_array_equal(np.isnan(found.error_m), [True, True, False])


def test_at_a_sharp_corner_the_foot_is_the_corner():
    line = polyline([0.0, 1.0, 1.0], [0.0, 0.0, 1.0])
    found = errors(line, 1.3, -0.4, 0.5)
    np.testing.assert_allclose(found.error_m, -0.5, atol=1e-12)


def test_a_line_turned_and_moved_with_its_points_has_the_same_errors():
    random = np.random.default_rng(3)
    line = arc(60.0, 1.5)
    at = random.uniform(5.0, 80.0, 50)
    x, y = np.interp(at / SPACING_M, np.arange(len(line.x_m)), line.x_m), random.normal(0, 0.5, 50)
    y = y + np.interp(at / SPACING_M, np.arange(len(line.x_m)), line.y_m)
    turn, shift = 2.2, 4.0e5
    cos, sin = np.cos(turn), np.sin(turn)
    moved = polyline(cos * line.x_m - sin * line.y_m + shift, sin * line.x_m + cos * line.y_m - shift)
    plain = errors(line, x, y, at / SPACING_M)
    turned = errors(moved, cos * x - sin * y + shift, sin * x + cos * y - shift, at / SPACING_M)
    np.testing.assert_allclose(turned.error_m, plain.error_m, atol=1e-8)


def test_a_mirrored_scene_has_the_opposite_errors():
    line = arc(100.0, 0.5)
    mirrored = polyline(line.x_m, -line.y_m)
    x, y, place = np.array([20.0, 30.0]), np.array([2.5, 4.0]), np.array([40.0, 60.0])
    np.testing.assert_allclose(
        errors(mirrored, x, -y, place).error_m, -errors(line, x, y, place).error_m, atol=1e-12
    )


def test_on_a_roundabout_driven_twice_the_foot_is_on_the_round_where_it_is_expected():
    turn = np.arange(0.0, 4 * np.pi, 0.02)
    radius = 20.0 + turn / 10  # the second round lies beside the first
    line = polyline(radius * np.sin(turn), -radius * np.cos(turn))
    first, second = 2.0, 2.0 + 2 * np.pi
    x, y = 20.1 * np.sin(first), -20.1 * np.cos(first)
    found = errors(line, [x, x], [y, y], np.array([first, second]) / 0.02, reach=60.0)
    np.testing.assert_allclose(found.error_m, [0.1, 0.728], atol=2e-3)


def test_a_guess_some_metres_off_finds_the_same_foot():
    line = arc(250.0, 0.6)
    x, y = 250.3 * np.sin(0.3), 250.0 - 250.3 * np.cos(0.3)
    guesses = 0.3 * 250.0 / SPACING_M + np.arange(-12.0, 13.0, 3.0)
    found = errors(line, np.full(9, x), np.full(9, y), guesses)
    np.testing.assert_allclose(found.place, found.place[4], atol=1e-9)


def test_points_and_places_that_are_not_known_have_no_error():
    line = polyline(np.arange(10.0), np.zeros(10))
    found = errors(line, [5.0, np.nan, 5.0], [1.0, 1.0, 1.0], [5.0, 5.0, np.nan])
    np.testing.assert_array_equal(found.error_m, [1.0, np.nan, np.nan])


def test_the_nearest_place_leads_the_vehicles_way_where_a_line_runs_back_beside_itself():
    there, back = np.arange(0.0, 100.0), np.arange(100.0, 0.0, -1.0)
    line = polyline(np.concatenate([there, back]), np.concatenate([np.zeros(100), np.full(100, 4.0)]))
    places = nearest_places(line, np.array([50.0, 50.0]), np.array([2.5, 1.5]), np.array([0.0, np.pi]), 10.0)
    np.testing.assert_array_equal(places, [50.0, 150.0])


def test_a_resampled_line_keeps_its_shape_and_its_gaps():
    x, y = np.array([0.0, 3.0, 10.0, 11.0]), np.array([0.0, 0.0, 0.0, 0.0])
    line = resampled_line(x, y, np.array([False, True, False]), 0.5)
    assert np.ptp(np.diff(line.x_m)) < 1e-9
    middle = (line.x_m[1:] + line.x_m[:-1]) / 2
    np.testing.assert_array_equal(line.gap, (middle > 3.0) & (middle < 10.0))
