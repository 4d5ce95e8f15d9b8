"""A video that is written image by image, whole or not at all. Needs OpenCV."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import ConfigError
from vsensor.image import Image, import_opencv

CODECS = {".mp4": "mp4v", ".avi": "FFV1"}
"""MPEG-4 is small and loses detail; FFV1 keeps every grey level, so that lanes can be measured in it."""


class VideoFile:
    """A video beside its place, moved there when it is whole. Odd sizes get one more row or column."""

    def __init__(self, path: Path, size: tuple[int, int], rate_hz: float, *, colour: bool) -> None:
        """Open a video of images `size` (width, height); raises ConfigError, MissingExtraError."""
        if path.suffix not in CODECS:
            raise ConfigError(f"{path}: a video ends in {', '.join(CODECS)}")
        self._cv2, self._path = import_opencv("a video"), path
        self._temporary = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
        self._frames = 0
        width, height = (length + length % 2 for length in size)
        self._writer: Any = self._cv2.VideoWriter(
            str(self._temporary),
            self._cv2.CAP_FFMPEG,
            self._cv2.VideoWriter_fourcc(*CODECS[path.suffix]),
            rate_hz,
            (width, height),
            colour,
        )
        if not self._writer.isOpened():
            self._temporary.unlink(missing_ok=True)
            raise ConfigError(f"{path}: cannot be written as a video of {width} x {height}")

    def write(self, image: Image) -> None:
        """Add an image: grey (H, W), or blue, green, red (H, W, 3)."""
        padding = [(0, size % 2) for size in image.shape[:2]] + [(0, 0)] * (image.ndim - 2)
        self._writer.write(np.pad(image, padding, mode="edge"))
        self._frames += 1

    def close(self) -> None:
        """Finish the video and move it to its place; raises ConfigError where the disk is full."""
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

    def __enter__(self) -> "VideoFile":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
