"""Paint that is too faint to be told from the road: night beyond the headlights, rain, fog, wear."""

import numpy as np

from vsensor import light
from vsensor.camera.optics import Camera
from vsensor.types import Array, CodeArray, IntArray, LinePoints, Marking, Scene, Unseen


def too_faint(
    camera: Camera,
    surroundings: Scene,
    candidates: LinePoints,
    painted: IntArray,
    points: Array,
    codes: CodeArray,
) -> None:
    """Set the codes (M,) of seen points whose contrast is below the camera's least.

    `points` (3, M) in the ego frame, `painted` (M,) their places among the candidates. Cost: nothing on a dry
    day without fog and with fresh paint.
    """
    least, air = camera.config.min_contrast, surroundings.environment
    worn = any(_is_worn(marking) for marking in surroundings.markings)
    if least <= 0.0 or (light.is_clear(air) and not worn):
        return
    seen = (codes == Unseen.SEEN).nonzero()[0]
    ahead, aside, _ = points.take(seen, axis=1)
    ahead = ahead - camera.config.position_m[0]
    left = _paint_left(surroundings, candidates)[painted[seen]]
    codes[seen[light.contrast(air, ahead, aside, left) < least]] = Unseen.TOO_FAINT


def _is_worn(marking: Marking) -> bool:
    return bool(np.min(marking.contrast, initial=1.0) < 1.0 or np.max(marking.wear, initial=0.0) > 0.0)


def _paint_left(surroundings: Scene, candidates: LinePoints) -> Array:
    """Return how much of the paint's contrast is left at each candidate (N,)."""
    edges = candidates.starts.tolist()
    parts = []
    for place, start, stop in zip(candidates.marking.tolist(), edges, edges[1:], strict=False):
        marking, index = surroundings.markings[place], candidates.index[start:stop]
        left = np.broadcast_to(marking.contrast * (1.0 - marking.wear), len(marking.points_world_m))
        parts.append(light.paint_left(left[index], marking.colour[index]))
    return np.concatenate(parts) if parts else np.zeros(0)
