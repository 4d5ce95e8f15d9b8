"""Rays through embree: triangles in, hits out, with what its float32 interface leaves unchecked made safe.

The library is imported when the first scene is built, which takes 20 ms that a free road need not pay.
"""

from functools import cache
from typing import Any, TypeAlias

import numpy as np

from vsensor.types import Array, BoolArray

EmbreeScene: TypeAlias = Any


def build(triangles_m: Array) -> EmbreeScene:
    """Return a scene of triangles (T, 3, 3), T > 0, given relative to a point near them."""
    from embreex.mesh_construction import TriangleMesh  # type: ignore[import-untyped]
    from embreex.rtcore_scene import EmbreeScene as Scene  # type: ignore[import-untyped]

    scene = Scene(_device())
    TriangleMesh(scene, np.ascontiguousarray(triangles_m, dtype=np.float32))
    return scene


def meets(scene: EmbreeScene, origin_m: Array, directions_m: Array, far: float) -> BoolArray:
    """Return which segments origin -> origin + far * direction (N, 3) meet a triangle, from either side.

    Coordinates as at `build`. A direction that holds NaN meets nothing.
    """
    rays = np.ascontiguousarray(directions_m, dtype=np.float32)
    origins = np.empty_like(rays)
    origins[:] = origin_m
    limits = np.full(len(rays), far, dtype=np.float32)
    answer = scene.run(origins, rays, dists=limits, query="OCCLUDED")
    return np.asarray(answer == 0)


@cache
def _device() -> Any:
    """Return the one embree device of the process (45 to 90 us each to make)."""
    from embreex import rtcore  # type: ignore[import-untyped]

    return rtcore.EmbreeDevice()
