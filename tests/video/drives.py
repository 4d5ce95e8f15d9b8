"""Small made drives with exact truth: a road by its curvature, markings beside it, a vehicle along it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from tests.lines import tick
from tests.roads import box, marking
from vsensor.camera import Camera, CameraConfig
from vsensor.draws import Draws
from vsensor.image import ImageConfig, render
from vsensor.transforms import rotation_from_rpy
from vsensor.types import EgoState, Environment, GroundPaint, Light, Marking, Obstacle, Scene, Snapshot
from vsensor.video.types import Motion, Picture

AXLE_M = 2.776
"""Wheelbase of a Volvo V60 of 2014."""
EOR = CameraConfig(
    width_px=355,
    height_px=288,
    fx_px=255.82,
    fy_px=280.99,
    cx_px=179.39,
    cy_px=143.19,
    position_m=(AXLE_M - 1.0, 0.19, 1.36),
)
"""P2 tables 2.2 and 2.3; the camera 1 m behind the front axle."""
STEP_M = 0.1
DAY, IMAGE = Environment(), ImageConfig()


@dataclass(frozen=True)
class Line:
    """A marking beside the road's middle; dashes of `dash_m` every `every_m`; no paint in `gaps`."""

    y_m: float
    dash_m: float = 0.0
    every_m: float = 1.0
    width_m: float = 0.15
    wear: float = 0.0
    gaps: tuple[tuple[float, float], ...] = ()
    colour: int = 1

    def painted(self, s):
        here = (s % self.every_m < self.dash_m) if self.dash_m else np.ones(len(s), bool)
        for begin, end in self.gaps:
            here &= ~((s >= begin) & (s < end))
        return here


TWO_LANES = (Line(5.25), Line(1.75, dash_m=3.0, every_m=12.0), Line(-1.75, width_m=0.2))
"""The own lane to the right of a dashed line, an edge line on both sides of the road."""


def zero(_):
    return 0.0


@dataclass(frozen=True)
class Drive:
    """`curvature` of the road by distance (1/m); of time (s): `offset` of the vehicle, pitch and heave."""

    lines: tuple[Line, ...] = TWO_LANES
    curvature: Callable = zero
    offset: Callable = zero
    pitch_rad: Callable = zero
    roll_rad: Callable = zero
    heave_m: Callable = zero
    speed_mps: float = 22.0
    air: Environment = DAY
    image: ImageConfig = IMAGE
    camera: CameraConfig = EOR
    rate_hz: float = 10.0
    seed: int = 1
    start_m: float = 30.0
    traffic: tuple[tuple[float, float], ...] = ()
    crossings: tuple[float, ...] = ()
    stop_lines: tuple[float, ...] = ()

    def frames(self, count) -> Iterator["Frame"]:
        """Yield `count` frames from the drive's start."""
        eye = Camera.from_config(self.camera)
        draws = Draws(self.seed)
        length_m = self.start_m + self.speed_mps * count / self.rate_hz + 150.0
        s = STEP_M * np.arange(int(length_m / STEP_M))
        middle, heading = _course(self.curvature, s)
        markings = [_marking(line, n, s, middle, heading) for n, line in enumerate(self.lines)]
        for k in range(count):
            yield self._frame(eye, draws, k, s, middle, heading, markings)

    def _frame(self, eye, draws, k, s, middle, heading, markings) -> "Frame":
        t = k / self.rate_hz
        at = self.start_m + self.speed_mps * t
        n = int(at / STEP_M)
        slide = (self.offset(t + 1e-3) - self.offset(t - 1e-3)) / 2e-3
        x, y = (np.interp(at, s, middle[:, axis]) for axis in (0, 1))
        road = np.interp(at, s, heading)
        aside = self.offset(t)
        ego = EgoState(
            t_ns=round(t * 1e9),
            position_world_m=np.array([x - aside * np.sin(road), y + aside * np.cos(road), 0.0]),
            yaw_rad=road + np.arctan2(slide, self.speed_mps),
            speed_mps=self.speed_mps,
            yaw_rate_radps=self.speed_mps * self.curvature(at),
            body_pitch_rad=self.pitch_rad(t),
            body_roll_rad=self.roll_rad(t),
            body_heave_m=self.heave_m(t),
        )
        scene = Scene(
            markings=tuple(_part(one, n - 50, n + 1300) for one in markings),
            obstacles=tuple(self._traffic(at, s, middle, heading)),
            environment=self.air,
            ground=tuple(self._ground(s, middle, heading)),
        )
        shot = Snapshot(t_ns=ego.t_ns, ego=ego, scene=scene)
        period_ns = round(1e9 / self.rate_hz)
        grey = render(eye, self.image, shot, draws, tick(k, period_ns))
        picture = Picture(index=k, t_ns=ego.t_ns, grey=grey)
        known = Motion(speed_mps=ego.speed_mps, yaw_rate_radps=ego.yaw_rate_radps)
        return Frame(picture, known, shot, [line.width_m for line in self.lines])

    def _traffic(self, at, s, middle, heading) -> Iterator[Obstacle]:
        for number, (ahead, aside) in enumerate(self.traffic):
            place = at + ahead
            x, y = _beside(s, middle, heading, place, aside)
            yield box(x, y, number=number, yaw_rad=float(np.interp(place, s, heading)))

    def _ground(self, s, middle, heading) -> Iterator[GroundPaint]:
        for begin in self.crossings:
            for aside in np.arange(-3.4, 5.2, 1.0):
                yield _patch(s, middle, heading, (begin, begin + 3.0), (aside, aside + 0.5))
        for begin in self.stop_lines:
            yield _patch(s, middle, heading, (begin, begin + 0.5), (-1.7, 1.7))


@dataclass(frozen=True)
class Frame:
    picture: Picture
    motion: Motion
    snapshot: Snapshot
    widths_m: list

    def truth(self, axle_m=AXLE_M, within_m=20.0):
        """Return inner edges left and right at the front axle, NaN where no paint is within that of it."""
        found, seen = [np.inf, -np.inf], [False, False]
        ego = self.snapshot.ego
        rotation = rotation_from_rpy(0.0, 0.0, ego.yaw_rad)
        for one, width_m in zip(self.snapshot.scene.markings, self.widths_m, strict=True):
            points = (one.points_world_m - ego.position_world_m) @ rotation
            y = float(np.interp(axle_m, points[:, 0], points[:, 1]))
            ahead = points[:, 0] - axle_m
            side, edge = (0, y - width_m / 2) if y > 0.0 else (1, y + width_m / 2)
            if abs(edge) < abs(found[side]):
                found[side] = edge
                seen[side] = (one.painted & (ahead > 0.0) & (ahead < within_m)).any()
        return tuple(edge if is_seen else np.nan for edge, is_seen in zip(found, seen, strict=True))


def night(image=None):
    """Return the changes of a drive at night."""
    return dict(air=Environment(light=Light.NIGHT), image=image or ImageConfig())


def _course(curvature, s):
    bend = np.array([curvature(at) for at in s])
    heading = np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]) * STEP_M)])
    middle = 0.5 * (heading[1:] + heading[:-1])
    steps = STEP_M * np.column_stack([np.cos(middle), np.sin(middle)])
    return np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)]), heading


def _marking(line, number, s, middle, heading) -> Marking:
    points = middle + line.y_m * np.column_stack([-np.sin(heading), np.cos(heading)])
    painted = line.painted(s)
    return marking(points, number, painted=painted, width_m=line.width_m, colour=line.colour, wear=line.wear)


def _part(one: Marking, begin, end) -> Marking:
    part = slice(max(begin, 0), end)
    return replace(
        one,
        points_world_m=one.points_world_m[part],
        painted=one.painted[part],
        kind=one.kind[part],
        colour=one.colour[part],
        width_m=one.width_m[part],
    )


def _beside(s, middle, heading, at, aside):
    x, y = (np.interp(at, s, middle[:, axis]) for axis in (0, 1))
    road = np.interp(at, s, heading)
    return x - aside * np.sin(road), y + aside * np.cos(road)


def _patch(s, middle, heading, along, across) -> GroundPaint:
    corners = [(along[0], across[0]), (along[1], across[0]), (along[1], across[1]), (along[0], across[1])]
    points = np.array([(*_beside(s, middle, heading, *corner), 0.0) for corner in corners])
    return GroundPaint(points_world_m=points, colour=1)
