"""Vehicles: boxes by their exact faces, meshes by their triangles, from far to near, lit and in the rain."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsensor.camera import Camera, project
from vsensor.image.config import BODY_RGB, LIGHTING, ImageConfig, headlights_level, levels, veil_level
from vsensor.image.coverage import FloatImage, coverage
from vsensor.image.ground import headlight
from vsensor.image.shapes import NEAR_M, Face, box_faces
from vsensor.light import extinction_per_m
from vsensor.transforms import Rigid, compose, rotation_from_rpy, transform
from vsensor.types import Array, Environment, Mesh, Obstacle

_SUN_EGO = np.array([-0.6, 0.0, 0.8])
_SHADE = 0.55  # of a face that the sun does not reach
_LEAST_BEAM = 0.1  # of the headlights on a face turned away from them

_PARTS = (
    4  # a mesh is drawn at four times the resolution, so its edges are true to about an eighth of a pixel
)
_FRACTION_BITS = 4


class _Drawn(NamedTuple):
    """A solid in the image from `top`, `left`: what it covers, and its light there, both (h, w)."""

    top: int
    left: int
    cover: FloatImage
    light: FloatImage


def draw_solids(
    camera: Camera,
    config: ImageConfig,
    air: Environment,
    planes: Sequence[FloatImage],
    frames: tuple[Rigid, Rigid],
    obstacles: Sequence[Obstacle],
) -> None:
    """Draw the obstacles into each channel's plane (H, W); `frames` are camera_from_ego, world_from_ego."""
    pose, world_from_ego = frames
    placed = []
    for obstacle in obstacles:
        centre = world_from_ego.rotation.T @ (obstacle.centre_world_m - world_from_ego.translation)
        turn = rotation_from_rpy(obstacle.roll_rad, obstacle.pitch_rad, obstacle.yaw_rad)
        ego_from_box = Rigid(world_from_ego.rotation.T @ turn, centre)
        placed.append((float(transform(pose, centre[None])[0, 2]), obstacle, ego_from_box))
    for depth_m, obstacle, ego_from_box in sorted(placed, key=lambda item: -item[0]):
        if obstacle.mesh is None:
            drawn = _box(camera, air, box_faces(camera, pose, ego_from_box, obstacle.size_m))
        else:
            drawn = _mesh(camera, air, pose, ego_from_box, obstacle.mesh)
        if drawn is not None:
            _blend(planes, levels(config, BODY_RGB[obstacle.id % len(BODY_RGB)]), air, drawn, depth_m)


def _blend(
    planes: Sequence[FloatImage], body: Array, air: Environment, drawn: _Drawn, depth_m: float
) -> None:
    """Put a solid over what is there, through rain and fog up to its depth."""
    height, width = drawn.cover.shape
    clear = float(np.exp(-extinction_per_m(air) * max(depth_m, 0.0)))
    veil = drawn.cover * (veil_level(air) * (1.0 - clear))
    for channel, plane in enumerate(planes):
        here = plane[drawn.top : drawn.top + height, drawn.left : drawn.left + width]
        here *= 1.0 - drawn.cover
        here += float(body[channel]) * clear * drawn.light + veil


def _box(camera: Camera, air: Environment, faces: Sequence[Face]) -> _Drawn | None:
    """Return the faces of a box at once: side by side, they leave no seam."""
    size = camera.config.width_px, camera.config.height_px
    covers = [(face, coverage(face.edges, *size)) for face in faces]
    covers = [(face, patch) for face, patch in covers if patch.values.size]
    if not covers:
        return None
    top, left = min(patch.top for _, patch in covers), min(patch.left for _, patch in covers)
    bottom = max(patch.top + patch.values.shape[0] for _, patch in covers)
    right = max(patch.left + patch.values.shape[1] for _, patch in covers)
    whole = np.zeros((bottom - top, right - left), dtype=np.float32)
    light = np.zeros_like(whole)
    for face, patch in covers:
        moved = patch._replace(top=patch.top - top, left=patch.left - left)
        covered = np.abs(patch.values)
        moved.of(whole)[...] += covered
        moved.of(light)[...] += covered * float(
            _light(air, face.normal_ego[None], np.array([face.depth_m]))[0]
        )
    return _Drawn(top, left, np.clip(whole, 0.0, 1.0), light)


def _mesh(camera: Camera, air: Environment, pose: Rigid, ego_from_box: Rigid, mesh: Mesh) -> _Drawn | None:
    """Return the triangles of a mesh, farthest first, without those that reach behind the camera."""
    import cv2

    vertices = transform(compose(pose, ego_from_box), mesh.vertices_m)
    pixels = project(camera, vertices)
    is_there = np.isfinite(pixels).all(axis=1) & (vertices[:, 2] >= NEAR_M)
    faces = mesh.faces[is_there[mesh.faces].all(axis=1)]
    if not len(faces):
        return None
    limits = np.array([camera.config.width_px, camera.config.height_px])
    used = pixels[faces.ravel()]
    low = np.clip(np.floor(used.min(axis=0) + 0.5), 0, limits).astype(int)
    high = np.clip(np.ceil(used.max(axis=0) + 0.5), 0, limits).astype(int)
    (width, height) = (high - low).tolist()
    if width <= 0 or height <= 0:
        return None
    corners = vertices[faces]
    depth_m = corners[:, :, 2].mean(axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals *= -np.sign((normals * corners[:, 0]).sum(axis=1, keepdims=True))  # towards the camera
    normals /= np.maximum(np.sqrt((normals * normals).sum(axis=1, keepdims=True)), 1e-12)
    light = _light(air, normals @ pose.rotation, depth_m)
    fine = np.full((height * _PARTS, width * _PARTS), -1.0, dtype=np.float32)
    places = ((pixels - low + 0.5) * _PARTS - 0.5) * 2**_FRACTION_BITS
    polygons = np.rint(np.clip(places, -(2.0**28), 2.0**28)[faces]).astype(np.int32)
    for triangle in np.argsort(-depth_m, kind="stable").tolist():
        cv2.fillConvexPoly(fine, polygons[triangle], float(light[triangle]), cv2.LINE_8, _FRACTION_BITS)
    parts = fine.reshape(height, _PARTS, width, _PARTS)
    cover = (parts >= 0.0).mean(axis=(1, 3), dtype=np.float32)
    return _Drawn(int(low[1]), int(low[0]), cover, np.maximum(parts, 0.0).mean(axis=(1, 3)))


def _light(air: Environment, normals_ego: Array, depth_m: Array) -> Array:
    """Return the light (N,) on surfaces by their outward normals (N, 3) and depths."""
    lighting = LIGHTING[air.light]
    sun = _SHADE + (1.0 - _SHADE) * np.maximum(normals_ego @ _SUN_EGO, 0.0)
    falls = headlight(air.headlights, depth_m, 0.0) * np.maximum(-normals_ego[:, 0], _LEAST_BEAM)
    beam = headlights_level(air) * falls
    lit: Array = lighting.ambient * sun + beam
    return lit
