"""`vsensor video view`: pictures and signals together, into a video or one picture."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.camera import Camera
from vsensor.errors import ConfigError, TableError
from vsensor.profile import Profile
from vsensor.sinks.image import write_png
from vsensor.sinks.video_file import VideoFile
from vsensor.types import NANOSECONDS_PER_SECOND, Array
from vsensor.video.camera_file import camera_of
from vsensor.video.can_signals import CanSignals, read_can
from vsensor.video.frames import PictureReader, open_pictures
from vsensor.video.rows import Rows, read_rows
from vsensor.video.types import Picture
from vsensor.video.views import GREEN, METHOD_COLOURS, REFERENCE_PX, Signal, Views

MOST_AWAY_S = 0.5
"""A row farther from a picture's time than this, or than half a period of the rows, is not drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewOptions:
    """What the command line says; `frame` is None for a video."""

    out: Path
    camera: str | None = None
    rows: tuple[Path, ...] = ()
    can: Path | None = None
    profiles: tuple[Profile, ...] = ()
    starts_at_log_s: float = 0.0
    view: str = "both"
    frame: int | None = None
    rate_hz: float | None = None
    limit: int | None = None
    progress: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewReport:
    """What was written, and sentences beside it."""

    line: str
    notes: tuple[str, ...]


def write_view(video: str, options: ViewOptions) -> ViewReport:
    """Write the views; raises ConfigError, VideoError, LogError, TableError, MissingExtraError."""
    if (options.frame is None) == (options.out.suffix == ".png"):
        raise ConfigError(f"{options.out}: a .png is one picture, --frame K; a video ends in .mp4 or .avi")
    can = None if options.can is None else read_can(options.can, options.profiles)
    tables = [(path, read_rows(path)) for path in options.rows]
    with open_pictures(video, options.rate_hz) as reader, ExitStack() as stack:
        camera, assumed = camera_of(options.camera, reader.size, video)
        views = Views(Camera.from_config(camera.config), camera.front_axle_x_m)
        draw = getattr(views, options.view)
        out: VideoFile | None = None
        written, last_s = 0, 0.0
        for picture in _wanted(reader, options):
            last_s = picture.t_ns / NANOSECONDS_PER_SECOND
            image = draw(picture, signals_at(last_s, tables, can, options.starts_at_log_s))
            if options.frame is not None:
                write_png(options.out, np.ascontiguousarray(image[:, :, ::-1]))
            else:
                if out is None:
                    size = image.shape[1], image.shape[0]
                    out = stack.enter_context(VideoFile(options.out, size, reader.rate_hz, colour=True))
                out.write(image)
            written += 1
        notes = [*([assumed] if assumed else []), *reader.notes]
    if not written:
        raise ConfigError(f"{video}: has no picture {options.frame}; counted from 0")
    if can is not None:
        can.require_overlap(options.starts_at_log_s, options.starts_at_log_s + last_s)
    return ViewReport(line=f"{options.out}: {written} picture{'s' * (written > 1)}", notes=tuple(notes))


def _wanted(reader: PictureReader, options: ViewOptions) -> Iterator[Picture]:
    pictures: Any = reader
    if options.progress:
        from tqdm import tqdm

        pictures = tqdm(reader, total=options.limit or reader.count, unit="picture")
    for picture in pictures:
        if options.frame is not None and picture.index < options.frame:
            continue
        if options.limit is not None and picture.index >= options.limit:
            return
        yield picture
        if options.frame is not None:
            return


def signals_at(
    t_s: float, tables: Sequence[tuple[Path, Rows]], can: CanSignals | None, starts_at_log_s: float
) -> list[Signal]:
    """Return the signals of a time of the video: each file of rows, then the CAN log's."""
    found = [
        _of_rows(path.stem, rows, t_s, METHOD_COLOURS[k % len(METHOD_COLOURS)])
        for k, (path, rows) in enumerate(tables)
    ]
    if can is not None:
        at = np.array([t_s + starts_at_log_s])
        left, right = (float(can.linear(f"{side}.lane_offset_m", at)[0]) for side in ("left", "right"))
        known = [one.heading_rad for one in found if one.heading_rad == one.heading_rad]
        heading = known[0] if known else 0.0
        told = Signal(
            name="CAN",
            colour=GREEN,
            left_m=left,
            right_m=right,
            heading_rad=heading,
            thick_px=REFERENCE_PX,
        )
        found.insert(0, told)
    return found


def _of_rows(name: str, rows: Rows, t_s: float, colour: tuple[int, int, int]) -> Signal:
    k = _nearest(name, rows.t_s, t_s)
    left, right, heading = (
        float(column[k]) if k is not None else float("nan")
        for column in (rows.left_offset_m, rows.right_offset_m, rows.heading_rad)
    )
    return Signal(name=name, colour=colour, left_m=left, right_m=right, heading_rad=heading)


def _nearest(name: str, times: Array, t_s: float) -> int | None:
    if not len(times):
        raise TableError(f"{name}: holds no row")
    k = int(np.abs(times - t_s).argmin())
    period_s = float(np.median(np.diff(times))) if len(times) > 1 else MOST_AWAY_S
    return k if abs(times[k] - t_s) <= min(MOST_AWAY_S, 0.51 * period_s) else None
