"""Events cut out of a long drive: a folder each, with the log's and the video's part and who took them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.errors import ConfigError
from vsensor.logs import open_log_writer, read_log
from vsensor.pages import require_folder
from vsensor.sinks.video_file import VideoFile
from vsensor.study.table import replace_file
from vsensor.types import NANOSECONDS_PER_SECOND
from vsensor.video.camera_file import VideoCamera, camera_text
from vsensor.video.can_signals import CanSignals
from vsensor.video.event_folder import FILE, SCHEMA
from vsensor.video.events import Event
from vsensor.video.frames import PictureReader, open_pictures
from vsensor.video.types import Picture


@dataclass(frozen=True, slots=True, kw_only=True)
class CutOptions:
    """Where to, and which video began when after the log's first frame."""

    out: Path
    video: str | None = None
    starts_at_log_s: float = 0.0
    profiles: tuple[str, ...] = ("p2",)
    progress: bool = False


def cut_events(
    can: CanSignals, events: Sequence[Event], camera: VideoCamera | None, options: CutOptions
) -> list[str]:
    """Write a folder for each event that the video has, and return sentences for the user.

    Raises ConfigError without video or camera, LogError or VideoError where one cannot be read, or the two do
    not overlap.
    """
    if options.video is None or camera is None:
        raise ConfigError("--out: events for vsensor video evaluate need --video and --camera")
    require_folder(options.out)
    with open_pictures(options.video) as reader:
        if reader.size != camera.size:
            raise ConfigError(
                f"{options.video}: is {reader.size[0]} x {reader.size[1]}, the camera {camera.size[0]} x "
                f"{camera.size[1]}: one size was expected"
            )
        cut = _Cutter(can, camera, options, reader)
        last_s = cut.follow(events)
    can.require_overlap(options.starts_at_log_s, options.starts_at_log_s + last_s)
    missed = len(events) - len(cut.written)
    notes = [f"{len(cut.written)} events written to {options.out}"]
    return notes + ([f"{missed} events are not wholly in the video"] if missed else [])


class _Cutter:
    """Goes once through the video; events come in order and do not overlap."""

    def __init__(
        self, can: CanSignals, camera: VideoCamera, options: CutOptions, reader: PictureReader
    ) -> None:
        self._table = read_log(can.path)
        self._camera, self._options, self._reader = camera, options, reader
        self.written: list[Path] = []

    def follow(self, events: Sequence[Event]) -> float:
        """Write the events that the video has wholly; returns the time of its last picture in s."""
        begin_s, at_s = self._options.starts_at_log_s, 0.0
        waiting = [(k, event) for k, event in enumerate(events) if event.begins_s >= begin_s - 1e-6]
        pictures = self._pictures()
        for number, event in waiting:
            at_s = self._write(number, event, pictures, begin_s)
        for picture in pictures:
            at_s = picture.t_ns / NANOSECONDS_PER_SECOND
        return at_s

    def _pictures(self) -> Iterator[Picture]:
        if not self._options.progress:
            yield from self._reader
            return
        from tqdm import tqdm

        yield from tqdm(self._reader, total=self._reader.count, unit="picture")

    def _write(self, number: int, event: Event, pictures: Iterator[Picture], begin_s: float) -> float:
        """Write one event from where the video is; returns the time of the last picture read, in s."""
        folder, period_s = self._options.out / f"event_{number:04d}", 1.0 / self._reader.rate_hz
        video, frames, at_s, first_s = None, 0, 0.0, 0.0
        for picture in pictures:
            at_s = picture.t_ns / NANOSECONDS_PER_SECOND
            if begin_s + at_s < event.begins_s - 1e-6:
                continue
            if video is None:
                require_folder(folder)
                first_s, is_colour = begin_s + at_s, picture.bgr is not None
                video = VideoFile(
                    folder / "video.avi", self._reader.size, self._reader.rate_hz, colour=is_colour
                )
            video.write(_as(picture, is_colour))
            frames += 1
            if begin_s + at_s + period_s >= event.ends_s - 1e-6:
                video.close()
                log_s = self._write_log(folder / "can.blf", event)
                text = self._text(folder.name, frames, first_s - log_s, event)
                replace_file(folder / FILE, text.encode())
                self.written.append(folder)
                return at_s
        if video is not None:  # it ends within the event
            video.close()
            (folder / "video.avi").unlink(missing_ok=True)
            folder.rmdir()
        return at_s

    def _write_log(self, path: Path, event: Event) -> float:
        """Write the event's part of the log; returns the time of its first frame in s of the whole."""
        begin_ns = self._table.report.first_ns
        low, high = (begin_ns + round(s * NANOSECONDS_PER_SECOND) for s in (event.begins_s, event.ends_s))
        chosen = (self._table.t_ns >= low) & (self._table.t_ns <= high)
        columns = self._table.columns.taken(chosen)
        with open_log_writer(path, self._table.channel_names) as writer:
            writer.write_columns(columns)
        return float(np.min(columns.t_ns) - begin_ns) / NANOSECONDS_PER_SECOND

    def _text(self, name: str, frames: int, starts_s: float, event: Event) -> str:
        profiles = [
            str(Path(one).resolve()) if Path(one).is_file() else one for one in self._options.profiles
        ]
        said: dict[str, Any] = {
            "schema": SCHEMA,
            "name": name,
            "kind": "cut",
            "video": "video.avi",
            "frames": frames,
            "can": "can.blf",
            "profile": profiles,
            "video_starts_at_log_s": round(starts_s, 6),
        }
        lines = [f"{key} = {_toml(value)}" for key, value in said.items()]
        camera = camera_text(self._camera).split("\n\n", 1)[1]
        conditions = f"[conditions]\nlog_begins_s = {event.begins_s:.3f}\nlog_ends_s = {event.ends_s:.3f}\n"
        return "\n".join([*lines, "", camera, conditions])


def _as(picture: Picture, is_colour: bool) -> NDArray[np.uint8]:
    """Return a picture with as many channels as the video's first one has."""
    if not is_colour:
        return picture.grey
    return picture.bgr if picture.bgr is not None else np.repeat(picture.grey[:, :, None], 3, axis=2)


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else repr(value)
