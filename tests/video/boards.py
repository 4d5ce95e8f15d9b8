"""Pictures of a chessboard as a known lens shows it, every pixel the mean of 3 x 3 rays."""

import cv2
import numpy as np

from vsensor.camera import Camera, CameraConfig, normalised
from vsensor.transforms import rotation_from_rpy

SQUARE_M = 0.1
FINE = 3


def board_picture(config: CameraConfig, centre_m, turn_deg, columns=9, rows=6):
    """Return a grey picture (H, W) of a board of inner corners, its middle at `centre_m` (optical frame).

    `turn_deg` are its roll, pitch and yaw; the board lies in its own x (right) and y (down).
    """
    camera = Camera.from_config(config)
    u, v = np.meshgrid(_fine(config.width_px), _fine(config.height_px))
    x, y = normalised(camera, np.array((u.ravel(), v.ravel())).T)
    rotation = rotation_from_rpy(*np.radians(turn_deg))
    normal, centre = rotation[:, 2], np.array(centre_m)
    depth = normal @ centre / (normal[0] * x + normal[1] * y + normal[2])
    apart = np.array((x * depth, y * depth, depth)) - centre[:, None]
    across, down = (rotation[:, :2].T @ apart) / SQUARE_M
    across, down = across + (columns + 1) / 2.0, down + (rows + 1) / 2.0
    board = (across > -1) & (across < columns + 2) & (down > -1) & (down < rows + 2) & (depth > 0)
    inside = (across > 0) & (across < columns + 1) & (down > 0) & (down < rows + 1)
    dark = inside & ((np.floor(across) + np.floor(down)) % 2 == 0)
    level = np.where(dark, 30.0, np.where(board, 220.0, 110.0))
    shape = config.height_px, FINE, config.width_px, FINE
    return np.rint(level.reshape(shape).mean(axis=(1, 3))).astype(np.uint8)


def _fine(size):
    return (np.arange(size * FINE) + 0.5) / FINE - 0.5


def write_boards(folder, config: CameraConfig, columns=9, rows=6, count=10, seed=1):
    """Write pictures of the board all over the image, from near and far, turned this way and that."""
    folder.mkdir(parents=True, exist_ok=True)
    draw = np.random.default_rng(seed)
    camera = Camera.from_config(config)
    for number in range(count):
        far = SQUARE_M * columns * camera.fx_px / config.width_px * draw.uniform(1.6, 2.6)
        u = config.width_px * (0.3 + 0.4 * (number % 3) / 2.0)
        v = config.height_px * (0.3 + 0.4 * (number // 3 % 3) / 2.0)
        centre = far * np.array(((u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px, 1.0))
        turn = draw.uniform((-42, -42, -8), (42, 42, 8))  # about x and y: tilted; about z: in the image
        cv2.imwrite(str(folder / f"board{number}.png"), board_picture(config, centre, turn, columns, rows))
    return folder
