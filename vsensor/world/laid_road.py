"""A road laid along a driven path: lane borders beside the smoothed path, flat (z = 0).

The path holds the steps of its signals and the driver's swaying; the road shall hold neither kinks
nor all of the swaying. So the path is smoothed with a Gaussian kernel of fourth order,
w(u) = (3 - u^2) phi(u) / 2: infinitely smooth, and it leaves cubics as they are, so that a bend is
not cut. On a circle its error is 3 sigma^4 / (8 R^3); with sigma = T v and a lateral acceleration of
v^2 / R = 3 m/s^2 that is 10 T^4 / v^2 in SI units: a time T, not a length, suits the turn at a
crossing as well as the motorway. u = integral of ds / sigma(s).
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec
import numpy as np

from vsensor.schema import Config
from vsensor.types import Array, BoolArray, Colour, Marking, MarkingKind, Stripe, frozen
from vsensor.world.dead_reckoning import DrivenPath

POINT_STEP_M = 0.1
BEFORE_M = 60.0
"""Straight road before the first and behind the last point of the path: what the view needs."""
AFTER_M = 300.0
SIGMA_M = (2.0, 60.0)
"""Least and largest standard deviation: finer than that are the samples, longer than that are bends."""
SIGMA_AVERAGE_M = 10.0  # the speed itself is averaged over this, so that its steps do not show
STEPS_PER_SIGMA = 20
KERNEL_REACH = 6.0  # in standard deviations; the kernel is 2e-7 of its middle there

Kind = Literal[
    "absent",
    "none",
    "solid",
    "dashed",
    "double_solid",
    "double_dashed",
    "solid_dashed",
    "dashed_solid",
    "botts_dots",
    "road_edge",
]
_Length = Annotated[float, msgspec.Meta(gt=0, le=100)]


class LaidRoadConfig(Config, frozen=True, kw_only=True):
    """`[road]`: the road that is laid along a recorded drive.

    The own lane is `lane_width_m` wide; `left` and `right` are its borders, `next_left` and
    `next_right` those of the lanes beside it ("absent": there is no such lane; "none": a border without
    paint). `smoothing_s` times the speed is the standard deviation of the kernel along the road, 0 for none.
    """

    lane_width_m: Annotated[float, msgspec.Meta(ge=2, le=8)] = 3.5
    left: Kind = "dashed"
    right: Kind = "solid"
    next_left: Kind = "solid"
    next_right: Kind = "absent"
    colour: Literal["white", "yellow", "orange", "blue", "red", "green"] = "white"
    marking_width_m: Annotated[float, msgspec.Meta(ge=0.05, le=0.5)] = 0.15
    dash_m: _Length = 6.0
    gap_m: _Length = 12.0
    double_gap_m: Annotated[float, msgspec.Meta(ge=0.05, le=0.5)] = 0.12
    smoothing_s: Annotated[float, msgspec.Meta(ge=0, le=5)] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LaidRoad:
    """Whole borders of a laid road; point k stands at `s_first_m + 0.1 k` of the path's length."""

    s_first_m: float
    markings: tuple[Marking, ...]
    centre_world_m: Array

    def markings_window(self, s_from_m: float, s_to_m: float) -> tuple[Marking, ...]:
        """Return the markings between two lengths along the path, as views; ids are those of the whole."""
        count = len(self.centre_world_m)
        first = min(max(int((s_from_m - self.s_first_m) / POINT_STEP_M), 0), count)
        last = min(max(int((s_to_m - self.s_first_m) / POINT_STEP_M) + 1, first), count)
        return tuple(_window(marking, slice(first, last)) for marking in self.markings)


def _window(marking: Marking, part: slice) -> Marking:
    return Marking(
        id=marking.id,
        group=marking.group,
        stripe=marking.stripe,
        points_world_m=marking.points_world_m[part],
        painted=marking.painted[part],
        kind=marking.kind[part],
        colour=marking.colour[part],
        width_m=marking.width_m[part],
        contrast=marking.contrast,
    )


def lay_road(config: LaidRoadConfig, path: DrivenPath, offset_in_lane_m: float = 0.0) -> LaidRoad:
    """Lay a road so that the path runs `offset_in_lane_m` to the left of its own lane's centre."""
    s_m, xy, speed_mps = _sampled(path)
    if config.smoothing_s > 0.0:
        xy = _smoothed_road(xy, config.smoothing_s * speed_mps)
    tangent = np.gradient(xy, axis=0)
    tangent /= np.hypot(tangent[:, 0], tangent[:, 1])[:, None]
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    centre = xy - offset_in_lane_m * normal
    markings: list[Marking] = []
    for group, (kind, lanes) in enumerate(
        ((config.left, 0.5), (config.right, -0.5), (config.next_left, 1.5), (config.next_right, -1.5))
    ):
        if kind != "absent":
            for stripe, shift_m, painted in _stripes(config, kind, s_m):
                line = centre + (lanes * config.lane_width_m + shift_m) * normal
                number = len(markings)
                markings.append(_marking(config, kind, line, painted, number, group, stripe))
    return LaidRoad(s_first_m=float(s_m[0]), markings=tuple(markings), centre_world_m=_flat(centre))


def _sampled(path: DrivenPath) -> tuple[Array, Array, Array]:
    """Return lengths (M,) in steps of 0.1 m, points (M, 2) and speed (M,), with straight ends added."""
    moving = np.concatenate([[True], np.diff(path.s_m) > 0.0])
    s, x, y = path.s_m[moving], path.x_m[moving], path.y_m[moving]
    speed = path.speed_mps[moving]
    yaw0, yaw1 = path.yaw_rad[0], path.yaw_rad[-1]
    s = np.concatenate([[s[0] - BEFORE_M], s, [s[-1] + AFTER_M]])
    x = np.concatenate([[x[0] - BEFORE_M * np.cos(yaw0)], x, [x[-1] + AFTER_M * np.cos(yaw1)]])
    y = np.concatenate([[y[0] - BEFORE_M * np.sin(yaw0)], y, [y[-1] + AFTER_M * np.sin(yaw1)]])
    at = s[0] + POINT_STEP_M * np.arange(int((s[-1] - s[0]) / POINT_STEP_M) + 1)
    points = np.column_stack([np.interp(at, s, x), np.interp(at, s, y)])
    return at, points, np.interp(at, s[1:-1], speed)


def _smoothed_road(xy: Array, sigma_m: Array) -> Array:
    """Return points (M, 2), 0.1 m apart, smoothed with a standard deviation (M,) that varies along them."""
    sigma = _averaged(np.clip(sigma_m, *SIGMA_M), SIGMA_AVERAGE_M / POINT_STEP_M)
    u = np.concatenate([[0.0], np.cumsum(2.0 * POINT_STEP_M / (sigma[1:] + sigma[:-1]))])
    even = np.linspace(0.0, u[-1], int(u[-1] * STEPS_PER_SIGMA) + 2)
    line = np.column_stack([np.interp(even, u, xy[:, 0]), np.interp(even, u, xy[:, 1])])
    from scipy.interpolate import CubicSpline  # 0.3 s to import: only a recorded drive pays for it

    road: Array = CubicSpline(even, smoothed(line, 1.0 / even[1]))(u)
    return road


def _averaged(values: Array, sigma: float) -> Array:
    """Return values (M,) averaged with a Gaussian of `sigma` steps, constant beyond the ends."""
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, sigma, mode="nearest"))


def smoothed(xy: Array, sigma: float) -> Array:
    """Return points (M, 2) smoothed along their order by the kernel of fourth order, `sigma` in points.

    Beyond its ends the line goes on by point reflection, which keeps a straight end straight.
    """
    reach = min(int(KERNEL_REACH * sigma), len(xy) - 1)
    u = np.arange(-reach, reach + 1) / sigma
    kernel = (3.0 - u**2) * np.exp(-(u**2) / 2.0)
    kernel /= kernel.sum()
    before = 2.0 * xy[0] - xy[reach:0:-1]
    after = 2.0 * xy[-1] - xy[-2 : -reach - 2 : -1]
    from scipy.signal import fftconvolve

    line: Array = fftconvolve(np.concatenate([before, xy, after]), kernel[:, None], mode="valid", axes=0)
    return line


def _stripes(config: LaidRoadConfig, kind: Kind, s_m: Array) -> list[tuple[Stripe, float, BoolArray]]:
    """Return place, shift to the left in metres and paint (M,) of each stripe of a border."""
    always = np.ones(len(s_m), dtype=bool)
    dashes: BoolArray = np.mod(s_m, config.dash_m + config.gap_m) < config.dash_m
    half = (config.double_gap_m + config.marking_width_m) / 2.0
    paint = {"solid": always, "road_edge": always, "none": ~always, "dashed": dashes, "botts_dots": dashes}
    if kind in paint:
        return [(Stripe.SINGLE, 0.0, paint[kind])]
    names = {"double_solid": "solid_solid", "double_dashed": "dashed_dashed"}.get(kind, kind).split("_")
    return [(Stripe.LEFT, half, paint[names[0]]), (Stripe.RIGHT, -half, paint[names[1]])]


def _marking(
    config: LaidRoadConfig,
    kind: Kind,
    line: Array,
    painted: BoolArray,
    number: int,
    group: int,
    stripe: Stripe,
) -> Marking:
    count = len(line)
    colour = Colour[config.colour.upper()]
    return Marking(
        id=number,
        group=group,
        stripe=stripe,
        points_world_m=_flat(line),
        painted=frozen(painted, np.bool_),
        kind=frozen(np.full(count, MarkingKind[kind.upper()]), np.uint8),
        colour=frozen(np.full(count, colour), np.uint8),
        width_m=frozen(np.full(count, config.marking_width_m)),
    )


def _flat(points_m: Array) -> Array:
    return frozen(np.column_stack([points_m, np.zeros(len(points_m))]))
