"""Which object hides which point of a line."""

import numpy as np

from vsensor import raycast
from vsensor.camera import Camera, camera_from_ego
from vsensor.scene import world_from_ego
from vsensor.transforms import invert
from vsensor.types import IntArray, Output, Unseen

NOBODY = -1
"""In place of an object's id: none. A point that is hidden by none is hidden by the road itself, a crest."""


def hiders(output: Output, camera: Camera) -> IntArray:
    """Return the id of the nearest object that hides each of `observation.candidates` (N,), NOBODY if none.

    Asked are the points whose reason is OCCLUDED. Cost: nothing where no point is.
    """
    observation = output.observation
    found = np.full(len(observation.reason), NOBODY, dtype=np.int64)
    hidden = (observation.reason == Unseen.OCCLUDED).nonzero()[0]
    obstacles = output.snapshot.scene.obstacles
    if not len(hidden) or not obstacles:
        return found
    ego = output.seen.ego
    eye_m = invert(camera_from_ego(camera, ego)).translation
    points = observation.candidates.points_ego_m[hidden]
    places = raycast.hiding_obstacle(world_from_ego(ego), eye_m, points, obstacles)
    ids = np.array([*(one.id for one in obstacles), NOBODY])
    found[hidden] = ids[places]
    return found
