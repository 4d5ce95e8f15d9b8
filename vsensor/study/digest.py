"""What a result depends on besides its settings: the files that a scenario names, and the program."""

import functools
import hashlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from vsensor.errors import ConfigError
from vsensor.schema import read_toml

PACKAGE = Path(__file__).parents[1]


def file_digest(path: Path) -> str:
    """Return the hash of a file's content; raises ConfigError where it cannot be read."""
    try:
        about = path.stat()
        return _digest(path, about.st_mtime_ns, about.st_size)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None


@functools.lru_cache(maxsize=256)
def _digest(path: Path, modified_ns: int, size: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:32]


def referenced_files(settings: Mapping[str, Any], folder: Path) -> dict[str, str]:
    """Return {name as given: hash} of every file that a word in `settings` names, seen from `folder`.

    A TOML file among them (a profile) is looked through as well: the database that it maps counts.
    """
    found: dict[str, str] = {}
    for word in _words(settings):
        path = folder / Path(word).expanduser()
        if _is_file(path):
            found[word] = file_digest(path)
            if path.suffix == ".toml":
                inner = referenced_files(read_toml(path), path.parent)
                found |= {str(Path(word).parent / name): digest for name, digest in inner.items()}
    return found


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a text that is no name of a file
        return False


def _words(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        if value:
            yield value
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from _words(item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _words(item)


@functools.cache
def program_digest() -> str:
    """Return the hash of this program with all that it ships: results of another one are not reused."""
    total = hashlib.sha256()
    for place, folders, files in os.walk(PACKAGE, followlinks=True):  # vsensor/dbc is a link in a clone
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        for name in sorted(files):
            path = Path(place, name)
            total.update(f"{path.relative_to(PACKAGE)}\0{file_digest(path)}\n".encode())
    return total.hexdigest()[:32]
