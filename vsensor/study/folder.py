"""A folder of results that is there whole or not at all."""

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from vsensor.errors import ConfigError


@contextlib.contextmanager
def own_folder(folder: Path, is_wanted: bool) -> Iterator[Path]:
    """Give an empty folder that takes its name when all in it is whole; the run before it goes."""
    if not is_wanted:
        yield folder
        return
    beside = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        beside.mkdir(parents=True, exist_ok=True)
        yield beside
        if folder.exists():
            shutil.rmtree(folder)
        beside.replace(folder)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def clear_parts(out: Path) -> None:
    """Remove folders that a crash left half done."""
    for left in out.glob(".*.part"):
        shutil.rmtree(left, ignore_errors=True)
