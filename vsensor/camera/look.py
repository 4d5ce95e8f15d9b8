"""One look at the road: which points of the markings are seen, where they appear, and why the others are not.

markings near -> painted -> in the image -> in sight -> not hidden -> nearest pixel centre -> back to the road
(exact points)                                                        (u, v)
"""

import numpy as np

from vsensor import raycast, scene
from vsensor.camera.faint import too_faint
from vsensor.camera.optics import Camera, camera_from_ego, in_image, project
from vsensor.camera.road import back_to_road
from vsensor.camera.sight import end_of_sight
from vsensor.transforms import Rigid, invert
from vsensor.types import (
    Array,
    BoolArray,
    CodeArray,
    IntArray,
    LinePoints,
    Observation,
    Scene,
    Snapshot,
    Unseen,
)

ROW_M = 1e-9
"""Points of the flat road whose x differ by no more belong to one row of pixels."""

_METHODS: dict[str, raycast.Method] = {"auto": "auto", "boxes": "shadow", "embree": "embree"}


def observe(camera: Camera, scene_config: scene.SceneConfig, snapshot: Snapshot) -> Observation:
    """Return what is seen of the markings near the pose, and for every point that is not, why."""
    candidates = scene.near(scene_config, snapshot.ego, snapshot.scene)
    painted = _painted(snapshot.scene, candidates)
    reason = np.where(painted, np.uint8(Unseen.SEEN), np.uint8(Unseen.NO_PAINT))
    seen = painted.nonzero()[0]
    points = candidates.points_ego_m.T.take(seen, axis=1)
    sigma = np.zeros(len(seen))
    if camera.config.model != "none":
        codes, points, sigma = _look(camera, scene_config, snapshot, candidates, seen, points)
        reason[seen] = codes
        seen = seen[codes == Unseen.SEEN]
    lines, sigma = _lines(candidates, seen, points, sigma, camera.assumed_from_ego is not None)
    kind, colour, width_m = _nearest_paint(snapshot.scene, lines, candidates)
    for array in (reason, sigma, kind, colour, width_m):
        array.flags.writeable = False
    return Observation(
        lines=lines,
        sigma_y_m=sigma,
        kind=kind,
        colour=colour,
        width_m=width_m,
        candidates=candidates,
        reason=reason,
    )


def _painted(surroundings: Scene, candidates: LinePoints) -> BoolArray:
    """Return (N,) whether there is paint at each candidate."""
    edges = candidates.starts.tolist()
    parts = [
        surroundings.markings[place].painted[candidates.index[start:stop]]
        for place, start, stop in zip(candidates.marking.tolist(), edges, edges[1:], strict=False)
    ]
    return np.concatenate(parts) if parts else np.zeros(0, dtype=bool)


def _look(
    camera: Camera,
    scene_config: scene.SceneConfig,
    snapshot: Snapshot,
    candidates: LinePoints,
    painted: IntArray,
    points: Array,
) -> tuple[CodeArray, Array, Array]:
    """Return for the painted candidates, points (3, N) of the ego frame, the reason each is unseen (N,).

    With it, of the M that are seen, where they appear to be, (3, M) in the ego frame, and their
    lateral standard deviation (M,).
    """
    config = camera.config
    to_camera = camera_from_ego(camera, snapshot.ego)
    optical = to_camera.rotation @ points
    optical += to_camera.translation[:, None]
    pixels = project(camera, optical.T)
    codes = np.where(in_image(camera, pixels), np.uint8(Unseen.SEEN), np.uint8(Unseen.OUTSIDE_IMAGE))
    codes[optical[2] < config.min_range_m] = Unseen.BEHIND_CAMERA
    if config.max_range_m is not None or config.min_width_px > 0.0:
        end_of_sight(camera, to_camera, snapshot.scene, candidates, painted, optical, codes)
    too_faint(camera, snapshot.scene, candidates, painted, points, codes)
    seen = (codes == Unseen.SEEN).nonzero()[0]
    if config.occlusion != "none":
        hidden = _hidden(camera, scene_config, snapshot, to_camera, points.take(seen, axis=1).T)
        codes[seen[hidden]] = Unseen.OCCLUDED
        seen = seen[~hidden]
    if camera.assumed_from_ego is None and not config.pixel_grid:
        return codes, points.take(seen, axis=1), np.zeros(len(seen))
    pixels = pixels.T.take(seen, axis=1)
    if config.pixel_grid:
        pixels = np.rint(pixels)  # P1 eq. 2.19, 2.20, a pixel's centre at integers
    appearing, sigma, found = back_to_road(camera, to_camera, pixels, optical[2].take(seen))
    if found is not None:
        codes[seen[~found]] = Unseen.BEYOND_SIGHT
    return codes, appearing, sigma if config.pixel_grid else np.zeros(len(sigma))


def _hidden(
    camera: Camera, scene_config: scene.SceneConfig, snapshot: Snapshot, to_camera: Rigid, points: Array
) -> BoolArray:
    """Return which points (N, 3) of the ego frame an obstacle or a crest of the road hides."""
    around, method = snapshot.scene, _METHODS[camera.config.occlusion]
    frame, eye = scene.world_from_ego(snapshot.ego), invert(to_camera).translation
    near = scene.obstacles_near(scene_config, snapshot.ego, around)
    standing = [one for one in around.obstacles if not one.is_moving]
    hidden = raycast.hidden_by_obstacles(frame, eye, points, near, standing, method)
    if camera.config.crest and around.surface is not None:
        sections = (around.surface.points_world_m - frame.translation) @ frame.rotation
        hidden |= raycast.hidden_by_surface(eye, points, sections)
    return hidden


def _lines(
    candidates: LinePoints, seen: IntArray, points: Array, sigma_y_m: Array, by_rows: bool
) -> tuple[LinePoints, Array]:
    """Return the seen points (3, M) as lines with x increasing along each, and their deviations.

    The grid of a pitched or turned camera moves points along x too; on a coarse one they can swap. With
    the flat road, all that a row of pixels shows lies at one x: `by_rows`, the middle one of them stays.
    """
    starts = seen.searchsorted(candidates.starts)
    index = candidates.index[seen]
    line = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    before = points[0, :-1] + ROW_M if by_rows else points[0, :-1]
    if ((points[0, 1:] <= before) & (line[1:] == line[:-1])).any():
        order = np.lexsort((points[0], line))
        if by_rows:
            order = _middles(order, points[0], line)
            starts = line[order].searchsorted(np.arange(len(starts)))
        index, points, sigma_y_m = index[order], points[:, order], sigma_y_m[order]
    for array in (starts, index, points):
        array.flags.writeable = False
    return LinePoints(
        marking=candidates.marking, starts=starts, index=index, points_ego_m=points.T
    ), sigma_y_m


def _middles(order: IntArray, x_m: Array, line: IntArray) -> IntArray:
    """Return `order`, by line and x, with the middle one only of points of a line at the same x."""
    x_m, line = x_m[order], line[order]
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = (x_m[1:] - x_m[:-1] > ROW_M) | (line[1:] != line[:-1])
    firsts = is_first.nonzero()[0]
    counts = np.diff(firsts, append=len(order))
    return np.asarray(order[firsts + (counts - 1) // 2])


def _nearest_paint(
    surroundings: Scene, lines: LinePoints, candidates: LinePoints
) -> tuple[CodeArray, CodeArray, Array]:
    """Return kind, colour and width of each line at its nearest seen point, else at its nearest candidate."""
    kind, colour, width = [], [], []
    firsts, ends = lines.starts.tolist(), candidates.starts.tolist()
    for line, place in enumerate(lines.marking.tolist()):
        start, stop = firsts[line], firsts[line + 1]
        at = lines.index[start] if start < stop else candidates.index[ends[line]]
        marking = surroundings.markings[place]
        kind.append(marking.kind[at])
        colour.append(marking.colour[at])
        width.append(marking.width_m[at])
    return np.array(kind, dtype=np.uint8), np.array(colour, dtype=np.uint8), np.array(width, dtype=np.float64)
