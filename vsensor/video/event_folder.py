"""An event on disk: a folder with a video, the CAN log of the same drive, and who took them.

NAME/event.toml        names of the others, how they belong together, camera, conditions
NAME/video.avi         or any video, or a folder of images
NAME/can.blf           or any CAN log
NAME/truth.parquet     where it is known: the columns of `rows`; confidence 4 = a marking is seen in the first
                       20 m, 0 and no offset = there is none in view
"""

from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from vsensor.camera import CameraConfig
from vsensor.errors import ConfigError, VideoError
from vsensor.schema import Config, check_schema, convert, read_toml
from vsensor.signals import VehicleConfig

SCHEMA = "vsensor.event/1"
FILE = "event.toml"
Condition = str | float | bool


class EventConfig(Config, frozen=True, kw_only=True):
    """`event.toml`.

    Names of files are seen from its folder; no `truth` is known without one. The video's first picture is at
    `video_starts_at_log_s` after the log's first frame; `rate_hz` takes the place of the video's own times.
    `profile`: one or several, shipped or files. `conditions`, `name`, `kind`, `is_made`, `seed` and `frames`
    are for people and for choosing.
    """

    camera: CameraConfig
    vehicle: VehicleConfig = VehicleConfig()
    video: str
    can: str
    truth: str | None = None
    profile: str | list[str] = "p2"
    video_starts_at_log_s: float = 0.0
    rate_hz: float | None = None
    name: str = ""
    kind: str = ""
    is_made: bool = False
    seed: int = 0
    frames: int = 0
    conditions: dict[str, Condition] = msgspec.field(default_factory=dict[str, Condition])


@dataclass(frozen=True, slots=True, kw_only=True)
class EventFolder:
    """An event that is there: its folder, and what its file says."""

    path: Path
    config: EventConfig
    profiles: tuple[str, ...] = field(default=("p2",))

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.path.name

    @property
    def video(self) -> Path:
        """The video."""
        return self.path / self.config.video

    @property
    def log(self) -> Path:
        """The CAN log."""
        return self.path / self.config.can

    @property
    def truth(self) -> Path | None:
        """The truth, if it is known."""
        return None if self.config.truth is None else self.path / self.config.truth

    def require_size(self, size: tuple[int, int]) -> None:
        """Raise VideoError where the video is not of the camera's size."""
        camera = self.config.camera
        if size != (camera.width_px, camera.height_px):
            raise VideoError(
                f"{self.video}: is {size[0]} x {size[1]}, the camera of {FILE} has {camera.width_px} x "
                f"{camera.height_px}: one size was expected"
            )


def read_event(path: Path) -> EventFolder:
    """Return the event of a folder; raises ConfigError naming what is wrong or missing."""
    where = path / FILE
    said = convert(check_schema(read_toml(where), SCHEMA, str(where)), EventConfig, str(where))
    named = [said.profile] if isinstance(said.profile, str) else said.profile
    profiles = tuple(str(path / name) if (path / name).is_file() else name for name in named)
    found = EventFolder(path=path, config=said, profiles=profiles)
    for file in (found.video, found.log, found.truth):
        if file is not None and not file.exists():
            raise ConfigError(f"{where}: names {file.name}, which is not there")
    return found


def find_events(place: Path) -> list[EventFolder]:
    """Return the events of a folder of folders, or the one that it is, in the order of their names.

    Raises ConfigError where there is none.
    """
    if (place / FILE).is_file():
        return [read_event(place)]
    if not place.is_dir():
        raise ConfigError(f"{place}: no such folder; one with events was expected")
    folders = sorted(folder for folder in place.iterdir() if (folder / FILE).is_file())
    if not folders:
        raise ConfigError(
            f"{place}: holds no event: folders with {FILE}, a video and a CAN log were expected"
        )
    return [read_event(folder) for folder in folders]
