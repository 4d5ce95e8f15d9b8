"""Shapes of triangles for tests, and a float64 search for the segments that meet them (Moeller-Trumbore)."""

import numpy as np

from vsensor.raycast import mesh_of

BOX_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


def box_mesh(size=(4.0, 2.0, 1.5)):
    """Return a box as a mesh."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return mesh_of(corners * size, BOX_FACES)


def ball_mesh(radius_m, rings, around):
    """Return a sphere of 2 (rings - 1) around triangles."""
    polar = np.pi * np.arange(rings + 1) / rings
    turn = 2 * np.pi * np.arange(around) / around
    vertices = radius_m * np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.sin(polar), np.sin(turn)),
            np.outer(np.cos(polar), np.ones(around)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    faces = []
    for ring in range(rings):
        for k in range(around):
            a, b = ring * around + k, ring * around + (k + 1) % around
            faces += [(a, a + around, b)] if ring else []
            faces += [(b, a + around, b + around)] if ring < rings - 1 else []
    return mesh_of(vertices, np.array(faces))


def heap_mesh(rng, triangles, reach_m=2.0):
    """Return triangles without order: some large, some slivers, wound either way."""
    centres = rng.uniform(-reach_m, reach_m, (triangles, 1, 3))
    sides = rng.normal(scale=rng.uniform(0.05, 0.6, (triangles, 1, 1)), size=(triangles, 3, 3))
    return mesh_of((centres + sides).reshape(-1, 3), np.arange(3 * triangles).reshape(-1, 3))


def wavy_wall(length_m, height_m, cells):
    """Return a wall across y that winds in x, its vertices on no round numbers."""
    y = np.linspace(-length_m / 2, length_m / 2, cells + 1)
    z = np.linspace(-height_m / 2, height_m / 2, 4)
    x = 0.3 * np.sin(1.7 * y)
    vertices = np.array([(x[k], y[k], at) for k in range(cells + 1) for at in z])
    corner = np.array([4 * k + row for k in range(cells) for row in range(3)])
    faces = [
        np.column_stack([corner, corner + 4, corner + 1]),
        np.column_stack([corner + 1, corner + 4, corner + 5]),
    ]
    return mesh_of(vertices, np.concatenate(faces))


def passes_within(origin, points, triangles, band_m):
    """Return which lines origin -> point pass an edge of a triangle within `band_m`."""
    start = np.concatenate([triangles[:, k] for k in range(3)]) - origin
    side = np.concatenate([triangles[:, k - 2] - triangles[:, k] for k in range(3)])
    near = np.zeros(len(points), dtype=bool)
    for place, point in enumerate(points):
        ray = (point - origin) / np.linalg.norm(point - origin)
        across, along = (v - (v @ ray)[:, None] * ray for v in (start, side))
        square = np.maximum((along * along).sum(axis=1), 1e-300)
        t = np.clip(-(across * along).sum(axis=1) / square, 0.0, 1.0)
        near[place] = np.linalg.norm(across + t[:, None] * along, axis=1).min() <= band_m
    return near


def meets(origin, points, triangles, far):
    """Return for segments origin -> origin + far (point - origin) whether a triangle of (T, 3, 3) is met.

    With it, whether the answer hangs on less than 1e-4 m: how near the line passes by an edge, or how near
    the segment's end is to the triangle's plane.
    """
    hits, unsure = np.zeros(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    directions = points - origin
    lengths = np.linalg.norm(directions, axis=1)
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        across = directions @ normal
        parallel = across == 0.0
        t = ((a - origin) @ normal) / np.where(parallel, 1.0, across)
        meeting = origin + t[:, None] * directions
        inside = [
            np.cross(q - p, meeting - p) @ normal / (np.linalg.norm(normal) * np.linalg.norm(q - p))
            for p, q in ((a, b), (b, c), (c, a))
        ]  # distances from the edges, positive within
        least = np.min(inside, axis=0)
        slant = np.abs(across) / (np.linalg.norm(normal) * lengths)
        band = 1e-4 / np.maximum(slant, 1e-9)  # 1e-4 m across the ray, as seen in the triangle's plane
        hits |= ~parallel & (least >= 0) & (t >= 0) & (t <= far)
        end = np.abs(t - far) * lengths
        unsure |= (np.abs(least) <= band) & (t > -1e-3) & (t <= far + 1e-3)
        unsure |= (least >= -band) & (end <= band)
    return hits, unsure


def world_triangles(obstacle):
    """Return the triangles of an obstacle's mesh in the world."""
    from vsensor.transforms import rotation_from_rpy

    rotation = rotation_from_rpy(obstacle.roll_rad, obstacle.pitch_rad, obstacle.yaw_rad)
    return (obstacle.mesh.vertices_m @ rotation.T + obstacle.centre_world_m)[obstacle.mesh.faces]
