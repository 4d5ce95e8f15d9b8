"""A video with its signals drawn: as it was seen, from above, and side by side (P2 2.6.2). Needs OpenCV.

picture ──────────────────────────► front view ─┐
   │    signals ──project──► pixels ──► drawn   ├──► side by side
   └──homography, interpolated──► top view ─────┘
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.camera import Camera, in_image, project
from vsensor.image import import_opencv
from vsensor.transforms import transform
from vsensor.types import Array
from vsensor.video.types import Picture

Pixels = NDArray[np.uint8]
Colour = tuple[int, int, int]

MAGENTA, GREEN, CYAN, ORANGE = (255, 0, 255), (0, 230, 0), (255, 220, 0), (0, 160, 255)
"""Blue, green, red. P2 draws the video's signal in magenta, the CAN bus's in green."""
METHOD_COLOURS = (MAGENTA, CYAN, ORANGE)
REFERENCE_PX = 5
"""A reference is drawn first and thicker, so that what is drawn upon it leaves its borders."""

AHEAD_M = 15.0
"""So far ahead of the front axle a signal is drawn, along the lane's direction."""
LEAST_HEIGHT_PX = 540
"""Smaller pictures are enlarged before anything is drawn."""
TOP_LATERAL_M = 7.5
TOP_AHEAD_M = 25.0
"""What is seen from above (P2 2.6.2.2): to either side, and ahead of the camera."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """Two offsets to be drawn: left and right at the front axle, positive to the left, NaN = none."""

    name: str
    colour: Colour
    left_m: float
    right_m: float
    heading_rad: float = 0.0
    thick_px: int = 2

    def points(self, axle_x_m: float) -> list[Array]:
        """Return the lines (K, 3) on the road, ego frame, that are known."""
        x = np.linspace(axle_x_m, axle_x_m + AHEAD_M, 61)
        slope = np.tan(self.heading_rad) if np.isfinite(self.heading_rad) else 0.0
        return [
            np.column_stack([x, offset + slope * (x - axle_x_m), np.zeros(len(x))])
            for offset in (self.left_m, self.right_m)
            if np.isfinite(offset)
        ]


class Views:
    """Draws the views of one camera; what a pixel of the top view is in the picture is found once."""

    def __init__(self, camera: Camera, axle_x_m: float) -> None:
        """Prepare; raises MissingExtraError without OpenCV."""
        self._cv2: Any = import_opencv("a view")
        self._camera, self._axle_x_m = camera, axle_x_m
        config = camera.config
        self._zoom = max(1, -(-LEAST_HEIGHT_PX // config.height_px))
        self._height_px = self._zoom * config.height_px
        self._per_m = self._height_px / TOP_AHEAD_M
        self._maps = self._top_maps()

    def front(self, picture: Picture, signals: Sequence[Signal]) -> Pixels:
        """Return the picture with the signals, enlarged where it is small."""
        cv2 = self._cv2
        image = cv2.resize(_bgr(picture), None, fx=self._zoom, fy=self._zoom, interpolation=cv2.INTER_CUBIC)
        for signal in signals:
            for points in signal.points(self._axle_x_m):
                pixels = project(self._camera, transform(self._camera.camera_from_body, points))
                seen = pixels[in_image(self._camera, pixels)]
                self._draw(image, (seen + 0.5) * self._zoom - 0.5, signal)
        return np.asarray(image, np.uint8)

    def top(self, picture: Picture, signals: Sequence[Signal]) -> Pixels:
        """Return the road from above, ahead is up, black where the camera does not see."""
        cv2 = self._cv2
        image = cv2.remap(_bgr(picture), *self._maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
        self._grid(image)
        for signal in signals:
            for points in signal.points(self._axle_x_m):
                self._draw(image, self._top_pixels(points), signal)
        return np.asarray(image, np.uint8)

    def both(self, picture: Picture, signals: Sequence[Signal]) -> Pixels:
        """Return front and top view side by side, with the time, the values and whose colour is whose."""
        image = np.hstack([self.front(picture, signals), self.top(picture, signals)])
        lines = [f"t = {picture.t_ns / 1e9:.2f} s"]
        lines += [f"{one.name}  {_metres(one.left_m)} | {_metres(one.right_m)}" for one in signals]
        colours = [(255, 255, 255), *(one.colour for one in signals)]
        for place, (text, colour) in enumerate(zip(lines, colours, strict=True)):
            self._text(image, text, (10, 24 + 24 * place), colour)
        return image

    def _top_maps(self) -> tuple[Any, Any]:
        """Return the pixel of the picture for each one from above: the road's homography, and the lens."""
        rows, columns = self._height_px, int(2 * TOP_LATERAL_M * self._per_m)
        ahead = (rows - 0.5 - np.arange(rows)) / self._per_m + self._camera.config.position_m[0]
        left = TOP_LATERAL_M - (np.arange(columns) + 0.5) / self._per_m
        x, y = np.meshgrid(ahead, left, indexing="ij")
        points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
        pixels = project(self._camera, transform(self._camera.camera_from_body, points))
        maps = np.where(np.isfinite(pixels), pixels, -10.0).astype(np.float32).reshape(rows, columns, 2)
        return maps[..., 0], maps[..., 1]

    def _top_pixels(self, points: Array) -> Array:
        ahead = points[:, 0] - self._camera.config.position_m[0]
        u = (TOP_LATERAL_M - points[:, 1]) * self._per_m - 0.5
        return np.column_stack([u, self._height_px - 0.5 - ahead * self._per_m])

    def _grid(self, image: Pixels) -> None:
        """Draw ticks every 5 m ahead of the camera, and the vehicle's centreline at the bottom."""
        for ahead in range(5, int(TOP_AHEAD_M), 5):
            v = int(self._height_px - 0.5 - ahead * self._per_m)
            self._cv2.line(image, (0, v), (8, v), (255, 255, 255), 1)
            self._text(image, f"{ahead} m", (12, v + 5), (255, 255, 255))
        u = int(TOP_LATERAL_M * self._per_m)
        self._cv2.line(image, (u, self._height_px - 16), (u, self._height_px - 1), (255, 255, 255), 1)

    def _draw(self, image: Pixels, pixels: Array, signal: Signal) -> None:
        if len(pixels) > 1:
            fixed = np.round(pixels * 16.0).astype(np.int32).reshape(-1, 1, 2)
            self._cv2.polylines(image, [fixed], False, signal.colour, signal.thick_px, self._cv2.LINE_AA, 4)

    def _text(self, image: Pixels, text: str, place: tuple[int, int], colour: Colour) -> None:
        font = self._cv2.FONT_HERSHEY_SIMPLEX
        for shade, step in (((0, 0, 0), 1), (colour, 0)):
            at = place[0] + step, place[1] + step
            self._cv2.putText(image, text, at, font, 0.55, shade, 1, self._cv2.LINE_AA)


def _bgr(picture: Picture) -> Pixels:
    return picture.bgr if picture.bgr is not None else np.repeat(picture.grey[:, :, None], 3, axis=2)


def _metres(value: float) -> str:
    return f"{value:+.2f} m" if np.isfinite(value) else "-"
