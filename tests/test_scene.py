"""Markings and obstacles near a pose."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.roads import box, ego, marking, moved, straight
from vsensor.scene import SceneConfig, near, obstacles_near
from vsensor.types import Scene, Stripe

CONFIG = SceneConfig(range_m=100.0)


def lines_near(markings, vehicle=None, config=CONFIG):
    found = near(config, vehicle or ego(), Scene(markings=tuple(markings)))
    bounds = zip(found.starts, found.starts[1:], strict=False)
    return found, [found.points_ego_m[start:stop] for start, stop in bounds]


def circle(radius, start_deg, stop_deg, count=2000):
    """Return points on a circle to the left of the ego: 0 degrees is at its side, on the right."""
    angle = np.radians(np.linspace(start_deg, stop_deg, count))
    return np.column_stack([radius * np.sin(angle), 15.0 - radius * np.cos(angle)])


def test_points_are_those_of_the_marking_seen_from_the_pose():
    vehicle = ego((12.0, -7.0, 3.0), roll_rad=0.02, pitch_rad=-0.03, yaw_rad=2.5)
    local = np.column_stack([np.linspace(0.5, 90, 300), np.full(300, 1.75), np.linspace(0, 0.4, 300)])
    _, (points,) = lines_near([marking(moved(local, vehicle))], vehicle)
    np.testing.assert_allclose(points, local, atol=1e-13)


def test_points_keep_a_nanometre_at_world_coordinates_of_five_thousand_kilometres():
    vehicle = ego((5.0e5, 5.4e6, 30.0), yaw_rad=0.3)
    local = np.column_stack([np.linspace(0.5, 90, 300), np.full(300, 1.75), np.zeros(300)])
    _, (points,) = lines_near([marking(moved(local, vehicle))], vehicle)
    np.testing.assert_allclose(points, local, atol=2e-9)  # the world coordinate's last place is 9e-10


def test_the_window_includes_both_ends():
    config = SceneConfig(range_m=10.0, behind_m=5.0)
    x = np.arange(-8.0, 20.0)
    _, (points,) = lines_near([marking(np.column_stack([x, np.ones(28)]))], config=config)
    np.testing.assert_array_equal(points[:, 0], np.arange(-5.0, 11.0))


def test_index_finds_each_point_in_its_marking():
    chains = [straight(1.75, 0), straight(-1.75, 1, step=0.25)]
    found, lines = lines_near(chains)
    for place, start, stop, points in zip(found.marking, found.starts, found.starts[1:], lines, strict=False):
        np.testing.assert_array_equal(chains[place].points_world_m[found.index[start:stop]], points)


def test_unpainted_points_are_returned_too():
    found, _ = lines_near([straight(1.75, painted=np.zeros(1401))])
    assert len(found.index) == 1001


def test_a_line_drawn_against_the_driving_direction_is_reversed_and_keeps_its_index():
    forward = straight(1.75)
    found, (points,) = lines_near([marking(forward.points_world_m[::-1])])
    _, (expected,) = lines_near([forward])
    np.testing.assert_array_equal(points, expected)
    np.testing.assert_array_equal(found.index, np.arange(1200, 199, -1))


def test_a_roundabout_is_cut_where_it_turns_back_ahead_and_behind():
    _, (points,) = lines_near([marking(circle(17.0, -170, 190))], config=SceneConfig(behind_m=100.0))
    assert points[0, 0] == pytest.approx(-17.0, abs=1e-3)  # 2000 points on the circle: 5e-5 m past the side
    assert points[-1, 0] == pytest.approx(17.0, abs=1e-3)
    assert points[:, 1].max() <= 15.0 + 0.06  # one step of 54 mm beyond the turn


def test_x_increases_strictly_along_every_line():
    chains = [straight(1.75, 0), marking(circle(17.0, -170, 190), 1), marking(circle(13.0, 190, -170), 2)]
    _, lines = lines_near(chains, config=SceneConfig(behind_m=50.0))
    assert len(lines) == 3
    assert all((np.diff(points[:, 0]) > 0).all() for points in lines)


def test_the_branch_that_passes_the_ego_is_chosen_not_the_far_one():
    far_first = circle(17.0, 180, 390)  # begins abeam on the far side of the roundabout
    _, (points,) = lines_near([marking(far_first)])
    assert points[0, 1] == pytest.approx(-2.0, abs=1e-3)


def test_a_bridge_above_does_not_take_the_place_of_the_road_below():
    x = np.arange(-50.0, 50.0, 0.1)
    below = np.column_stack([x, np.full(1000, 3.0), np.zeros(1000)])
    above = np.column_stack([x[::-1], np.full(1000, 1.0), np.full(1000, 6.0)])
    _, (points,) = lines_near([marking(np.concatenate([above, below]))])
    assert (points[:, 2] == 0.0).all()


def test_a_joint_that_steps_back_a_millimetre_does_not_end_the_line():
    x = np.concatenate([np.arange(0.0, 50.0, 0.1), np.arange(49.899, 90.0, 0.1)])
    _, (points,) = lines_near([marking(np.column_stack([x, np.full(len(x), 1.75)]))])
    assert points[-1, 0] > 89.0
    assert (np.diff(points[:, 0]) > 0).all()


def test_a_step_back_of_two_centimetres_ends_the_line():
    x = np.concatenate([np.arange(0.0, 50.0, 0.1), np.arange(49.88, 90.0, 0.1)])
    _, (points,) = lines_near([marking(np.column_stack([x, np.full(len(x), 1.75)]))])
    assert points[-1, 0] == pytest.approx(49.9)


def test_repeated_points_are_dropped():
    x = np.repeat(np.arange(0.0, 50.0, 0.1), 2)
    _, (points,) = lines_near([marking(np.column_stack([x, np.full(len(x), 1.75)]))])
    assert len(points) == 500


def test_a_fold_back_in_steps_of_a_millimetre_ends_the_line():
    x = np.concatenate([np.arange(0.0, 30.0, 0.1), np.arange(29.9, 10.0, -0.001), np.arange(10.0, 90.0, 0.1)])
    _, (points,) = lines_near([marking(np.column_stack([x, np.full(len(x), 1.75)]))])
    assert points[-1, 0] == pytest.approx(29.9)


def test_a_line_straight_across_is_one_point():
    y = np.arange(-30.0, 30.0, 0.1)
    _, (points,) = lines_near([marking(np.column_stack([np.full(600, 8.0), y]))])
    assert len(points) == 1


def test_a_line_that_begins_ahead_is_kept_from_its_beginning():
    _, (points,) = lines_near([straight(1.75, start=40.0)])
    assert points[0, 0] == 40.0


def test_a_line_that_ended_behind_is_left_out():
    found, _ = lines_near([straight(1.75, 0, stop=-5.0), straight(-1.75, 1)])
    np.testing.assert_array_equal(found.marking, [1])


def test_a_line_too_far_to_the_side_is_left_out():
    found, _ = lines_near([straight(20.1, 0), straight(19.9, 1), straight(-20.1, 2)])
    np.testing.assert_array_equal(found.marking, [1])


def test_a_single_point_is_a_line():
    _, (points,) = lines_near([marking([[30.0, 1.75]])])
    np.testing.assert_array_equal(points, [[30.0, 1.75, 0.0]])


@pytest.mark.parametrize("markings", [(), (marking(np.empty((0, 3))),)])
def test_nothing_painted_gives_no_line(markings):
    found, lines = lines_near(markings)
    assert lines == []
    assert found.points_ego_m.shape == (0, 3)


def test_an_empty_marking_does_not_shift_the_others():
    found, (points,) = lines_near([marking(np.empty((0, 3)), 0), straight(1.75, 1)])
    np.testing.assert_array_equal(found.marking, [1])
    assert points[0, 1] == 1.75


def test_arrays_are_read_only():
    found, _ = lines_near([straight(1.75)])
    assert not any(
        array.flags.writeable for array in (found.marking, found.starts, found.index, found.points_ego_m)
    )


def double(y, first_number, flipped=False):
    """Return the two stripes of a double line at y, left and right along its own direction."""
    stripes = (Stripe.RIGHT, Stripe.LEFT) if flipped else (Stripe.LEFT, Stripe.RIGHT)
    chains = [straight(y + 0.1), straight(y - 0.1)]
    return [
        marking(
            chain.points_world_m[:: -1 if flipped else 1], first_number + k, group=first_number, stripe=stripe
        )
        for k, (chain, stripe) in enumerate(zip(chains, stripes, strict=True))
    ]


@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize(("y", "inner_y"), [(1.75, 1.65), (-1.75, -1.65)])
def test_of_a_double_line_the_stripe_nearer_to_the_ego_stays(y, inner_y, flipped):
    _, (points,) = lines_near(double(y, 0, flipped))
    np.testing.assert_allclose(points[:, 1], inner_y, atol=1e-15)


def test_the_stripe_is_chosen_by_the_side_at_the_ego_not_far_ahead():
    x = np.arange(0.0, 100.0, 0.1)
    bend = -0.002 * x * x  # to the right: at 100 m the border on the left lies at y = -18 m
    left = marking(np.column_stack([x, 1.85 + bend]), 0, group=0, stripe=Stripe.LEFT)
    right = marking(np.column_stack([x, 1.65 + bend]), 1, group=0, stripe=Stripe.RIGHT)
    found, _ = lines_near([left, right])
    np.testing.assert_array_equal(found.marking, [1])


def test_a_stripe_without_its_partner_stays():
    found, _ = lines_near(double(1.75, 0)[:1])
    np.testing.assert_array_equal(found.marking, [0])


def test_two_single_lines_of_one_group_both_stay():
    found, _ = lines_near([straight(1.75, 0, group=5), straight(-1.75, 1, group=5)])
    assert len(found.marking) == 2


def test_obstacles_are_kept_as_far_as_they_reach():
    inside, reaching, beyond = box(50, 0, number=0), box(101.5, 0, number=1), box(110, 0, number=2)
    behind, aside = box(-20, 0, number=3), box(50, 120, number=4)
    found = obstacles_near(
        CONFIG, ego(), Scene(markings=(), obstacles=(inside, reaching, beyond, behind, aside))
    )
    assert [item.id for item in found] == [0, 1]


def test_obstacles_are_looked_at_in_the_ego_frame():
    vehicle = ego((1000.0, 2000.0, 0.0), yaw_rad=np.pi / 2)
    ahead, behind = box(1000, 2050, number=0), box(1000, 1950, number=1)
    found = obstacles_near(CONFIG, vehicle, Scene(markings=(), obstacles=(ahead, behind)))
    assert [item.id for item in found] == [0]


@pytest.mark.parametrize("yaw", [np.pi, -np.pi, 3 * np.pi, np.nextafter(np.pi, 4)])
def test_a_heading_of_half_a_turn_is_the_same_however_it_is_written(yaw):
    chain = straight(1.75, start=-120.05, stop=20)  # no point just at an end of the window
    (_, (expected,)), (_, (points,)) = (lines_near([chain], ego(yaw_rad=angle)) for angle in (np.pi, yaw))
    np.testing.assert_allclose(points, expected, atol=1e-12)
    assert points[0, 1] == pytest.approx(-1.75)


@pytest.mark.parametrize("unknown", [{"yaw_rad": np.nan}, {"position": (np.nan, 0.0, 0.0)}])
def test_a_pose_that_is_not_known_finds_no_line_and_no_obstacle(unknown):
    vehicle = ego(**unknown)
    assert len(lines_near([straight(1.75)], vehicle)[0].index) == 0
    assert obstacles_near(CONFIG, vehicle, Scene(markings=(), obstacles=(box(30, 0),))) == ()


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.5), st.booleans())
def test_a_wandering_line_gives_its_whole_rising_run_and_no_more(seed, curviness, turned):
    rng = np.random.default_rng(seed)
    heading = np.cumsum(rng.normal(0.0, curviness, 300)) + (np.pi if turned else 0.0)
    steps = 0.5 * np.column_stack([np.cos(heading), np.sin(heading)])
    chain = np.cumsum(steps, axis=0) + rng.uniform(-15, 15, 2)
    config = SceneConfig(range_m=40.0, behind_m=20.0, lateral_m=200.0)
    found, lines = lines_near([marking(chain)], config=config)
    if not lines:
        return
    x, index = lines[0][:, 0], found.index
    np.testing.assert_array_equal(lines[0][:, :2], chain[index])
    assert (np.diff(x) > 0).all()
    assert x[0] >= -20.0
    assert x[-1] <= 40.0
    direction = np.unique(np.diff(index)).tolist() or [1]
    assert direction in ([1], [-1])
    for end, beyond, sign in ((x[-1], index[-1] + direction[0], 1), (x[0], index[0] - direction[0], -1)):
        if len(x) > 1 and 0 <= beyond < len(chain):
            folds_back = sign * (chain[beyond, 0] - end) <= 0
            assert folds_back or not -20.0 <= chain[beyond, 0] <= 40.0
