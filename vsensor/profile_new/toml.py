"""What a database says, as TOML: names and values quoted where they must be, comments in one line."""

import json
import re

from vsensor.codec import SignalLayout
from vsensor.profile_new.codes import shown_choices
from vsensor.profile_new.marks import MARK, unmarked

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_LONGEST = 100


def toml_key(name: str) -> str:
    """Return a name as a TOML key."""
    return name if _BARE.fullmatch(name) else _string(name)


def toml_value(value: object) -> str:
    """Return a value as TOML, tables in one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{toml_key(str(k))} = {toml_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return _string(value) if isinstance(value, str) else repr(value)


def _string(text: str) -> str:
    """Return a basic string, which differs from JSON's in DEL; without a mark that nobody made."""
    said = json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
    return said.replace(MARK, "\\u0023?")


def about(signal: SignalLayout) -> str:
    """Return what the database says of a signal, for a comment."""
    return "; ".join(
        said for one in (_bits(signal), shown_choices(signal), signal.comment) if (said := short(one))
    )


def _bits(signal: SignalLayout) -> str:
    unit = f" {signal.unit}" if signal.unit else ""
    if signal.is_float:
        return f"float of {signal.length} bits{unit}"
    low, high = sorted((signal.physical(signal.raw_min), signal.physical(signal.raw_max)))
    return f"{signal.length} bit{'s' * (signal.length > 1)}, {low:g} to {high:g}{unit}"


def short(text: str, longest: int = _LONGEST) -> str:
    """Return text of a database for a comment, cut where it is long."""
    said = unmarked(text)
    return said if len(said) <= longest else f"{said[: longest - 4].rstrip()} ..."
