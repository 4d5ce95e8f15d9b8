"""Angles at their ends: yaw at +-pi, pitch at +-90 degrees of ego and camera, gimbal lock."""

from math import nextafter, pi

import numpy as np

from tests.hard_cases import chain, exact
from tests.hard_cases.exact import Row
from tests.hard_cases.far_out import EXACT
from tests.roads import ego, marking, snapshot, straight
from vsensor.camera import Camera, CameraConfig, camera_from_ego, project, unproject
from vsensor.scene import world_from_ego
from vsensor.transforms import rotation_from_rpy, rpy_from_rotation, transform
from vsensor.types import EgoState, Side, frozen

HALF_TURNS = (pi, -pi, nextafter(pi, 4.0), nextafter(-pi, -4.0), 3 * pi, 1_000_001 * pi)
LOCKS = tuple(sign * pi / 2 - sign * 10.0**-k for sign in (1, -1) for k in (*range(1, 17), 400))
ATTITUDES = (
    *((0.0, 0.0, yaw) for yaw in (pi, -pi, pi / 2, -pi / 2)),
    *((0.0, pitch, yaw) for pitch in (pi / 2, -pi / 2) for yaw in (0.0, pi, 1.0)),
    (pi, 0.0, 0.0),
    (0.3, nextafter(pi / 2, 0.0), -pi),
)
TURN = rotation_from_rpy(0.5, -0.8, 2.0)
"""Turned by it and back, a rotation's elements have errors of 1e-16 of 1 and no longer of themselves."""
LINES = {Side.LEFT: 1.8, Side.RIGHT: -1.7, Side.NEXT_LEFT: 5.4, Side.NEXT_RIGHT: -5.3}


def turned_road(roll, pitch, yaw):
    """Return the straight lines of a road that stands in space as its vehicle does."""
    vehicle = ego((3.0, -2.0, 1.0), roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)
    pose = world_from_ego(vehicle)
    lines = []
    for number, y in enumerate(LINES.values()):
        x = np.arange(-200, 1200) / 10.0
        points = np.column_stack([x, y + 2e-4 * x * x, 0.0 * x])
        lines.append(marking(transform(pose, points), number))
    return snapshot(lines, (), vehicle)


def reported_error_m():
    """Return how far reported lines are from the true ones up to 100 m, in every attitude of the vehicle."""
    worst = 0.0
    for attitude in ATTITUDES:
        output, _ = chain.shown(turned_road(*attitude), **EXACT)
        for side, y in LINES.items():
            found = np.polynomial.Polynomial(output.estimate.on(side).coefficients)
            worst = max(worst, *(abs(found(x) - y - 2e-4 * x * x) for x in (10.0, 50.0, 100.0)))
    return float(worst)


def rotation_error():
    """Return the largest error of a rotation's elements, angles of both half turns and both locks."""
    angles = [(0.4, pitch, yaw) for pitch in (*LOCKS, 0.0) for yaw in HALF_TURNS]
    return max(exact.largest(exact.rotation(*rpy) - exact.matrix(rotation_from_rpy(*rpy))) for rpy in angles)


def lock_error():
    """Return how far the rotation of the angles found is from the one they were found from, near lock."""
    worst = 0.0
    for pitch in LOCKS:
        for roll, yaw in ((0.4, 1.0), (-3.0, 2.9), (3.0, -0.1)):
            given = TURN.T @ (TURN @ rotation_from_rpy(roll, pitch, yaw))
            back = exact.rotation(*rpy_from_rotation(given))
            worst = max(worst, exact.largest(back - exact.matrix(given)))
    return worst


def pitched_camera_error_px():
    """Return the error of the pixels of road points before cameras that look straight down and up."""
    worst = 0.0
    vehicle = EgoState(t_ns=0, position_world_m=frozen([0, 0, 0]), speed_mps=0.0, body_pitch_rad=1e-3)
    for degrees, height in ((90.0, 0.0), (-90.0, 9.0)):
        config = CameraConfig(hfov_deg=52.0, pitch_deg=degrees, yaw_deg=180.0, roll_deg=-180.0)
        camera = Camera.from_config(config)
        points = np.array([[x, y, height] for x in (1.5, 1.9, 2.5) for y in (-0.5, 0.0, 0.4)])
        to_camera = camera_from_ego(camera, vehicle)
        pixels = project(camera, transform(to_camera, points))
        for point, pixel in zip(points, pixels, strict=True):
            worst = max(
                worst, exact.largest(_true_pixel(config, camera, vehicle, point) - exact.matrix(pixel))
            )
    return worst


def _true_pixel(config, camera, vehicle, point):
    """Return the pixel by the plain chain of frames, angles in degrees made exact."""
    body = exact.rotation(0, vehicle.body_pitch_rad, 0)
    degree = exact.mp.pi / 180
    mount = exact.rotation(
        *(exact.mp.mpf(a) * degree for a in (config.roll_deg, config.pitch_deg, config.yaw_deg))
    )
    forward, left, up = mount.T * (body.T * exact.matrix(point) - exact.matrix(config.position_m))
    focal = exact.mp.mpf(config.width_px) / (2 * exact.mp.tan(exact.mp.mpf(config.hfov_deg) * degree / 2))
    return exact.matrix([0, 0]) + exact.mp.matrix(
        [-left / forward * focal + camera.cx_px, -up / forward * focal + camera.cy_px]
    )


def optical_centre_errors():
    """Return relative errors of pixels, and of points brought back, at depths of 1e-8 to 1e6 m."""
    camera = Camera.from_config(CameraConfig())
    depths, sides = 10.0 ** np.arange(-8, 7), np.array([-1e4, -3.0, 1e-6, 0.2, 700.0])
    points = np.array([[x, 0.7 * x + 0.1, z] for z in depths for x in sides])
    pixels = project(camera, points)
    there = back = 0.0
    for point, pixel, again in zip(points, pixels, unproject(camera, pixels, points[:, 2]), strict=True):
        x, y, z = exact.matrix(point)
        for value, offset, found in ((x, camera.cx_px, pixel[0]), (y, camera.cy_px, pixel[1])):
            steep = camera.fx_px * value / z
            there = max(
                there, float(abs(steep + offset - exact.mp.mpf(float(found))) / (abs(steep) + offset))
            )
        back = max(back, float(np.abs(again - point).max() / (np.abs(point).max() + point[2])))
    return there, back


def differing_half_turns():
    """Return how many frames differ between a heading of pi and of -pi, all on."""
    lines = [straight(y, number, start=-120.0, stop=20.0) for number, y in enumerate(LINES.values())]
    shots = [snapshot(lines, (), ego(yaw_rad=yaw)) for yaw in (pi, -pi)]
    first, second = (chain.bits(chain.shown(shot, ticks=5)[0]) for shot in shots)
    return float(sum(a != b for a, b in zip(first, second, strict=True)))


def rows():
    there, back = optical_centre_errors()
    lock = "gimbal lock, pitch within 0 to 0.1 rad of +-90 degrees"
    return [
        # a cubic through points of 100 m, rounded to 1e-14 m
        Row(
            "yaw +-pi, pitch +-90 degrees (vehicle)",
            "reported lines",
            reported_error_m(),
            "m",
            1e-13,
            "closed form",
        ),
        Row("yaw pi against -pi", "frames that differ", differing_half_turns(), "frames", 0.0, "each other"),
        # three products of numbers up to 1; an angle, however large, counts as it is
        Row("half turns and locks", "elements of the rotation", rotation_error(), "", 5e-16, "120 digits"),
        # below a cosine of 1e-12 roll is taken as 0
        Row(lock, "rotation from the angles found", lock_error(), "", 2e-12, "120 digits"),
        Row("camera pitched by +-90 degrees", "pixels", pitched_camera_error_px(), "px", 2e-12, "120 digits"),
        Row("depth of 1e-8 to 1e6 m", "pixels, relative", there, "", 5e-16, "120 digits"),
        Row("depth of 1e-8 to 1e6 m", "points brought back, relative", back, "", 5e-16, "the points"),
    ]
