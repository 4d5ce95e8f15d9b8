"""What the road's own height hides: paint and vehicles behind a crest, and where it climbs into the sky.

Along each marking the road is taken as the height of the marking itself:

    eye o------..........          the highest line of sight so far ends the view of what lies
         `---.___  ___---`---      below it further away
                 `'         `--.__
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vsensor.camera import Camera
from vsensor.image.coverage import Edges, Patch, chained, coverage
from vsensor.image.shapes import stripe_edges
from vsensor.transforms import Rigid, invert
from vsensor.types import Array, BoolArray, Obstacle

CLEARANCE_M = 0.005
"""What lies no further than this below the line of sight is seen: map heights are no better."""
ROAD_M = 8.0
"""Road is drawn so wide about each marking where it rises above the horizon of the plane."""
_NEAREST_M = 5.0
_AT_HORIZON = -0.002  # slope of a line of sight that may rise above the horizon within a pixel or so


class Skyline:
    """The lines of sight along one marking by its points (N, 3) in the ego frame, ahead of the camera."""

    def __init__(self, eye_m: Array, view_ego: Array, points_ego_m: Array) -> None:
        relative = points_ego_m - eye_m
        ahead = (relative @ view_ego > 0.0).nonzero()[0]
        distance = np.hypot(relative[ahead, 0], relative[ahead, 1])
        order = np.argsort(distance, kind="stable")
        ahead, distance = ahead[order], np.maximum(distance[order], 1e-3)
        rise = relative[ahead, 2]
        highest = np.maximum.accumulate(rise / distance)
        self.points_ego_m = points_ego_m
        self._distance_m, self._highest = distance, highest
        self.seen: BoolArray = np.ones(len(points_ego_m), dtype=bool)
        self.seen[ahead] = rise >= highest * distance - CLEARANCE_M
        self.reaches_horizon = bool(len(highest)) and bool(highest[-1] > _AT_HORIZON)

    def height_hidden_m(self, distance_m: float) -> float:
        """Return up to which height over the eye (mostly negative) nothing is seen at a distance."""
        nearer = int(self._distance_m.searchsorted(distance_m))
        return float(self._highest[nearer - 1]) * distance_m if nearer else -np.inf

    def distance_to_m(self, point_ego_m: Array) -> float:
        """Return how far a point is from the marking, seen from above."""
        return float(np.hypot(*(self.points_ego_m[:, :2] - point_ego_m[:2]).T).min())


def road_above_horizon(camera: Camera, pose: Rigid, skylines: Sequence[Skyline]) -> Patch | None:
    """Return the part of each pixel that the road covers about its markings; None where it stays below."""
    if not any(skyline.reaches_horizon for skyline in skylines):
        return None
    eye_m, view_ego = invert(pose).translation, pose.rotation[2]
    strips: list[Edges] = []
    for skyline in skylines:
        points = skyline.points_ego_m
        is_far = ((points - eye_m) @ view_ego > _NEAREST_M) & skyline.seen
        found = stripe_edges(camera, pose, points, np.full(len(points), ROAD_M), is_far.astype(np.float64))
        if found is not None:
            strips.append(found)
    if not strips:
        return None
    patch = coverage(chained(*strips), camera.config.width_px, camera.config.height_px)
    return patch._replace(values=np.clip(patch.values, 0.0, 1.0)) if patch.values.size else None


def without_hidden_part(
    eye_m: Array, world_from_ego: Rigid, skylines: Sequence[Skyline], box: Obstacle
) -> Obstacle | None:
    """Return the box without what a crest hides of its lower part, None if it hides all."""
    if not skylines:
        return box
    centre = world_from_ego.rotation.T @ (box.centre_world_m - world_from_ego.translation)
    length, width, height = box.size_m
    distance_m = float(np.hypot(*(centre - eye_m)[:2])) - 0.5 * max(length, width)
    if distance_m <= _NEAREST_M:
        return box
    skyline = min(skylines, key=lambda line: line.distance_to_m(centre))
    bottom_m = centre[2] - 0.5 * height
    cut_m = eye_m[2] + skyline.height_hidden_m(distance_m) - bottom_m - CLEARANCE_M
    if cut_m <= 0.0:
        return box
    if cut_m >= height:
        return None
    raised = box.centre_world_m + world_from_ego.rotation @ np.array([0.0, 0.0, 0.5 * cut_m])
    return replace(box, centre_world_m=raised, size_m=(length, width, height - cut_m))
