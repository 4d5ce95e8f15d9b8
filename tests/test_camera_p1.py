"""Projection, image and inverse against P1's equations 2.16-2.23; its field of view is in test_camera."""

import numpy as np
import pytest

from tests import p1
from vsensor.camera import Camera, CameraConfig, in_image, project, unproject

FOCAL = 0.008  # m; ours has none in metres, so it must not matter
COLUMNS, ROWS = 640, 480
HFOV_DEG = 50.0
HALF_WIDTH = FOCAL * np.tan(np.radians(HFOV_DEG / 2))
HALF_HEIGHT = HALF_WIDTH * ROWS / COLUMNS
FROM_P1 = np.array([1.0, -1.0, -1.0])
"""From P1's frame (x right, y up, looking along -z) to the optical one."""

CAMERA = Camera.from_config(CameraConfig(width_px=COLUMNS, height_px=ROWS, hfov_deg=HFOV_DEG))


@pytest.fixture
def points():
    """Points of P1's frame in front of the camera, out to twice its image."""
    rng = np.random.default_rng(19)
    depth = rng.uniform(1.0, 120.0, 3000)
    aside, up = rng.uniform(-1.0, 1.0, (2, 3000))
    return np.column_stack([depth * aside, depth * up, -depth])


def test_a_pixel_is_p1s_cell_half_a_pixel_from_the_edge(points):
    n, m = p1.cell(*p1.on_image_plane(points, FOCAL), HALF_WIDTH, HALF_HEIGHT, COLUMNS, ROWS)
    pixels = project(CAMERA, points * FROM_P1)
    np.testing.assert_allclose(pixels, np.column_stack([n, m]) - 0.5, atol=1e-9)


def test_the_image_is_p1s_region(points):
    u, v = p1.on_image_plane(points, FOCAL)
    inside = p1.is_in_region(u, v, HALF_WIDTH, HALF_HEIGHT)
    np.testing.assert_array_equal(in_image(CAMERA, project(CAMERA, points * FROM_P1)), inside)
    assert 0.1 < inside.mean() < 0.9


def test_the_inverse_is_p1s(points):
    n, m = p1.cell(*p1.on_image_plane(points, FOCAL), HALF_WIDTH, HALF_HEIGHT, COLUMNS, ROWS)
    n, m = np.rint(n - 0.5) + 0.5, np.rint(m - 0.5) + 0.5  # the nearest pixel's centre
    theirs = p1.from_cell(n, m, points[:, 2], FOCAL, HALF_WIDTH, HALF_HEIGHT, COLUMNS, ROWS)
    pixels = np.rint(project(CAMERA, points * FROM_P1))
    ours = unproject(CAMERA, pixels, -points[:, 2])
    np.testing.assert_allclose(ours * FROM_P1, theirs, atol=1e-10)
