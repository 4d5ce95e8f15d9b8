"""Who is hidden: the segment from the camera to a point, against solid boxes (P1 2.1.3).

A point is hidden if the segment from the camera to it, short of its last 1e-5, meets a box. So a
point on the near side of its own box is free, a point inside a box or behind it is hidden, and a
camera inside a box or on its surface sees nothing. Both methods agree except within 1e-4 m of a
silhouette:

- shadow: the points in each box's shadow, which is a convex volume, nearest boxes first, float64
- embree: at most three faces a box, those turned to the camera, float32 relative to the camera
"""

from typing import Literal

import numpy as np

from vsensor.raycast.boxes import Boxes, solids_of
from vsensor.raycast.faces import hidden_by_faces
from vsensor.raycast.shadow import Judge, chart_of, rectangles, shadow
from vsensor.types import Array, BoolArray

Method = Literal["auto", "shadow", "embree"]

RAYS_FROM_BESIDE, RAYS_FROM_SHARE = 3, 0.2
"""Embree, its scene built anew, is the faster test where more than 3 boxes and a fifth of those in view
reach beside the camera: these have no outline, so that the shadow test tries every point against them.

CPU time of shadow test and embree in ms, medians of 15 with 4000 points on the lines, and of boxes all
around with points all around:

    boxes                           10           30           120          400          800
    a row of cars in three lanes    0.17, 0.44   0.39, 0.67   0.72, 1.06   2.00, 2.26   3.87, 3.93
    scattered about the lines       0.16, 0.44   0.23, 0.63   0.53, 1.11   1.25, 2.22   2.54, 4.69
    small and far                   0.14, 0.33   0.24, 0.54   0.55, 1.19   1.40, 3.04   3.07, 6.25
    all around                      0.31, 0.33   0.75, 0.57   2.41, 1.20   6.79, 2.58

What reaches beside the camera takes the shadow test 0.02 ms each, another box 0.003, embree 0.006.
"""


def hidden(origin_m: Array, points_m: Array, boxes: Boxes, method: Method = "auto") -> BoolArray:
    """Return for each of `points_m` (N, 3) whether a box hides it from `origin_m` (3,).

    All in one frame near the camera. A negative size counts with its absolute value; a box without
    thickness hides like a sheet. Points and boxes that hold NaN are not hidden and do not hide.
    """
    count = len(points_m)
    if not count or not len(boxes.centre_m):
        return np.zeros(count, dtype=bool)
    local = np.einsum("mij,mi->mj", boxes.rotation, origin_m - boxes.centre_m)
    if (np.abs(local) <= boxes.half_m).all(axis=1).any():
        return np.ones(count, dtype=bool)
    directions = points_m.T - origin_m[:, None]
    solids = solids_of(origin_m, boxes, local)
    chart = chart_of(directions)
    low, high, in_view = rectangles(chart, solids.corners_m)
    if not len(in_view):
        return np.zeros(count, dtype=bool)
    solids = solids.pick(in_view)
    beside = int(np.isinf(low[0, in_view]).sum())
    is_faster = beside > RAYS_FROM_BESIDE + RAYS_FROM_SHARE * len(in_view)
    if method == "embree" or (method == "auto" and is_faster):
        return hidden_by_faces(directions, chart, low[:, in_view], high[:, in_view], solids)
    free = np.ones(count, dtype=bool)
    shadow(directions, chart, low[:, in_view], high[:, in_view], solids, free)
    return ~free


def hidden_within(origin_m: Array, points_m: Array, boxes: Boxes, judge: Judge) -> BoolArray:
    """Return which of `points_m` (N, 3) are hidden by what the boxes hold, as `judge` finds.

    It is asked, nearest box first, about the segments that meet a box, and about all where the
    camera is inside it; a point that is found hidden is not asked about again.
    """
    count = len(points_m)
    free = np.ones(count, dtype=bool)
    if not count or not len(boxes.centre_m):
        return ~free
    local = np.einsum("mij,mi->mj", boxes.rotation, origin_m - boxes.centre_m)
    around = (np.abs(local) <= boxes.half_m).all(axis=1)
    for box in around.nonzero()[0].tolist():
        tried = free.nonzero()[0]
        free[tried] = ~judge(box, tried)
    directions = points_m.T - origin_m[:, None]
    solids = solids_of(origin_m, boxes, local)
    chart = chart_of(directions)
    low, high, in_view = rectangles(chart, solids.corners_m)
    in_view = in_view[~around[in_view]]
    if len(in_view):
        view = low[:, in_view], high[:, in_view], solids.pick(in_view)
        shadow(directions, chart, *view, free, lambda box, tried: judge(int(in_view[box]), tried))
    return ~free
