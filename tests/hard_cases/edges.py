"""Occlusion at edges: how far from the box's surface an answer is ever wrong, in metres.

Each point is judged in 120 digits too. Where the answers differ, the box is grown or shrunk until the
exact answer is the one found: by so much the answer is wrong.
"""

import numpy as np

from tests.hard_cases import exact
from tests.hard_cases.exact import Row
from tests.roads import box
from vsensor.raycast import FAR_LIMIT, boxes_in, hidden
from vsensor.transforms import Rigid, rotation_from_rpy

EYE = np.array([1.9, 0.1, 1.35])
TURNS = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.3), (0.02, -0.05, 1.0))
STEPS_M = np.array([sign * 10.0**-k for k in range(1, 17) for sign in (1, -1)] + [0.0])
BANDS_M = 10.0 ** np.arange(-17.0, 1.0, 0.25)
HERE = Rigid(np.eye(3), np.zeros(3))
METHODS = {"shadow": 1e-13, "embree": 1e-5}
"""Each method's bound in m: some units in the last place of 100 m, 1.4e-14 in float64, 7.6e-6 in float32."""


def placed(turn, at, size):
    """Return a box with its centre at `at` from the camera, in axes turned by `turn`, that has those axes."""
    roll, pitch, yaw = turn
    centre = EYE + rotation_from_rpy(*turn) @ np.array(at, dtype=float)
    return box(*centre, size=size, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)


def beyond(turn, points):
    """Return points (N, 3) given from the camera in turned axes."""
    return EYE + np.array(points, dtype=float) @ rotation_from_rpy(*turn).T


def side_plane(turn):
    """The camera is in the plane of the box's left side; points to both sides of that plane behind it."""
    wall = placed(turn, (28.0, -1.0, -0.35), (20.0, 2.0, 4.0))
    return wall, beyond(turn, [(d, s, -0.3) for d in (20.0, 38.5, 90.0) for s in STEPS_M])


def along_edge(turn):
    """The camera is on the line of the box's upper left edge; points all around that line."""
    wall = placed(turn, (28.0, -1.0, -2.0), (20.0, 2.0, 4.0))
    around = [(1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (1, 0), (0, -1)]
    return wall, beyond(
        turn, [(d, y * s, z * s) for d in (30.0, 60.0) for y, z in around for s in STEPS_M[::2]]
    )


def through_edges(turn):
    """Rays that pass the edges and corners of the outline of a box straight ahead, in and out."""
    block = placed(turn, (30.0, 0.0, 0.0), (4.0, 2.0, 2.0))
    ring = [(1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (0.3, 1)]
    return block, beyond(turn, [(84.0, 3 * y * (1 + s), 3 * z * (1 + s)) for y, z in ring for s in STEPS_M])


def sheet_across(turn):
    """A box without thickness, seen from the front; points about its rim and before and behind it."""
    sheet = placed(turn, (30.0, 0.0, 0.0), (0.0, 2.0, 2.0))
    rim = [(60.0, 2 + s, 0.2) for s in STEPS_M] + [(60.0, 0.2, -2 - s) for s in STEPS_M]
    return sheet, beyond(turn, [*rim, (29.0, 0, 0), (31.0, 0, 0)])


def sheet_edge_on(turn):
    """A box without thickness, seen along its plane; points to both sides of it."""
    sheet = placed(turn, (30.0, 0.0, 0.0), (10.0, 0.0, 3.0))
    return sheet, beyond(turn, [(60.0, s, 0.1) for s in STEPS_M])


def inverted(turn):
    """A box of negative sizes is its mirror image."""
    _, points = through_edges(turn)
    return placed(turn, (30.0, 0.0, 0.0), (-4.0, -2.0, -2.0)), points


def own_face(turn):
    """Points before, on and behind the near face of their own box, at 5 and 95 m."""
    block = placed(turn, (55.0, 0.0, 0.0), (100.0, 9.0, 9.0))
    spots = [(5 + s, y, -0.5) for s in STEPS_M for y in (-0.3, 0.0, 0.4)]
    return block, beyond(turn, [*spots, (6.0, 0, 0), (95.0, 1, 1), (104.9, 0, 0), (4.9, 0, 0)])


def around_camera(turn):
    """The camera is in the box, and just inside each of its faces: nothing is seen, inside or outside."""
    return placed(turn, (0.0, 0.5, -0.35), (4.0, 1.0 + 2e-12, 3.0)), beyond(
        turn, [(50.0, 0, 0), (1.0, 0, 0), (0.5, 0.2, -1), (-9.0, 0, 0), (0.0, 30.0, 0), (0.0, 0, -1.35)]
    )


CASES = {
    "camera in the plane of a box's side": side_plane,
    "rays along a box's edge": along_edge,
    "rays through edges and corners": through_edges,
    "box without thickness, from the front": sheet_across,
    "box without thickness, edge-on": sheet_edge_on,
    "box of negative size": inverted,
    "points at the near side of their own box, and inside": own_face,
    "box around the camera": around_camera,
}


def wrong_by_m(obstacle, points, method):
    """Return by how much the box must be moved, at most, for each answer to be the exact one."""
    found = hidden(EYE, points, boxes_in(HERE, [obstacle]), method)
    turn = exact.rotation(obstacle.roll_rad, obstacle.pitch_rad, obstacle.yaw_rad)
    solid = (obstacle.centre_world_m, obstacle.size_m, turn)
    return max(
        point_wrong_by_m(point, bool(is_hidden), solid)
        for point, is_hidden in zip(points, found, strict=True)
    )


def point_wrong_by_m(point, found, solid):
    def answer(grown_m):
        return exact.is_hidden(EYE, point, solid, grown_m, FAR_LIMIT)

    if answer(0.0) == found:
        return 0.0
    sign = 1.0 if found else -1.0
    return next((float(band) for band in BANDS_M if answer(sign * band) == found), np.inf)


def rows():
    return [
        Row(
            case,
            f"distance from the surface where the answer is wrong, {method}",
            max(wrong_by_m(*make(turn), method) for turn in TURNS),
            "m",
            bound,
            "120 digits",
        )
        for case, make in CASES.items()
        for method, bound in METHODS.items()
    ]
