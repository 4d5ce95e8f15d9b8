"""The road plane in every pixel: where it ends, how far away it is, how uneven, how much light falls on it.

The plane is that of the road-level ego frame. What is drawn on it lies where the road really is.
"""

from functools import cache
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vsensor.camera import Camera, unproject
from vsensor.image.config import (
    HEADLIGHT_ASIDE_M,
    HEADLIGHT_M,
    HEADLIGHT_SLOPE,
    LIGHTING,
    RETROREFLECTION,
    ImageConfig,
    headlights_level,
)
from vsensor.image.coverage import FloatImage
from vsensor.light import extinction_per_m
from vsensor.scene import world_from_ego
from vsensor.transforms import Rigid, invert
from vsensor.types import Array, Beam, BoolArray, EgoState, Environment, Light

FARTHEST_M = 200.0
"""The plane is treated as no farther away than this; a road that climbs above its horizon is nearer."""

_GRID_PX = (
    16  # rays are computed at so many pixels, linear between: within 0.1 px with a wide lens, else exact
)
_TEXEL_M = 0.06
_TILE = 256
_FADE_M = 0.3  # a pixel that covers so much road along the line of sight shows half of the unevenness


class Ground(NamedTuple):
    """The rows from `top` on, each (H - top, W); None stands for 1 in every pixel.

    `cover` is the part of the pixel below the horizon; `relief` the road's unevenness; `on_road` and
    `on_paint` the light; `clear` the part of the contrast that rain leaves. `blind` (H, W) is where the
    lens shows nothing, to within 16 px; None is nowhere.
    """

    top: int
    cover: FloatImage
    relief: FloatImage | None
    on_road: FloatImage | None
    on_paint: FloatImage | None
    clear: FloatImage | None
    blind: BoolArray | None


def look(
    camera: Camera, config: ImageConfig, pose: Rigid, ego: EgoState, air: Environment, top: int
) -> Ground:
    """Return the plane as the camera sees it; `pose` is camera_from_ego, the rows begin at `top` or above."""
    eye = invert(pose)
    ahead, left, up, blind = _rays(camera, eye.rotation)
    below = (up < 0.0).any(axis=1)
    first = min(top, int(below.argmax()) - 1 if below.any() else camera.config.height_px)
    first = max(first, 0)
    ahead, left, up = ahead[first:], left[first:], up[first:]
    slope = _slope_per_px(up)
    cover = np.clip(0.5 - up / slope, 0.0, 1.0)
    depth = np.minimum(float(eye.translation[2]) / np.maximum(-up, 1e-6), FARTHEST_M)
    return Ground(
        first,
        cover,
        _relief(config, ego, eye, depth, ahead, left, camera) if config.texture else None,
        *_light(air, depth, left),
        np.exp(depth * -extinction) if (extinction := extinction_per_m(air)) else None,
        blind,
    )


def headlight(beam: Beam, depth_m: Any, aside_m: Any) -> Any:
    """Return the part of the headlights' light that falls at a depth and distance to the side."""
    wide_m = HEADLIGHT_ASIDE_M + HEADLIGHT_SLOPE * depth_m
    return 1.0 / ((1.0 + (depth_m / HEADLIGHT_M[beam]) ** 2) * (1.0 + (aside_m / wide_m) ** 2))


@cache
def unevenness() -> NDArray[np.float32]:
    """Return a tile of road (256, 256), smooth over three texels, mean 0, deviation 1, seamless."""
    values = np.random.Generator(np.random.Philox(key=1)).standard_normal((_TILE, _TILE))
    for axis in (0, 1):
        values = np.roll(values, 1, axis) + values + np.roll(values, -1, axis)
    tile: NDArray[np.float32] = ((values - values.mean()) / values.std()).astype(np.float32)
    tile.flags.writeable = False
    return tile


def worn(wear: Array | float, points_world_m: Array) -> Array:
    """Return how much paint is left at points (N, 3): 1 - wear on average, patchy where some is worn."""
    column, row = (np.floor(points_world_m[:, axis] / 0.4).astype(np.int64) % _TILE for axis in (0, 1))
    left: Array = 1.0 - wear + wear * (1.0 - wear) * unevenness()[row, column].astype(np.float64)
    return left.clip(0.0, 1.0)


def _rays(
    camera: Camera, ego_from_camera: Array
) -> tuple[FloatImage, FloatImage, FloatImage, BoolArray | None]:
    """Return x, y, z (H, W) in the ego frame of each pixel's ray, of depth 1 in the camera; and the blind."""
    import cv2

    width, height = camera.config.width_px, camera.config.height_px
    columns, rows = ceil(width / _GRID_PX) + 2, ceil(height / _GRID_PX) + 2
    u, v = (_GRID_PX * (np.arange(count) - 0.5) - 0.5 for count in (columns, rows))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    rays = unproject(camera, grid, np.ones(len(grid))) @ ego_from_camera.T
    size, inner = (columns * _GRID_PX, rows * _GRID_PX), (slice(_GRID_PX, None), slice(_GRID_PX, None))
    is_blind = np.isnan(rays).any(axis=1)
    rays[is_blind] = 0.0
    x, y, z, dark = (
        np.asarray(cv2.resize(axis.reshape(rows, columns).astype(np.float32), size))[inner][:height, :width]
        for axis in (*rays.T, is_blind)
    )
    return x, y, z, dark > 0.0 if is_blind.any() else None


def _slope_per_px(up: FloatImage) -> float:
    """Return by how much the rays' z changes from pixel to pixel, across the horizon."""
    if min(up.shape) < 2:
        return 1.0
    along, down = np.median(np.diff(up[::16], axis=1)), np.median(np.diff(up[:, ::16], axis=0))
    return max(float(np.hypot(along, down)), 1e-9)


def _light(
    air: Environment, depth: FloatImage, left: FloatImage
) -> tuple[FloatImage | None, FloatImage | None]:
    """Return the light on asphalt and on paint; the beads of paint do not send it back through water."""
    lighting = LIGHTING[air.light]
    if air.light is Light.DAY:
        return None, None
    beam = headlights_level(air) * headlight(air.headlights, depth, left * depth)
    return lighting.ambient + RETROREFLECTION * beam, lighting.ambient + (1.0 - 0.5 * air.rain) * beam


def _relief(
    config: ImageConfig,
    ego: EgoState,
    eye: Rigid,
    depth: FloatImage,
    ahead: FloatImage,
    left: FloatImage,
    camera: Camera,
) -> FloatImage:
    """Return the road's unevenness, fixed to the world, about 1; it fades where a pixel covers more of it."""
    import cv2

    frame = world_from_ego(ego)
    corner = frame.rotation[:2] @ eye.translation + np.mod(frame.translation[:2], _TILE * _TEXEL_M)
    turn, (column_0, row_0) = frame.rotation[:2, :2] / _TEXEL_M, (corner / _TEXEL_M).tolist()
    x, y = ahead * depth, left * depth
    column = column_0 + float(turn[0, 0]) * x + float(turn[0, 1]) * y
    row = row_0 + float(turn[1, 0]) * x + float(turn[1, 1]) * y
    tile = np.asarray(cv2.remap(unevenness(), column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP))
    covered_m = depth * depth / max(float(eye.translation[2]) * camera.fy_px, 1e-3)
    faded: FloatImage = 1.0 + config.texture * tile / (1.0 + (covered_m / _FADE_M) ** 2)
    return faded
