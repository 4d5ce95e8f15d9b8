"""Finished cells as small files, each named by its cell's key: the hash of its canonical JSON."""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from vsensor.errors import ConfigError

SCHEMA = "vsensor.cell/1"

Cell = Mapping[str, Any]
"""Everything that a result depends on, as JSON has it: dicts with string keys, lists, numbers, words."""
Result = dict[str, Any]
"""What a cell gives, as JSON has it: NaN becomes None, a tuple a list."""


class _Finished(msgspec.Struct, kw_only=True):
    """The content of a finished cell's file."""

    schema: str
    cell: dict[str, Any]
    result: Result


def cell_key(cell: Cell) -> str:
    """Return the key of a cell: the same for the same content, whatever the order of its dicts."""
    content = msgspec.json.encode([SCHEMA, cell], order="deterministic")
    return hashlib.sha256(content).hexdigest()[:32]


def encoded(cell: Cell, result: Mapping[str, Any]) -> bytes:
    """Return the content of a finished cell's file."""
    finished = _Finished(schema=SCHEMA, cell=dict(cell), result=dict(result))
    return msgspec.json.encode(finished)


def decoded(content: bytes) -> Result | None:
    """Return the result in a finished cell's file, None if the content is damaged or of another schema."""
    try:
        finished = msgspec.json.decode(content, type=_Finished)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None
    return finished.result if finished.schema == SCHEMA else None


class Store:
    """A folder of finished cells."""

    def __init__(self, folder: Path) -> None:
        """Make the folder; raises ConfigError where it cannot be."""
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"{folder}: cannot be made: {error.strerror or error}") from None

    def read(self, key: str) -> Result | None:
        """Return the result of a finished cell, None if it is not finished (or its file is damaged)."""
        try:
            return decoded((self.folder / f"{key}.json").read_bytes())
        except FileNotFoundError:
            return None
        except OSError as error:
            raise ConfigError(f"{self.folder}: cannot be read: {error.strerror or error}") from None

    def forget(self, key: str) -> None:
        """Let a cell be unfinished again."""
        try:
            (self.folder / f"{key}.json").unlink(missing_ok=True)
        except OSError as error:
            raise ConfigError(f"{self.folder}: cannot be written: {error.strerror or error}") from None

    def write(self, key: str, content: bytes) -> None:
        """Keep what `encoded` returned: written beside its place and moved there, so a file is whole."""
        beside = self.folder / f".{key}.{os.getpid()}.part"
        try:
            beside.write_bytes(content)
            beside.replace(self.folder / f"{key}.json")
        except OSError as error:
            raise ConfigError(f"{self.folder}: cannot be written: {error.strerror or error}") from None
        finally:
            beside.unlink(missing_ok=True)
