"""Crosswalks and stop lines: seen in images, where the camera says, and no lane lines in the truth."""

from dataclasses import replace

import numpy as np
import pytest

from tests.lines import tick
from tests.world.road.made import STRAIGHT, built
from vsensor.camera import Camera, CameraConfig, camera_from_ego, project
from vsensor.draws import Draws
from vsensor.image import ImageConfig, render
from vsensor.scene import world_from_ego
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.transforms import relative_to, transform
from vsensor.types import Colour
from vsensor.world.corridor import Corridor
from vsensor.world.route import CorridorConfig

CLEAN = ImageConfig(noise_std=0.0, blur_px=0.0, wear=0.0, texture=0.0)
CAMERA = Camera.from_config(CameraConfig(width_px=640, height_px=400))
CROSSWALK = "crosswalk = [{ at_m = 30, length_m = 4, stripe_m = 0.5, gap_m = 0.5 }]\n"
STOP_LINE = "stop_line = [{ at_m = 27, width_m = 0.5, colour = 'yellow', contrast = 0.6 }]\n"


def snapshot(folder, more, start_m=15.0):
    """Return the truth in front of the paint."""
    drive = MapDrive(
        Corridor(built(folder, STRAIGHT + more), CorridorConfig(road="1", lane=-1, s_m=start_m)),
        EgoConfig(speed_kmh=36.0),
    )
    return drive.advance(None, tick(0), ())[1]


def brightness(shot, x, y):
    """Return the image's level where a point of the road is, with and without the painted areas."""
    images = [
        render(CAMERA, CLEAN, one, Draws(0), tick(0)).astype(float)
        for one in (shot, replace(shot, scene=replace(shot.scene, ground=())))
    ]
    point = relative_to(world_from_ego(shot.ego), np.array([[x, y, 0.0]]))
    u, v = np.rint(project(CAMERA, transform(camera_from_ego(CAMERA, shot.ego), point)))[0].astype(int)
    return images[0][v, u], images[1][v, u]


@pytest.mark.parametrize(("y", "painted"), [(-3.25, True), (-2.75, False), (-1.25, True), (-0.75, False)])
def test_stripes_of_a_crosswalk_are_where_they_are_painted(tmp_path, y, painted):
    seen, bare = brightness(snapshot(tmp_path, CROSSWALK), 32.0, y)
    assert (seen > bare + 50.0) is np.True_ if painted else seen == bare


def test_paint_on_the_ground_makes_no_marking(tmp_path):
    bare, painted = (snapshot(tmp_path, more).scene for more in ("", CROSSWALK + STOP_LINE))
    assert [m.id for m in painted.markings] == [m.id for m in bare.markings]
    for one, other in zip(painted.markings, bare.markings, strict=True):
        np.testing.assert_array_equal(one.points_world_m, other.points_world_m)
        np.testing.assert_array_equal(one.painted, other.painted)
    assert (len(bare.ground), len(painted.ground)) == (0, 5)


def test_a_stop_line_spans_its_side_in_its_own_colour_and_contrast(tmp_path):
    (line,) = snapshot(tmp_path, "left = [{}]\n" + STOP_LINE).scene.ground
    assert (line.colour, line.contrast) == (Colour.YELLOW, 0.6)
    np.testing.assert_allclose(line.points_world_m.min(axis=0)[:2], [27.0, -3.5], atol=1e-9)
    np.testing.assert_allclose(line.points_world_m.max(axis=0)[:2], [27.5, 0.0], atol=1e-9)


def test_paint_that_reaches_behind_the_camera_is_cut_there(tmp_path):
    shot = snapshot(tmp_path, "crosswalk = [{ at_m = 8, length_m = 20 }]\n", start_m=10.0)
    seen, bare = brightness(shot, 20.0, -1.25)
    assert seen > bare + 50.0


def test_paint_follows_the_height_of_the_road(tmp_path):
    more = STOP_LINE + "elevation = [{ at_m = 0, z_m = 1 }, { at_m = 100, z_m = 6 }]\n"
    (line,) = snapshot(tmp_path, more).scene.ground
    x, _, z = line.points_world_m.T
    np.testing.assert_allclose(z, 1.0 + 0.05 * x, atol=1e-9)
