"""The lane's edge that a vehicle drifts to, and how far its tyre is from it.

                   | marking |
  lane             | w       |          edge: the marking's inner border, or where there is no
o===o  front axle  |         |          paint (the road's end) the lane's border itself
  --------------->|
  distance_m, across the edge, from the outer side of the front tyre; negative once it is over
"""

from dataclasses import dataclass
from math import atan, cos

import numpy as np

from vsensor.scene import world_from_ego
from vsensor.transforms import relative_to
from vsensor.types import Marking, Snapshot

WITHIN_M = 6.0
"""A lane's edge is no farther to the side."""
_TANGENT_HALF_M = 0.5  # the edge's direction is taken over one metre


@dataclass(frozen=True, slots=True, kw_only=True)
class TyreToEdge:
    """Where an edge is: `distance_m` across it from the tyre's outer side, `width_m` of its marking.

    `towards_rad`: the angle at which the vehicle's axis meets it, positive towards it.
    """

    distance_m: float
    width_m: float
    towards_rad: float


def edge_beside(snapshot: Snapshot, is_left: bool, front_axle_x_m: float) -> int | None:
    """Return the `id` of the border nearest to the vehicle's middle on one side, painted or not."""
    sign = 1.0 if is_left else -1.0
    beside = [
        (sign * y, marking.id)
        for marking in snapshot.scene.markings
        if (y := _abeam(snapshot, marking, front_axle_x_m)[0]) is not None and 0.0 < sign * y < WITHIN_M
    ]
    return min(beside)[1] if beside else None


def tyre_to_edge(
    snapshot: Snapshot, marking_id: int, is_left: bool, front_axle_x_m: float, vehicle_width_m: float
) -> TyreToEdge | None:
    """Return the distance of the front tyre of one side to a border; None where the border is not abeam."""
    for marking in snapshot.scene.markings:
        if marking.id == marking_id:
            y, slope, width_m = _abeam(snapshot, marking, front_axle_x_m)
            if y is None:
                return None
            # The axle's end, and the inner border half a width beside the marking's middle, both taken
            # across the edge, which the vehicle's axis meets at atan(slope).
            sign, angle = (1.0 if is_left else -1.0), atan(slope)
            across = sign * y * cos(angle) - width_m / 2.0
            return TyreToEdge(
                distance_m=across - vehicle_width_m / 2.0 * cos(angle),
                width_m=width_m,
                towards_rad=-sign * angle,
            )
    return None


def _abeam(snapshot: Snapshot, marking: Marking, front_axle_x_m: float) -> tuple[float | None, float, float]:
    """Return y of a border on the line of the front axle, its slope there, and the width of its paint."""
    points = relative_to(world_from_ego(snapshot.ego), marking.points_world_m)
    x, y = points[:, 0], points[:, 1]
    near = np.flatnonzero(np.abs(x - front_axle_x_m) <= 2.0)
    near = near[np.abs(y[near]) <= 3.0 * WITHIN_M]
    if near.size < 2:
        return None, 0.0, 0.0
    order = near[np.argsort(x[near])]
    if not x[order[0]] <= front_axle_x_m <= x[order[-1]]:
        return None, 0.0, 0.0
    low, middle, high = np.interp(
        (front_axle_x_m - _TANGENT_HALF_M, front_axle_x_m, front_axle_x_m + _TANGENT_HALF_M),
        x[order],
        y[order],
    ).tolist()
    place = int(order[np.abs(x[order] - front_axle_x_m).argmin()])
    width_m = float(marking.width_m[place]) if marking.painted.any() else 0.0
    return middle, (high - low) / (2.0 * _TANGENT_HALF_M), width_m
