"""A method run again with changed cameras, beside its lines seen again."""

import numpy as np
import pytest

from tests.video.event_made import straight_event
from vsensor.camera import Camera, normalised, project
from vsensor.errors import ConfigError
from vsensor.transforms import transform
from vsensor.types import Boundary, Colour, LaneEstimate, MarkingKind, Side, frozen
from vsensor.video.evaluate.runs import RunOptions
from vsensor.video.event_folder import read_event
from vsensor.video.methods import METHODS, MethodKind
from vsensor.video.sensitivity.report import WITHIN
from vsensor.video.sensitivity.reproject import PARAMETERS
from vsensor.video.sensitivity.rerun import changed_camera, rerun, rerun_table

pytest.importorskip("cv2")

AHEAD_M = np.array([8.0, 18.0])


class Pixels:
    """A method that finds the same pixels whatever camera it is told of, and takes them back to the road."""

    def __init__(self, true, told):
        self.true, self.told = true, told

    def begin(self):
        return None

    def look(self, state, picture, motion):
        lines = (self.line(Side.LEFT, 1.55), self.line(Side.RIGHT, -1.95))
        return state, LaneEstimate(exposed_at_ns=picture.t_ns, image_index=picture.index, boundaries=lines)

    def line(self, side, y_m):
        points = np.column_stack([AHEAD_M, np.full(2, y_m), np.zeros(2)])
        seen = project(self.true, transform(self.true.camera_from_body, points))
        rays = (
            np.column_stack([*normalised(self.told, seen), np.ones(2)]) @ self.told.camera_from_body.rotation
        )
        place = np.array(self.told.config.position_m)
        (x1, y1, _), (x2, y2, _) = place - rays * (place[2] / rays[:, 2:])
        slope = (y2 - y1) / (x2 - x1)
        return Boundary(
            side=side,
            coefficients=frozen([y1 - slope * x1, slope]),
            covariance=frozen(np.zeros((2, 2))),
            x_min_m=3.0,
            x_max_m=40.0,
            quality=4,
            kind=MarkingKind.SOLID,
            colour=Colour.WHITE,
            width_m=0.0,
            measured=True,
            marking=-1,
            points=0,
        )


@pytest.fixture(scope="module")
def event(tmp_path_factory):
    return read_event(straight_event(tmp_path_factory.mktemp("event") / "one", seconds=0.2))


def ran(event, out, maker, monkeypatch):
    kind = MethodKind(maker=maker, has_lov=False, has_steps=False, about="of these tests")
    monkeypatch.setitem(METHODS, "pixels", kind)
    return rerun(event, "pixels", WITHIN, out, RunOptions(workers=0))


def test_a_method_that_finds_the_same_pixels_gives_what_seeing_again_says(event, tmp_path, monkeypatch):
    true = Camera.from_config(event.config.camera)
    found = ran(event, tmp_path, lambda setup: Pixels(true, setup.camera), monkeypatch)
    assert [one.parameter for one in found] == [name for name in PARAMETERS for _ in range(2)]
    for one in found:
        assert one.run_again_m == pytest.approx(one.seen_again_m, abs=1e-9), one
        assert one.reported == 1.0
    assert found[3].run_again_m == pytest.approx((0.05, -0.05))  # the camera 0.05 m farther to the left
    assert rerun_table(found)[4][:2] == ["lateral", "+0.05 m"]


def test_a_method_that_finds_the_camera_itself_does_not_change(event, tmp_path, monkeypatch):
    true = Camera.from_config(event.config.camera)
    found = ran(event, tmp_path, lambda setup: Pixels(true, true), monkeypatch)
    for one in found:
        assert one.run_again_m == pytest.approx((0.0, 0.0), abs=1e-12)
        assert abs(one.seen_again_m[0]) > 0.01


def test_a_method_that_is_none_is_named(event, tmp_path):
    with pytest.raises(ConfigError, match="nothing"):
        rerun(event, "nothing", WITHIN, tmp_path, RunOptions(workers=0))


def test_a_changed_camera_stands_where_it_is_said_to(event):
    camera = changed_camera(event.config.camera, (0.1, 0.2, 1.0, 2.0, 3.0))
    x, y, z = event.config.camera.position_m
    assert camera.position_m == pytest.approx((x, y + 0.2, z + 0.1))
    assert (camera.yaw_deg, camera.pitch_deg, camera.roll_deg) == (1.0, 2.0, 3.0)
