"""Small scenes for tests of the optics: markings from a chain of points, snapshots from poses."""

import numpy as np

from vsensor.transforms import rotation_from_rpy
from vsensor.types import EgoState, Marking, MarkingKind, Obstacle, Scene, Snapshot, Stripe, frozen


def marking(points, number=0, *, painted=None, kind=MarkingKind.SOLID, colour=1, width_m=0.15, **more):
    """Return a marking along `points` (N, 2 or 3), painted throughout unless said otherwise."""
    points = np.asarray(points, dtype=float)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    count = len(points)
    return Marking(
        id=number,
        group=more.pop("group", number),
        stripe=more.pop("stripe", Stripe.SINGLE),
        points_world_m=frozen(points),
        painted=frozen(np.ones(count) if painted is None else painted, bool),
        kind=frozen(np.broadcast_to(kind, count), np.uint8),
        colour=frozen(np.broadcast_to(colour, count), np.uint8),
        width_m=frozen(np.broadcast_to(width_m, count)),
        **more,
    )


def straight(y, number=0, start=-20.0, stop=120.0, step=0.1, **more):
    """Return a straight marking along x at lateral position `y`."""
    x = start + step * np.arange(round((stop - start) / step) + 1)
    return marking(np.column_stack([x, np.full(len(x), y)]), number, **more)


def ego(position=(0.0, 0.0, 0.0), **state):
    """Return a vehicle at `position`, at 30 m/s unless said otherwise."""
    return EgoState(t_ns=0, position_world_m=frozen(position), **{"speed_mps": 30.0, **state})


def snapshot(markings, obstacles=(), vehicle=None):
    """Return markings and obstacles around a vehicle at the origin."""
    return Snapshot(
        t_ns=0, ego=vehicle or ego(), scene=Scene(markings=tuple(markings), obstacles=tuple(obstacles))
    )


def box(x, y, z=0.75, size=(4.0, 2.0, 1.5), number=0, **angles):
    """Return a box obstacle with its centre at (x, y, z)."""
    return Obstacle(id=number, centre_world_m=frozen((x, y, z)), size_m=size, **angles)


def moved(points, vehicle):
    """Return points (N, 3) of the road-level ego frame in the world, in the plain way."""
    rotation = rotation_from_rpy(vehicle.roll_rad, vehicle.pitch_rad, vehicle.yaw_rad)
    return np.array([rotation @ point + vehicle.position_world_m for point in points])
