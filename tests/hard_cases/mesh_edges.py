"""Occlusion by meshes: at their outlines, along their edges, in the planes of their triangles, and through
the edges between them, where no ray may pass.

The mesh is a box, each face of it a grid of triangles, so that the exact answer is that of the box.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from tests.hard_cases import edges, exact
from tests.hard_cases.exact import Row
from tests.hard_cases.far_out import place
from vsensor.raycast import hidden_by_obstacles, mesh_of
from vsensor.transforms import Rigid, rotation_from_rpy, transform
from vsensor.types import frozen

GRID = 6  # cells along each side of a face
SILHOUETTE_M = 1e-5
"""Bound: units in the last place of 100 m in float32, a tenth of the band that is stated."""


def box_mesh(size, cells=GRID):
    """Return a box as a closed mesh about its centre, each face of cells x cells squares of two triangles."""
    steps = np.linspace(-0.5, 0.5, cells + 1)
    u, v = (part.ravel() for part in np.meshgrid(steps, steps, indexing="ij"))
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, up = corner + cells + 1, corner + 1
    face = np.concatenate([np.column_stack([corner, right, up]), np.column_stack([right, right + 1, up])])
    vertices, faces = [], []
    for axis in range(3):
        for end in (-0.5, 0.5):
            points = np.empty((len(u), 3))
            points[:, axis], points[:, axis - 2], points[:, axis - 1] = end, u, v
            faces.append(face + len(vertices) * len(u))
            vertices.append(points * np.array(size))
    return mesh_of(np.concatenate(vertices), np.concatenate(faces))


def meshed(obstacle):
    """Return the box as a mesh."""
    return replace(obstacle, mesh=box_mesh(np.abs(obstacle.size_m)))


def through_inner_edges(turn):
    """Rays through every vertex and every edge's middle of the grid on the near face: all are hidden."""
    block = edges.placed(turn, (30.0, 0.0, 0.0), (4.0, 3.0, 2.0))
    halves = np.linspace(-0.5, 0.5, 4 * GRID + 1)[1:-1]
    points = [(84.0, 9.0 * y, 6.0 * z) for y in halves for z in halves]
    return block, edges.beyond(turn, points)


def beside_edge(turn, off_m):
    """The camera is so far off the line of an edge, in neither plane that meets there; points all around."""
    wall = edges.placed(turn, (28.0, -1.0 - off_m, -2.0 - off_m), (20.0, 2.0, 4.0))
    return wall, edges.along_edge(turn)[1]


def in_the_planes_of_triangles(turn):
    """The camera is in the plane of a side; points in that plane, before, beside and behind its triangles."""
    wall = edges.placed(turn, (28.0, -1.0, -0.35), (20.0, 2.0, 4.0))
    heights = (-5.3, -2.36, -2.3501, -2.0, 1.6, 1.6501, 1.66, 5.3)
    steps = (0.0, 1e-7, -1e-7, 1e-5, -1e-5, 1e-4, -1e-4, 2e-4)
    return wall, edges.beyond(
        turn, [(d, s, z * d / 18.0) for d in (17.0, 25.0, 60.0) for z in heights for s in steps]
    )


CASES = {
    "rays through a mesh's inner edges and vertices": through_inner_edges,
    "rays through a mesh's outline": edges.through_edges,
    "camera in the plane of a mesh's side": edges.side_plane,
    "rays in the plane of a mesh's side": in_the_planes_of_triangles,
    "rays along a mesh's edge": edges.along_edge,
    "rays along a mesh's edge, 0.1 mm off": partial(beside_edge, off_m=1e-4),
    "rays along a mesh's edge, 1 mm off": partial(beside_edge, off_m=1e-3),
    "points at the near side of their own mesh, and inside": edges.own_face,
}


WHERE = (
    ("moving", 0.0, True),
    ("moving, 1e7 m out", 1e7, True),
    ("standing, 1e5 m out", 1e5, False),
    ("standing, 1e6 m out", 1e6, False),
    ("standing, 1e7 m out", 1e7, False),
)


def wrong_by_m(make, turn, distance_m=0.0, is_moving=True):
    """Return how far from the surface an answer is ever wrong, the world's origin so far away."""
    obstacle, points = make(turn)
    pose = Rigid(rotation_from_rpy(0.0, 0.0, 0.4), place(distance_m))
    turned = rotation_from_rpy(obstacle.roll_rad, obstacle.pitch_rad, obstacle.yaw_rad)
    centre = frozen(transform(pose, obstacle.centre_world_m[None])[0])
    there = replace(
        meshed(obstacle),
        centre_world_m=centre,
        yaw_rad=obstacle.yaw_rad + 0.4,
        is_moving=is_moving,
    )
    found = hidden_by_obstacles(pose, edges.EYE, points, [there])
    solid = (obstacle.centre_world_m, obstacle.size_m, exact.matrix(turned))
    return max(edges.point_wrong_by_m(p, bool(f), solid) for p, f in zip(points, found, strict=True))


def rows():
    return [
        Row(
            case,
            f"distance from the surface where the answer is wrong, {how}",
            max(wrong_by_m(make, turn, distance_m, is_moving) for turn in edges.TURNS),
            "m",
            SILHOUETTE_M,
            "120 digits",
        )
        for case, make in CASES.items()
        for how, distance_m, is_moving in WHERE
    ]
