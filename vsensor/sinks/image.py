"""Images of a run: a PNG every so many ticks, a video of all of them. Needs OpenCV."""

import os
from pathlib import Path

import numpy as np

from vsensor.camera import Camera
from vsensor.draws import Draws
from vsensor.errors import ConfigError
from vsensor.image import Image, ImageConfig, import_opencv, render
from vsensor.sinks.video_file import VideoFile
from vsensor.types import NANOSECONDS_PER_SECOND, Output

_PNG_EFFORT = 1  # of 9: noise does not compress any further


class ImageSink:
    """Renders what the camera saw and writes it; whoever wants no image never loads OpenCV."""

    def __init__(
        self,
        camera: Camera,
        config: ImageConfig,
        draws: Draws,
        *,
        folder: Path | None = None,
        every: int = 25,
        video: Path | None = None,
        period_ns: int = 40_000_000,
    ) -> None:
        """Make the folder, open the video; raises ConfigError where that cannot be, MissingExtraError."""
        import_opencv("--images and --video" if folder and video else "an image")
        if camera.config.model == "none":
            raise ConfigError('[camera] model = "none" has no image; with "pinhole" it has')
        self._camera, self._config, self._draws = camera, config, draws
        self._folder, self._every = folder, every
        size = camera.config.width_px, camera.config.height_px
        rate_hz = NANOSECONDS_PER_SECOND / period_ns
        self._video = VideoFile(video, size, rate_hz, colour=config.channels == "rgb") if video else None
        if folder is not None:
            try:
                folder.mkdir(exist_ok=True)
            except OSError as error:
                raise ConfigError(f"{folder}: cannot be made: {error.strerror or error}") from None

    def write(self, output: Output) -> None:
        """Render one tick, if one of the two wants it; raises ConfigError where it cannot be written."""
        wants_file = self._folder is not None and output.tick.index % self._every == 0
        if not wants_file and self._video is None:
            return
        image = render(self._camera, self._config, output.seen, self._draws, output.tick)
        if self._video is not None:
            self._video.write(_bgr(image))
        if wants_file and self._folder is not None:
            write_png(self._folder / f"{output.tick.index:06d}.png", image)

    def close(self) -> None:
        """Finish the video and move it to its place."""
        if self._video is not None:
            self._video.close()


def write_png(path: Path, image: Image) -> None:
    """Write an image, grey or RGB, whole or not at all; raises ConfigError."""
    cv2 = import_opencv("a PNG")
    _, data = cv2.imencode(".png", _bgr(image), [cv2.IMWRITE_PNG_COMPRESSION, _PNG_EFFORT])
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        temporary.write_bytes(data.tobytes())
        temporary.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        temporary.unlink(missing_ok=True)


def _bgr(image: Image) -> Image:
    """Return the image as OpenCV writes it."""
    return image if image.ndim == 2 else np.ascontiguousarray(image[:, :, ::-1])
