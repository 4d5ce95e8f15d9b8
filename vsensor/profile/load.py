"""Profile files: found, read, and compiled with their database."""

from collections.abc import Sequence
from pathlib import Path

from vsensor.codec import load_database
from vsensor.errors import ConfigError
from vsensor.profile.bind import hint
from vsensor.profile.compiled import Profile
from vsensor.profile.config import ProfileConfig
from vsensor.profile.messages import compile_profile
from vsensor.schema import check_schema, convert, read_toml

SCHEMA = "vsensor.profile/1"
SHIPPED = Path(__file__).parents[1] / "dbc"
"""Folder of the shipped profiles and databases, in a checkout and in a wheel."""


def shipped_profiles() -> list[str]:
    """Return the names of the profiles that come with the program."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def load_profile(name: str | Path, dbc: Path | None = None) -> Profile:
    """Load a shipped profile by name, or a file by path; `dbc` replaces the database it names.

    Raises ConfigError (file, message, signal, what was expected) or DbcError.
    """
    path = _find(name)
    config = convert(check_schema(read_toml(path), SCHEMA, str(path)), ProfileConfig, str(path))
    if dbc is None and config.database is None:
        raise ConfigError(f"{path}: maps a database that is not shipped; give it with --dbc FILE")
    database = load_database(dbc if dbc is not None else path.parent / str(config.database))
    return compile_profile(path, config, database)


def load_profiles(names: Sequence[str | Path], dbc: Path | None = None) -> list[Profile]:
    """Load several profiles, each a name, a file or "NAME=DATABASE".

    Of several, `dbc` goes to those that name no database of their own; of one, it replaces that.
    """
    if len(names) == 1 and dbc is not None:
        return [load_profile(names[0], dbc)]
    return [load_worded(str(name), dbc) for name in names]


def load_worded(text: str, spare: Path | None = None) -> Profile:
    """Load "NAME" or "NAME=DATABASE", as a command line says it; `spare` is for a profile without one."""
    name, equals, database = text.partition("=")
    if not equals or Path(text).is_file():
        return load_profile(text, None if "database" in read_toml(_find(text)) else spare)
    if not name or not database:
        raise ConfigError(f"profile {text!r}: NAME or NAME=DATABASE was expected, as honda=honda.dbc")
    return load_profile(name, Path(database))


def _find(name: str | Path) -> Path:
    path = Path(name)
    if path.suffix == ".toml" or path.is_file():
        return path
    shipped = SHIPPED / f"{name}.toml"
    if shipped.is_file():
        return shipped
    raise ConfigError(
        f"profile {str(name)!r}: not shipped{hint(str(name), shipped_profiles())}; or give a file"
    )
