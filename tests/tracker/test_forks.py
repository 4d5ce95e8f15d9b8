"""Lines that part or join: the one of the driven path keeps the place, the other becomes the next one."""

import numpy as np
import pytest

from tests.tracker.images import LEFT, NEXT_LEFT, NEXT_RIGHT, RIGHT, SIDES_ONLY, drive, line
from vsensor.tracker import TrackerConfig

CONFIG = TrackerConfig()
SPEED_MPS = 20.0
STEP_M = 0.8
VIEW_M = 60.0
MIRROR = {LEFT: RIGHT, RIGHT: LEFT, NEXT_LEFT: NEXT_RIGHT, NEXT_RIGHT: NEXT_LEFT}


def straight(y, at_m, first_m=-1e9, last_m=1e9):
    """A straight line of the road between two places, from the vehicle at `at_m`; None if out of view."""
    begin, end = max(4.0, first_m - at_m), min(VIEW_M, last_m - at_m)
    return line(y, 0.0, x_min_m=begin, x_max_m=end) if end - begin > 8.0 else None


def leaving(y, at_m, fork_m, bend=1.0 / 400.0, sign=-1.0):
    """A line that parts from the straight one at `fork_m` with a curvature, to the right."""
    begin, end = max(4.0, fork_m - at_m), VIEW_M
    if end - begin <= 8.0:
        return None
    here = at_m - fork_m  # y = sign * bend / 2 * (x + here)^2
    half = sign * 0.5 * bend
    return line(y + half * here**2, 2.0 * half * here, half, x_min_m=begin, x_max_m=end)


def mirrored(fit):
    if fit is None:
        return None
    return line(*(-fit.coefficients), x_min_m=fit.x_min_m, x_max_m=fit.x_max_m)


def exit_at(at_m, fork_m=100.0):
    """Left line, right line going on, and an exit's line parting from it to the right."""
    return straight(1.75, at_m), straight(-1.75, at_m), leaving(-1.75, at_m, fork_m)


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_past_an_exit_the_right_line_goes_on_and_the_exits_line_is_the_next_one(is_mirrored):
    images = [exit_at(STEP_M * n) for n in range(160)]
    if is_mirrored:
        images = [tuple(mirrored(fit) for fit in fits) for fits in images]
    found, _ = drive(images, SPEED_MPS, CONFIG)
    own, other, beyond = (RIGHT, LEFT, NEXT_RIGHT) if not is_mirrored else (LEFT, RIGHT, NEXT_LEFT)
    for one in found[2:]:
        assert (one.sides[own], one.sides[other]) == (1, 0)
        assert one.sides.get(beyond, 2) == 2
    # known as a line of its own well before the vehicle is there, and from then on in every image
    first = next(n for n, one in enumerate(found) if beyond in one.sides)
    assert STEP_M * first < 85.0
    assert all(beyond in one.sides for one in found[first:])
    assert not any(one.lane_change for one in found)


def test_where_the_road_widens_the_line_that_goes_on_with_the_path_takes_the_place_when_it_is_beside():
    # the right border bends away; a new line begins there and goes on straight
    def image(n):
        at = STEP_M * n
        return straight(1.75, at), leaving(-1.75, at, 100.0), straight(-1.75, at, first_m=100.0)

    def border(n):
        at = STEP_M * n
        return straight(-1.75, at, last_m=100.0) or image(n)[1]

    found, _ = drive([(image(n)[0], border(n), image(n)[2]) for n in range(160)], SPEED_MPS, CONFIG)
    sides = [one.sides for one in found]
    assert sides[10][RIGHT] == 1
    assert sides[-1] == {LEFT: 0, RIGHT: 2, NEXT_RIGHT: 1}
    assert not any(one.lane_change for one in found)


def test_of_two_lines_that_begin_at_one_place_ahead_the_one_that_follows_the_path_is_the_own_one():
    for order in ((0, 1, 2), (0, 2, 1), (2, 0, 1)):
        fits = [straight(1.75, 0.0), straight(-1.75, 60.0, 70.0), leaving(-1.75, 60.0, 70.0)]
        found, state = drive([[fits[k] for k in order]], SPEED_MPS, SIDES_ONLY)
        sides = found[0].sides
        assert [track.position_m for track in state.tracks][:2] == pytest.approx([1.75, -1.75])
        assert {side: order[k] for side, k in sides.items()} == {LEFT: 0, RIGHT: 1, NEXT_RIGHT: 2}


def test_a_vehicle_that_takes_the_exit_follows_the_exits_line():
    bend = 1.0 / 400.0

    def image(n):
        """On the exit's arc: its lines are a bend, the road that goes on parts to the left."""
        at = STEP_M * n
        half = -0.5 * bend
        own = [line(y, 0.0, half, x_max_m=VIEW_M) for y in (1.75, -1.75)]
        return *own, straight_from_the_exit(at)

    def straight_from_the_exit(at_m):
        angle = bend * at_m  # the vehicle has turned right by it since the fork, where the line lay at 1.75
        aside = 0.5 * bend * at_m**2
        return line((1.75 + aside), angle, x_min_m=4.0, x_max_m=VIEW_M)

    found, _ = drive([image(n) for n in range(5, 60)], SPEED_MPS, CONFIG, yaw_rate_radps=-SPEED_MPS * bend)
    for one in found[3:]:
        assert (one.sides[LEFT], one.sides[RIGHT]) == (0, 1)
    assert found[-1].sides[NEXT_LEFT] == 2


def test_lines_that_join_become_one_and_the_own_one_stays():
    def image(n):
        at = STEP_M * n
        ramp = -1.75 - 0.05 * max(80.0 - at, 0.0)  # joins the right line at 80 m
        slope = 0.05 if at < 80.0 else 0.0
        joining = line(ramp, slope, x_max_m=min(VIEW_M, max(80.0 - at, 10.0)))
        return straight(1.75, at), straight(-1.75, at), joining if at < 72.0 else None

    found, state = drive([image(n) for n in range(130)], SPEED_MPS, CONFIG)
    assert all((one.sides[LEFT], one.sides[RIGHT]) == (0, 1) for one in found[2:])
    assert found[30].sides[NEXT_RIGHT] == 2
    assert not any(one.lane_change for one in found)
    assert {track.side for track in state.tracks} == {LEFT, RIGHT}


def test_two_fits_to_one_paint_that_differ_by_noise_ahead_are_one_line():
    noisy = line(-1.75, 0.005, 1e-4)  # 0.9 m aside at its end
    found, _ = drive([(straight(1.75, 0.0), straight(-1.75, 0.0), noisy)], SPEED_MPS, SIDES_ONLY)
    assert set(found[0].sides) == {LEFT, RIGHT}


def test_near_a_fork_each_line_keeps_its_own_number_though_they_lie_side_by_side():
    _, state = drive([exit_at(STEP_M * n) for n in range(160)], SPEED_MPS, CONFIG)
    assert sorted(track.number for track in state.tracks) == [0, 1, 2]
    by_position = [track.number for track in sorted(state.tracks, key=lambda track: -track.position_m)]
    assert by_position == [0, 1, 2]
    assert np.diff([track.position_m for track in state.tracks]).max() < 0.0


def test_two_lines_that_lie_side_by_side_are_told_apart_by_where_they_go():
    on, off = line(-1.75), line(-2.15, 0.0, -0.005)
    jumped = line(-2.1), line(-1.78, 0.0, -0.005)  # each where the other one was
    _, state = drive([(on, off)] * 3 + [jumped], 0.0, CONFIG)
    last = {track.number: track.last.fit for track in state.tracks}
    assert last == {0: jumped[0], 1: jumped[1]}
