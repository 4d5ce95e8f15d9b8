"""Meshes in hard places, through the whole chain; the errors at their edges are in the table."""

from dataclasses import replace

import numpy as np
import pytest

from tests.hard_cases import chain
from tests.hard_cases.mesh_edges import box_mesh, meshed
from tests.hard_cases.test_obstacles import CAMERA, looked_at
from tests.roads import box
from vsensor.raycast import mesh_of
from vsensor.types import Unseen

STATES = pytest.mark.parametrize("is_moving", [True, False], ids=["moving", "standing"])


@STATES
def test_a_mesh_around_the_camera_hides_every_line(is_moving):
    around = replace(meshed(box(*CAMERA, size=(4.0, 1.0, 1.0))), is_moving=is_moving)
    output, _ = looked_at("auto", around)
    assert set(chain.reasons(output).values()) == {Unseen.OCCLUDED}


@STATES
def test_a_mesh_of_a_box_hides_what_the_box_hides(is_moving):
    car = box(30.0, 1.53, size=(4.0, 1.9, 1.6), yaw_rad=0.2)
    reasons = [
        looked_at("auto", one)[0].observation.reason
        for one in (car, replace(meshed(car), is_moving=is_moving))
    ]
    assert (reasons[0] == Unseen.OCCLUDED).sum() > 200
    assert (reasons[0] != reasons[1]).sum() <= 4  # points inside: a mesh is a surface


@STATES
@pytest.mark.parametrize("cells", [0, 1])
def test_a_mesh_of_nothing_and_one_without_area_hide_nothing(cells, is_moving):
    flat = box_mesh((4.0, 0.0, 0.0), cells) if cells else mesh_of(np.zeros((0, 3)), np.zeros((0, 3), int))
    obstacle = replace(box(30.0, 1.53), mesh=flat, is_moving=is_moving)
    assert chain.bits(looked_at("auto", obstacle)[0]) == chain.bits(looked_at("auto")[0])


@STATES
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_camera_in_the_plane_of_a_meshs_side_sees_the_lines_on_its_free_side(side, is_moving):
    wall = replace(meshed(box(35.0, side * 2.5, 2.0, size=(50.0, 5.0, 4.0))), is_moving=is_moving)
    output, _ = looked_at("auto", wall)
    hidden = output.observation.candidates.points_ego_m[output.observation.reason == Unseen.OCCLUDED]
    assert len(hidden) > 500
    assert (hidden[:, 1] * side > 0.0).all()
