"""How far it is from an entity to what a condition refers to: another entity, or a position.

             euclidian: through the air, of boxes between their outlines (freespace)
entity frame longitudinal, lateral: along and across the entity's heading
road, lane   longitudinal: along the road; lateral: in t, to the left as driven
"""

from math import cos, sin

import numpy as np

from vsensor.types import Array
from vsensor.world.openscenario.model import Condition
from vsensor.world.openscenario.places import point_for, spot_for
from vsensor.world.openscenario.work import Work, boxes_apart_m


def distance_m(work: Work, condition: Condition, entity: int) -> float:
    """Return the signed distance to what a condition refers to, along its axis; euclidian ones unsigned.

    NaN where it is not known: nobody there, or not on the way.
    """
    if condition.position is not None:
        return _to_position(work, condition, entity)
    other = condition.ref
    here, there = work.pose(entity), work.pose(other)
    if here is None or there is None:
        return float("nan")
    if condition.measure == "euclidian":
        if condition.freespace:
            return boxes_apart_m(work.corners(entity), work.corners(other))
        return float(np.linalg.norm(there[0] - here[0]))
    along = _along_m(work, condition, entity, there[0], other)
    if along is None:
        return float("nan")
    if not condition.freespace:
        return along
    axis = here[1] + (np.pi / 2 if condition.measure == "lateral" else 0.0)
    (low, high), (other_low, other_high) = work.extent(entity, axis), work.extent(other, axis)
    gap = along + other_low - high if along >= 0.0 else along + other_high - low
    return max(gap, 0.0) if along >= 0.0 else min(gap, 0.0)


def _along_m(work: Work, condition: Condition, entity: int, point: Array, other: int = -1) -> float | None:
    """Return how far ahead (or to the left) a point or an entity is."""
    lateral = condition.measure == "lateral"
    here = work.pose(entity)
    assert here is not None
    if condition.frame == "entity":
        dx, dy = float(point[0] - here[0][0]), float(point[1] - here[0][1])
        c, s = cos(here[1]), sin(here[1])
        return dy * c - dx * s if lateral else dx * c + dy * s
    mine = work.place(entity)
    if other >= 0:
        place, spot = work.place(other), work.spot(other)
    else:
        assert condition.position is not None
        spot = spot_for(work, condition.position)
        place = work.tracks.road_spot(spot)
    if lateral:
        return (
            None
            if mine is None or place is None
            else mine.direction * (work.tracks.t_of(place) - work.tracks.t_of(mine))
        )
    return work.ahead_m(entity, place, spot)


def _to_position(work: Work, condition: Condition, entity: int) -> float:
    here = work.pose(entity)
    assert condition.position is not None
    point = point_for(work, condition.position)
    if here is None or point is None:
        return float("nan")
    if condition.measure == "euclidian":
        return float(np.linalg.norm(point - here[0]))
    along = _along_m(work, condition, entity, point)
    return float("nan") if along is None else along
