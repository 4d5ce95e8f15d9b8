"""P1's own algorithms (section 2.1), ported equation by equation as references for ours.

P1's camera frame: x right, y up, looking along -z. Only what the errata decide differs from print:
alpha is the half horizontal angle, and tan(beta) = rows / columns * tan(alpha).
"""

from itertools import product

import numpy as np


def is_in_rectangle(w, v1, v2):
    """Return P1 eq. 2.12 for vectors `w` (N, 3) from a corner with the sides v1, v2 (broadcast to (N, 3))."""
    along_1, along_2 = (w * v1).sum(axis=-1), (w * v2).sum(axis=-1)
    length_1, length_2 = (v1 * v1).sum(axis=-1), (v2 * v2).sum(axis=-1)
    return (along_1 >= 0) & (along_2 >= 0) & (length_1 >= along_1) & (length_2 >= along_2)


def is_in_field_of_view(points, alpha, columns, rows, sight):
    """Return for points (N, 3) of P1's camera frame whether they are in the field of view, eq. 2.7-2.12."""
    tan_alpha = np.tan(alpha)
    tan_beta = rows / columns * tan_alpha  # eq. 2.1
    v_oe = np.array([0.0, 0.0, -sight])
    along = points @ v_oe
    visible = (along >= 0) & (v_oe @ v_oe >= along)  # eq. 2.7, 2.8
    b = np.linalg.norm(np.cross(v_oe, points), axis=1) / np.linalg.norm(v_oe)  # eq. 2.9
    h = np.linalg.norm(points, axis=1)  # eq. 2.10
    a = np.sqrt(np.maximum(h * h - b * b, 0.0))  # eq. 2.11
    corner_1 = np.column_stack([-a * tan_alpha, a * tan_beta, -a])
    corner_2 = np.column_stack([a * tan_alpha, a * tan_beta, -a])
    corner_3 = np.column_stack([-a * tan_alpha, -a * tan_beta, -a])
    return visible & is_in_rectangle(points - corner_1, corner_2 - corner_1, corner_3 - corner_1)


def hidden(origin, points, boxes):
    """Return for points (N, 3) whether a side of a box breaks the ray to `origin`, eq. 2.13-2.15.

    `boxes` are (centre, size, rotation frame_from_box). Normals 1 to 3 stand in corner 1, 4 to 6 in
    the corner opposite (fig. 2.11).
    """
    result = np.zeros(len(points), dtype=bool)
    u = origin - points
    for centre, size, rotation in boxes:
        sides = rotation * size  # columns: the box's edges
        for end, axis in product((-0.5, 0.5), range(3)):
            corner = centre + end * sides.sum(axis=1)
            v1, v2 = (-np.sign(end) * sides[:, other] for other in range(3) if other != axis)
            normal = np.cross(v1, v2)
            v = corner - points
            across = u @ normal
            crosses = across != 0.0
            s = (v @ normal) / np.where(crosses, across, 1.0)  # eq. 2.13
            crosses &= (s >= 0) & (s <= 1)  # eq. 2.14
            meeting = points + u * s[:, None]  # eq. 2.15
            result |= crosses & is_in_rectangle(meeting - corner, v1, v2)
    return result


def on_image_plane(points, focal):
    """Return u, v on the image plane of points (N, 3), eq. 2.16, 2.17 with the sign of 2.23."""
    x, y, z = points.T
    return -x * focal / z, -y * focal / z


def is_in_region(u, v, half_width, half_height):
    """Return which points of the image plane are in the image, eq. 2.18."""
    return (-half_width <= u) & (u <= half_width) & (-half_height <= v) & (v <= half_height)


def cell(u, v, half_width, half_height, columns, rows):
    """Return the place in the image matrix of eq. 2.19, 2.20 before they round: 0 is the left edge."""
    return (u + half_width) / (2 * half_width) * columns, (1 - (v + half_height) / (2 * half_height)) * rows


def from_cell(n, m, z, focal, half_width, half_height, columns, rows):
    """Return the points (N, 3) of places in the image matrix at depth z < 0, eq. 2.21-2.23."""
    u = 2 * n * half_width / columns - half_width
    v = 2 * half_height * (1 - m / rows) - half_height
    return np.column_stack([-u * z / focal, -v * z / focal, z])
