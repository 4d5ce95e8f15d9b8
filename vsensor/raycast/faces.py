"""Boxes by rays: at most three faces of each, those turned to the camera, in a scene of this moment."""

import numpy as np

from vsensor.raycast import embree
from vsensor.raycast.boxes import FACES, HALVES, Solids
from vsensor.raycast.pieces import ROUNDING, TRUSTED_M
from vsensor.raycast.shadow import FAR_LIMIT, Chart, shadow, shadow_bounds
from vsensor.types import Array, BoolArray, IntArray


def hidden_by_faces(directions: Array, chart: Chart, low: Array, high: Array, solids: Solids) -> BoolArray:
    """Return which segments (3, N) from the camera meet a face that is turned to it.

    `chart` is that of the directions, `low` and `high` (2, M) are the boxes' rectangles in it. Float32
    cannot tell where a face ends that is narrow as the camera sees it (see `pieces`): a hit on such a
    face is asked of its box in float64, and where that denies it, of all boxes.
    """
    box, face = solids.is_front.nonzero()
    quads = solids.corners_m[box[:, None], FACES[face]]
    scene = embree.build(quads[:, HALVES].reshape(-1, 3, 3))
    first = embree.first_met(scene, np.zeros(3), directions.T, FAR_LIMIT)
    met = first >= 0
    places = met.nonzero()[0]
    which = first.take(places) >> 1
    doubtful = _narrow(quads, solids.normals[box, face], which, directions.take(places, axis=1))
    if len(doubtful):
        places, owner = places[doubtful], box[which[doubtful]]
        a, b = chart.tangents.take(places, axis=1), directions.take(places, axis=1).T
        sure = ((low.take(owner, axis=1) <= a) & (a <= high.take(owner, axis=1))).all(axis=0)
        normals, least = shadow_bounds(solids)
        sure &= (normals[owner] @ b[:, :, None] >= least[owner]).all(axis=(1, 2))
        met[places] = sure
        rest = places[~sure]
        free = np.ones(len(rest), dtype=bool)
        if len(rest):
            shadow(directions.take(rest, axis=1), chart.pick(rest), low, high, solids, free)
        met[rest] = ~free
    return met


def _narrow(quads: Array, normals: Array, which: IntArray, directions: Array) -> IntArray:
    """Return the places of those hits on faces `which` (K,) by segments (3, K) that float32 may have made up.

    Of a face's corners (F, 4, 3) the narrowest angle is about height / base of its triangles times the
    sine under which it is seen; beyond such a corner rounding lets it go on by rounding / angle.
    """
    sides = quads[:, 1:3] - quads[:, :2]
    a, b = (sides * sides).sum(axis=2).T
    slant = normals * (np.sqrt(a * b) / np.maximum(a + b, 1e-30))[:, None]
    angle = np.abs((slant.take(which, axis=0).T * directions).sum(axis=0))
    reach_m = np.abs(quads).max(axis=(1, 2)).take(which)
    rounded = ROUNDING * reach_m * np.sqrt((directions * directions).sum(axis=0))
    return np.asarray((angle * TRUSTED_M < rounded).nonzero()[0])
