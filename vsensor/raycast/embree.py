"""Rays through embree: triangles in, hits out, with what its float32 interface leaves unchecked made safe.

The library is imported when the first scene is built, which takes 20 ms that a free road need not pay.
"""

from functools import cache
from typing import Any, TypeAlias

import numpy as np

from vsensor.types import Array, IntArray

EmbreeScene: TypeAlias = Any


def build(triangles_m: Array) -> EmbreeScene:
    """Return a scene of triangles (T, 3, 3), T > 0, given relative to a point near them."""
    from embreex.mesh_construction import TriangleMesh  # type: ignore[import-untyped]
    from embreex.rtcore_scene import EmbreeScene as Scene  # type: ignore[import-untyped]

    scene = Scene(_device())
    TriangleMesh(scene, np.ascontiguousarray(triangles_m, dtype=np.float32))
    return scene


def first_met(scene: EmbreeScene, origin_m: Array, directions_m: Array, far: float) -> IntArray:
    """Return which triangle each segment origin -> origin + far * direction (N, 3) meets first, or -1.

    From either side; coordinates as at `build`. A direction that holds NaN meets nothing. To ask for
    the triangle takes a fifth more time than to ask whether there is one.
    """
    rays = np.ascontiguousarray(directions_m, dtype=np.float32)
    origins = np.empty_like(rays)
    origins[:] = origin_m
    limits = np.full(len(rays), far, dtype=np.float32)
    return np.asarray(scene.run(origins, rays, dists=limits, query="INTERSECT"), dtype=np.int64)


@cache
def _device() -> Any:
    """Return the one embree device of the process (45 to 90 us each to make)."""
    from embreex import rtcore  # type: ignore[import-untyped]

    return rtcore.EmbreeDevice()
