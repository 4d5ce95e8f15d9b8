"""The optical end of the field of view: too far, or paint too narrow in the image to be found."""

import numpy as np

from vsensor.camera.optics import Camera
from vsensor.distortion import jacobian
from vsensor.transforms import Rigid
from vsensor.types import Array, CodeArray, IntArray, LinePoints, Scene, Unseen


def end_of_sight(
    camera: Camera,
    to_camera: Rigid,
    surroundings: Scene,
    candidates: LinePoints,
    painted: IntArray,
    optical: Array,
    codes: CodeArray,
) -> None:
    """Set the codes (N,) of points in the image that lie beyond sight or are too narrow.

    `optical` (3, N) are the points in the optical frame, `painted` (N,) their places among the candidates.
    """
    if camera.config.max_range_m is not None:
        codes[(codes == Unseen.SEEN) & (optical[2] > camera.config.max_range_m)] = Unseen.BEYOND_SIGHT
    if camera.config.min_width_px > 0.0:
        inside = (codes == Unseen.SEEN).nonzero()[0]
        places = painted[inside]
        along = to_camera.rotation @ _directions(candidates, places)
        up = to_camera.rotation[:, 2]
        width_m = _widths_m(surroundings, candidates)[places]
        width_px = apparent_width_px(camera, optical.take(inside, axis=1), along, up, width_m)
        codes[inside[width_px < camera.config.min_width_px]] = Unseen.TOO_NARROW


def apparent_width_px(camera: Camera, points: Array, along: Array, up: Array, width_m: Array) -> Array:
    """Return how wide stripes of `width_m` (N,) at points (3, N) are in the image, across their image.

    `along` (3, N) is the stripe's direction, `up` (3,) the normal of the road, all in the optical frame.
    The stripe's two sides pass through the ends of the vector across; their images run along the image
    of `along`, and the width is the distance between them: f width / depth for a stripe straight below
    the camera, less for one far aside. A stripe seen end-on has the length of the vector across.
    """
    across = np.array(
        (
            up[1] * along[2] - up[2] * along[1],
            up[2] * along[0] - up[0] * along[2],
            up[0] * along[1] - up[1] * along[0],
        )
    )
    length = np.sqrt((across * across).sum(axis=0))
    across *= np.divide(width_m, length, out=np.zeros(len(width_m)), where=length > 0.0)
    (across_u, across_v), (along_u, along_v) = (_image_of(camera, points, v) for v in (across, along))
    run = np.hypot(along_u, along_v)
    area = np.abs(across_u * along_v - across_v * along_u)
    return np.divide(area, run, out=np.hypot(across_u, across_v), where=run > 0.0)


def _image_of(camera: Camera, points: Array, vectors: Array) -> tuple[Array, Array]:
    """Return the pixels per unit by which the images of points (3, N) move along vectors (3, N)."""
    depth = points[2]
    x, y = points[0] / depth, points[1] / depth
    dx, dy = (vectors[0] - x * vectors[2]) / depth, (vectors[1] - y * vectors[2]) / depth
    if camera.distortion is not None:
        xx, xy, yy = jacobian(camera.distortion, x, y)
        dx, dy = xx * dx + xy * dy, xy * dx + yy * dy
    return camera.fx_px * dx, camera.fy_px * dy


def _directions(candidates: LinePoints, places: IntArray) -> Array:
    """Return the direction (3, M) of the lines at the candidates `places` (M,), not normalised.

    It is that from the point before to the point after; a point that is alone has the vehicle's.
    """
    points, starts = candidates.points_ego_m.T, candidates.starts
    line = np.repeat(np.arange(len(starts) - 1), np.diff(starts)).take(places)
    before = np.maximum(places - 1, starts.take(line))
    after = np.minimum(places + 1, starts.take(line + 1) - 1)
    directions = points.take(after, axis=1) - points.take(before, axis=1)
    directions[0, before == after] = 1.0
    return np.asarray(directions)


def _widths_m(surroundings: Scene, candidates: LinePoints) -> Array:
    """Return the width (N,) of the paint at each candidate."""
    edges = candidates.starts.tolist()
    parts = [
        surroundings.markings[place].width_m[candidates.index[start:stop]]
        for place, start, stop in zip(candidates.marking.tolist(), edges, edges[1:], strict=False)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)
