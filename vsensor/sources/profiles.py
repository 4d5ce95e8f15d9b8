"""Profiles that a scenario names for what it reads: shipped ones by name, files from its folder."""

from collections.abc import Sequence
from pathlib import Path

from vsensor.profile import Profile, load_profiles
from vsensor.schema import user_path


def profiles_of(names: Sequence[str], dbc: str | None, folder: Path) -> list[Profile]:
    """Load profiles; raises ConfigError, DbcError."""
    return load_profiles([_in_folder(name, folder) for name in names], _dbc(dbc, folder))


def _in_folder(name: str, folder: Path) -> str:
    """Return a profile's path from the scenario's folder; a shipped name stays as it is."""
    return str(folder / user_path(name)) if Path(name).suffix else name


def _dbc(dbc: str | None, folder: Path) -> Path | None:
    return None if dbc is None else folder / user_path(dbc)
