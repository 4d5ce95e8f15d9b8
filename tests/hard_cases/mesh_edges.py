"""Occlusion by meshes: at their outlines, and through the edges between triangles, where no ray may pass.

The mesh is a box, each face of it a grid of triangles, so that the exact answer is that of the box.
A ray in the very plane of a triangle (camera and point within 1e-4 m of it) has no defined answer: what
float32 makes of a triangle seen edge-on may stand decimetres beside it. So rays along an edge are 1 mm off.
"""

from dataclasses import replace

import numpy as np

from tests.hard_cases import edges, exact
from tests.hard_cases.exact import Row
from tests.hard_cases.far_out import place
from vsensor.raycast import hidden_by_obstacles, mesh_of
from vsensor.transforms import Rigid, rotation_from_rpy, transform
from vsensor.types import frozen

GRID = 6  # cells along each side of a face
SILHOUETTE_M, KEPT_M = 1e-5, 1e-4
"""Bounds: units in the last place of 100 m in float32; of what stands, those of a tile of 500 m."""


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


def almost_along_edge(turn):
    """The camera is a millimetre off the line of an edge, so in the plane of no triangle."""
    wall = edges.placed(turn, (28.0, -1.001, -2.001), (20.0, 2.0, 4.0))
    return wall, edges.along_edge(turn)[1]


CASES = {
    "rays through a mesh's inner edges and vertices": through_inner_edges,
    "rays through a mesh's outline": edges.through_edges,
    "camera in the plane of a mesh's side": edges.side_plane,
    "rays along a mesh's edge, 1 mm off": almost_along_edge,
    "points at the near side of their own mesh, and inside": edges.own_face,
}


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
            bound,
            "120 digits",
        )
        for case, make in CASES.items()
        for how, distance_m, is_moving, bound in (
            ("moving", 0.0, True, SILHOUETTE_M),
            ("standing, 1e6 m out", 1e6, False, KEPT_M),
        )
    ]
