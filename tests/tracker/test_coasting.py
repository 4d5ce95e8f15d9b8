"""Lines are confirmed, predicted while they are not seen, taken up again, and dropped."""

import pickle

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.polynomial import polynomial

from tests.lines import ego, tick
from tests.tracker.images import LEFT, NEXT_LEFT, RIGHT, SIDES_ONLY, drive, line, sighting
from vsensor.tracker import TrackerConfig, assign, initial_state
from vsensor.types import Colour, MarkingKind

CONFIG = TrackerConfig()
SPEED_MPS = 80.0 / 3.6
STEP_M = SPEED_MPS * 0.04


def on(side, assignment):
    return next((one for one in assignment.boundaries if one.side is side), None)


def unseen_after(images, gone, config=CONFIG, **changes):
    """Drive over `images` images of a straight left line of 80 m, and over `gone` without it."""
    return drive([*[(line(1.75, **changes),)] * images, *[()] * gone], SPEED_MPS, config)


# --- confirmed --------------------------------------------------------------------------------------


def test_a_new_line_is_reported_from_the_third_image_on():
    found, _ = unseen_after(5, 0)
    assert [len(one.boundaries) for one in found] == [0, 0, 1, 1, 1]


def test_a_line_that_comes_and_goes_is_not_reported():
    found, _ = drive([(line(1.75),), ()] * 20, SPEED_MPS, CONFIG)
    assert all(one.boundaries == () for one in found)


def test_a_line_missed_once_in_a_while_is_confirmed_all_the_same():
    found, _ = drive([(line(1.75),), (line(1.75),), ()] * 4, SPEED_MPS, CONFIG)
    assert [len(one.boundaries) for one in found] == [0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1]


def test_a_new_line_moves_no_confirmed_one_from_its_side_until_it_is_confirmed_itself():
    own, new = line(3.0), line(1.0)
    found, _ = drive([*[(own,)] * 5, *[(own, new)] * 3], 0.0, CONFIG)
    assert [one.sides for one in found[4:]] == [{LEFT: 0}, {LEFT: 0}, {LEFT: 0}, {LEFT: 1, NEXT_LEFT: 0}]


# --- predicted --------------------------------------------------------------------------------------


def test_a_line_that_is_not_seen_is_predicted_with_the_paint_it_had():
    found, _ = unseen_after(3, 1)
    left = on(LEFT, found[-1])
    assert (left.measured, left.points, left.marking) == (False, -1, -1)
    assert (left.kind, left.colour, left.width_m) == (MarkingKind.DASHED, Colour.YELLOW, 0.15)
    assert found[-1].predicted == {LEFT: 100}
    assert found[-1].sides == {}


def test_a_measured_line_is_the_fit_itself_however_it_was_predicted():
    fits = [line(1.75), line(1.75), line(1.75), None, line(1.80, 0.001, x_max_m=60.0)]
    found, _ = drive([(fit,) for fit in fits], SPEED_MPS, CONFIG)
    again = on(LEFT, found[-1])
    assert again.measured
    assert again.coefficients is fits[-1].coefficients
    assert again.covariance is fits[-1].covariance
    assert (again.x_min_m, again.x_max_m, again.points) == (4.0, 60.0, 0)


def test_on_a_straight_road_a_predicted_line_is_exact_and_its_range_what_was_seen_of_it():
    fit = line(1.75, 0.02)
    found, _ = drive([*[(fit,)] * 3, *[()] * 30], SPEED_MPS, CONFIG)
    for image, one in enumerate(found[3:], 1):
        left, driven_m = on(LEFT, one), image * STEP_M
        assert left.coefficients == pytest.approx([1.75 + 0.02 * driven_m, 0.02], abs=1e-9)
        assert left.x_max_m == pytest.approx(80.0 - driven_m)
        assert left.x_min_m == pytest.approx(max(4.0 - driven_m, 0.0))


@pytest.mark.parametrize("radius_m", [150.0, 500.0, -150.0])
def test_in_a_bend_a_predicted_line_follows_the_bend_within_a_centimetre(radius_m):
    x = np.linspace(4.0, 60.0, 300)

    def y(x):
        return radius_m - np.sign(radius_m) * np.sqrt((radius_m - 1.75) ** 2 - x**2)

    fit = line(*polynomial.polyfit(x, y(x), 3), x_max_m=60.0)
    speed_mps = 20.0
    found, _ = drive([*[(fit,)] * 3, *[()] * 50], speed_mps, CONFIG, yaw_rate_radps=speed_mps / radius_m)
    for one in found[3:]:
        left = on(LEFT, one)
        place = np.linspace(left.x_min_m, left.x_max_m, 50)
        assert np.abs(polynomial.polyval(place, left.coefficients) - y(place)).max() < 0.01


def test_while_speed_and_yaw_rate_change_the_motion_is_their_mean_between_two_images():
    state = drive([(line(1.75),)] * 3, 20.0, CONFIG)[1]
    _, found = assign(CONFIG, state, (), ego(22.0, 0.02), tick(3))
    left = on(LEFT, found)
    assert left.x_max_m == pytest.approx(80.0 - 21.0 * 0.04, abs=1e-3)
    assert left.coefficients[1] == pytest.approx(-np.tan(0.01 * 0.04), abs=1e-9)


@pytest.mark.parametrize("gap_m", [5.0, 15.0, 30.0, 50.0])
def test_a_gap_of_5_to_50_m_hidden_to_the_camera_is_bridged_at_80_kmh(gap_m):
    images = int(gap_m / STEP_M)
    found, _ = drive([*[(line(1.75),)] * 3, *[()] * images, (line(1.75),)], SPEED_MPS, CONFIG)
    assert all(on(LEFT, one) for one in found[2:])
    assert [on(LEFT, one).measured for one in found[2:]] == [True, *[False] * images, True]


def test_the_quality_falls_step_by_step_from_that_of_the_last_sight_to_nothing():
    found, _ = unseen_after(3, 80)
    qualities = [on(LEFT, one).quality if one.boundaries else 0 for one in found[2:]]
    assert qualities == sorted(qualities, reverse=True)
    assert set(qualities) == {4, 3, 2, 1, 0}
    assert all(b <= 1 for b in np.abs(np.diff(qualities)))


def test_a_poor_line_does_not_become_better_by_not_being_seen():
    state = initial_state()
    for image in range(3):
        state, _ = assign(CONFIG, state, (sighting(line(1.75), quality=2),), ego(SPEED_MPS), tick(image))
    found, _ = drive([()] * 50, SPEED_MPS, CONFIG, state, 3)
    assert {on(LEFT, one).quality for one in found} == {1, 2}


def test_a_line_is_dropped_where_the_seen_part_lies_behind_the_vehicle():
    found, state = unseen_after(3, 30, x_max_m=15.0)
    reported = [on(LEFT, one) for one in found[3:]]
    assert sum(one is not None for one in reported) == int(15.0 / STEP_M)
    assert all(one.x_max_m > 0.0 for one in reported if one)
    assert all(one.x_min_m <= one.x_max_m for one in reported if one)
    assert state.tracks == ()


@pytest.mark.parametrize(
    ("changes", "speed_mps", "images"),
    [
        ({"coast_s": 1.0}, SPEED_MPS, 24),  # the 25th is 1 s after the last sight
        ({"coast_m": 20.0}, SPEED_MPS, 22),
        ({}, 0.0, 62),
        ({"coast_s": 0.0}, SPEED_MPS, 0),
        ({"coast_m": 0.0}, 0.0, 0),
    ],
)
def test_a_line_is_predicted_for_coast_s_or_coast_m_whichever_ends_first(changes, speed_mps, images):
    found, state = drive([*[(line(1.75),)] * 3, *[()] * 80], speed_mps, replace(CONFIG, **changes))
    assert sum(bool(one.boundaries) for one in found[3:]) == images
    assert state.tracks == ()


def test_a_line_that_is_not_confirmed_is_not_predicted():
    found, _ = unseen_after(2, 5)
    assert all(one.boundaries == () for one in found)


# --- seen again -------------------------------------------------------------------------------------


def test_a_predicted_line_that_is_seen_again_is_the_same_line():
    found, state = drive([*[(line(1.75),)] * 3, *[()] * 25, (line(1.75),)], SPEED_MPS, CONFIG)
    assert [track.number for track in state.tracks] == [0]
    assert found[-1].sides == {LEFT: 0}


def test_the_gate_grows_while_a_line_is_not_seen():
    def again(gone):
        return drive([*[(line(1.0),)] * 3, *[()] * gone, (line(2.2),)], SPEED_MPS, CONFIG)[1].next_number

    assert again(1) == 2  # 1.2 m aside after 0.1 s is another line
    assert again(50) == 1  # after 2 s it is this one


def test_a_line_seen_again_only_far_ahead_is_known_there_and_keeps_its_place():
    # in this bend a line that begins at 30 m cannot be placed beside the vehicle by itself
    bend = (0.0, 1.0 / 100.0)
    near = [line(y, *bend, x_max_m=60.0) for y in (1.75, -1.75)]
    far = [line(y, *bend, x_min_m=30.0, x_max_m=60.0) for y in (1.75, -1.75)]
    found, state = drive([near] * 3 + [far] * 3, 0.0, CONFIG)
    assert found[-1].sides == {LEFT: 0, RIGHT: 1}
    assert [track.position_m for track in state.tracks] == pytest.approx([1.75, -1.75], abs=0.01)
    assert drive([far], 0.0, SIDES_ONLY)[0][0].sides != {LEFT: 0, RIGHT: 1}


def test_a_line_far_ahead_that_the_turning_vehicle_places_elsewhere_is_known_where_it_is_seen():
    far = line(1.75, x_min_m=30.0)
    state = drive([(far,)] * 3, 0.0, CONFIG)[1]
    after, _ = assign(
        CONFIG, state, (sighting(far),), ego(20.0, 0.08), tick(3)
    )  # its path is 1.8 m aside there
    assert [track.number for track in after.tracks] == [0]


def test_a_line_that_is_not_seen_is_expected_where_its_polynomial_leads():
    bend = line(1.75, 0.0, 1.0 / 200.0)
    _, state = drive(
        [(bend,)] * 3 + [()] * 25, 20.0, CONFIG
    )  # 20 m straight on: the line goes off to the left
    assert state.tracks[0].position_m == pytest.approx(1.75 + 20.0**2 / 200.0, abs=1e-6)


def test_a_predicted_line_ends_where_a_confirmed_one_is_seen_in_its_place():
    images = [*[(line(1.0),)] * 3, *[(line(2.05),)] * 3, (line(1.95),)]  # beyond the gate, then within
    found, state = drive(images, 0.0, CONFIG)
    assert len(found[-2].boundaries) == 2
    assert found[-1].sides == {LEFT: 0}
    assert len(state.tracks) == len(found[-1].boundaries) == 1


# --- lane changes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("is_seen", [True, False])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_line_crossed_changes_its_side_in_one_image_with_one_flag_seen_or_not(direction, is_seen):
    slope, speed_mps = -0.05 * direction, 30.0
    images = []
    for image in range(60):
        aside_m = slope * speed_mps * 0.04 * image
        lanes = [line(y * direction + aside_m, slope, x_max_m=90.0) for y in (5.25, 1.75, -1.75, -5.25)]
        images.append(lanes if image < 15 or is_seen else [lanes[0], None, *lanes[2:]])
    found, _ = drive(images, speed_mps, CONFIG)
    own, beyond, other = (LEFT, NEXT_LEFT, RIGHT) if direction == 1 else (RIGHT, LEFT + 2 + 1, LEFT)
    changes = [one.lane_change for one in found]
    assert [change for change in changes if change] == [direction]
    crossed = changes.index(direction)
    before, after = found[crossed - 1], found[crossed]
    assert on(other, after).measured is is_seen
    assert on(own, before).measured is is_seen
    assert before.sides[beyond] == 0
    assert after.sides[own] == 0  # what was the next line bounds the new lane
    assert abs(on(own, before).coefficients[0]) <= CONFIG.hysteresis_m + 0.06


def test_driving_on_a_line_that_is_seen_now_and_then_does_not_flicker():
    images = [(line(-0.1 * (-1) ** n), line(-3.5)) if n % 3 else (None, line(-3.5)) for n in range(40)]
    found, _ = drive(images, SPEED_MPS, CONFIG)
    assert not any(one.lane_change for one in found)
    assert all(on(LEFT, one) for one in found[5:])


# --- what is not known, and restarts ----------------------------------------------------------------


def test_while_the_motion_is_not_known_the_last_one_is_held():
    state = drive([(line(1.75),)] * 3, 20.0, CONFIG)[1]
    for image in range(3, 13):
        state, found = assign(CONFIG, state, (), ego(np.nan, np.nan), tick(image))
    assert on(LEFT, found).x_max_m == pytest.approx(80.0 - 10 * 0.8)


def test_a_run_restarted_while_lines_are_predicted_goes_on_bit_for_bit():
    random = np.random.default_rng(7)
    images = [
        tuple(
            line(y + 0.01 * random.standard_normal()) if random.random() < 0.6 else None
            for y in (1.75, -1.75)
        )
        for _ in range(60)
    ]
    whole, end = drive(images, SPEED_MPS, CONFIG, yaw_rate_radps=0.01)
    for at in (1, 7, 20, 41):
        state = pickle.loads(pickle.dumps(drive(images[:at], SPEED_MPS, CONFIG, yaw_rate_radps=0.01)[1]))
        rest, again = drive(images[at:], SPEED_MPS, CONFIG, state, at, 0.01)
        assert pickle.dumps(rest) == pickle.dumps(whole[at:])
        assert repr(again) == repr(end)
