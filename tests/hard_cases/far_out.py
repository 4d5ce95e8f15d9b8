"""World coordinates of 1e5 to 1e7 m: near, camera, occlusion, fit, frames."""

from functools import cache

import numpy as np

from tests.hard_cases import chain, exact
from tests.hard_cases.exact import Row
from tests.roads import box, ego, marking, snapshot
from vsensor.camera import CameraConfig
from vsensor.error_model import ErrorModelConfig
from vsensor.scene import SceneConfig, near, world_from_ego
from vsensor.transforms import transform
from vsensor.types import Scene

DISTANCES_M = (1e5, 1e6, 1e7)
ATTITUDE = {"roll_rad": 0.02, "pitch_rad": -0.03, "yaw_rad": 0.7}
EXACT = {"camera": CameraConfig(pixel_grid=False), "error_model": ErrorModelConfig(mode="none")}
GRAIN_M = 2.0**-20
"""Coordinates that are whole multiples of this have no rounding up to 4e9 m."""


def place(distance_m):
    """Return an origin as far out: east and north each, and 800 m up."""
    return np.array([distance_m, -0.8 * distance_m, 800.0]) if distance_m else np.zeros(3)


def scene_at(origin, grain_m=0.0):
    """Return four bending lines and traffic around a vehicle at `origin`; all coordinates on a grain."""

    def grained(points):
        return np.rint(points / grain_m) * grain_m if grain_m else points

    vehicle = ego(**ATTITUDE)
    x = np.arange(-200, 1300) / 10.0 + 0.04  # none at the window's edges, where rounding would decide
    bend = 2e-4 * x * x + 1e-6 * x**3
    pose = world_from_ego(vehicle)
    lines = [
        marking(grained(transform(pose, np.column_stack([x, y + bend, 0.0 * x]))) + origin, number)
        for number, y in enumerate((1.8, -1.7, 5.4, -5.3))
    ]
    cars = [(25.0, -3.5), (40.0, 4.1), (60.0, 0.5), (80.0, -4.0), (33.0, 7.5)]
    boxes = [
        box(*(grained(transform(pose, np.array([[*at, 0.75]]))[0]) + origin), number=number, yaw_rad=0.65)
        for number, at in enumerate(cars)
    ]
    return snapshot(lines, boxes, ego(origin, **ATTITUDE))


def ulp_m(distance_m):
    """Return the distance of neighbouring float64 numbers at a coordinate."""
    return float(np.spacing(distance_m))


@cache
def sensed(distance_m):
    return chain.shown(scene_at(place(distance_m)), **EXACT)[0]


def arithmetic_error_m(distance_m):
    """Return how far the points of `near` are from 120 digits on the same coordinates; every 40th."""
    shot = scene_at(place(distance_m))
    found = near(SceneConfig(), shot.ego, Scene(markings=shot.scene.markings))
    turn = exact.rotation(*ATTITUDE.values())
    differences = []
    for row in range(0, len(found.index), 40):
        line = int(np.searchsorted(found.starts, row, side="right")) - 1
        world = shot.scene.markings[int(found.marking[line])].points_world_m[found.index[row]]
        true = exact.in_frame(turn, shot.ego.position_world_m, world)
        differences += list(true - exact.matrix(found.points_ego_m[row]))
    return exact.largest(differences)


def reported_difference_m(distance_m):
    """Return how far the reported lines are from those at the origin, over their view ranges."""
    worst = 0.0
    for here in sensed(0.0).estimate.boundaries:
        there = sensed(distance_m).estimate.on(here.side)
        x = np.linspace(here.x_min_m, here.x_max_m, 9)
        worst = max(
            worst, np.abs(np.polynomial.polynomial.polyval(x, here.coefficients - there.coefficients)).max()
        )
    return float(worst)


def differing_reasons(distance_m):
    """Return for how many points another reason is given than at the origin."""
    return float((sensed(0.0).observation.reason != sensed(distance_m).observation.reason).sum())


def differing_frames(distance_m):
    """Return how many of the frames differ from those at the origin, coordinates without rounding, all on."""
    frames = [chain.bits(chain.shown(scene_at(place(d), GRAIN_M), ticks=5)[0]) for d in (0.0, distance_m)]
    return float(sum(a != b for a, b in zip(*frames, strict=True)))


def rows():
    found = []
    for distance_m in DISTANCES_M:
        case = f"world coordinates of {distance_m:.0e} m"
        rounding = ulp_m(distance_m)
        found += [
            # three products of up to 100 m and their sums, each rounded to 2^-53
            Row(case, "points near the vehicle", arithmetic_error_m(distance_m), "m", 5e-14, "120 digits"),
            # vehicle and point are each rounded by up to half a unit in each of x, y
            Row(
                case, "reported lines", reported_difference_m(distance_m), "m", 2 * rounding, "at the origin"
            ),
            Row(case, "points seen otherwise", differing_reasons(distance_m), "points", 0.0, "at the origin"),
            Row(case, "frames that differ", differing_frames(distance_m), "frames", 0.0, "at the origin"),
        ]
    return found
