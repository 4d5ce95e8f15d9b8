"""Rigid transforms: conventions fixed by closed forms, inverses by composition."""

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.transforms import (
    CAMERA_FROM_FORWARD_LEFT_UP,
    Rigid,
    compose,
    invert,
    relative_to,
    rotation_from_rpy,
    rpy_from_rotation,
    transform,
)

FORWARD, LEFT, UP = np.eye(3)
ANGLE = st.floats(-pi, pi)
METRES = st.floats(-1e3, 1e3)


def p1_passive(roll, pitch, yaw):
    """Return P1's three coordinate rotations Rx, Ry, Rz as printed below eq. 2.3."""
    rx = np.array([[1, 0, 0], [0, cos(roll), sin(roll)], [0, -sin(roll), cos(roll)]])
    ry = np.array([[cos(pitch), 0, -sin(pitch)], [0, 1, 0], [sin(pitch), 0, cos(pitch)]])
    rz = np.array([[cos(yaw), sin(yaw), 0], [-sin(yaw), cos(yaw), 0], [0, 0, 1]])
    return rx, ry, rz


def rigid(roll, pitch, yaw, *position):
    return Rigid(rotation_from_rpy(roll, pitch, yaw), np.array(position))


def test_positive_yaw_turns_forward_to_the_left():
    np.testing.assert_allclose(rotation_from_rpy(0, 0, pi / 2) @ FORWARD, LEFT, atol=1e-15)


def test_positive_pitch_points_the_nose_down():
    np.testing.assert_allclose(rotation_from_rpy(0, pi / 2, 0) @ FORWARD, -UP, atol=1e-15)


def test_positive_roll_lifts_the_left_side():
    np.testing.assert_allclose(rotation_from_rpy(pi / 2, 0, 0) @ LEFT, UP, atol=1e-15)


def test_roll_is_applied_before_pitch_and_pitch_before_yaw():
    turned = rotation_from_rpy(0.3, -0.2, 1.1)
    one_by_one = rotation_from_rpy(0, 0, 1.1) @ rotation_from_rpy(0, -0.2, 0) @ rotation_from_rpy(0.3, 0, 0)
    np.testing.assert_allclose(turned, one_by_one, atol=1e-15)


@given(ANGLE, ANGLE, ANGLE)
def test_the_rotation_is_p1_equation_2_4_with_its_negated_passive_matrices(roll, pitch, yaw):
    rx, ry, rz = p1_passive(-roll, -pitch, -yaw)
    np.testing.assert_allclose(rotation_from_rpy(roll, pitch, yaw), rz @ ry @ rx, atol=1e-15)


def test_the_optical_frame_looks_forward_with_x_right_and_y_down():
    np.testing.assert_array_equal(CAMERA_FROM_FORWARD_LEFT_UP @ FORWARD, [0, 0, 1])
    np.testing.assert_array_equal(CAMERA_FROM_FORWARD_LEFT_UP @ LEFT, [-1, 0, 0])
    np.testing.assert_array_equal(CAMERA_FROM_FORWARD_LEFT_UP @ UP, [0, -1, 0])


def test_the_optical_frame_is_p1_equation_2_5_turned_half_way_about_its_x_axis():
    cam_to_vehicle = np.array(
        [[0, 0, -1], [-1, 0, 0], [0, 1, 0]]
    )  # P1's camera: x right, y up, looks along -z
    half_turn = np.diag([1, -1, -1])
    np.testing.assert_array_equal(CAMERA_FROM_FORWARD_LEFT_UP.T, cam_to_vehicle @ half_turn)


@given(ANGLE, st.floats(-pi / 2, pi / 2), ANGLE)
def test_angles_from_a_rotation_give_the_same_rotation(roll, pitch, yaw):
    rotation = rotation_from_rpy(roll, pitch, yaw)
    np.testing.assert_allclose(rotation_from_rpy(*rpy_from_rotation(rotation)), rotation, atol=1e-9)


@pytest.mark.parametrize("pitch", [pi / 2, -pi / 2])
def test_angles_at_gimbal_lock_give_the_same_rotation(pitch):
    rotation = rotation_from_rpy(0.4, pitch, 1.0)
    roll, _, _ = angles = rpy_from_rotation(rotation)
    assert roll == 0.0
    np.testing.assert_allclose(rotation_from_rpy(*angles), rotation, atol=1e-15)


def test_small_angles_come_back_to_rounding():
    angles = (1e-9, -2e-9, 3e-9)
    np.testing.assert_allclose(rpy_from_rotation(rotation_from_rpy(*angles)), angles, rtol=1e-12)


@given(ANGLE, ANGLE, ANGLE, METRES, METRES, METRES)
def test_a_transform_and_its_inverse_leave_points_where_they_were(roll, pitch, yaw, x, y, z):
    pose = rigid(roll, pitch, yaw, x, y, z)
    points = np.array([[1.0, -2.0, 3.0], [0.0, 0.0, 0.0], [-500.0, 40.0, 7.0]])
    back = transform(invert(pose), transform(pose, points))
    np.testing.assert_allclose(back, points, atol=1e-11)  # 1e3 m in float64


def test_composed_transforms_act_one_after_the_other():
    a_from_b, b_from_c = rigid(0.1, 0.2, 0.3, 1, 2, 3), rigid(-1, 0.5, 2, -4, 5, 6)
    points = np.array([[1.0, -2.0, 3.0]])
    np.testing.assert_allclose(
        transform(compose(a_from_b, b_from_c), points),
        transform(a_from_b, transform(b_from_c, points)),
        atol=1e-14,
    )


def test_relative_coordinates_are_those_of_the_inverse_transform():
    pose = rigid(0.1, 0.2, 0.3, 10, -20, 3)
    points = np.array([[1.0, -2.0, 3.0], [40.0, 50.0, 60.0]])
    np.testing.assert_allclose(relative_to(pose, points), transform(invert(pose), points), atol=1e-13)


def test_relative_coordinates_keep_their_digits_five_thousand_kilometres_out():
    offset = np.array([5.0e5, 5.4e6, 30.0])
    local = np.array([[80.0, 1.75, 0.0]])
    found = relative_to(
        Rigid(rotation_from_rpy(0, 0, 0.7), offset), local @ rotation_from_rpy(0, 0, 0.7).T + offset
    )
    np.testing.assert_allclose(found, local, atol=1e-9)  # one unit in the last place of 5.4e6 is 9e-10
