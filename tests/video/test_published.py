"""P2's method on whole pictures."""

from dataclasses import replace
from itertools import islice

import msgspec
import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from tests.video.drawn import EOR, VEHICLE, WIDTH_M, road_picture
from vsensor.camera import Camera, CameraConfig
from vsensor.distortion import DistortionConfig
from vsensor.errors import ConfigError
from vsensor.types import Side
from vsensor.video import Motion
from vsensor.video.frames import open_pictures
from vsensor.video.methods import Setup, open_method, rows_by
from vsensor.video.published import Published, PublishedConfig
from vsensor.video.steps import StepFolder, line_pixels


def rows_of_pictures(*pictures, config=EOR):
    setup = Setup(camera=Camera.from_config(config), vehicle=VEHICLE)
    method = open_method("published", setup)
    return rows_by("published", setup, [method.look(None, one, Motion())[1] for one in pictures])


@pytest.mark.parametrize(("left_m", "right_m"), [(1.7, -1.6), (1.2, -2.3), (2.2, -1.1)])
def test_both_offsets_are_within_the_marking_and_the_steps_of_the_transform(left_m, right_m):
    rows = rows_of_pictures(road_picture(left_m=left_m, right_m=right_m))
    # The line runs somewhere in the paint, edges included; 1 degree and 1 pixel are some 3 cm at the axle.
    assert abs(rows.left_offset_m[0] - left_m) < WIDTH_M / 2 + 0.06
    assert abs(rows.right_offset_m[0] - right_m) < WIDTH_M / 2 + 0.06
    assert rows.left_confidence[0] >= 1
    assert rows.lane_width_m[0] == pytest.approx(rows.left_offset_m[0] - rows.right_offset_m[0], abs=0.02)


def test_a_bent_lens_changes_nothing_once_it_is_straightened():
    bent = msgspec.structs.replace(EOR, distortion=DistortionConfig(k1=-0.2, k2=0.03))
    rows = rows_of_pictures(road_picture(config=bent), config=bent)
    assert abs(rows.left_offset_m[0] - 1.7) < WIDTH_M / 2 + 0.06
    assert abs(rows.right_offset_m[0] + 1.6) < WIDTH_M / 2 + 0.06


@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_empty_picture_has_no_offset_and_no_confidence(level):
    picture = road_picture(left_m=None, right_m=None)
    rows = rows_of_pictures(replace(picture, grey=np.full_like(picture.grey, level)))
    assert np.isnan([rows.left_offset_m[0], rows.right_offset_m[0], rows.lane_width_m[0]]).all()
    assert np.isnan(rows.heading_rad[0])
    assert rows.left_confidence[0] == rows.right_confidence[0] == 0


def test_black_noise_has_no_lines():
    picture = road_picture(left_m=None, right_m=None)
    noise = np.random.default_rng(6).integers(0, 3, picture.grey.shape, dtype=np.uint8)
    rows = rows_of_pictures(replace(picture, grey=noise))
    assert rows.left_confidence[0] == rows.right_confidence[0] == 0


def test_of_one_line_only_its_side_is_there():
    rows = rows_of_pictures(road_picture(left_m=None))
    assert np.isnan(rows.left_offset_m[0])
    assert rows.left_confidence[0] == 0
    assert abs(rows.right_offset_m[0] + 1.6) < WIDTH_M / 2 + 0.06


def test_every_picture_stands_for_itself():
    pictures = [road_picture(index=k, left_m=1.5 + 0.1 * k) for k in range(3)]
    together = rows_of_pictures(*pictures)
    alone = [rows_of_pictures(one).left_offset_m[0] for one in pictures]
    np.testing.assert_array_equal(together.left_offset_m, alone)


def test_every_step_leaves_its_picture(tmp_path):
    method = Published(
        PublishedConfig(), Camera.from_config(EOR), show=StepFolder(tmp_path / "steps", every=2)
    )
    for k in range(3):
        method.look(None, road_picture(index=k), Motion())
    steps = ["1_straight", "3_region", "4_white", "5_borders", "6_lines"]
    found = sorted(path.name for path in (tmp_path / "steps").iterdir())
    assert found == [f"{index:06}_{step}.png" for index in (0, 2) for step in steps]


@needs_shared
def test_on_real_pictures_the_right_line_runs_through_the_paint():
    config = CameraConfig(width_px=960, height_px=540, hfov_deg=52.0, pitch_deg=-2.4)
    camera = Camera.from_config(config)
    method = Published(PublishedConfig(), camera)
    with open_pictures(SHARED_DATA / "camera" / "carnd_lanelines" / "solidWhiteRight.mp4") as reader:
        for picture in islice(reader, 0, 41, 20):
            line = method.look(None, picture, Motion())[1].on(Side.RIGHT)
            pixels = line_pixels(camera, line)
            for row in (400, 450, 500):
                bright = np.flatnonzero(picture.grey[row, 480:] > 170) + 480  # the marking alone is
                place = np.argsort(pixels[:, 1])
                u = np.interp(row, pixels[place, 1], pixels[place, 0])
                assert bright.min() - 3 <= u <= bright.max() + 3


def test_a_method_that_is_none_is_refused_by_name():
    with pytest.raises(ConfigError, match="--method publisht: ours, published were"):
        open_method("publisht", Setup(camera=Camera.from_config(EOR)))
