"""The path that a driver follows: the lane's middle, over to other lanes where a manoeuvre says so.

lane beside ------------------- . * * * * * *>
                            . *                 10 u^3 - 15 u^4 + 6 u^5 along the road:
own lane    * * * * * * * '                     curvature begins and ends at 0
                         start_m      end_m
"""

from collections.abc import Callable, Sequence
from math import floor, pi

import numpy as np

from vsensor.sources.manoeuvres import Shift
from vsensor.sources.traffic_boxes import OFFSET_STEP_M as KNOT_M
from vsensor.types import Array
from vsensor.world.corridor import Corridor

TURN = 2.0 * pi
SLOPE_M = 0.5
"""Half the step of the difference that gives the slope of lanes whose widths change."""


class LanePath:
    """The driven path as an offset to the left of the lane's middle, by distance along the route."""

    def __init__(
        self, corridor: Corridor, shifts: Sequence[Shift], lane_offset_m: Callable[[int, float], float]
    ) -> None:
        """Join shifts; `lane_offset_m(lanes_left, s_m)` is where the middle of a lane beside lies."""
        self._corridor = corridor
        self._shifts = tuple(sorted(shifts, key=lambda shift: shift.start_m))
        self._lane_offset = lane_offset_m

    def offset_m(self, s_m: Array) -> Array:
        """Return the offsets (N,) at distances (N,)."""
        offset, lanes = np.zeros(len(s_m)), 0
        last = float(s_m.max())
        for shift in self._shifts:
            if shift.start_m > last:
                break
            share = _smooth(s_m, shift)
            target = lanes + shift.lanes_left
            if shift.lanes_left:
                offset += share * (self._lanes(target, s_m) - self._lanes(lanes, s_m))
            offset += share * shift.offset_m
            lanes = target
        return offset

    def _lanes(self, lanes: int, s_m: Array) -> Array:
        """Return where a lane beside lies (N,), linear between places KNOT_M apart."""
        if lanes == 0:
            return np.zeros(len(s_m))
        first, last = floor(float(s_m.min()) / KNOT_M), floor(float(s_m.max()) / KNOT_M) + 1
        knots = [self._lane_offset(lanes, k * KNOT_M) for k in range(first, last + 1)]
        return np.interp(s_m / KNOT_M, np.arange(first, last + 1), knots)

    def looked(self, s_m: Array) -> tuple[Array, float, float]:
        """Return the path's turns between distances (N,) that rise, (N - 1,), on the map.

        Behind them its heading and its offset at the first.
        """
        poses = self._corridor.poses(s_m)
        headings, offset = poses.yaw_rad, 0.0
        if self._shifts and self._shifts[0].start_m <= float(s_m[-1]):
            count = len(s_m)
            offsets = self.offset_m(np.concatenate((s_m, s_m + SLOPE_M, s_m - SLOPE_M)))
            slope = (offsets[count : 2 * count] - offsets[2 * count :]) / (2.0 * SLOPE_M)
            headings = headings + np.arctan2(slope, 1.0 - poses.curvature_per_m * offsets[:count])
            offset = float(offsets[0])
        turns = headings[1:] - headings[:-1]
        return turns - TURN * np.rint(turns / TURN), float(headings[0]), offset


def _smooth(s_m: Array, shift: Shift) -> Array:
    if shift.end_m <= shift.start_m:
        return np.ones(len(s_m))
    u = np.minimum(np.maximum((s_m - shift.start_m) / (shift.end_m - shift.start_m), 0.0), 1.0)
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))
