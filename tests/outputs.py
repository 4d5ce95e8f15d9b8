"""Outputs made by hand for the tests of what scores and shows them: lines y(x), seen and reported at will."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vsensor.scene import SceneConfig, near, world_from_ego
from vsensor.transforms import transform
from vsensor.types import (
    SIDE_NAMES,
    Boundary,
    Colour,
    Detections,
    EgoState,
    LaneEstimate,
    LinePoints,
    Marking,
    MarkingKind,
    Observation,
    Obstacle,
    Output,
    Scene,
    Side,
    Snapshot,
    Stripe,
    Tick,
    Unseen,
    frozen,
)


def nothing(points):
    """Say False for every point."""
    return np.zeros(len(points), dtype=bool)


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A line y(x) in the ego frame: where it runs, is painted and seen, and how it is reported.

    `reported` is a side, or None; `error` (order + 1,) is added to the fitted coefficients.
    """

    y: Callable
    x_range_m: tuple = (-5.0, 130.0)
    kind: MarkingKind = MarkingKind.SOLID
    stripe: Stripe = Stripe.SINGLE
    group: int = -1
    width_m: float = 0.15
    unpainted: Callable = nothing
    unseen: Callable = nothing
    reason: Unseen = Unseen.OCCLUDED
    reported: Side | None = None
    error: tuple = (0.0, 0.0, 0.0, 0.0)
    measured: bool = True
    quality: int = 4
    against: bool = False  # drawn against the driving direction
    joint: int | None = None  # number of a point that is there twice, as at the joints of real maps


def ego_at(x=0.0, y=0.0, yaw=0.0, speed=30.0, t_ns=0):
    """Return an ego state on the plane."""
    position = frozen([x, y, 0.0])
    return EgoState(t_ns=t_ns, position_world_m=position, yaw_rad=yaw, speed_mps=speed, yaw_rate_radps=0.01)


def marking_of(number, line, ego):
    """Return the world marking of a drawn line."""
    x = np.arange(round(10 * line.x_range_m[0]), round(10 * line.x_range_m[1]) + 1) / 10
    if line.joint is not None:
        x = np.insert(x, line.joint, x[line.joint])
    points = np.column_stack([x, line.y(x), np.zeros_like(x)])
    painted = ~line.unpainted(points)
    if line.against:
        points, painted = points[::-1], painted[::-1]
    count = len(x)
    return Marking(
        id=number,
        group=number if line.group < 0 else line.group,
        stripe=line.stripe,
        points_world_m=frozen(transform(world_from_ego(ego), points)),
        painted=frozen(painted, dtype=bool),
        kind=frozen(np.full(count, line.kind), dtype=np.uint8),
        colour=frozen(np.full(count, Colour.WHITE), dtype=np.uint8),
        width_m=frozen(np.full(count, line.width_m)),
    )


def chosen(lines, keep):
    """Return the line points where `keep` (N,)."""
    counts = [int(keep[a:b].sum()) for a, b in zip(lines.starts[:-1], lines.starts[1:], strict=True)]
    return LinePoints(
        marking=lines.marking,
        starts=frozen(np.concatenate([[0], np.cumsum(counts)]), dtype=np.int64),
        index=frozen(lines.index[keep], dtype=np.int64),
        points_ego_m=frozen(lines.points_ego_m[keep]),
    )


def reasons_of(candidates, markings, lines):
    """Return why each candidate was not seen."""
    reason = np.zeros(len(candidates.index), dtype=np.uint8)
    for k, number in enumerate(candidates.marking):
        part = slice(candidates.starts[k], candidates.starts[k + 1])
        line, points = lines[number], candidates.points_ego_m[part]
        reason[part][line.unseen(points)] = line.reason
        reason[part][~markings[number].painted[candidates.index[part]]] = Unseen.NO_PAINT
    return frozen(reason, dtype=np.uint8)


def boundary_of(k, number, line, points, order=3):
    """Return the report of a drawn line: the least-squares polynomial of its points plus its error."""
    x = points[:, 0]
    coefficients = np.polynomial.Polynomial.fit(x, points[:, 1], order).convert().coef + np.array(line.error)
    return Boundary(
        side=line.reported,
        coefficients=frozen(coefficients),
        covariance=frozen(np.eye(order + 1) * 1e-6),
        x_min_m=float(x[0]),
        x_max_m=float(x[-1]),
        quality=line.quality,
        kind=line.kind,
        colour=Colour.WHITE,
        width_m=line.width_m,
        measured=line.measured,
        marking=number if line.measured else -1,
        points=k if line.measured else -1,
    )


def output_of(
    lines, *, tick=0, ego=None, obstacles: tuple[Obstacle, ...] = (), values=None, ghosts=(), reach_m=100.0
):
    """Return the Output of one tick in which exactly the given lines were there, seen and reported."""
    ego = ego or ego_at(t_ns=tick * 40_000_000)
    scene = Scene(
        markings=tuple(marking_of(n, line, ego) for n, line in enumerate(lines)), obstacles=obstacles
    )
    snapshot = Snapshot(t_ns=ego.t_ns, ego=ego, scene=scene)
    candidates = near(SceneConfig(range_m=reach_m), ego, scene)
    reason = reasons_of(candidates, scene.markings, lines)
    seen = chosen(candidates, reason == Unseen.SEEN)
    optics = {
        "lines": seen,
        "sigma_y_m": frozen(np.zeros(len(seen.index))),
        "kind": frozen([lines[n].kind for n in seen.marking], dtype=np.uint8),
        "colour": frozen([Colour.WHITE] * len(seen.marking), dtype=np.uint8),
        "width_m": frozen([lines[n].width_m for n in seen.marking]),
    }
    reports = [
        boundary_of(k, int(n), lines[n], seen.points_ego_m[seen.starts[k] : seen.starts[k + 1]])
        for k, n in enumerate(seen.marking)
        if lines[n].reported is not None and seen.starts[k + 1] > seen.starts[k]
    ]
    sent = {f"{SIDE_NAMES[line.side]}.available": 1.0 for line in (*reports, *ghosts)}
    return Output(
        tick=Tick(index=tick, t_ns=tick * 40_000_000, period_ns=40_000_000),
        snapshot=snapshot,
        observation=Observation(**optics, candidates=candidates, reason=reason),
        detections=Detections(exposed_at_ns=ego.t_ns, operating_range_m=reach_m, **optics),
        estimate=LaneEstimate(exposed_at_ns=ego.t_ns, image_index=tick, boundaries=(*reports, *ghosts)),
        values=sent | (values or {}),
        frames=(),
    )


def straight(offset_m, slope=0.0):
    """Return y(x) of a straight line."""
    return lambda x: offset_m + slope * x


def circle(offset_m, radius_m):
    """Return y(x) of a circle's arc with its centre on the y axis: positive radius bends to the left."""
    return lambda x: radius_m - np.sign(radius_m) * np.sqrt((radius_m - offset_m) ** 2 - x * x)


def four_lines(**changes):
    """Return the lines of the middle one of three straight lanes, all seen and reported."""
    places = {Side.LEFT: 1.8, Side.RIGHT: -1.9, Side.NEXT_LEFT: 5.5, Side.NEXT_RIGHT: -5.6}
    return [Drawn(y=straight(y), reported=side, **changes) for side, y in places.items()]
