"""How time grows with points, boxes and triangles, and with which power."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tools.bench.measure import in_turns, median, one_core
from tools.bench.peers import BOX_CORNERS, BOX_TRIANGLES, eye_and_points
from tools.bench.scene import CENTRE_WORLD_M, ReferenceDrive, ticks_at
from vsensor import lanefit, raycast
from vsensor.camera import Camera, CameraConfig, observe
from vsensor.lanefit import LaneFitConfig
from vsensor.raycast import embree
from vsensor.scene import SceneConfig, world_from_ego
from vsensor.transforms import Rigid
from vsensor.types import Array, Mesh, Obstacle, frozen

POINTS = (1_000, 4_000, 16_000, 64_000, 256_000, 1_000_000)
BOXES = (1, 3, 10, 30, 100, 300, 1000)
TRIANGLES = (100, 1_000, 10_000, 100_000)

Curve = dict[str, list[float]]


def growth(
    points: Sequence[int] = POINTS,
    boxes: Sequence[int] = BOXES,
    triangles: Sequence[int] = TRIANGLES,
    rounds: int = 9,
) -> dict[str, object]:
    """Measure all three; `exponent` is the slope on log-log axes over the larger half of the sizes."""
    with one_core():
        return {
            "points": _curves(points, _over_points, rounds),
            "boxes": _curves(boxes, _over_boxes, rounds),
            "triangles": _curves(triangles, _over_triangles, rounds),
        }


def exponent(sizes: Sequence[int], times_ms: Sequence[float]) -> float:
    """Return k of time ~ size^k, by least squares over the larger half of the sizes."""
    start = len(sizes) // 2 - (len(sizes) < 4)
    x, y = np.log(sizes[max(start, 0) :]), np.log(times_ms[max(start, 0) :])
    return float(np.polyfit(x, y, 1)[0])


def _curves(sizes: Sequence[int], over: Callable[[int], dict], rounds: int) -> dict[str, object]:
    rows = []
    for size in sizes:
        times = in_turns(over(size), rounds)
        rows.append({name: median(values) for name, values in times.items()})
    curves: Curve = {name: [row[name] for row in rows] for name in rows[0]}
    return {
        "sizes": list(sizes),
        "ms": curves,
        "exponents": {name: exponent(sizes, times) for name, times in curves.items()},
    }


def _over_points(count: int) -> dict[str, Callable[[], object]]:
    """Return camera and fits on the reference scene's four lines, ever denser, with 10 of its boxes."""
    snapshot = ReferenceDrive(points=count // 4, boxes=None).advance(None, ticks_at([50])[0], ())[1]
    scene = replace(snapshot.scene, obstacles=snapshot.scene.obstacles[:50:5])
    snapshot = replace(snapshot, scene=scene)
    camera, scene_config, fit = Camera.from_config(CameraConfig()), SceneConfig(), LaneFitConfig()
    seen = observe(camera, scene_config, snapshot)
    return {
        "camera": lambda: observe(camera, scene_config, snapshot),
        "fits": lambda: lanefit.fit_lines(fit, seen.lines, seen.sigma_y_m),
    }


def _over_boxes(count: int) -> dict[str, Callable[[], object]]:
    """Return who is hidden of 4000 points: by either test, and embree's rebuild and query apart."""
    snapshot = ReferenceDrive(boxes=0).advance(None, ticks_at([50])[0], ())[1]
    eye_m, points_m = eye_and_points(snapshot)
    points_m = np.ascontiguousarray(points_m.T).T  # x, y, z apart, as they come from the camera
    pose, obstacles = Rigid(np.eye(3), np.array(CENTRE_WORLD_M)), scattered(count)
    boxes = raycast.boxes_in(pose, obstacles)
    triangles = _box_triangles(boxes, eye_m)
    scene, rays = embree.build(triangles), points_m - eye_m
    return {
        "boxes of obstacles": lambda: raycast.boxes_in(pose, obstacles),
        "hidden, shadow test": lambda: raycast.hidden(eye_m, points_m, boxes, "shadow"),
        "hidden, embree with rebuild": lambda: raycast.hidden(eye_m, points_m, boxes, "embree"),
        "embree, rebuild of all faces": lambda: embree.build(triangles),
        "embree, query": lambda: embree.first_met(scene, np.zeros(3), rays, raycast.FAR_LIMIT),
    }


def scattered(count: int) -> tuple[Obstacle, ...]:
    """Return vehicles standing about on 10 to 100 m ahead, in a frame at the scene's origin."""
    draw = np.random.default_rng(5)
    places = np.column_stack(
        [draw.uniform(10, 100, count), draw.uniform(-14, 14, count), np.full(count, 0.75)]
    )
    size_m = (4.5, 1.8, 1.5) if count <= 100 else (1.5, 0.6, 1.0)
    return tuple(
        Obstacle(id=k, centre_world_m=frozen(place + CENTRE_WORLD_M), size_m=size_m, yaw_rad=float(yaw))
        for k, (place, yaw) in enumerate(zip(places, draw.uniform(-3, 3, count), strict=True))
    )


def _box_triangles(boxes: raycast.Boxes, eye_m: Array) -> Array:
    """Return all 12 triangles of each box (12 M, 3, 3) relative to the eye."""
    corners = (2 * boxes.half_m[:, None] * BOX_CORNERS) @ boxes.rotation.transpose(0, 2, 1)
    return (corners + (boxes.centre_m - eye_m)[:, None])[:, BOX_TRIANGLES].reshape(-1, 3, 3)


def _over_triangles(count: int) -> dict[str, Callable[[], object]]:
    """Return the build of a shape of so many triangles, and a frame with ten moving vehicles that wear it."""
    snapshot = ReferenceDrive().advance(None, ticks_at([50])[0], ())[1]
    eye_m, points_m = eye_and_points(snapshot)
    pose, mesh = world_from_ego(snapshot.ego), egg(count)
    obstacles = tuple(replace(box, mesh=mesh) for box in snapshot.scene.obstacles[:50:5])
    triangles = mesh.vertices_m[mesh.faces]
    return {
        "one shape, build": lambda: embree.build(triangles),
        "ten vehicles, a frame": lambda: raycast.hidden_by_obstacles(pose, eye_m, points_m, obstacles),
    }


def egg(count: int) -> Mesh:
    """Return an ellipsoid of a car's size with about so many triangles."""
    rows = max(3, round((count / 4) ** 0.5))
    around = 2 * rows
    up, about = np.meshgrid(
        np.linspace(0.01, np.pi - 0.01, rows + 1), np.arange(around) * 2 * np.pi / around, indexing="ij"
    )
    vertices = np.stack([np.sin(up) * np.cos(about), np.sin(up) * np.sin(about), np.cos(up)], axis=-1)
    place = np.arange(rows * around).reshape(rows, around)
    beside = np.roll(place, -1, axis=1)
    quads = np.stack([place, beside, beside + around, place, beside + around, place + around], axis=-1)
    return raycast.mesh_of((vertices * (2.25, 0.9, 0.75)).reshape(-1, 3), quads.reshape(-1, 3))
