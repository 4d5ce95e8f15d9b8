"""The road's surface in hard places: what has no answer is free, and nothing is said on the terminal."""

from dataclasses import replace

import numpy as np
import pytest

from tests.hard_cases import chain, crests
from tests.hard_cases.far_out import place
from tests.roads import ego, marking, snapshot
from vsensor.raycast import hidden_by_surface
from vsensor.types import RoadSurface, Unseen, frozen

CREST = crests.Road(0.0, -1 / 2000.0, 0.0, 1.35)
POINTS = crests.lines(CREST)
SECTIONS = crests.sections(CREST)


def hidden(sections, road=CREST, points=POINTS):
    return hidden_by_surface(road.eye, points, sections)


@pytest.mark.parametrize("times", [2, 5])
def test_sections_that_are_there_several_times_change_nothing(times):
    np.testing.assert_array_equal(hidden(np.repeat(SECTIONS, times, axis=0)), hidden(SECTIONS))


def test_borders_that_lie_on_each_other_change_nothing():
    doubled = SECTIONS[:, [0, 0, 1, 1]]
    np.testing.assert_array_equal(hidden(doubled), hidden(SECTIONS))


def test_sections_without_length_hide_nothing():
    assert not hidden(SECTIONS[:, [0, 0]]).any()


@pytest.mark.parametrize("column", [0, 1])
def test_a_section_of_one_border_hides_nothing(column):
    half = SECTIONS.copy()
    half[:, 1 - column] = np.nan
    assert not hidden(half).any()


def test_a_surface_of_nan_hides_nothing():
    assert not hidden(np.full((40, 3, 3), np.nan)).any()


def test_sections_that_are_nan_are_as_if_not_there():
    holed = SECTIONS.copy()
    holed[::3] = np.nan
    np.testing.assert_array_equal(hidden(holed), hidden(np.delete(SECTIONS, slice(None, None, 3), axis=0)))
    assert hidden(holed).any()


def test_a_section_seen_end_on_hides_nothing():
    along = np.array([[(10.0, 1.75, 0.9), (30.0, 1.75, 0.9)]])
    points = np.array([(60.0, 1.75, 0.0), (60.0, 1.75, 0.5)])
    assert not hidden_by_surface(np.array([0.0, 1.75, 1.35]), points, along).any()


def test_a_camera_on_the_road_sees_the_plane_and_nothing_behind_a_crest():
    plane = crests.Road(0.02, 0.0, 0.0, 0.0)
    assert not hidden(crests.sections(plane), plane, crests.lines(plane)).any()
    ground = CREST._replace(eye_m=0.0)
    assert hidden(SECTIONS, ground)[POINTS[:, 0] > 10.0].all()


def test_a_camera_below_the_road_sees_nothing_beyond_the_next_section():
    below = CREST._replace(eye_m=-0.2)
    assert hidden(SECTIONS, below)[POINTS[:, 0] > 10.0].all()


@pytest.mark.parametrize("step_m", [1.0, 20.0])
@pytest.mark.parametrize("wall_m", [3.0, 1000.0])
def test_a_step_up_hides_nothing_of_itself_and_all_behind_it_that_is_lower(wall_m, step_m):
    x = np.arange(0.0, 100.0, step_m)
    across = np.array([[(a, y, wall_m * (40.0 <= a < 60.0)) for y in (6.0, -6.0)] for a in x])
    ahead = np.column_stack([np.arange(2.0, 99.0, 0.1), np.zeros(970), np.zeros(970)])
    ahead[:, 2] = wall_m * ((ahead[:, 0] >= 40.0) & (ahead[:, 0] < 60.0))
    found = hidden_by_surface(np.array([0.0, 0.0, 1.35]), ahead, across)
    assert found[ahead[:, 0] > 60.5].all()
    assert not found[ahead[:, 0] < 39.5].any()


@pytest.mark.parametrize("far_m", [1e5, 1e6, 1e7])
def test_a_crest_hides_the_same_points_far_out(far_m):
    grain_m = 2.0**-20  # so that moving the scene rounds nothing

    def seen(origin):
        x = np.arange(-200, 1300) / 10.0 + 0.04
        lines = [np.column_stack([x, 0 * x + y, CREST.height(x, y)]) for y in (1.8, -1.7)]
        points = [np.rint(line / grain_m) * grain_m + origin for line in lines]
        across = np.rint(SECTIONS / grain_m) * grain_m + origin
        flat = snapshot([marking(line, number) for number, line in enumerate(points)], [], ego(origin))
        scene = replace(flat.scene, surface=RoadSurface(points_world_m=frozen(across)))
        return chain.shown(replace(flat, scene=scene))[0].observation.reason

    here = seen(np.zeros(3))
    assert 100 < (here == Unseen.OCCLUDED).sum() < 1500
    np.testing.assert_array_equal(seen(place(far_m)), here)
