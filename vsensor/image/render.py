"""The image of a snapshot: road and sky, paint, vehicles from far to near, then lens and sensor."""

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.camera import Camera, camera_from_ego
from vsensor.draws import Draws, Stage
from vsensor.errors import ConfigError, MissingExtraError
from vsensor.image import ground
from vsensor.image.config import (
    LIGHTING,
    PAINT_RGB,
    RAIN_VEIL,
    ROAD_RGB,
    SKY_RGB,
    ImageConfig,
    haze,
    levels,
    veil_level,
)
from vsensor.image.coverage import Edges, FloatImage, Patch, chained, coverage
from vsensor.image.ground import Ground
from vsensor.image.hills import Skyline, road_above_horizon, without_hidden_part
from vsensor.image.shapes import polygon_edges, stripe_edges
from vsensor.image.solids import draw_solids
from vsensor.light import WET_PAINT
from vsensor.scene import world_from_ego
from vsensor.transforms import Rigid, invert, relative_to
from vsensor.types import Array, Colour, EgoState, Environment, Marking, Scene, Snapshot, Tick

Image = NDArray[np.uint8]

_Paint = tuple[Colour, Patch]


def render(camera: Camera, config: ImageConfig, snapshot: Snapshot, draws: Draws, tick: Tick) -> Image:
    """Return what the camera sees, (H, W) grey or (H, W, 3) RGB; pixel centres are those of `project`.

    Edges lie where `project` says to a hundredth of a pixel. Raises MissingExtraError without OpenCV,
    ConfigError for a camera of model "none". Where the vehicle is not known the road is empty.
    """
    import_opencv("an image")
    if camera.config.model == "none":
        raise ConfigError('[camera] model = "none" has no image; with "pinhole" it has')
    if not _is_known(snapshot.ego):
        standing = EgoState(t_ns=snapshot.t_ns, position_world_m=np.zeros(3), speed_mps=0.0)
        empty = Scene(markings=(), environment=snapshot.scene.environment)
        snapshot = replace(snapshot, ego=standing, scene=empty)
    ego, scene = snapshot.ego, snapshot.scene
    pose, frame, air = camera_from_ego(camera, ego), world_from_ego(ego), scene.environment
    eye_m = invert(pose).translation
    markings = [marking for marking in scene.markings if len(marking.points_world_m)]
    skylines = [Skyline(eye_m, pose.rotation[2], relative_to(frame, m.points_world_m)) for m in markings]
    edges = _line_edges(camera, config, pose, air, list(zip(markings, skylines, strict=True)))
    _add_ground_edges(camera, config, (pose, frame), scene, skylines, edges)
    paints = _covered(camera, edges)
    hill = road_above_horizon(camera, pose, skylines)
    drawn = [patch for _, patch in paints if patch.values.size] + ([hill] if hill is not None else [])
    top = min((patch.top for patch in drawn), default=camera.config.height_px)
    view = ground.look(camera, config, pose, ego, air, top)
    if hill is not None:
        here = hill._replace(top=hill.top - view.top)
        np.maximum(here.of(view.cover), here.values, out=here.of(view.cover))
    planes = _background(camera, config, air, view, paints)
    boxes = [without_hidden_part(eye_m, frame, skylines, box) for box in scene.obstacles]
    draw_solids(camera, config, air, planes, (pose, frame), [box for box in boxes if box is not None])
    if view.blind is not None:
        for plane in planes:
            plane[view.blind] = 0.0
    return _exposed(config, air, planes, draws, tick)


def import_opencv(purpose: str) -> Any:
    """Return cv2, or raise MissingExtraError. Its FFmpeg keeps quiet: what is wrong is said in our words."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # read once, when it first opens a video
    try:
        import cv2
    except ImportError:
        raise MissingExtraError("OpenCV", "video", purpose) from None
    return cv2


def _is_known(ego: EgoState) -> bool:
    angles = (ego.roll_rad, ego.pitch_rad, ego.yaw_rad, ego.body_roll_rad, ego.body_pitch_rad)
    return bool(np.isfinite([*ego.position_world_m, *angles, ego.body_heave_m]).all())


def _line_edges(
    camera: Camera,
    config: ImageConfig,
    pose: Rigid,
    air: Environment,
    lines: Sequence[tuple[Marking, Skyline]],
) -> dict[Colour, list[Edges]]:
    """Return for each colour the outlines of lines, weighted by how much of the paint is left."""
    edges: dict[Colour, list[Edges]] = {}
    for marking, skyline in lines:
        painted = marking.painted & skyline.seen
        if not painted.any():
            continue
        wet = marking.contrast * (1.0 - WET_PAINT * air.rain)
        gone = 1.0 - (1.0 - config.wear) * (1.0 - marking.wear)
        left = ground.worn(gone, marking.points_world_m) * wet
        for colour in np.unique(marking.colour[painted]).tolist():
            opacity = np.where(painted & (marking.colour == colour), left, 0.0)
            found = stripe_edges(camera, pose, skyline.points_ego_m, marking.width_m, opacity)
            if found is not None:
                edges.setdefault(Colour(colour), []).append(found)
    return edges


def _add_ground_edges(
    camera: Camera,
    config: ImageConfig,
    frames: tuple[Rigid, Rigid],
    scene: Scene,
    skylines: Sequence[Skyline],
    edges: dict[Colour, list[Edges]],
) -> None:
    """Add the outlines of painted areas; `frames` are camera_from_ego and world_from_ego.

    An area behind a crest is left out: where the nearest point of the lines is not seen.
    """
    pose, frame = frames
    for area in scene.ground:
        points = relative_to(frame, area.points_world_m)
        if not _is_seen(points.mean(axis=0), skylines):
            continue
        wet = area.contrast * (1.0 - WET_PAINT * scene.environment.rain)
        found = polygon_edges(camera, pose, points, (1.0 - config.wear) * (1.0 - area.wear) * wet)
        if found is not None:
            edges.setdefault(area.colour, []).append(found)


def _is_seen(point_ego_m: Array, skylines: Sequence[Skyline]) -> bool:
    if not skylines:
        return True
    nearest = min(skylines, key=lambda line: line.distance_to_m(point_ego_m))
    apart = nearest.points_ego_m[:, :2] - point_ego_m[:2]
    return bool(nearest.seen[int((apart * apart).sum(axis=1).argmin())])


def _covered(camera: Camera, edges: dict[Colour, list[Edges]]) -> list[_Paint]:
    """Return for each colour how much of every pixel its paint covers, times how much of it is left."""
    size = camera.config.width_px, camera.config.height_px
    patches = [(colour, coverage(chained(*parts), *size)) for colour, parts in edges.items()]
    for _, patch in patches:
        np.clip(patch.values, 0.0, 1.0, out=patch.values)  # where stripes cross
    return patches


def _background(
    camera: Camera, config: ImageConfig, air: Environment, view: Ground, paints: Sequence[_Paint]
) -> list[FloatImage]:
    """Return each channel's plane (H, W) with sky, road and paint."""
    ambient = LIGHTING[air.light].ambient
    road = levels(config, ROAD_RGB)
    sky = levels(config, SKY_RGB) * ambient
    sky += haze(air) * (veil_level(air) - sky)
    planes = []
    for channel in range(len(road)):
        plane = np.full((camera.config.height_px, camera.config.width_px), sky[channel], dtype=np.float32)
        part = np.full_like(view.cover, road[channel])
        for factor in (view.relief, view.on_road):
            if factor is not None:
                part *= factor
        for colour, patch in paints:
            _draw_paint(part, view, float(levels(config, PAINT_RGB[colour])[channel]), patch)
        if view.clear is not None:
            part = veil_level(air) + view.clear * (part - np.float32(veil_level(air)))
        plane[view.top :] += view.cover * (part - np.float32(sky[channel]))
        planes.append(plane)
    return planes


def _draw_paint(part: FloatImage, view: Ground, level: float, patch: Patch) -> None:
    if not patch.values.size:
        return
    moved = patch._replace(top=patch.top - view.top)
    here = moved.of(part)
    light = 1.0 if view.on_paint is None else moved.of(view.on_paint)
    here += patch.values * (np.float32(level) * light - here)


def _exposed(
    config: ImageConfig, air: Environment, planes: Sequence[FloatImage], draws: Draws, tick: Tick
) -> Image:
    """Return the image that lens and sensor make: veil of a wet windscreen, blur, gain, noise, 8 bits."""
    import cv2

    wet = RAIN_VEIL * air.rain
    noise_std = config.noise_std * LIGHTING[air.light].noise * (1.0 + air.rain)
    taken = []
    for channel, plane in enumerate(planes):
        gain = 255.0 * config.exposure
        seen = plane * np.float32(gain * (1.0 - wet)) + np.float32(gain * wet * veil_level(air))
        if config.blur_px:
            seen = np.asarray(cv2.GaussianBlur(seen, (0, 0), config.blur_px, borderType=cv2.BORDER_REPLICATE))
        if noise_std:
            seen += noise_std * _normal(draws, tick, channel, seen.shape)
        taken.append(np.rint(np.clip(seen, 0.0, 255.0)).astype(np.uint8))
    return taken[0] if len(taken) == 1 else np.ascontiguousarray(np.dstack(taken))


_STEPS = 4096


@cache
def _quantiles() -> NDArray[np.float32]:
    """Return the normal law's quantiles at 4096 equal steps, deviation 1."""
    from scipy.special import ndtri

    values = np.asarray(ndtri((np.arange(_STEPS) + 0.5) / _STEPS))
    return np.asarray(values / values.std(), np.float32)


def _normal(draws: Draws, tick: Tick, channel: int, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return normal numbers; from 16 random bits and a table it takes a fifth of standard_normal's time."""
    words = np.frombuffer(draws.at(Stage.IMAGE, tick.index, channel).bytes(2 * shape[0] * shape[1]), "<u2")
    return np.asarray(_quantiles()[words.reshape(shape) >> 4])
