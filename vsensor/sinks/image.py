"""Images of a run: a PNG every so many ticks, a video of all of them. Needs OpenCV."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.camera import Camera
from vsensor.draws import Draws
from vsensor.errors import ConfigError
from vsensor.image import Image, ImageConfig, import_opencv, render
from vsensor.types import NANOSECONDS_PER_SECOND, Output

CODECS = {".mp4": "mp4v", ".avi": "FFV1"}
"""MPEG-4 is small and loses detail; FFV1 keeps every grey level, so that lanes can be measured in it."""

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
        self._cv2 = import_opencv("--images and --video" if folder and video else "an image")
        if camera.config.model == "none":
            raise ConfigError('[camera] model = "none" has no image; with "pinhole" it has')
        self._camera, self._config, self._draws = camera, config, draws
        self._folder, self._every = folder, every
        self._video = _Video(self._cv2, video, camera, config, period_ns) if video else None
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
            self._video.write(image)
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


class _Video:
    """A video beside its place, moved there when it is whole. Odd sizes get one more row or column."""

    def __init__(self, cv2: Any, path: Path, camera: Camera, config: ImageConfig, period_ns: int) -> None:
        if path.suffix not in CODECS:
            raise ConfigError(f"{path}: a video ends in {', '.join(CODECS)}")
        self._cv2, self._path = cv2, path
        self._temporary = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
        self._frames = 0
        width, height = (size + size % 2 for size in (camera.config.width_px, camera.config.height_px))
        self._writer: Any = cv2.VideoWriter(
            str(self._temporary),
            cv2.CAP_FFMPEG,
            cv2.VideoWriter_fourcc(*CODECS[path.suffix]),
            NANOSECONDS_PER_SECOND / period_ns,
            (width, height),
            config.channels == "rgb",
        )
        if not self._writer.isOpened():
            self._temporary.unlink(missing_ok=True)
            raise ConfigError(f"{path}: cannot be written as a video of {width} x {height}")

    def write(self, image: Image) -> None:
        padding = [(0, size % 2) for size in image.shape[:2]] + [(0, 0)] * (image.ndim - 2)
        self._writer.write(_bgr(np.pad(image, padding, mode="edge")))
        self._frames += 1

    def close(self) -> None:
        if self._writer is None:
            return
        self._writer.release()
        self._writer = None
        try:
            if not self._frames:
                return  # a run without a tick leaves no video
            held = int(self._cv2.VideoCapture(str(self._temporary)).get(self._cv2.CAP_PROP_FRAME_COUNT))
            if held != self._frames:  # the writer does not say when the disk is full
                raise ConfigError(f"{self._path}: holds {held} of {self._frames} images: is the disk full?")
            self._temporary.replace(self._path)
        except OSError as error:
            raise ConfigError(f"{self._path}: cannot be written: {error.strerror or error}") from None
        finally:
            self._temporary.unlink(missing_ok=True)


def _bgr(image: Image) -> Image:
    """Return the image as OpenCV writes it."""
    return image if image.ndim == 2 else np.ascontiguousarray(image[:, :, ::-1])
