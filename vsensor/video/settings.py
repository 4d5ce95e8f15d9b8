"""What can be set of the methods: a file with a table for each, all keys optional."""

from pathlib import Path

from vsensor.schema import Config, check_schema, convert, read_toml
from vsensor.video.lov import LovConfig
from vsensor.video.published.config import PublishedConfig
from vsensor.video.ridge.config import RidgeConfig

SCHEMA = "vsensor.video/1"


class VideoConfig(Config, frozen=True, kw_only=True):
    """`[ours]`: our method; `[published]`: P2's; `[lov]`: what is done to its offsets afterwards."""

    ours: RidgeConfig = RidgeConfig()
    published: PublishedConfig = PublishedConfig()
    lov: LovConfig = LovConfig()


def read_settings(path: Path | None) -> VideoConfig:
    """Read a settings file, the defaults where there is none; raises ConfigError."""
    if path is None:
        return VideoConfig()
    return convert(check_schema(read_toml(path), SCHEMA, str(path)), VideoConfig, str(path))
