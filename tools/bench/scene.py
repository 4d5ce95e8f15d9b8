"""The reference scene: a bend in UTM coordinates, four lines of 1000 points, 50 vehicles on the move.

A circular road of 800 m radius, the ego on the middle of three lanes at 30 m/s. The vehicles of each
lane move at one speed on a ring of 150 m around the ego, so that there are always as many in view:

    lane       -2      -1      0 (ego's)      1      2
    vehicles   12      11        4            11     12
"""

from collections.abc import Sequence
from math import pi

import numpy as np

from vsensor.camera import Camera, camera_from_ego, in_image, project
from vsensor.line import Line
from vsensor.profile import load_profile
from vsensor.sensor import Sensor, SensorConfig
from vsensor.signals import VehicleConfig
from vsensor.sources import Inputs
from vsensor.state import StateConfig
from vsensor.transforms import transform
from vsensor.transmit import Transmitter
from vsensor.types import (
    Array,
    Colour,
    EgoState,
    Marking,
    MarkingKind,
    Obstacle,
    Scene,
    Snapshot,
    Stripe,
    Tick,
    frozen,
)

CENTRE_WORLD_M = np.array([6.9e5, 5.4e6, 310.0])
RADIUS_M = 800.0
SPEED_MPS = 30.0
LINES_M = (5.25, 1.75, -1.75, -5.25)
SPACING_M = 0.1
POINTS = 1000
RING_M, BEHIND_M = 150.0, 35.0
LANES = ((-7.0, 12, 4.0), (-3.5, 11, -2.0), (0.0, 4, 0.0), (3.5, 11, 3.0), (7.0, 12, -5.0))
"""Offset, number of vehicles, speed against the ego."""
CAR_M, VAN_M = (4.5, 1.8, 1.5), (6.0, 2.0, 2.6)


class ReferenceDrive:
    """The source of the reference scene: everything follows from the time, so the state is None."""

    notes: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    duration_s = float("inf")

    def __init__(self, points: int = POINTS, boxes: int | None = None) -> None:
        """Lay `points` per line over the same 100 m; of the vehicles the first `boxes` count."""
        self._points = points
        self._spacing_m = SPACING_M * POINTS / points
        self._count = round(2 * pi * RADIUS_M / self._spacing_m)
        along_m = self._spacing_m * np.arange(self._count + points)
        self._lines = [frozen(on_road(along_m, y)) for y in LINES_M]
        size = self._count + points
        self._painted = frozen(np.ones(size), bool)
        self._kind = frozen(np.full(size, MarkingKind.SOLID), np.uint8)
        self._colour = frozen(np.full(size, Colour.WHITE), np.uint8)
        self._width_m = frozen(np.full(size, 0.15))
        rows = [
            (offset, k * RING_M / n + 6.0, rate, VAN_M if k % 4 == 3 else CAR_M)
            for offset, n, rate in LANES
            for k in range(n)
        ][:boxes]
        self._offset_m, self._start_m, self._rate_mps = (np.array([row[k] for row in rows]) for k in range(3))
        self._sizes_m = [row[3] for row in rows]
        self._half_height_m = np.array([size_m[2] / 2 for size_m in self._sizes_m])

    def initial_state(self) -> None:
        """Return the state, which is nothing."""
        return None

    def advance(self, state: None, tick: Tick, inputs: Inputs) -> tuple[None, Snapshot]:
        """Return the truth at `tick.t_ns`."""
        t_s = tick.t_ns * 1e-9
        driven_m = SPEED_MPS * t_s
        first = int(driven_m / self._spacing_m) % self._count
        position = on_road(np.array([driven_m]), 0.0)[0]
        ego = EgoState(
            t_ns=tick.t_ns,
            position_world_m=frozen(position),
            yaw_rad=float(_heading(driven_m)),
            speed_mps=SPEED_MPS,
            yaw_rate_radps=SPEED_MPS / RADIUS_M,
            lateral_acceleration_mps2=SPEED_MPS**2 / RADIUS_M,
        )
        window = slice(first, first + self._points)
        markings = tuple(self._marking(number, window) for number in range(len(LINES_M)))
        scene = Scene(markings=markings, obstacles=self._obstacles(t_s, driven_m))
        return None, Snapshot(t_ns=tick.t_ns, ego=ego, scene=scene)

    def _marking(self, number: int, window: slice) -> Marking:
        return Marking(
            id=number,
            group=number,
            stripe=Stripe.SINGLE,
            points_world_m=self._lines[number][window],
            painted=self._painted[window],
            kind=self._kind[window],
            colour=self._colour[window],
            width_m=self._width_m[window],
        )

    def _obstacles(self, t_s: float, driven_m: float) -> tuple[Obstacle, ...]:
        ahead_m = (self._start_m + self._rate_mps * t_s) % RING_M - BEHIND_M
        along_m = driven_m + np.where((self._offset_m == 0.0) & (ahead_m < 20.0), ahead_m - 160.0, ahead_m)
        centres = on_road(along_m, self._offset_m, self._half_height_m)
        centres.flags.writeable = False
        return tuple(
            Obstacle(id=number, centre_world_m=centre, size_m=size_m, yaw_rad=yaw)
            for number, (centre, size_m, yaw) in enumerate(
                zip(centres, self._sizes_m, _heading(along_m).tolist(), strict=True)
            )
        )


def on_road(along_m: Array, left_m: Array | float, up_m: Array | float = 0.0) -> Array:
    """Return world points (N, 3) so far along the road and so far to the left of the ego's lane."""
    angle = along_m / RADIUS_M
    radius = RADIUS_M - left_m
    points = np.empty((len(along_m), 3))
    points[:, 0], points[:, 1], points[:, 2] = radius * np.cos(angle), radius * np.sin(angle), up_m
    return points + CENTRE_WORLD_M


def _heading(along_m):
    return np.remainder(along_m / RADIUS_M + pi / 2 + pi, 2 * pi) - pi


def reference_line(config: SensorConfig | None = None, drive: ReferenceDrive | None = None) -> Line:
    """Return the whole line on the reference scene: all stages at their defaults, native messages."""
    config, vehicle = config or SensorConfig(), VehicleConfig()
    return Line(
        source=drive or ReferenceDrive(),
        sensor=Sensor.of(config, seed=1),
        vehicle=vehicle,
        state_config=StateConfig(),
        transmitter=Transmitter(load_profile("native"), vehicle, config.camera.position_m[0]),
    )


def boxes_in_view(camera: Camera, snapshot: Snapshot) -> int:
    """Return how many obstacles have a corner in the image and their centre within 100 m."""
    return sum(
        1
        for box in snapshot.scene.obstacles
        if _is_in_view(camera, snapshot, corners_m(box) - snapshot.ego.position_world_m)
    )


def corners_m(box: Obstacle) -> Array:
    """Return the corners (8, 3) of an upright box in the world."""
    half = np.array(box.size_m) / 2
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    return (signs * half) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + box.centre_world_m


def _is_in_view(camera: Camera, snapshot: Snapshot, relative_m: Array) -> bool:
    c, s = np.cos(snapshot.ego.yaw_rad), np.sin(snapshot.ego.yaw_rad)
    in_ego = relative_m @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    optical = transform(camera_from_ego(camera, snapshot.ego), in_ego)
    ahead = optical[:, 2] > 0.5
    return bool(in_ego[:, 0].mean() < 100.0 and in_image(camera, project(camera, optical))[ahead].any())


def ticks_at(indices: Sequence[int], period_ns: int = 40_000_000) -> list[Tick]:
    """Return the ticks of these indices."""
    return [Tick(index=index, t_ns=index * period_ns, period_ns=period_ns) for index in indices]
