"""From a line in the picture to one on the road (P2 2.5.1.3, 2.5.2.2.4)."""

from math import inf, nan

import msgspec
import numpy as np

from vsensor.camera import Camera, on_road
from vsensor.distortion import DistortionConfig
from vsensor.types import Array, BoolArray, Boundary, Colour, MarkingKind, Side, frozen
from vsensor.video.published.hough import ImageLine

NEAR_LINE_PX = 1.5
"""The mask's pixels this close to a line are its own."""
FARTHEST_M = 100.0
"""A pixel higher up is metres of road: no line of two points is known farther."""


def straight_camera(camera: Camera) -> Camera:
    """Return the camera of the straightened pictures: no distortion, back to the road by the ground plane."""
    config = msgspec.structs.replace(camera.config, distortion=DistortionConfig(), inverse="ground_plane")
    return Camera.from_config(config)


def on_ground(camera: Camera, line: ImageLine, rows_px: Array) -> Array:
    """Return x and y (2, N) in the ego frame where the line crosses rows (N,); NaN at and above the horizon.

    P2 eq. 2.17 with the errata's solution: the ray through the pixel meets the plane z = 0.
    """
    assert camera.assumed_from_ego is not None
    points, _, meets = on_road(camera, camera.assumed_from_ego, np.array((line.u_at(rows_px), rows_px)))
    found = np.full((2, len(rows_px)), np.nan)
    found[:, meets] = points[:2]
    return found


def boundary(camera: Camera, line: ImageLine, side: Side, mask: BoolArray, first_row: int) -> Boundary | None:
    """Return the line as the sensor reports one; None where two of its points do not meet the road ahead.

    Two points of the image line are put on the road, and the line through them there is the boundary. The
    range is that of the mask's pixels on the line. P2 measures to the line itself: it has no width, its
    centre is its edge. P2 has no confidence: here it is how many of the lines asked for were found.
    """
    last_row = first_row + mask.shape[0] - 1
    x, y = on_ground(camera, line, np.array([last_row, last_row - (last_row - first_row) / 4.0]))
    if not x[1] > x[0]:  # NaN, or not ahead
        return None
    slope = (y[1] - y[0]) / (x[1] - x[0])
    start_m, end_m = _range_m(camera, line, mask, first_row)
    if not end_m > start_m:
        return None
    return Boundary(
        side=side,
        coefficients=frozen([y[0] - slope * x[0], slope]),
        covariance=frozen(np.full((2, 2), nan)),
        x_min_m=start_m,
        x_max_m=end_m,
        quality=min(line.found, 4),
        kind=MarkingKind.UNKNOWN,
        colour=Colour.UNKNOWN,
        width_m=0.0,
        measured=True,
        marking=-1,
        points=-1,
    )


def _range_m(camera: Camera, line: ImageLine, mask: BoolArray, first_row: int) -> tuple[float, float]:
    """Return the nearest and farthest x of the line's own pixels; inf, 0 where there are none."""
    v, u = np.nonzero(mask)
    v = v + first_row
    away_px = np.abs(u * np.cos(line.theta_rad) + v * np.sin(line.theta_rad) - line.rho_px)
    rows = np.unique(v[away_px <= NEAR_LINE_PX]).astype(np.float64)
    x = on_ground(camera, line, rows)[0]
    x = x[x <= FARTHEST_M]
    return (float(x.min()), float(x.max())) if len(x) else (inf, 0.0)
