"""Pictures of a video, a folder of images, a pattern, or one image, in order and with their times.

A video's pictures have its own timestamps; images have none and are spaced by a rate. What is not as it seems
(a stated rate that is not the video's, images without one) is a sentence in `notes`, what cannot be used a
VideoError: a file that is no video, one without a picture, times that do not go on, sizes that differ.
"""

import re
from collections.abc import Iterator
from contextlib import suppress
from math import isfinite
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vsensor.errors import ConfigError, VideoError
from vsensor.image import import_opencv
from vsensor.video.types import Picture

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm")
IMAGES_RATE_HZ = 25.0
"""Images carry no time: without a rate they are taken to be a video of this one."""
SLOWEST_HZ, FASTEST_HZ = 0.01, 1000.0
RATE_TOLERANCE = 0.01
"""A stated rate that differs by more from a video's own is told."""
COLOUR_EVERY = 8
"""Of every so many rows and columns a pixel says whether a picture has colour."""

_Bgr = NDArray[np.uint8]


class _Source(Protocol):
    """Where pictures come from: `read` gives time in s (None = has none) and picture, None at the end."""

    rate_hz: float
    count: int | None

    def read(self) -> tuple[float | None, _Bgr] | None: ...

    def close(self) -> None: ...


class PictureReader:
    """Pictures one by one; `with` it. `size` is (width, height), `count` what the file says it holds.

    `rate_hz` is that of the times. `notes` are sentences for the user, complete when all has been read. It is
    read once: what is iterated again goes on where it was.
    """

    def __init__(self, name: str, source: _Source, rate_hz: float | None) -> None:
        """Read the first picture; raises VideoError where there is none, ConfigError for a useless rate."""
        self.name, self._source, self.count = name, source, source.count
        self.notes: list[str] = []
        self._own_times = rate_hz is None and source.rate_hz > 0.0
        self._index, self._t_ns, self._first_s = 0, -1, 0.0
        try:
            self.rate_hz = self._rate(rate_hz, source.rate_hz)
            self._next = source.read()
            if self._next is None:
                raise VideoError(f"{name}: holds no picture")
        except BaseException:
            source.close()
            raise
        height, width = self._next[1].shape[:2]
        self.size = width, height

    def _rate(self, said_hz: float | None, own_hz: float) -> float:
        if said_hz is None:
            return own_hz or self._assumed_rate()
        if not SLOWEST_HZ <= said_hz <= FASTEST_HZ:
            raise ConfigError(
                f"rate {said_hz:g}: {SLOWEST_HZ:g} to {FASTEST_HZ:g} pictures per second were expected"
            )
        if own_hz and abs(said_hz / own_hz - 1.0) > RATE_TOLERANCE:
            self.notes.append(
                f"{self.name}: has {own_hz:g} pictures/s by itself, the stated {said_hz:g} are taken"
            )
        return said_hz

    def _assumed_rate(self) -> float:
        if isinstance(self._source, _Video):
            raise VideoError(
                f"{self.name}: does not say how many pictures a second it has: --rate HZ was expected"
            )
        if self.count != 1:
            self.notes.append(
                f"{self.name}: images carry no time: {IMAGES_RATE_HZ:g} a second are assumed; "
                "--rate HZ says otherwise"
            )
        return IMAGES_RATE_HZ

    def __enter__(self) -> "PictureReader":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        self._source.close()

    def __iter__(self) -> Iterator[Picture]:
        """Yield the pictures; raises VideoError for one that does not fit the others."""
        while self._next is not None:
            time_s, bgr = self._next
            self._check_size(bgr)
            yield self._picture(self._time_ns(time_s), bgr)
            self._next = self._source.read()
        if self.count is not None and self._index < self.count:
            self.notes.append(f"{self.name}: ends after {self._index} of the {self.count} pictures it states")

    def _picture(self, t_ns: int, bgr: _Bgr) -> Picture:
        import cv2

        few = bgr[::COLOUR_EVERY, ::COLOUR_EVERY]
        is_grey = bool((few[..., 0] == few[..., 1]).all() and (few[..., 1] == few[..., 2]).all())
        grey = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY), np.uint8)
        picture = Picture(index=self._index, t_ns=t_ns, grey=grey, bgr=None if is_grey else bgr)
        self._index, self._t_ns = self._index + 1, t_ns
        return picture

    def _time_ns(self, time_s: float | None) -> int:
        if not self._own_times or time_s is None:
            return round(self._index * 1e9 / self.rate_hz)
        if self._index == 0:
            self._first_s = time_s
        t_ns = round((time_s - self._first_s) * 1e9)
        if t_ns <= self._t_ns:
            raise VideoError(
                f"{self.name}: picture {self._index} is of {t_ns / 1e9:.3f} s, the one before of "
                f"{self._t_ns / 1e9:.3f} s: times that go on were expected; --rate HZ takes them from a rate"
            )
        return t_ns

    def _check_size(self, bgr: _Bgr) -> None:
        height, width = bgr.shape[:2]
        if (width, height) != self.size:
            where = getattr(self._source, "last", None) or f"picture {self._index}"
            raise VideoError(
                f"{self.name}: {where} is {width} x {height}, the first one "
                f"{self.size[0]} x {self.size[1]}: one size was expected"
            )


def open_pictures(path: str | Path, rate_hz: float | None = None) -> PictureReader:
    """Open a video, a folder of images, a pattern such as `drive/*.png`, or one image. Needs OpenCV.

    `rate_hz` takes the place of a video's own times. Raises VideoError, MissingExtraError.
    """
    cv2 = import_opencv("reading a video")
    name = str(path)
    files = image_files(path)
    if files is None:
        return PictureReader(name, _Video(cv2, Path(path).expanduser()), rate_hz)
    return PictureReader(name, _Images(files), rate_hz)


def image_files(path: str | Path) -> list[Path] | None:
    """Return the images of a folder or pattern in the order of their numbers, an image alone; None: a video.

    Raises VideoError where nothing is there.
    """
    name, path = str(path), Path(path).expanduser()
    if path.is_dir():
        found = [file for file in path.iterdir() if _is_image(file)]
        if not found:
            raise VideoError(f"{name}: a folder without images ({' '.join(IMAGE_SUFFIXES)})")
        return sorted(found, key=_by_number)
    if path.is_file():
        return [path] if _is_image(path) else None
    if any(sign in name for sign in "*?["):
        found = [file for file in path.parent.glob(path.name) if file.is_file()]
        if not found:
            raise VideoError(f"{name}: no file fits this pattern")
        return sorted(found, key=_by_number)
    raise VideoError(f"{name}: no such file")


def read_image(path: Path) -> _Bgr:
    """Return an image (H, W, 3), blue first; raises VideoError where it is none."""
    cv2 = import_opencv("reading an image")
    try:
        data = np.fromfile(path, np.uint8)
    except OSError as error:
        raise VideoError(f"{path}: cannot be read: {error.strerror or error}") from None
    decoded: Any = None
    with suppress(cv2.error):  # of an empty file, or one with a size that no memory holds
        decoded = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    if decoded is None:
        raise VideoError(f"{path}: is empty" if not len(data) else f"{path}: not an image that can be read")
    return np.asarray(decoded, np.uint8)


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith(".")


def _by_number(path: Path) -> list[tuple[int, int, str]]:
    """Return a key by which frame2 stands before frame10."""
    words = re.split(r"(\d+)", path.name)
    return [(1, int(word), "") if word.isdigit() else (0, 0, word) for word in words]


class _Video:
    """A video by FFmpeg, quietly: what is wrong with it is said in our words."""

    def __init__(self, cv2: Any, path: Path) -> None:
        if not path.stat().st_size:
            raise VideoError(f"{path}: is empty")
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        self._capture: Any = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        self._at_ms = cv2.CAP_PROP_POS_MSEC
        if not self._capture.isOpened():
            raise VideoError(f"{path}: not a video that can be read")
        self.rate_hz = self._rate_hz(self._capture.get(cv2.CAP_PROP_FPS))
        count = self._capture.get(cv2.CAP_PROP_FRAME_COUNT)
        self.count: int | None = round(count) if isfinite(count) and 0 < count < 1e9 else None

    @staticmethod
    def _rate_hz(said_hz: float) -> float:
        return said_hz if isfinite(said_hz) and SLOWEST_HZ <= said_hz <= FASTEST_HZ else 0.0

    def read(self) -> tuple[float | None, _Bgr] | None:
        there, bgr = self._capture.read()
        return (float(self._capture.get(self._at_ms)) / 1e3, np.asarray(bgr, np.uint8)) if there else None

    def close(self) -> None:
        self._capture.release()


class _Images:
    """Images of files, one after the other."""

    def __init__(self, files: list[Path]) -> None:
        self.rate_hz = 0.0
        self.count: int | None = len(files)
        self._files, self.last = iter(files), ""

    def read(self) -> tuple[float | None, _Bgr] | None:
        path = next(self._files, None)
        if path is None:
            return None
        self.last = path.name
        return None, read_image(path)

    def close(self) -> None:
        pass
