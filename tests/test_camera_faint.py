"""Paint that is too faint: what the camera's least contrast takes from sight, and what it costs nothing."""

from dataclasses import replace

import numpy as np
import pytest

from tests.roads import ego, snapshot, straight
from vsensor import light
from vsensor.camera import Camera, CameraConfig, observe
from vsensor.scene import SceneConfig
from vsensor.types import Colour, Environment, Light, Unseen

CONFIG = CameraConfig()
FOG = Environment(visibility_m=100.0)
NIGHT = Environment(light=Light.NIGHT)


def look(environment, *markings, **camera):
    """Return x and reasons of the points of the markings, those in the image."""
    scene = replace(snapshot(markings or (straight(1.8),)).scene, environment=environment)
    found = observe(
        Camera.from_config(CameraConfig(occlusion="none", **camera)),
        SceneConfig(),
        replace(snapshot(()), ego=ego(), scene=scene),
    )
    inside = ~np.isin(found.reason, (Unseen.OUTSIDE_IMAGE, Unseen.BEHIND_CAMERA))
    return found.candidates.points_ego_m[inside, 0], found.reason[inside]


def seen_up_to_m(environment, *markings, **camera):
    x, reason = look(environment, *markings, **camera)
    return float(x[reason == Unseen.SEEN].max(initial=0.0))


@pytest.mark.parametrize("environment", [FOG, NIGHT, Environment(rain=1.0, visibility_m=60.0)])
def test_paint_is_seen_as_far_as_its_contrast_reaches_from_the_camera(environment):
    range_m = light.visible_range_m(environment, 0.1) + CONFIG.position_m[0]
    assert seen_up_to_m(environment) == pytest.approx(range_m, abs=0.6)  # the line runs 1.8 m aside


def test_what_lies_beyond_is_too_faint_and_nothing_else():
    x, reason = look(FOG)
    assert set(reason.tolist()) == {Unseen.SEEN, Unseen.TOO_FAINT}
    assert x[reason == Unseen.TOO_FAINT].min() > x[reason == Unseen.SEEN].max()


def test_on_a_clear_day_nothing_is_too_faint():
    assert (look(Environment())[1] == Unseen.SEEN).all()


def test_a_camera_without_a_least_contrast_sees_through_the_night():
    assert (look(NIGHT, min_contrast=0.0)[1] == Unseen.SEEN).all()


def test_worn_paint_is_lost_first():
    fresh, worn = straight(1.8), straight(1.8, contrast=0.4)
    assert seen_up_to_m(FOG, worn) < seen_up_to_m(FOG, fresh) - 5.0


def test_paint_worn_to_next_to_nothing_is_not_seen_by_day_either():
    assert (look(Environment(), straight(1.8, contrast=0.1))[1] == Unseen.TOO_FAINT).all()
    assert (look(Environment(), straight(1.8, contrast=0.2))[1] == Unseen.SEEN).all()


def test_yellow_paint_is_lost_before_white():
    yellow = straight(1.8, colour=Colour.YELLOW)
    assert seen_up_to_m(NIGHT, yellow) < seen_up_to_m(NIGHT)


def test_wear_may_change_along_a_marking():
    line = straight(1.8)
    fades = np.where(line.points_world_m[:, 0] < 40.0, 1.0, 0.05)
    assert seen_up_to_m(Environment(), replace(line, contrast=fades)) == pytest.approx(40.0, abs=0.15)


def test_a_clear_day_asks_for_no_contrast(monkeypatch):
    def fail(*_):
        raise AssertionError("contrast was computed")

    monkeypatch.setattr(light, "contrast", fail)
    assert (look(Environment())[1] == Unseen.SEEN).all()
