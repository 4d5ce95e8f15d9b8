"""Who is hidden by boxes: P1's algorithm as reference, and defined answers in degenerate places."""

import numpy as np
import pytest

from tests import p1
from tests.roads import box
from vsensor.raycast import Boxes, boxes_in, hidden, shadow, solids
from vsensor.transforms import Rigid, rotation_from_rpy

HERE = Rigid(np.eye(3), np.zeros(3))
EYE = np.array([1.9, 0.0, 1.35])
BAND_M = 1e-4

both_methods = pytest.mark.parametrize("method", ["shadow", "embree"])


def is_hidden(point, obstacles, method, eye=EYE):
    return bool(hidden(np.asarray(eye), np.array([point], dtype=float), boxes_in(HERE, obstacles), method)[0])


def random_obstacles(rng, count):
    """Return boxes turned every way, clear of the road's surface, as vehicles are."""
    return [
        box(
            rng.uniform(8, 95),
            rng.uniform(-12, 12),
            rng.uniform(1.0, 1.4),
            size=(rng.uniform(0.3, 5), rng.uniform(0.3, 2.5), rng.uniform(0.3, 1.0)),
            roll_rad=rng.uniform(-0.1, 0.1),
            pitch_rad=rng.uniform(-0.1, 0.1),
            yaw_rad=rng.uniform(-np.pi, np.pi),
        )
        for _ in range(count)
    ]


def p1_boxes(obstacles, grown_m):
    """Return the obstacles as P1's reference takes them, each face moved outwards by `grown_m`."""
    return [
        (
            item.centre_world_m,
            np.array(item.size_m) + 2 * grown_m,
            rotation_from_rpy(item.roll_rad, item.pitch_rad, item.yaw_rad),
        )
        for item in obstacles
    ]


@both_methods
@pytest.mark.parametrize("count", [2, 12, 80])
def test_hidden_points_are_p1s_except_in_a_band_of_a_silhouette(method, count):
    rng = np.random.default_rng(count)
    obstacles = random_obstacles(rng, count)
    points = np.column_stack([rng.uniform(4, 100, 3000), rng.uniform(-15, 15, 3000), np.zeros(3000)])
    found = hidden(EYE, points, boxes_in(HERE, obstacles), method)
    surely = p1.hidden(EYE, points, p1_boxes(obstacles, -BAND_M))
    maybe = p1.hidden(EYE, points, p1_boxes(obstacles, BAND_M))
    assert (maybe != surely).mean() < 1e-3  # the band is thin, so the comparison says something
    assert 0.005 < surely.mean() < 0.99
    assert not (surely & ~found).any()
    assert not (found & ~maybe).any()


@both_methods
def test_points_in_the_air_among_the_boxes_are_judged_as_p1_does(method):
    rng = np.random.default_rng(3)
    obstacles = [
        box(*rng.uniform((5, -4, 0), (15, 4, 3)), size=rng.uniform(0.5, 2.5, 3), yaw_rad=rng.uniform(-3, 3))
        for _ in range(12)
    ]
    points = rng.uniform((4, -6, -1), (16, 6, 4), (3000, 3))
    found = hidden(EYE, points, boxes_in(HERE, obstacles), method)
    assert not (p1.hidden(EYE, points, p1_boxes(obstacles, -2 * BAND_M)) & ~found).any()
    assert not (found & ~p1.hidden(EYE, points, p1_boxes(obstacles, BAND_M))).any()
    assert 0.2 < found.mean() < 0.8


@both_methods
def test_points_all_around_the_camera_are_judged_too(method):
    rng = np.random.default_rng(5)
    obstacles = [
        box(*rng.uniform(-40, 40, 2), rng.uniform(1.5, 3), yaw_rad=rng.uniform(-3, 3)) for _ in range(20)
    ]
    points = np.column_stack([rng.uniform(-60, 60, (3000, 2)), np.zeros(3000)])
    found = hidden(EYE, points, boxes_in(HERE, obstacles), method)
    assert not (p1.hidden(EYE, points, p1_boxes(obstacles, -BAND_M)) & ~found).any()
    assert not (found & ~p1.hidden(EYE, points, p1_boxes(obstacles, BAND_M))).any()


@pytest.mark.parametrize("pitch", [0.2, 1.5, -1.5])
@pytest.mark.parametrize("yaw", [0.0, 1.0, 1.6, 3.1, -1.6])
def test_the_answer_does_not_depend_on_which_way_the_camera_looks(yaw, pitch):
    rng = np.random.default_rng(6)
    obstacles = random_obstacles(rng, 10)
    points = np.column_stack([rng.uniform(4, 100, 2000), rng.uniform(-15, 15, 2000), np.zeros(2000)])
    turn = Rigid(rotation_from_rpy(0.1, pitch, yaw), np.array([3.0, -5.0, 2.0]))
    seen = hidden(EYE, points, boxes_in(HERE, obstacles), "shadow")
    turned = hidden(
        (EYE - turn.translation) @ turn.rotation,
        (points - turn.translation) @ turn.rotation,
        boxes_in(turn, obstacles),
        "shadow",
    )
    assert (seen != turned).sum() == 0


def test_masks_in_several_pieces_give_the_same_answer(monkeypatch):
    rng = np.random.default_rng(7)
    boxes = boxes_in(HERE, random_obstacles(rng, 15))
    points = np.column_stack([rng.uniform(4, 100, 500), rng.uniform(-15, 15, 500), np.zeros(500)])
    at_once = hidden(EYE, points, boxes, "shadow")
    monkeypatch.setattr(shadow, "_MASK_SIZE", 1200)
    np.testing.assert_array_equal(hidden(EYE, points, boxes, "shadow"), at_once)


@pytest.mark.parametrize(
    ("beside", "ahead", "by_rays"), [(0, 300, 0), (3, 0, 0), (4, 0, 4), (13, 40, 0), (14, 40, 54)]
)
def test_auto_takes_rays_only_where_many_of_the_boxes_in_view_reach_beside_the_camera(
    monkeypatch, beside, ahead, by_rays
):
    asked = [0]
    monkeypatch.setattr(solids, "hidden_by_faces", lambda *given: asked.append(len(given[-1].is_front)))
    around = [box(5, 3, size=(20, 1, 3))] * beside + [box(-20, 0)] * 100
    front = [box(20 + 0.2 * k, 0, size=(0.1, 0.2, 0.2)) for k in range(ahead)]
    hidden(EYE, np.array([[90.0, -1, 0], [90, 1, 3], [10, -9, -1]]), boxes_in(HERE, around + front))
    assert asked[-1] == by_rays


@pytest.mark.parametrize("off_m", [0.0, 1e-6, 1e-4])
@both_methods
def test_rays_almost_in_the_plane_of_a_side_are_hidden_by_nothing_beside_it(method, off_m):
    rng = np.random.default_rng(4)
    beside = 0
    for _ in range(80):
        angles, axis, side = rng.uniform(-3, 3, 3), rng.integers(3), rng.choice([-0.5, 0.5])
        centre, size, turned = (
            rng.uniform((8, -8, -2), (90, 8, 3)),
            rng.uniform(0.2, 6, 3),
            rotation_from_rpy(*angles),
        )
        obstacle = box(*centre, size=size, roll_rad=angles[0], pitch_rad=angles[1], yaw_rad=angles[2])
        eye = (EYE - centre) @ turned
        eye[axis] = side * size[axis] + np.sign(side) * off_m
        on_side = rng.uniform(-1.5, 1.5, (200, 3)) * size
        on_side[:, axis] = eye[axis] + rng.choice([0.0, 1e-6, -1e-6, 1e-5], 200)
        points = centre + (eye + (on_side - eye) * rng.uniform(1, 3, (200, 1))) @ turned.T
        eye = centre + turned @ eye
        found = hidden(eye, points, boxes_in(HERE, [obstacle]), method)
        endless = (centre, size + 2 * BAND_M + 99.0 * (np.arange(3) == axis), turned)  # across the side
        passes = ~p1.hidden(eye, points, [endless])
        assert not (found & passes).any()
        beside += passes.sum()
    assert beside > 3000


@both_methods
def test_a_point_before_the_box_is_free_and_one_behind_it_is_hidden(method):
    obstacle = box(30, 0, size=(4, 2, 3))
    assert not is_hidden((27.9, 0, 0.5), [obstacle], method)
    assert is_hidden((32.1, 0, 0.5), [obstacle], method)


@both_methods
def test_a_point_on_the_near_side_of_its_own_box_is_free(method):
    assert not is_hidden((28.0, 0.3, 1.0), [box(30, 0, size=(4, 2, 3))], method)


@both_methods
def test_a_point_inside_a_box_is_hidden(method):
    assert is_hidden((30.0, 0.0, 1.0), [box(30, 0, size=(4, 2, 3))], method)


@both_methods
def test_a_camera_inside_a_box_sees_nothing(method):
    around = box(1.0, 0, size=(4, 2, 3))
    assert is_hidden((50, 0, 0), [around], method)
    assert is_hidden((2.5, 0, 1), [around], method)


@both_methods
def test_a_camera_behind_the_box_sees_what_is_ahead_of_it(method):
    assert not is_hidden((50, 0, 0), [box(-10, 0)], method)


@both_methods
def test_a_camera_in_the_plane_of_a_side_sees_past_it_and_not_through_the_box(method):
    wall = box(30, -1.0, z=1.0, size=(20, 2, 4))  # its left side is the plane y = 0
    assert not is_hidden((60, 0.01, 0), [wall], method)
    assert is_hidden((60, -0.01, 0), [wall], method)


@both_methods
def test_a_sheet_without_thickness_hides(method):
    sheet = box(30, 0, size=(0, 2, 3))
    assert is_hidden((40, 0, 0), [sheet], method)
    assert not is_hidden((29, 0, 0), [sheet], method)
    assert not is_hidden((40, 5, 0), [sheet], method)


@both_methods
def test_a_sheet_seen_edge_on_hides_nothing_beside_it(method):
    sheet = box(30, 0, size=(10, 0, 3))
    assert not is_hidden((40, 0.01, 0), [sheet], method)
    assert not is_hidden((40, -0.01, 0), [sheet], method)


@both_methods
def test_a_box_of_negative_size_hides_as_its_mirror_image(method):
    inverted = box(30, 0, size=(-4, -2, -1.5))
    assert is_hidden((40, 0, 0), [inverted], method)
    assert not is_hidden((40, 5, 0), [inverted], method)


@both_methods
def test_a_box_that_reaches_beside_the_camera_hides(method):
    wall = box(20, 3, z=1.0, size=(60, 0.5, 4))
    assert is_hidden((30, 6, 0), [wall], method)
    assert not is_hidden((30, 2, 0), [wall], method)


@both_methods
def test_a_box_that_is_not_a_number_hides_nothing(method):
    assert not is_hidden((40, 0, 0), [box(np.nan, 0)], method)


@both_methods
def test_a_point_that_is_not_a_number_is_not_hidden_and_spoils_no_other(method):
    points = np.array([[np.nan, 0, 0], [40.0, 0, 0], [20.0, 0, 0]])
    found = hidden(EYE, points, boxes_in(HERE, [box(30, 0)]), method)
    np.testing.assert_array_equal(found, [False, True, False])


@both_methods
def test_no_points_or_no_boxes_give_no_answer_but_an_empty_or_free_one(method):
    boxes = boxes_in(HERE, [box(30, 0)])
    assert hidden(EYE, np.empty((0, 3)), boxes, method).shape == (0,)
    assert not hidden(EYE, np.ones((2, 3)), boxes_in(HERE, []), method).any()


@both_methods
def test_rays_through_edges_and_corners_are_hidden_one_tenth_of_a_millimetre_inside(method):
    obstacle = box(30, 0, z=1.35, size=(4, 2, 2))
    ring = np.array([(1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1)], dtype=float)
    edge = np.column_stack([np.full(8, 28.0), ring[:, 0], 1.35 + ring[:, 1]])
    centre = np.array([28.0, 0.0, 1.35])
    for grown, expected in ((-BAND_M, True), (BAND_M, False)):
        through = edge + grown * (edge - centre)
        found = hidden(EYE, EYE + 3.0 * (through - EYE), boxes_in(HERE, [obstacle]), method)
        assert (found == expected).all()


def test_boxes_come_into_the_frame_with_nine_digits_behind_the_metre_far_out():
    pose = Rigid(rotation_from_rpy(0.02, -0.01, 2.0), np.array([5.0e5, 5.4e6, 30.0]))
    turned = rotation_from_rpy(0.1, 0.2, 0.3)
    centre = pose.rotation @ np.array([40.0, 3.0, 0.8]) + pose.translation
    found = boxes_in(pose, [box(*centre, size=(4, 2, 1), roll_rad=0.1, pitch_rad=0.2, yaw_rad=0.3)])
    np.testing.assert_allclose(found.centre_m, [[40.0, 3.0, 0.8]], atol=2e-9)
    np.testing.assert_allclose(found.rotation[0], pose.rotation.T @ turned, atol=1e-15)
    np.testing.assert_array_equal(found.half_m, [[2.0, 1.0, 0.5]])


def test_boxes_can_be_given_directly():
    wall = Boxes(np.array([[30.0, 0, 1]]), np.array([[0.1, 5.0, 5.0]]), np.eye(3)[None])
    np.testing.assert_array_equal(hidden(EYE, np.array([[40.0, 0, 0], [20, 0, 0]]), wall), [True, False])
