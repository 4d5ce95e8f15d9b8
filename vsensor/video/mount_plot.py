"""The mount in a picture: the lane that it means, drawn into the video; angles and width over time."""

from pathlib import Path
from typing import Any

import numpy as np

from vsensor.camera import Camera, CameraConfig, project
from vsensor.errors import ConfigError
from vsensor.pages import new_figure
from vsensor.transforms import transform
from vsensor.types import Array
from vsensor.video.camera_file import VideoCamera
from vsensor.video.mount import Found
from vsensor.video.types import Picture

SHOWN = 3
BEFORE, AFTER = "#D55E00", "#0072B2"
"""Told apart by the colour-blind (Okabe and Ito)."""


def draw_mount(path: Path, pictures: list[Picture], before: VideoCamera, found: Found) -> None:
    """Draw pictures with the straight lane that the mount before and after means; raises ConfigError."""
    figure = new_figure(12.0, 8.0, "a picture of the mount")
    grid = figure.add_gridspec(2, SHOWN)
    for column, picture in enumerate(pictures[:SHOWN]):
        _draw_picture(figure.add_subplot(grid[0, column]), picture, before, found)
    lanes, part = found.seen, found.camera.config.position_m[2] / before.config.position_m[2]
    rows = (
        ("pitch, deg", np.degrees(lanes.pitch_rad), found.pitch_deg.value),
        ("yaw and heading in the lane, deg", np.degrees(lanes.yaw_rad), found.yaw_deg.value),
        (
            "lane width, m",
            lanes.width_m * part,
            found.width_m.value,
        ),
    )
    for column, (name, values, value) in enumerate(rows):
        axes = figure.add_subplot(grid[1, column])
        axes.plot(lanes.t_s, values, ".", color="#999999", markersize=3, label="each picture")
        axes.axhline(value, color=AFTER, label="found")
        axes.set_xlabel("time, s")
        axes.set_ylabel(name)
        axes.legend(fontsize=8)
    try:
        figure.savefig(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror or error}") from None


def _draw_picture(axes: Any, picture: Picture, before: VideoCamera, found: Found) -> None:
    axes.imshow(picture.grey, cmap="gray", vmin=0, vmax=255)
    left_m = float(np.median(found.seen.left_m))
    at_start = float(np.median(found.seen.width_m))
    part = found.camera.config.position_m[2] / before.config.position_m[2]
    for camera, colour, name, scale in (
        (before, BEFORE, "before", 1.0),
        (found.camera, AFTER, "found", part),
    ):
        for offset in (left_m * scale, (left_m - at_start) * scale):
            u, v = _straight(camera.config, offset).T
            axes.plot(u, v, color=colour, linewidth=1.0, label=name)
            name = "_"
    axes.set_xlim(0, picture.grey.shape[1])
    axes.set_ylim(picture.grey.shape[0], 0)
    axes.set_title(f"{picture.t_ns / 1e9:.2f} s", fontsize=9)
    axes.axis("off")
    axes.legend(fontsize=7, loc="upper right")


def _straight(config: CameraConfig, y_m: float) -> Array:
    """Return pixels (N, 2) of a straight line ahead at `y_m` to the left."""
    camera = Camera.from_config(config)
    x = np.geomspace(4.0, 300.0, 60)
    points = np.column_stack([x, np.full(len(x), y_m), np.zeros(len(x))])
    return project(camera, transform(camera.camera_from_body, points))
