"""The road ahead as a grid of places, and where each of them is seen in a picture.

far   . . . . . . . . .      rows: distance from the camera grows by a constant factor, as the rows of
      . . . . . . . . .            pixels do that the road is seen in
      . . . . . . . . .      columns: evenly across, so a marking is as wide far ahead as it is near
near  . . . . . . . . .
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsensor.camera import Camera, in_image, project
from vsensor.errors import ConfigError
from vsensor.image import import_opencv
from vsensor.transforms import invert, transform
from vsensor.types import Array, BoolArray, frozen
from vsensor.video.ridge.config import RidgeConfig
from vsensor.video.types import Picture

Levels = NDArray[np.float32]

NEAREST_M = 1.0
"""Ahead of the camera; nearer than this no road is looked at."""
PALE, YELLOW = np.float32(30.0), np.float32(0.7)
"""Levels by which blue is below green and red in dry grass and concrete; beyond that, what a level counts."""
LUMA = np.array([0.114, 0.587, 0.299], np.float32)
"""Of blue, green, red: ITU-R BT.601, as the grey picture has them."""
OWN_LANE_M = 2.5
"""A row is of use where some of the road so near to the camera is seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """The grid: rows (K,) nearest first, columns (M,) from right to left.

    `ahead_m` (K,) and `aside_m` (M,) from the camera's foot, in the ego frame's directions; `foot_m` is that
    foot there and `height_m` the camera's height. `u_px`, `v_px` (K, M) where each place is seen with the
    body level; `seen` (K, M) whether it is. `across_m`, `along_m` (K,) are what a pixel covers of the road.
    `growth` is each row's distance over the one before. The offset of a line is read at `front_axle_m` ahead
    of the rear axle.
    """

    ahead_m: Array
    aside_m: Array
    step_m: float
    foot_m: tuple[float, float]
    height_m: float
    u_px: Levels
    v_px: Levels
    seen: BoolArray
    across_m: Array
    along_m: Array
    growth: float
    front_axle_m: float

    @classmethod
    def of(cls, config: RidgeConfig, camera: Camera, front_axle_m: float) -> "Ground":
        """Lay the grid for a camera. Raises ConfigError where it sees no road."""
        eye = invert(camera.camera_from_body).translation
        half = round(config.aside_m / config.step_m)
        aside: Array = config.step_m * np.arange(-half, half + 1).astype(np.float64)
        nearest = _nearest_m(config, camera, eye)
        ahead = np.geomspace(nearest, _farthest_m(config, camera, eye), config.rows)
        pixels = _pixels(camera, eye, ahead, aside)
        beyond = _pixels(camera, eye, ahead * 1.01, aside[len(aside) // 2 :][:1])[:, 0]
        middle = pixels[:, len(aside) // 2]
        beside = _pixels(camera, eye, ahead, aside[len(aside) // 2 :][:1] + 0.1)[:, 0]
        seen = in_image(camera, pixels.reshape(-1, 2)).reshape(pixels.shape[:2])
        lost = np.where(np.isfinite(pixels), pixels, -1e4).astype(np.float32)
        return cls(
            ahead_m=frozen(ahead),
            aside_m=frozen(aside),
            step_m=config.step_m,
            foot_m=(float(eye[0]), float(eye[1])),
            height_m=float(eye[2]),
            u_px=np.ascontiguousarray(lost[..., 0]),
            v_px=np.ascontiguousarray(lost[..., 1]),
            seen=seen,
            across_m=frozen(0.1 / np.hypot(*(beside - middle).T)),
            along_m=frozen(0.01 * ahead / np.hypot(*(beyond - middle).T)),
            growth=float(ahead[1] / ahead[0]),
            front_axle_m=front_axle_m,
        )

    def sample(self, picture: Picture) -> Levels:
        """Return a picture's levels at the grid's places (K, M), linear between pixels; 0 where not seen.

        Yellow counts as lighter than it is: on pale concrete it is paint by its colour alone.
        """
        cv2 = import_opencv("the video's lines")
        if picture.bgr is None:
            return np.asarray(cv2.remap(picture.grey, self.u_px, self.v_px, cv2.INTER_LINEAR), np.float32)
        bgr = np.asarray(cv2.remap(picture.bgr, self.u_px, self.v_px, cv2.INTER_LINEAR))
        blue, green, red = (np.asarray(channel, np.float32) for channel in cv2.split(bgr))
        yellow = np.maximum(np.minimum(green, red) - blue - PALE, 0.0)
        return np.asarray(LUMA[0] * blue + LUMA[1] * green + LUMA[2] * red + YELLOW * yellow)


def _pixels(camera: Camera, eye: Array, ahead: Array, aside: Array) -> Array:
    """Return pixels (K, M, 2) of places on the level road."""
    x, y = np.meshgrid(ahead + eye[0], aside + eye[1], indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return project(camera, transform(camera.camera_from_body, points)).reshape(*x.shape, 2)


def _farthest_m(config: RidgeConfig, camera: Camera, eye: Array) -> float:
    """Return how far ahead a pixel covers so little of the road that a marking is seen."""
    focal_px = camera.fx_px
    return max(min(config.range_m, config.most_px_m * focal_px), 2.0 * NEAREST_M)


def _nearest_m(config: RidgeConfig, camera: Camera, eye: Array) -> float:
    """Return how near to the camera the road is seen."""
    ahead = np.geomspace(NEAREST_M, config.range_m, 400)[:-1]
    aside = np.linspace(-OWN_LANE_M, OWN_LANE_M, 21)
    pixels = _pixels(camera, eye, ahead, aside)
    seen = in_image(camera, pixels.reshape(-1, 2)).reshape(pixels.shape[:2]).sum(axis=1) >= 3
    if eye[2] <= 0.0 or not seen.any():
        raise ConfigError(
            f"[camera]: it sees no road within {config.range_m:g} m: its pose does not look ahead along it"
        )
    return float(ahead[int(seen.argmax())])
