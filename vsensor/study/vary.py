"""`--vary KEY=VALUES`: which keys of a scenario take which values, and a scenario with such keys set."""

import copy
import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal, InvalidOperation
from itertools import product
from typing import Any

from vsensor.config import Scenario, load_scenario
from vsensor.errors import ConfigError
from vsensor.schema import read_toml

MOST_VALUES = 10_000
MOST_CELLS = 100_000

Settings = dict[str, Any]
"""Dotted key -> value, one choice of those that vary."""

_BARE = re.compile(r"[\w./+-]+")
_BRACKETS = {"[": 1, "{": 1, "]": -1, "}": -1}


def parse_vary(texts: Sequence[str]) -> dict[str, list[Any]]:
    """Return {dotted key: its values} of texts such as `camera.width_px=320,640` or `ego.lane=-3:-1:1`.

    Values are separated by commas, each written as in TOML or a bare word; start:stop:step is a range
    that includes its stop. Raises ConfigError naming the text and what was expected.
    """
    found: dict[str, list[Any]] = {}
    for text in texts:
        key, equals, values = text.partition("=")
        key = key.strip()
        if not equals or not re.fullmatch(r"\w+(\.\w+)*", key):
            raise ConfigError(
                f"--vary {text}: KEY=VALUES was expected, such as camera.width_px=320,640 "
                "or camera.pitch_deg=-2:2:0.5"
            )
        if key in found:
            raise ConfigError(f"--vary {key}: given twice; put all values into one")
        found[key] = _values(text, values)
    return found


def grid(varied: Mapping[str, Sequence[Any]]) -> Iterator[Settings]:
    """Yield every combination of the values, the last key fastest."""
    for choice in product(*varied.values()):
        yield dict(zip(varied, choice, strict=True))


def scenario_with(name_or_path: str, settings: Mapping[str, Any], told_by: str = "--vary") -> Scenario:
    """Load a scenario with dotted keys set; a number in a key is a place in a list (`traffic.0.kind`).

    Raises ConfigError as for a scenario file: an unknown key is named with the nearest known one; `told_by`
    says where the settings come from.
    """
    path = load_scenario(name_or_path).path
    data = read_toml(path) if path is not None else {}
    changed = copy.deepcopy(data)
    for key, value in settings.items():
        _set(changed, key, value, told_by)
    return load_scenario(name_or_path, {top: changed[top] for top in {key.split(".")[0] for key in settings}})


def _values(text: str, values: str) -> list[Any]:
    found = [value for part in _parts(values) for value in _part(text, part.strip())]
    shown = [json.dumps(value) for value in found]
    if len(set(shown)) < len(shown):
        twice = next(value for value in shown if shown.count(value) > 1)
        raise ConfigError(f"--vary {text}: {twice} is there twice")
    return found


def _parts(values: str) -> list[str]:
    """Split at commas outside of brackets and quotes."""
    parts, depth, quote = [""], 0, ""
    for letter in values:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "'\"":
            quote = letter
        else:
            depth += _BRACKETS.get(letter, 0)
        if letter == "," and not quote and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _part(text: str, part: str) -> list[Any]:
    if re.fullmatch(r"[^:'\"\[{]+:[^:]+:[^:]+", part):
        return _range(text, part)
    try:
        value = tomllib.loads(f"value = {part}")["value"]
    except (tomllib.TOMLDecodeError, KeyError):
        value = part
        if not _BARE.fullmatch(part):
            problem = f"{part!r} is no value" if part else "a value is missing"
            raise ConfigError(f"--vary {text}: {problem}; numbers, words, true, false, [lists]") from None
    return [value if isinstance(value, bool | int | float | str | list | dict) else part]


def _range(text: str, part: str) -> list[int | float]:
    """Return start, start + step ... up to stop, as a person writes them: 0.1 steps end at 0.3, not below."""
    try:
        start, stop, step = (Decimal(number.strip()) for number in part.split(":"))
        count = int((stop - start) / step) + 1
    except (InvalidOperation, ArithmeticError, ValueError):
        raise ConfigError(
            f"--vary {text}: {part}: start:stop:step was expected, numbers, step not 0"
        ) from None
    if (stop - start) / step < 0:
        raise ConfigError(f"--vary {text}: {part}: the step leads away from {stop}")
    if count > MOST_VALUES:
        raise ConfigError(f"--vary {text}: {part}: {count} values; at most {MOST_VALUES}")
    are_whole = all(re.fullmatch(r"\s*[+-]?\d+\s*", number) for number in part.split(":"))
    return [int(v) if are_whole else float(v) for v in (start + k * step for k in range(count))]


def _set(data: Any, key: str, value: Any, told_by: str) -> None:
    *parents, last = key.split(".")
    place, said = data, ""
    where = f"{told_by} {key}"
    for part in parents:
        place = _inner(place, part, said, where)
        said = f"{said}.{part}" if said else part
    if isinstance(place, list):
        place[_index(place, last, said, where)] = value
    elif isinstance(place, dict):
        place[last] = value
    else:
        raise ConfigError(f"{where}: {said} is no section")


def _inner(place: Any, part: str, said: str, where: str) -> Any:
    if isinstance(place, list):
        return place[_index(place, part, said, where)]
    if isinstance(place, dict):
        return place.setdefault(part, {})
    raise ConfigError(f"{where}: {said} is no section")


def _index(place: Sequence[Any], part: str, said: str, where: str) -> int:
    if not part.isdecimal() or int(part) >= len(place):
        raise ConfigError(f"{where}: {said} has {len(place)} entries, counted from 0")
    return int(part)
