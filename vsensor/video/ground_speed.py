"""How high a camera is, from how fast the road comes nearer: taken twice as high, it comes twice as fast.

Two pictures some metres apart are laid on the road. The shift along it at which they agree, over the way that
CAN says was driven, is the height that was taken over the true one; all pairs of a drive vote together.

    picture i    |---- A ----------|          what is x ahead in i is x - way in j, and seems to be
    picture j   |---- A ----------|           x - way * (taken height) / (true height)
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import msgspec
import numpy as np

from vsensor.camera import Camera, on_road, project
from vsensor.image import import_opencv
from vsensor.transforms import transform
from vsensor.types import Array
from vsensor.video.camera_file import VideoCamera
from vsensor.video.types import Motion, Picture
from vsensor.video.upright import upright_camera, upright_grey
from vsensor.video.value import Value

STEP_M = 0.1
LENGTH_M, HALF_WIDTH_M = 14.0, 2.4
"""The road that is compared: so long from where it is first seen, lane and its lines."""
LEAST_WAY_M, MOST_WAY_M = 2.0, 8.0
"""Pictures are compared that lie so far apart: less is inexact, more leaves little in common."""
RATIOS = np.arange(0.74, 1.3501, 0.005)
HIGH_PASS_M = 1.5
ASIDE_M = 0.3
"""Blur across the road: what moves by less to the side, in a bend, still agrees."""
PARTS = 4
"""A drive is told in so many parts, too: how they differ is the deviation."""
LEAST_PAIRS = 12
LEAST_AGREEMENT, MOST_ELSEWHERE = 0.05, 0.6
"""Correlation at the best shift, and how much of it may be anywhere else, or the road shows nothing."""
NEAR_RATIO = 0.08


@dataclass(slots=True)
class _Votes:
    """Sums over pairs of pictures for each of RATIOS: products, and squares of both."""

    products: Array
    first: Array
    second: Array


def height_from_speed(
    pictures: Iterable[Picture], camera: VideoCamera, motions: Sequence[Motion]
) -> Value | None:
    """Return the camera's height, None where the road shows nothing that comes nearer.

    `camera` has its angles right; `motions` are those of the pictures, in the same order.
    """
    cv2 = import_opencv("reading a video")
    maps = _ground(camera)
    kept: list[tuple[float, Array]] = []  # way driven, road
    parts = [_Votes(*np.zeros((3, len(RATIOS)))) for _ in range(PARTS)]
    way_m, last_s, pairs = 0.0, float("nan"), 0
    for picture, motion in zip(pictures, motions, strict=False):
        now_s = picture.t_ns / 1e9
        step_m = motion.speed_mps * (now_s - last_s) if kept else 0.0
        last_s = now_s
        if not np.isfinite(step_m):
            kept = []
            step_m = 0.0
        way_m += step_m
        road = _road(cv2, upright_grey(picture.grey, camera.config), maps)
        kept = [(at, one) for at, one in kept if way_m - at <= MOST_WAY_M]
        for at, one in kept[:1]:
            if way_m - at >= LEAST_WAY_M:
                _vote(parts[int(way_m / 40.0) % PARTS], one, road, way_m - at)
                pairs += 1
        kept.append((way_m, road))
    return _height(parts, pairs, camera.config.position_m[2])


def _height(parts: Sequence[_Votes], pairs: int, taken_m: float) -> Value | None:
    if pairs < LEAST_PAIRS:
        return None
    total = _Votes(
        np.sum([part.products for part in parts], axis=0),
        np.sum([part.first for part in parts], axis=0),
        np.sum([part.second for part in parts], axis=0),
    )
    ratio = _best(total)
    if ratio is None:
        return None
    each = [found for part in parts if (found := _best(part)) is not None]
    spread = float(np.std(each, ddof=1)) / sqrt(len(each)) if len(each) > 1 else 0.03
    return Value(value=taken_m / ratio, std=taken_m / ratio * spread / ratio)


def _best(votes: _Votes) -> float | None:
    """Return the ratio at which pictures agree best, None where none stands out."""
    norm = np.sqrt(votes.first * votes.second)
    if not (norm > 0.0).all():
        return None
    agreement = votes.products / norm
    place = int(agreement.argmax())
    elsewhere = agreement[np.abs(RATIOS - RATIOS[place]) > NEAR_RATIO].max()
    clear = max(LEAST_AGREEMENT, float(elsewhere) / MOST_ELSEWHERE)
    if not 0 < place < len(RATIOS) - 1 or agreement[place] < clear:
        return None
    before, here, after = agreement[place - 1 : place + 2]
    bend = before - 2.0 * here + after
    return float(
        RATIOS[place] + (0.5 * (before - after) / bend if bend < 0.0 else 0.0) * (RATIOS[1] - RATIOS[0])
    )


def _ground(camera: VideoCamera) -> tuple[Any, Any]:
    """Return the pixels (X, Y) of the road that is compared, row and column apart."""
    seen = Camera.from_config(upright_camera(camera.config))
    rows = np.arange(seen.config.height_px, dtype=float)
    middle, _, _ = on_road(seen, seen.camera_from_body, np.array((np.full(len(rows), seen.cx_px), rows)))
    ahead = np.arange(float(middle[0].min()) + 0.3, float(middle[0].min()) + 0.3 + LENGTH_M, STEP_M)
    aside = np.arange(-HALF_WIDTH_M, HALF_WIDTH_M + STEP_M / 2.0, STEP_M)
    x, y = np.meshgrid(ahead, aside, indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    pixels = np.nan_to_num(project(seen, transform(seen.camera_from_body, points)), nan=-1e4)
    u, v = (pixels[:, k].reshape(x.shape).astype(np.float32) for k in (0, 1))
    return u, v


def _road(cv2: Any, grey: Any, maps: tuple[Any, Any]) -> Array:
    """Return the road from above (X, Y), what changes along it alone."""
    road = cv2.remap(grey, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float32)
    road = cv2.GaussianBlur(road, (0, 0), sigmaX=ASIDE_M / STEP_M, sigmaY=1.0)
    return np.asarray(road - cv2.blur(road, (1, 2 * round(HIGH_PASS_M / STEP_M / 2.0) + 1)), float)


def _vote(votes: _Votes, before: Array, now: Array, way_m: float) -> None:
    """Add how well two roads agree at each ratio."""
    size = len(now)
    for k, ratio in enumerate(RATIOS):
        shift = ratio * way_m / STEP_M
        whole = int(shift)
        count = size - whole - 1
        if count < 10:
            continue
        part = shift - whole
        moved = before[whole : whole + count] * (1.0 - part) + before[whole + 1 : whole + 1 + count] * part
        here = now[:count]
        votes.products[k] += float((moved * here).sum())
        votes.first[k] += float((moved * moved).sum())
        votes.second[k] += float((here * here).sum())


def with_height(camera: VideoCamera, height_m: float) -> VideoCamera:
    """Return the camera at another height."""
    x, y, _ = camera.config.position_m
    config = msgspec.structs.replace(camera.config, position_m=(x, y, round(height_m, 3)))
    return camera._replace(config=config)
