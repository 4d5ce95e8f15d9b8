"""Which line is on which side, with every line counted at once and none predicted."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.lines import ego, tick
from tests.tracker.images import LEFT, NEXT_LEFT, NEXT_RIGHT, RIGHT, SIDES_ONLY, line, shown
from tests.tracker.images import drive as drive_over
from vsensor.tracker import assign, initial_state

CONFIG = SIDES_ONLY


def parallel(line_, by):
    """A line beside another, at the same distance everywhere (to first order)."""
    coefficients = line_.coefficients.copy()
    coefficients[0] += by
    return line(*coefficients)


def sides(*fits, config=CONFIG, state=None, ego_=None, index=0):
    return assign(config, state or initial_state(), shown(fits), ego_ or ego(), tick(index))[1].sides


def drive(images, speed_mps=0.0, config=CONFIG, state=None, first=0):
    """Run over images (tuples of fits); return per image the sides and the lane changes."""
    found, state = drive_over(images, speed_mps, config, state, first)
    return [one.sides for one in found], [one.lane_change for one in found], state


# --- one image --------------------------------------------------------------------------------------


def test_lines_are_numbered_outwards_from_the_vehicle():
    found = sides(line(-5.2), line(1.7), line(5.3), line(-1.8))
    assert found == {LEFT: 1, RIGHT: 3, NEXT_LEFT: 2, NEXT_RIGHT: 0}


def test_a_fifth_line_has_no_side():
    found = sides(line(0.5), line(2.5), line(4.5), line(-3.0), line(7.5))
    assert found == {LEFT: 0, NEXT_LEFT: 1, RIGHT: 3}


def test_no_lines_and_lines_without_a_fit_have_no_side():
    assert sides() == {}
    assert sides(None, None) == {}
    assert sides(None, line(1.7), None) == {LEFT: 1}


@given(st.lists(st.floats(-7.9, 7.9), max_size=8))
def test_a_mirrored_road_swaps_left_and_right(offsets):
    mirror = {LEFT: RIGHT, RIGHT: LEFT, NEXT_LEFT: NEXT_RIGHT, NEXT_RIGHT: NEXT_LEFT}
    offsets = [offset for offset in offsets if abs(offset) > 1e-3]
    found = sides(*(line(offset, 0.01, 1e-4) for offset in offsets))
    mirrored = sides(*(line(-offset, -0.01, -1e-4) for offset in offsets))
    assert mirrored == {mirror[side]: k for side, k in found.items()}


@given(st.permutations([5.2, 1.7, -1.8, -5.3]))
def test_the_order_in_which_lines_come_does_not_matter(offsets):
    found = sides(*(line(offset) for offset in offsets))
    assert {side: offsets[k] for side, k in found.items()} == {
        NEXT_LEFT: 5.2,
        LEFT: 1.7,
        RIGHT: -1.8,
        NEXT_RIGHT: -5.3,
    }


def test_a_line_beyond_the_lateral_limit_is_ignored():
    config = replace(CONFIG, max_lateral_m=6.0)
    assert sides(line(1.7), line(6.1), line(-5.9), config=config) == {LEFT: 0, NEXT_RIGHT: 2}


def test_a_line_too_far_for_the_own_lane_is_the_next_one_though_no_other_is_seen():
    assert sides(line(4.4), line(-4.6)) == {LEFT: 0, NEXT_RIGHT: 1}
    assert sides(line(4.6), line(-4.4)) == {NEXT_LEFT: 0, RIGHT: 1}


@pytest.mark.parametrize("better", [{"x_max_m": 90.0}, {"points": 501}])
def test_of_two_fits_to_the_same_paint_the_better_seen_is_kept(better):
    assert sides(line(1.7), line(1.9, **better), line(-1.8)) == {LEFT: 1, RIGHT: 2}
    assert sides(line(1.9, **better), line(1.7), line(-1.8)) == {LEFT: 0, RIGHT: 2}


def test_lines_farther_apart_than_the_separation_are_two():
    assert sides(line(1.7), line(2.01)) == {LEFT: 0, NEXT_LEFT: 1}


def test_in_a_bend_a_line_seen_only_far_ahead_is_placed_beside_one_seen_near_and_far():
    bend = line(-1.8, 0.0, 1.0 / 500.0)  # radius 250 m to the left: 4.9 m to the left at 70 m
    far_left = line(1.7, 0.0, 1.0 / 500.0, x_min_m=50.0, x_max_m=75.0)
    far_right = line(-5.3, 0.0, 1.0 / 500.0, x_min_m=50.0, x_max_m=75.0)
    assert sides(bend, far_left, far_right) == {RIGHT: 0, LEFT: 1, NEXT_RIGHT: 2}


def test_a_line_far_ahead_is_placed_beside_the_nearest_of_the_lines_seen_there():
    ramp = line(-5.3, 0.0, -1.0 / 500.0)  # leaves the straight road to the right: 5 m at 50 m
    assert sides(ramp, line(-1.8), line(-5.3, x_min_m=50.0, x_max_m=75.0)) == {
        RIGHT: 1,
        NEXT_RIGHT: 0,
    }
    assert sides(ramp, line(-1.8), line(1.7, x_min_m=50.0, x_max_m=75.0)) == {
        LEFT: 2,
        RIGHT: 1,
        NEXT_RIGHT: 0,
    }


def test_in_a_bend_lines_seen_only_far_ahead_are_placed_beside_the_driven_path():
    # y is read at 50 m, where this bend has both lines on the left of the vehicle's x axis
    far = [line(y, 0.0, 1.0 / 500.0, x_min_m=50.0, x_max_m=75.0) for y in (1.7, -1.8)]
    assert sides(*far, ego_=ego(20.0, yaw_rate_radps=20.0 / 250.0)) == {LEFT: 0, RIGHT: 1}


def test_a_line_that_begins_behind_a_bend_is_placed_where_it_begins_not_where_its_cubic_leads_back_to():
    # the own left line of a junction's entry, painted from 21 m on: 1.9 m to the left there
    behind_the_bend = line(-2.19, 0.321, -0.0081, 1e-4, x_min_m=21.3, x_max_m=90.8)
    assert sides(behind_the_bend) == {LEFT: 0}
    assert sides(behind_the_bend, line(-1.75)) == {LEFT: 0, RIGHT: 1}


def test_a_line_far_ahead_is_not_placed_beside_a_line_that_leaves_the_road():
    leaving = line(2.3, 0.23, -0.0054, x_min_m=9.0, x_max_m=57.0)
    far = line(1.74, x_min_m=31.0, x_max_m=57.0)
    assert sides(leaving, far, line(-1.75)) == {LEFT: 1, NEXT_LEFT: 0, RIGHT: 2}


def test_a_camera_that_sees_no_nearer_than_12_m_places_lines_at_the_vehicle_all_the_same():
    crossing = [line(y, -0.05, x_min_m=12.5) for y in (0.3, -3.2)]  # on the right from 6 m on
    assert sides(*crossing) == {LEFT: 0, RIGHT: 1}


def test_lines_seen_only_far_ahead_while_crossing_the_lane_are_placed_by_the_heading_known_from_before():
    state, _ = assign(CONFIG, initial_state(), shown([line(1.0, -0.03)]), ego(20.0), tick(0))
    _, found = assign(CONFIG, state, shown([line(1.0, -0.03, x_min_m=50.0)]), ego(20.0), tick(1))
    assert found.sides == {LEFT: 0}  # at 50 m it is 0.5 m to the right of the vehicle's x axis


def test_a_short_piece_of_line_far_ahead_is_not_extended_to_the_vehicle_by_its_own_cubic():
    wild = line(*np.polynomial.polynomial.polyfromroots([30.0, 31.0, 32.0]), x_min_m=30.0, x_max_m=32.0)
    assert sides(wild, line(-1.8), parallel(line(-1.8), 3.5)) == {RIGHT: 1, LEFT: 0, NEXT_LEFT: 2}


@pytest.mark.parametrize("speed_mps", [np.nan, 0.0, np.inf])
def test_an_unknown_or_standing_ego_is_no_trouble(speed_mps):
    state, _ = assign(CONFIG, initial_state(), shown([line(1.7)]), ego(speed_mps), tick(0))
    far = line(1.7, x_min_m=50.0)
    state, found = assign(CONFIG, state, shown([far]), ego(speed_mps, np.nan), tick(1))
    assert found.sides == {LEFT: 0}


# --- image after image ------------------------------------------------------------------------------


def test_a_line_that_jitters_about_the_centre_keeps_its_side():
    images = [(line(y), line(y - 3.5)) for y in (0.3, 0.05, -0.1, 0.1, -0.15, 0.05)]
    found, changes, _ = drive(images)
    assert found == [{LEFT: 0, RIGHT: 1}] * 6
    assert changes == [0] * 6


@pytest.mark.parametrize(("direction", "sign"), [(1, -1.0), (-1, 1.0)])
def test_crossing_a_line_swaps_the_sides_once_and_flags_one_lane_change(direction, sign):
    drift = sign * np.arange(0.0, 3.5, 0.04)
    images = [tuple(line(y + by) for y in (5.25, 1.75, -1.75, -5.25)) for by in drift]
    found, changes, _ = drive(images)
    assert found[0] == {NEXT_LEFT: 0, LEFT: 1, RIGHT: 2, NEXT_RIGHT: 3}
    last = {LEFT: 0, RIGHT: 1, NEXT_RIGHT: 2} if direction == 1 else {NEXT_LEFT: 1, LEFT: 2, RIGHT: 3}
    assert {side: found[-1][side] for side in last} == last
    assert [change for change in changes if change] == [direction]
    crossed = changes.index(direction)
    assert abs(drift[crossed]) == pytest.approx(1.75 + CONFIG.hysteresis_m, abs=0.04)
    swaps = sum(a[LEFT] != b[LEFT] for a, b in pairwise(found))
    assert swaps == 1


def test_a_crossing_undone_is_two_lane_changes():
    there = np.arange(0.0, 2.5, 0.04)
    drift = np.concatenate([there, there[::-1]])
    _, changes, _ = drive([(line(1.75 - by), line(-1.75 - by)) for by in drift])
    assert [change for change in changes if change] == [1, -1]


def test_a_line_unseen_for_a_moment_comes_back_on_its_side():
    seen, gone = (line(0.1), line(-3.4)), (None, line(-3.4))
    slipped = (line(-0.1), line(-3.6))
    found, changes, _ = drive([seen, *[gone] * 5, slipped])
    assert found[-1] == {LEFT: 0, RIGHT: 1}
    assert found[1] == {RIGHT: 1}
    assert changes == [0] * 7


def test_a_line_unseen_for_longer_than_the_memory_is_placed_anew():
    seen, gone = (line(0.1), line(-3.4)), (None, line(-3.4))
    found, _, _ = drive([seen, *[gone] * 15, (line(-0.1), line(-3.6))])
    assert found[-1] == {RIGHT: 0, NEXT_RIGHT: 1}


def test_an_unseen_line_is_expected_where_the_vehicle_has_gone_meanwhile():
    # heading 0.1 rad to the left at 30 m/s: the line comes 0.12 m nearer in every image
    def at(index):
        return line(1.5 - 0.12 * index, -0.1)

    # at 13 it is at -0.06 m, 1.56 m from where it was seen: known (and so still left) only if expected
    found, changes, _ = drive([(at(0),), *[()] * 12, *[(at(k),) for k in (13, 14, 15)]], speed_mps=30.0)
    assert found[-3:] == [{LEFT: 0}, {LEFT: 0}, {RIGHT: 0}]
    assert changes[-3:] == [0, 0, 1]


def test_a_line_beyond_the_gate_is_another_line():
    found, changes, _ = drive([(line(0.9),), (line(-0.9),)])
    assert found[1] == {RIGHT: 0}
    assert changes == [0, 0]


def test_what_lies_left_of_a_left_line_is_left_even_within_the_hysteresis():
    config = replace(CONFIG, hysteresis_m=1.0)
    found, changes, _ = drive([(line(-0.1),), (line(0.5),), (line(0.6), line(0.1))], config=config)
    assert found == [{RIGHT: 0}, {RIGHT: 0}, {LEFT: 1, NEXT_LEFT: 0}]
    assert changes == [0, 0, -1]


def test_no_other_line_takes_the_side_of_a_confirmed_line_that_is_hidden_for_a_moment():
    both, far = (line(1.0), line(4.0)), (None, line(4.0))
    found, _, _ = drive([*[both] * 5, *[far] * 15])
    assert found[5:17] == [{NEXT_LEFT: 1}] * 12
    assert found[-1] == {LEFT: 1}


def test_a_line_seen_in_fewer_images_than_it_takes_to_confirm_holds_no_side():
    config = replace(CONFIG, confirm_images=5)
    found, _, _ = drive([*[(line(1.0), line(4.0))] * 4, (None, line(4.0))], config=config)
    assert found[-1] == {LEFT: 1}


def test_a_line_is_remembered_once_however_long_it_is_seen():
    state = drive([(line(1.7), line(-1.8))] * 10)[2]
    assert [track.side for track in state.tracks] == [LEFT, RIGHT]


def test_a_jump_by_a_whole_lane_is_no_lane_change():
    _, changes, _ = drive([(line(1.75), line(-1.75)), (line(5.25), line(1.75), line(-1.75))])
    assert changes == [0, 0]


def test_a_run_restarted_from_a_saved_state_gives_the_same_sides():
    drift = np.arange(0.0, 3.5, 0.04)
    images = [tuple(line(y - by) for y in (5.25, 1.75, -1.75)) for by in drift]
    whole, changes, _ = drive(images)
    for at in (1, 47, 48, 49, 50):
        state = pickle.loads(pickle.dumps(drive(images[:at])[2]))
        sides_, changes_, _ = drive(images[at:], state=state, first=at)
        assert sides_ == whole[at:]
        assert changes_ == changes[at:]
