"""Pictures of what a method does, step by step, and of the lines that it found."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.camera import Camera, project
from vsensor.errors import ConfigError
from vsensor.image import import_opencv
from vsensor.pages import require_folder
from vsensor.transforms import transform
from vsensor.types import Array, Boundary, Side
from vsensor.video.types import Picture

Image = NDArray[Any]
Show = Callable[[Picture, str, Image | Callable[[], Image]], None]
"""Takes a picture, a step's name and its image (grey, BGR or a mask), or what makes that if it is wanted."""

COLOURS = {
    Side.LEFT: (255, 0, 255),
    Side.RIGHT: (255, 0, 255),
    Side.NEXT_LEFT: (255, 170, 0),
    Side.NEXT_RIGHT: (255, 170, 0),
}
"""BGR: P2 draws what the video says in magenta (fig. 2.18); the next lanes' lines are ours."""


def show_nothing(picture: Picture, step: str, image: Image | Callable[[], Image]) -> None:
    """Show nothing."""


class StepFolder:
    """Writes the image of every step of every `every`-th picture to FOLDER/INDEX_STEP.png."""

    def __init__(self, folder: Path, every: int = 1) -> None:
        """Make the folder; raises ConfigError, MissingExtraError."""
        self._cv2: Any = import_opencv("--steps")
        require_folder(folder)
        self._folder, self._every = folder, every

    def __call__(self, picture: Picture, step: str, image: Image | Callable[[], Image]) -> None:
        """Write one step; raises ConfigError where that cannot be."""
        if picture.index % self._every:
            return
        pixels = image() if callable(image) else image
        if pixels.dtype == np.bool_:
            pixels = pixels.astype(np.uint8) * 255
        path = self._folder / f"{picture.index:06}_{step}.png"
        if not self._cv2.imwrite(str(path), pixels):
            raise ConfigError(f"{path}: cannot be written")


def drawn_lines(image: Image, camera: Camera, lines: tuple[Boundary, ...]) -> Image:
    """Return the image (H, W) or (H, W, 3) with the lines drawn where `camera` sees them, as BGR."""
    cv2: Any = import_opencv("a picture of lines")
    drawn = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
    for line in lines:
        pixels = line_pixels(camera, line)
        cv2.polylines(
            drawn, [np.rint(pixels * 16).astype(np.int32)], False, COLOURS[line.side], 2, cv2.LINE_AA, 4
        )
    return np.asarray(drawn)


def line_pixels(camera: Camera, line: Boundary) -> Array:
    """Return pixels (N, 2) along a line's range, near the picture alone."""
    x_m = np.geomspace(max(line.x_min_m, 0.5), max(line.x_max_m, 1.0), 60)
    y_m = np.polynomial.polynomial.polyval(x_m, line.coefficients)
    points = np.column_stack([x_m, y_m, np.zeros_like(x_m)])
    pixels = project(camera, transform(camera.camera_from_body, points))
    width, height = camera.config.width_px, camera.config.height_px
    near = (np.abs(pixels) < 4 * max(width, height)).all(axis=1)  # not NaN either
    return pixels[near]
