"""Occlusion alone, from obstacles to answer: ours, P1's algorithm, trimesh, open3d (extra `peers`)."""

from collections.abc import Callable

import numpy as np

from tests import p1
from tools.bench.measure import in_turns, median, one_core, ratio
from tools.bench.scene import ReferenceDrive, ticks_at
from vsensor import raycast
from vsensor.camera import Camera, CameraConfig, camera_from_ego
from vsensor.scene import world_from_ego
from vsensor.transforms import invert, rotation_from_rpy
from vsensor.types import Array, BoolArray, Obstacle, Snapshot

TARGETS = {"p1": 50.0, "trimesh": 3.0}
FAR = 1.0 - 1e-5
BOX_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
BOX_TRIANGLES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def occlusion(rounds: int = 25) -> dict[str, object]:
    """Time who is hidden at 50 boxes and 4000 points, from obstacles to answer, in turns."""
    snapshot = ReferenceDrive().advance(None, ticks_at([100])[0], ())[1]
    eye_m, points_m = eye_and_points(snapshot)
    with one_core():
        peers = sides(snapshot, eye_m, points_m)
        answers = {name: work() for name, work in peers.items()}
        times = in_turns(peers, rounds)
        parts = in_turns(_parts(snapshot, eye_m, points_m), rounds)
    found: dict[str, object] = {
        "points": len(points_m),
        "boxes": len(snapshot.scene.obstacles),
        "hidden": float(answers["p1"].mean()),
        "ms": {name: median(values) for name, values in times.items()},
        "parts_p50_ms": {name: median(values) for name, values in parts.items()},
        "unlike_p1": {name: float((answer != answers["p1"]).mean()) for name, answer in answers.items()},
        "times_faster_than": {name: ratio(times[name], times["ours"]) for name in times if name != "ours"},
        "targets": TARGETS,
    }
    return found


def eye_and_points(snapshot: Snapshot) -> tuple[Array, Array]:
    """Return the camera (3,) and all points of the lines (N, 3) in the ego frame."""
    world = np.concatenate([line.points_world_m for line in snapshot.scene.markings])
    pose = world_from_ego(snapshot.ego)
    camera = Camera.from_config(CameraConfig())
    return invert(camera_from_ego(camera, snapshot.ego)).translation, (
        world - pose.translation
    ) @ pose.rotation


def sides(snapshot: Snapshot, eye_m: Array, points_m: Array) -> dict[str, Callable[[], BoolArray]]:
    """Return what is compared: functions that say which points are hidden, from obstacles in the world.

    Each has the points in memory as it likes them: ours x, y, z apart, as they come from the camera.
    """
    pose, obstacles = world_from_ego(snapshot.ego), snapshot.scene.obstacles
    apart_m = np.ascontiguousarray(points_m.T).T
    works = {
        "ours": lambda: raycast.hidden(eye_m, apart_m, raycast.boxes_in(pose, obstacles)),
        "p1": lambda: p1.hidden(eye_m, points_m, _frames(pose, obstacles)),
        "trimesh": lambda: _trimesh_hidden(eye_m, points_m, _frames(pose, obstacles)),
    }
    try:
        import open3d
    except ImportError:
        return works
    works["open3d"] = lambda: _open3d_hidden(open3d, eye_m, points_m, _frames(pose, obstacles))
    return works


def _parts(snapshot: Snapshot, eye_m: Array, points_m: Array) -> dict[str, Callable[[], object]]:
    """Return what ours consists of, and the other test that it could take."""
    pose, obstacles = world_from_ego(snapshot.ego), snapshot.scene.obstacles
    apart_m, boxes = np.ascontiguousarray(points_m.T).T, raycast.boxes_in(pose, obstacles)
    return {
        "boxes of obstacles": lambda: raycast.boxes_in(pose, obstacles),
        "shadow test": lambda: raycast.hidden(eye_m, apart_m, boxes, "shadow"),
        "embree with rebuild, in its place": lambda: raycast.hidden(eye_m, apart_m, boxes, "embree"),
    }


def _frames(pose, obstacles: tuple[Obstacle, ...]) -> list[tuple[Array, Array, Array]]:
    """Return centre, size and rotation of each box in the ego frame."""
    return [
        (
            pose.rotation.T @ (box.centre_world_m - pose.translation),
            np.array(box.size_m),
            pose.rotation.T @ rotation_from_rpy(box.roll_rad, box.pitch_rad, box.yaw_rad),
        )
        for box in obstacles
    ]


def _mesh(boxes: list[tuple[Array, Array, Array]]) -> tuple[Array, Array]:
    """Return vertices (8 M, 3) and triangles (12 M, 3) of boxes."""
    centres, sizes, rotations = (np.array(part) for part in zip(*boxes, strict=True))
    vertices = (BOX_CORNERS * sizes[:, None]) @ rotations.transpose(0, 2, 1) + centres[:, None]
    triangles = BOX_TRIANGLES + 8 * np.arange(len(boxes))[:, None, None]
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def _trimesh_hidden(eye_m: Array, points_m: Array, boxes: list) -> BoolArray:
    """Ask trimesh's ray interface for the first hit of each ray, and compare its distance."""
    import trimesh

    vertices, triangles = _mesh(boxes)
    mesh = trimesh.Trimesh(vertices=vertices, faces=triangles, process=False)
    directions = points_m - eye_m
    origins = np.broadcast_to(eye_m, directions.shape)
    places, rays, _ = mesh.ray.intersects_location(origins, directions, multiple_hits=False)
    hidden = np.zeros(len(points_m), dtype=bool)
    reach = np.linalg.norm(places - eye_m, axis=1)
    hidden[rays[reach < FAR * np.linalg.norm(directions[rays], axis=1)]] = True
    return hidden


def _open3d_hidden(open3d, eye_m: Array, points_m: Array, boxes: list) -> BoolArray:
    """Ask open3d whether anything lies between, on one thread."""
    vertices, triangles = _mesh(boxes)
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        open3d.core.Tensor(vertices.astype(np.float32)), open3d.core.Tensor(triangles.astype(np.uint32))
    )
    rays = np.empty((len(points_m), 6), dtype=np.float32)
    rays[:, :3], rays[:, 3:] = eye_m, points_m - eye_m
    return scene.test_occlusions(open3d.core.Tensor(rays), tnear=0.0, tfar=FAR).numpy()
