"""The drive along a lane: poses and borders against closed forms, and on every real map."""

import math

import numpy as np
import pytest

from tests.maps import REAL_MAPS, geometry, lane, loaded, real, road, section
from tests.shared import needs_shared
from vsensor.transforms import rotation_from_rpy
from vsensor.types import MarkingKind, Stripe
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map
from vsensor.world.route import CorridorConfig

BEND = geometry('<arc curvature="0.01"/>', 150.0)


def on_bend(tmp_path, **where):
    """Return a corridor on a left bend of R = 100 m with lanes of 3.5 m."""
    road_map = loaded(tmp_path, road(BEND, length=150.0))
    return Corridor(road_map, CorridorConfig(road="1", **where))


@pytest.mark.parametrize(("lane_id", "radius", "turn"), [(-1, 101.75, 1), (1, 98.25, -1)])
def test_a_lane_of_a_bend_is_driven_on_its_own_circle(tmp_path, lane_id, radius, turn):
    corridor = on_bend(tmp_path, lane=lane_id)
    assert corridor.length_m == pytest.approx(1.5 * radius, abs=1e-6)
    s = np.linspace(0.0, corridor.length_m, 31)
    poses = corridor.poses(s)
    angle = s / radius if turn > 0 else 1.5 - s / radius
    expected = np.column_stack([radius * np.sin(angle), 100.0 - radius * np.cos(angle), 0 * s])
    np.testing.assert_allclose(poses.position_world_m, expected, atol=1e-6)
    np.testing.assert_allclose(poses.curvature_per_m, turn / radius, atol=1e-8)
    yaw = angle if turn > 0 else angle + math.pi
    np.testing.assert_allclose(np.sin(poses.yaw_rad - yaw), 0.0, atol=1e-8)


def test_an_offset_moves_to_the_left_and_keeps_the_heading(tmp_path):
    corridor = on_bend(tmp_path, lane=1)
    middle, left = corridor.pose(40.0), corridor.pose(40.0, 1.0)
    step = left.position_world_m[0] - middle.position_world_m[0]
    np.testing.assert_allclose(
        step[:2], [-math.sin(middle.yaw_rad[0]), math.cos(middle.yaw_rad[0])], atol=1e-12
    )
    assert left.yaw_rad[0] == middle.yaw_rad[0]


def test_downhill_is_nose_down_and_a_right_bank_is_right_side_down(tmp_path):
    slope, tilt = '<elevation s="0" a="10" b="-0.1" c="0" d="0"/>', 0.05
    lateral = f'<superelevation s="0" a="{tilt}" b="0" c="0" d="0"/>'
    road_map = loaded(tmp_path, road(elevation=slope, lateral=lateral))
    along = Corridor(road_map, CorridorConfig(road="1", lane=-1)).pose(50.0)
    against = Corridor(road_map, CorridorConfig(road="1", lane=1)).pose(50.0)
    pitch = math.atan(0.1)
    assert (along.pitch_rad[0], along.roll_rad[0]) == pytest.approx((pitch, tilt), abs=1e-9)
    assert (against.pitch_rad[0], against.roll_rad[0]) == pytest.approx((-pitch, -tilt), abs=1e-9)


@needs_shared
@pytest.mark.parametrize("name", ["velodrome", "curves_elevation", "Town04", "soderleden"])
def test_the_poses_axes_lie_in_the_road(name):
    """The pose's own rotation maps ahead and left onto the surface that the markings lie on."""
    corridor = Corridor(real(name))
    for s in np.linspace(20.0, min(corridor.length_m, 1900.0) - 20.0, 15):
        pose, near = corridor.pose(s), corridor.poses(np.array([s - 1e-3, s + 1e-3]))
        rotation = rotation_from_rpy(pose.roll_rad[0], pose.pitch_rad[0], pose.yaw_rad[0])
        ahead = np.diff(near.position_world_m, axis=0)[0] / 2e-3
        np.testing.assert_allclose(ahead, rotation[:, 0], atol=2e-3)
        place, on_road = corridor.place(s)
        each = corridor.road_map.road(place.road_id)
        across = each.point(on_road, 1.0)[0] - each.point(on_road, 0.0)[0]
        assert place.direction * across @ rotation[:, 1] == pytest.approx(1.0, abs=1e-3)
        assert across @ rotation[:, 2] == pytest.approx(0.0, abs=1e-9)


@needs_shared
@pytest.mark.parametrize("path", REAL_MAPS, ids=lambda path: path.stem)
def test_every_real_map_is_driven_to_its_end_or_2_km(path):
    corridor = Corridor(load_map(path))
    end = min(corridor.length_m, 2000.0)
    s = np.arange(0.0, end, 0.05)
    poses = corridor.poses(s)
    step = np.linalg.norm(np.diff(poses.position_world_m, axis=0), axis=1)
    np.testing.assert_allclose(step, 0.05, atol=2e-3)  # the files' own joints gape by up to 1.5 mm
    turn = np.abs(np.remainder(np.diff(poses.yaw_rad) + np.pi, 2 * np.pi) - np.pi)
    assert turn.max() < 0.05  # no joint turns by more than 3 degrees
    assert not corridor.reaches(end + 0.01) or corridor.length_m > 2000.0


def sides(corridor, s, markings):
    """Return for each marking group the lateral place (left positive) of its point nearest to the pose."""
    pose = corridor.pose(s)
    left = np.array([-math.sin(pose.yaw_rad[0]), math.cos(pose.yaw_rad[0])])
    found = {}
    for line in markings:
        away = line.points_world_m[:, :2] - pose.position_world_m[0, :2]
        nearest = np.argmin((away * away).sum(axis=1))
        found.setdefault(line.group, []).append(float(away[nearest] @ left))
    return found


@needs_shared
@pytest.mark.parametrize("path", REAL_MAPS, ids=lambda path: path.stem)
def test_the_lane_lies_between_its_left_and_right_border_everywhere(path):
    corridor = Corridor(load_map(path))
    for s in np.arange(3.0, min(corridor.length_m, 2000.0) - 6.0, 23.0):
        found = sides(corridor, s, corridor.markings_window(s - 2.0, s + 2.0))
        left, right = corridor.own_groups(s)
        assert min(found[left]) > 0.0 > max(found[right])
        middles = [np.mean(found[left]), np.mean(found[right])]
        assert abs(sum(middles)) < 0.7  # the lane's middle, but for the stripes' own offsets


@needs_shared
@pytest.mark.parametrize("path", REAL_MAPS, ids=lambda path: path.stem)
def test_every_line_goes_on_without_a_jump(path):
    corridor = Corridor(load_map(path))
    end = min(corridor.length_m, 2000.0)
    for s in np.arange(0.0, end, 150.0):
        for line in corridor.markings_window(s, s + 200.0):
            step = np.linalg.norm(np.diff(line.points_world_m, axis=0), axis=1)
            double = line.stripe is not Stripe.SINGLE  # where a double begins, its stripes step aside
            assert step.max(initial=0.0) < (0.35 if double else 0.25)


@needs_shared
@pytest.mark.parametrize("name", ["Town04", "velodrome", "roadmarks", "soderleden"])
def test_what_a_window_shows_does_not_depend_on_what_was_asked_before(name):
    walked, direct = Corridor(real(name)), Corridor(real(name))
    end = min(walked.length_m, 1500.0) - 50.0
    for s in np.arange(0.0, end, 40.0):
        expected = walked.markings_window(s, s + 100.0)
    for line, other in zip(expected, direct.markings_window(s, s + 100.0), strict=True):
        assert (line.id, line.group, line.stripe) == (other.id, other.group, other.stripe)
        np.testing.assert_array_equal(line.points_world_m, other.points_world_m)
        np.testing.assert_array_equal(line.painted, other.painted)


@needs_shared
@pytest.mark.parametrize("name", ["Town04", "e6mini", "highway_example_with_merge_and_split"])
def test_a_point_of_a_line_is_the_same_from_whatever_page(name):
    corridor = Corridor(real(name))
    for s in (150.0, 380.0):
        early = {line.id: line for line in corridor.markings_window(s, s + 60.0)}
        late = {line.id: line for line in corridor.markings_window(s + 55.0, s + 60.0)}
        for number in early.keys() & late.keys():
            np.testing.assert_array_equal(
                early[number].points_world_m[-40:], late[number].points_world_m[-40:]
            )


def test_a_window_is_a_view_of_read_only_arrays(tmp_path):
    corridor = on_bend(tmp_path)
    first, again = corridor.markings_window(10.0, 60.0)[0], corridor.markings_window(10.0, 60.0)[0]
    assert np.shares_memory(first.points_world_m, again.points_world_m)
    assert not any(
        a.flags.writeable for a in (first.points_world_m, first.painted, first.kind, first.width_m)
    )
    assert first.points_world_m.flags.c_contiguous
    assert len(first.painted) == 501


def test_a_window_beyond_the_road_is_empty(tmp_path):
    corridor = on_bend(tmp_path)
    assert corridor.markings_window(1000.0, 1100.0) == ()
    assert corridor.markings_window(-50.0, -10.0) == ()
    assert not corridor.reaches(1000.0)


@needs_shared
@pytest.mark.parametrize("lane_id", [-1, 1])
def test_dashes_lie_where_the_files_numbers_say_in_both_directions(lane_id):
    corridor = Corridor(real("curve_r100"), CorridorConfig(road="0", lane=lane_id))
    centre = next(line for line in corridor.markings_window(0.0, 400.0) if line.kind[0] == MarkingKind.DASHED)
    x = centre.points_world_m[:, 0]
    straight = (x < 499.0) & (np.mod(x, 4.0) > 1e-6) & (np.mod(x, 4.0) < 4.0 - 1e-6)  # not on an edge
    assert straight.sum() > 1000
    np.testing.assert_array_equal(centre.painted[straight], np.mod(x[straight], 12.0) < 4.0)


@needs_shared
def test_the_borders_of_the_bend_of_100_m_are_circles_in_the_window():
    corridor = Corridor(real("curve_r100"), CorridorConfig(road="0", lane=-1))
    found = {line.kind[0]: line.points_world_m for line in corridor.markings_window(520.0, 640.0)}
    radius = np.hypot(found[MarkingKind.DASHED][:, 0] - 500.0, found[MarkingKind.DASHED][:, 1] - 100.0)
    np.testing.assert_allclose(radius, 100.0, atol=1e-8)


@pytest.mark.parametrize("lane_id", [-1, 1])
@pytest.mark.parametrize("step", [7.0, 10.0, 12.3, 25.0])
def test_a_solid_line_has_no_hole_at_a_joint(tmp_path, lane_id, step):
    plan = geometry('<arc curvature="0.002"/>', 100.0)
    starts = np.arange(0.0, 100.0, step)
    lanes = [section(left=[lane(1)], right=[lane(-1)], s=float(s)) for s in starts]
    road_map = loaded(tmp_path, road(plan, "".join(lanes)))
    for line in Corridor(road_map, CorridorConfig(road="1", lane=lane_id)).markings_window(0.0, 100.0):
        assert len(line.painted) > 990
        assert line.painted.all()


def double_road(tmp_path, lane_id):
    """Return a corridor whose centre line is single, then double from 50 m on (solid left, broken right)."""
    marks = '<roadMark sOffset="0" type="broken"/><roadMark sOffset="50" type="solid broken" width="0.1"/>'
    lanes = section(left=[lane(1)], centre=lane(0, marks=marks), right=[lane(-1)])
    return Corridor(loaded(tmp_path, road(sections=lanes)), CorridorConfig(road="1", lane=lane_id))


def test_the_stripes_of_a_double_share_their_group_and_meet_where_it_is_single(tmp_path):
    window = double_road(tmp_path, -1).markings_window(0.0, 100.0)
    left, right = (line for line in window if line.stripe is not Stripe.SINGLE)
    assert (left.stripe, right.stripe, left.group) == (Stripe.LEFT, Stripe.RIGHT, right.group)
    apart = left.points_world_m[:, 1] - right.points_world_m[:, 1]
    np.testing.assert_allclose(apart[:500], 0.0, atol=1e-12)
    np.testing.assert_allclose(apart[501:], 0.2, atol=1e-12)
    assert left.painted[501:].all()
    assert not right.painted[501:].all()
    assert set(left.kind[501:]) == {MarkingKind.SOLID_DASHED}


def test_the_oncoming_driver_sees_the_double_mirrored(tmp_path):
    window = double_road(tmp_path, 1).markings_window(0.0, 100.0)
    left, right = (line for line in window if line.stripe is not Stripe.SINGLE)
    assert not left.painted[:499].all()
    assert right.painted[:499].all()
    assert set(left.kind[:499]) == {MarkingKind.DASHED_SOLID}
    np.testing.assert_allclose(left.points_world_m[:499, 1], -0.1, atol=1e-12)


def test_a_border_keeps_its_group_over_sections_and_a_new_one_gets_its_own(tmp_path):
    first = section(left=[lane(1)], right=[lane(-1, links='<successor id="-1"/>')])
    opening = (
        '<lane id="-2" type="driving"><width sOffset="0" a="0" b="0.1" c="0" d="0"/>'
        '<roadMark sOffset="0" type="solid"/></lane>'
    )
    broken = lane(-1, marks='<roadMark sOffset="0" type="broken"/>', links='<predecessor id="-1"/>')
    second = section(left=[lane(1)], right=[broken, opening], s=50.0)
    corridor = Corridor(loaded(tmp_path, road(sections=first + second)), CorridorConfig(road="1", lane=-1))
    before, after = corridor.own_groups(10.0), corridor.own_groups(90.0)
    assert before == after  # the lane's own borders are followed by its links
    new = {line.group for line in corridor.markings_window(60.0, 90.0)} - {
        line.group for line in corridor.markings_window(0.0, 40.0)
    }
    assert len(new) == 1


@needs_shared
def test_lanes_beside_are_named_with_their_direction():
    corridor = Corridor(real("e6mini"), CorridorConfig(road="0", lane=-3))
    right, left = corridor.lane_beside(50.0, -1), corridor.lane_beside(50.0, 1)
    assert (right.lane_id, left.lane_id) == (-4, -2)
    assert right.offset_m[0] < -2.5
    assert left.offset_m[0] > 2.5
    assert not right.oncoming
    assert corridor.lane_beside(50.0, 40) is None


def test_a_shoulder_is_passed_over_in_counting_lanes(tmp_path):
    lanes = section(left=[lane(1)], right=[lane(-1), lane(-2, "1", kind="shoulder"), lane(-3)])
    corridor = Corridor(loaded(tmp_path, road(sections=lanes)), CorridorConfig(road="1", lane=-1))
    right, left = corridor.lane_beside(50.0, -1), corridor.lane_beside(50.0, 1)
    assert (right.lane_id, right.offset_m[0], right.oncoming) == (-3, -4.5, False)
    assert (left.lane_id, left.offset_m[0], left.oncoming) == (1, 3.5, True)
    against = Corridor(corridor.road_map, CorridorConfig(road="1", lane=1)).lane_beside(50.0, 1)
    assert (against.lane_id, against.offset_m[0], against.oncoming) == (-1, 3.5, True)


@needs_shared
def test_left_hand_traffic_has_the_oncoming_lanes_on_its_right():
    corridor = Corridor(real("e6mini-lht"))
    lanes = [corridor.lane_beside(50.0, n) for n in range(-8, 9)]
    oncoming = [each.offset_m[0] for each in lanes if each and each.type == "driving" and each.oncoming]
    assert oncoming
    assert max(oncoming) < 0.0


@needs_shared
def test_a_long_drive_keeps_no_more_than_its_window():
    corridor = Corridor(real("velodrome"))
    for s in np.arange(0.0, 20_000.0, 50.0):
        corridor.markings_window(s, s + 100.0)
        corridor.pose(s)
    assert len(corridor._windows._strips) <= 12
    assert len(corridor._windows._pages) <= 3
    assert len(corridor._blocks._tables) <= 12
    assert len({id(block.piece) for block in corridor._blocks}) <= 12  # pieces are shared by all laps


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_distance_that_is_none_is_refused(tmp_path, value):
    with pytest.raises(ValueError, match="not finite"):
        on_bend(tmp_path).pose(value)


@needs_shared
@pytest.mark.parametrize("path", REAL_MAPS, ids=lambda path: path.stem)
def test_the_short_cubics_agree_with_the_maps_own_curves(path):
    corridor = Corridor(load_map(path))
    end = min(corridor.length_m, 1000.0) - 1e-6
    s = np.linspace(0.0, end, 4001)
    poses, numbers = corridor.poses(s), corridor._blocks.numbers_at(s)
    for number in set(numbers):
        block, mine = corridor._blocks[number], numbers == number
        exact = block.piece.frames(s[mine] - block.start_m)
        np.testing.assert_allclose(poses.position_world_m[mine], exact.position.T, atol=2e-6)
        yaw = np.arctan2(exact.forward[1], exact.forward[0])
        np.testing.assert_allclose(np.sin(poses.yaw_rad[mine] - yaw), 0.0, atol=1e-6)
