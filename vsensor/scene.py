"""The part of the scene near the pose: markings as exact points in the road-level ego frame.

The points of all markings are handled in one pass; only a line that turns back or was drawn against
the driving direction is looked at on its own. Painted or not, everything near is returned: what the
camera makes of it is said there, point by point.
"""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta

from vsensor.schema import Config
from vsensor.transforms import Rigid, rotation_from_rpy
from vsensor.types import Array, EgoState, IntArray, LinePoints, Marking, Obstacle, Scene, Stripe

JOINT_M = 0.01
"""A chain that steps back by less has a joint there, not a turn: real maps overlap by 1e-6 to 1e-3 m."""


BATCH_POINTS = 1500
"""Chains are transformed in batches of at least this many points."""


class SceneConfig(Config, frozen=True, kw_only=True):
    """How much of the scene is looked at, as x and y of the road-level ego frame.

    The default is a point more than 100 m, so that a line may be read at 100 m.
    """

    range_m: Annotated[float, Meta(ge=5.0, le=500.0)] = 100.2
    behind_m: Annotated[float, Meta(ge=0.0, le=100.0)] = 0.0
    lateral_m: Annotated[float, Meta(ge=2.0, le=200.0)] = 20.0


class _Run(NamedTuple):
    """The part of one marking that is kept: its points (3, n), and y where it passes the ego."""

    marking: int
    points: Array
    index_in_marking: IntArray
    abeam_m: float
    is_reversed: bool


def world_from_ego(ego: EgoState) -> Rigid:
    """Return the pose of the road-level ego frame (without the body's own motion)."""
    return Rigid(rotation_from_rpy(ego.roll_rad, ego.pitch_rad, ego.yaw_rad), ego.position_world_m)


def near(config: SceneConfig, ego: EgoState, scene: Scene) -> LinePoints:
    """Return the points of the markings near the pose, painted or not, exact, in the ego frame.

    A line is the run of increasing x that holds the point nearest to the ego: one that folds back is
    cut there, one that was drawn against the driving direction is reversed. x is in [-behind_m,
    range_m]; a line that passes (or begins) further than `lateral_m` to the side is left out; of a
    double line the inner stripe stays. The points are contiguous along x, y and z each.
    """
    places = [place for place, line in enumerate(scene.markings) if len(line.points_world_m)]
    if not places:
        return _gathered([])
    chains = [scene.markings[place].points_world_m for place in places]
    offsets: list[int] = np.cumsum([0, *map(len, chains)]).tolist()
    points = _in_ego_frame(ego, chains, offsets)
    is_simple = _rising(points[0], offsets)
    x_edges_m = np.array([-config.behind_m, 0.0, np.nextafter(config.range_m, np.inf)])
    runs = [
        _run(place, points[:, start:stop], x_edges_m, simple)
        for place, start, stop, simple in zip(places, offsets, offsets[1:], is_simple, strict=False)
    ]
    close = [run for run in runs if len(run.index_in_marking) and abs(run.abeam_m) <= config.lateral_m]
    return _gathered(_inner_stripes(scene.markings, close))


def obstacles_near(config: SceneConfig, ego: EgoState, scene: Scene) -> tuple[Obstacle, ...]:
    """Return the obstacles that can stand between a camera on the vehicle and a point of `near`.

    An obstacle counts where its bounding sphere reaches into x of [-behind_m - 10, range_m] and |y|
    up to range_m; the 10 m are room for a camera behind the rear axle.
    """
    if not scene.obstacles:
        return ()
    centres = np.concatenate([box.centre_world_m for box in scene.obstacles]).reshape(-1, 3)
    sizes = np.array([box.size_m for box in scene.obstacles])
    pose = world_from_ego(ego)
    x, y, _ = pose.rotation.T @ (centres - pose.translation).T
    radius = 0.5 * np.sqrt((sizes * sizes).sum(axis=1))
    behind = config.behind_m + 10.0
    within = (x - radius <= config.range_m) & (x + radius >= -behind) & (np.abs(y) - radius <= config.range_m)
    return tuple(box for box, keep in zip(scene.obstacles, within.tolist(), strict=True) if keep)


def _in_ego_frame(ego: EgoState, chains: Sequence[Array], offsets: list[int]) -> Array:
    """Return the points of all chains as (3, N): the origin is subtracted first, then rotated.

    Column by column, as broadcasting over rows of three takes four times as long; and a batch of
    chains at a time, so that what is needed in between stays small enough for malloc to keep (six
    chains of 1200 points take 0.08 ms, in one piece 0.29, most of it page faults).
    """
    pose = world_from_ego(ego)
    points = np.empty((3, offsets[-1]))
    first = 0
    for last in range(1, len(chains) + 1):
        count = offsets[last] - offsets[first]
        if count < BATCH_POINTS and last < len(chains):
            continue
        world = np.concatenate(chains[first:last])
        relative = np.empty((3, count))
        for axis in range(3):
            np.subtract(world[:, axis], pose.translation[axis], out=relative[axis])
        np.matmul(pose.rotation.T, relative, out=points[:, offsets[first] : offsets[last]])
        first = last
    return points


def _rising(x: Array, offsets: list[int]) -> list[bool]:
    """Return for each chain whether its x increases from every point to the next."""
    rises = np.empty(len(x), dtype=bool)
    np.greater(x[1:], x[:-1], out=rises[1:])
    rises[offsets[:-1]] = True  # a chain's first point follows nothing
    if rises.all():
        return [True] * (len(offsets) - 1)
    chains: list[bool] = np.logical_and.reduceat(rises, offsets[:-1]).tolist()
    return chains


def _run(place: int, points: Array, x_edges_m: Array, is_simple: bool) -> _Run:
    """Return the window of one chain (3, n) on x, and its y at the point nearest to x = 0."""
    order, is_reversed = (None, False) if is_simple else _driven(points)
    if order is not None:
        points = points[:, order]
    start, abeam, stop = points[0].searchsorted(x_edges_m).tolist()
    index = np.arange(start, stop) if order is None else order[start:stop]
    abeam_m = float(points[1, min(abeam, points.shape[1] - 1)])
    return _Run(place, points[:, start:stop], index, abeam_m, is_reversed)


def _driven(points: Array) -> tuple[IntArray, bool]:
    """Return the indices of the run of increasing x around the point nearest to the ego, and if reversed."""
    count = points.shape[1]
    nearest = int((points * points).sum(axis=0).argmin())
    before, after = max(nearest - 1, 0), min(nearest + 1, count - 1)
    is_reversed = bool(points[0, after] < points[0, before])
    up, down = np.arange(nearest, count), np.arange(nearest, -1, -1)
    ahead, behind = (down, up) if is_reversed else (up, down)
    forward = ahead[_steady(points[:, ahead], 1.0)]
    backward = behind[_steady(points[:, behind], -1.0)]
    return np.concatenate([backward[:0:-1], forward]), is_reversed


def _steady(points: Array, sign: float) -> IntArray:
    """Return which points (3, n) advance in sign * x beyond all before, up to the first turn.

    A point that does not advance is left out as a joint where it lies within JOINT_M of the last one
    that did; further away it is a turn (or a line across) and ends the run.
    """
    x = sign * points[0]
    advances = np.empty(len(x), dtype=bool)
    advances[0] = True
    np.greater(x[1:], np.maximum.accumulate(x)[:-1], out=advances[1:])
    if advances.all():
        return np.arange(len(x))
    last = np.maximum.accumulate(np.where(advances, np.arange(len(x)), 0))
    gap = points - points[:, last]
    turns = ((gap * gap).sum(axis=0) > JOINT_M * JOINT_M).nonzero()[0]
    end = int(turns[0]) if len(turns) else len(x)
    return advances[:end].nonzero()[0]


def _inner_stripes(markings: Sequence[Marking], runs: list[_Run]) -> list[_Run]:
    """Return the runs without the outer stripes of double lines.

    A border to the left of the ego shows its right stripe and vice versa; the words left and right
    are those along the chain, so they swap where the chain is reversed.
    """
    borders: dict[int, dict[Stripe, _Run]] = {}
    for run in runs:
        marking = markings[run.marking]
        if marking.stripe is not Stripe.SINGLE:
            borders.setdefault(marking.group, {})[marking.stripe] = run
    outer: set[int] = set()
    for stripes in borders.values():
        if len(stripes) == 2:
            left, right = stripes[Stripe.LEFT], stripes[Stripe.RIGHT]
            if left.is_reversed:
                left, right = right, left
            outer.add(left.marking if left.abeam_m + right.abeam_m > 0.0 else right.marking)
    return [run for run in runs if run.marking not in outer]


def _gathered(runs: list[_Run]) -> LinePoints:
    """Return the runs as flat arrays, read-only."""
    points = np.concatenate([np.empty((3, 0)), *(run.points for run in runs)], axis=1)
    index = np.concatenate([np.empty(0, dtype=np.int64), *(run.index_in_marking for run in runs)])
    starts = np.zeros(len(runs) + 1, dtype=np.int64)
    np.cumsum([len(run.index_in_marking) for run in runs], out=starts[1:])
    marking = np.array([run.marking for run in runs], dtype=np.int64)
    for array in (points, index, starts, marking):
        array.flags.writeable = False
    return LinePoints(marking=marking, starts=starts, index=index, points_ego_m=points.T)
