"""Files that last: TOML into frozen structs, unknown keys refused by naming the nearest known one.

Each module declares its own `Config` subclass with units in its keys and plausible ranges in
`msgspec.Meta`; this module only reads, checks and reports.
"""

import difflib
import math
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from vsensor.errors import ConfigError

T = TypeVar("T")


class Config(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every configuration section: frozen, keyword-only, unknown keys refused."""


def user_path(name: str) -> Path:
    """Return a path as a user writes it: a leading `~` or `~name` is a home folder where there is one."""
    return Path(os.path.expanduser(name))


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file, a byte order mark in front is no harm; raises ConfigError naming file and line."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise ConfigError(f"{path}: is a folder, a TOML file was expected") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ConfigError(f"{path}: line {line}: not UTF-8, which a TOML file must be") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None
    except RecursionError:
        raise ConfigError(f"{path}: not TOML: brackets are nested too deeply") from None
    except ValueError as error:  # a name that no file can have
        raise ConfigError(f"{path!r}: cannot be read: {error}") from None


def convert(data: Mapping[str, Any], struct: type[T], where: str) -> T:
    """Convert a parsed table to `struct`; raises ConfigError naming `where`, the key, the expectation."""
    _require_finite(data, where, "")
    try:
        return msgspec.convert(data, struct)
    except msgspec.ValidationError as error:
        raise ConfigError(
            f"{where}: {_explain(_with_keys(str(error), data, struct), data, struct)}"
        ) from None


def check_schema(data: dict[str, Any], expected: str, where: str) -> dict[str, Any]:
    """Return `data` without its `schema` key; refuses a missing, foreign or newer schema.

    `expected` is like "vsensor.scenario/1"; a file of a lower version still loads.
    """
    found = data.get("schema")
    name, _, version = expected.partition("/")
    match = re.fullmatch(rf"{re.escape(name)}/(\d+)", found) if isinstance(found, str) else None
    if match is None:
        raise ConfigError(f'{where}: schema is {found!r}, expected schema = "{expected}"')
    if int(match[1]) > int(version) or int(match[1]) < 1:
        raise ConfigError(
            f"{where}: schema {found!r} is newer than this version of vsensor, which reads up to {expected!r}"
        )
    return {key: value for key, value in data.items() if key != "schema"}


def _require_finite(value: Any, where: str, path: str) -> None:
    if isinstance(value, Mapping):
        for key, item in value.items():
            _require_finite(item, where, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list):
        for number, item in enumerate(value):
            _require_finite(item, where, f"{path}[{number}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(f"{where}: {path} = {value}: a finite number was expected")


def _explain(message: str, data: Mapping[str, Any], struct: type) -> str:
    """Turn msgspec's message into one that names the key and the nearest known one."""
    unknown = re.match(r"Object contains unknown field `([^`]*)`(?: - at `\$\.?([^`]*)`)?", message)
    unknown = unknown or re.match(r"Invalid enum value '(.*)' - at `key` in `\$\.?([^`]*)`", message)
    if unknown is None:
        found = re.match(r"(.*?)(?: - at `(?:key in )?\$\.?([^`]*)`)?$", message)
        if found is None or not found[2]:
            return message
        value = _value_at(data, found[2])
        shown = "" if value is None or isinstance(value, Mapping | list) else f" = {value!r}"
        words = sorted(map(str, _known_words(struct, found[2])))
        if found[1].startswith(("Invalid enum value", "Invalid value")) and words:
            return f"{found[2]}{shown}: {', '.join(words)} {'was' if len(words) == 1 else 'were'} expected"
        return f"{found[2]}{shown}: {found[1][0].lower()}{found[1][1:]}"
    key, path = unknown[1], unknown[2] or ""
    known = sorted(_known_keys(struct, path))
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    full = f"{path}.{key}" if path else key
    hint = f"did you mean {near[0]}?" if near else f"known keys: {', '.join(known)}"
    return f"{full}: unknown key; {hint}"


def _with_keys(message: str, data: Mapping[str, Any], struct: type) -> str:
    """Name the tables whose keys are the user's own words: msgspec's path has `[...]` in their place.

    The culprit is the one that, alone in its table, still gives the same message.
    """
    named = message
    while (unnamed := re.search(r"`\$\.?([^`]*?)\[\.\.\.\]", named)) is not None:
        table = _value_at(data, unnamed[1])
        keys = table if isinstance(table, Mapping) else ()
        trials = {key: _with_only(data, re.findall(r"[^.\[\]]+", unnamed[1]), key) for key in keys}
        wrong = next((key for key in trials if _refusal(trials[key], struct) == message), None)
        if wrong is None:
            break
        data, named = trials[wrong], named.replace("[...]", f".{wrong}", 1)
    return named


def _with_only(data: Any, parts: list[str], key: str) -> Any:
    """Return a copy of `data` whose table at `parts` has only `key`."""
    if not parts:
        return {key: data[key]}
    if isinstance(data, list):
        place = int(parts[0])
        return [*data[:place], _with_only(data[place], parts[1:], key), *data[place + 1 :]]
    return {**data, parts[0]: _with_only(data[parts[0]], parts[1:], key)}


def _refusal(data: Any, struct: type) -> str:
    try:
        msgspec.convert(data, struct)
    except msgspec.ValidationError as error:
        return str(error)
    return ""


def _value_at(data: Any, path: str) -> Any:
    for part in re.findall(r"[^.\[\]]+", path):
        if isinstance(data, Mapping):
            data = data.get(part)
        elif isinstance(data, list) and part.isdigit() and int(part) < len(data):
            data = data[int(part)]
        else:
            return None
    return data


def _types_at(struct: Any, path: str) -> list[msgspec.inspect.Type]:
    """Return what may stand at a msgspec path such as `camera`, `traffic[0]` or `messages.NAME`."""
    kinds = [msgspec.inspect.type_info(struct)]
    for part in re.findall(r"[^.\[\]]+|\[[^\]]*\]", path):
        kinds = [item for kind in kinds for item in _step(kind, part)]
    return [option for kind in kinds for option in _options(kind)]


def _known_keys(struct: Any, path: str) -> list[str]:
    known: list[str] = []
    for kind in _types_at(struct, path):
        if isinstance(kind, msgspec.inspect.StructType):
            known += [field.encode_name for field in kind.fields]
        elif isinstance(kind, msgspec.inspect.DictType) and isinstance(
            kind.key_type, msgspec.inspect.LiteralType
        ):
            known += map(str, kind.key_type.values)
    return known


def _known_words(struct: Any, path: str) -> list[Any]:
    literals = (kind for kind in _types_at(struct, path) if isinstance(kind, msgspec.inspect.LiteralType))
    return [word for kind in literals for word in kind.values]


def _options(kind: msgspec.inspect.Type) -> list[msgspec.inspect.Type]:
    return list(kind.types) if isinstance(kind, msgspec.inspect.UnionType) else [kind]


def _step(kind: msgspec.inspect.Type, part: str) -> list[msgspec.inspect.Type]:
    found: list[msgspec.inspect.Type] = []
    for option in _options(kind):
        if isinstance(option, msgspec.inspect.StructType):
            found += [field.type for field in option.fields if field.encode_name == part]
            if option.tag_field == part:
                found.append(msgspec.inspect.LiteralType((option.tag,)))
        elif isinstance(option, msgspec.inspect.DictType):
            found.append(option.value_type)
        elif isinstance(option, msgspec.inspect.ListType | msgspec.inspect.VarTupleType):
            found.append(option.item_type)
    return found
