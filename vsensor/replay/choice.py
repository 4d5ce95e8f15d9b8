"""Which frames of a log are played, and under which id: decided for whole runs of frames at once."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np

from vsensor.errors import ConfigError
from vsensor.logs import Columns
from vsensor.logs.table import EXTENDED, MAX_EXTENDED_ID, MAX_STANDARD_ID
from vsensor.types import BoolArray, IntArray

if TYPE_CHECKING:
    from vsensor.codec import Database

EXTENDED_KEY = 1 << 29
_NUMBER = re.compile(r"(0[xX][0-9a-fA-F]+?)([xX]?)")
_RANGE = re.compile(r"(0[xX][0-9a-fA-F]+)-(0[xX][0-9a-fA-F]+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """What the databases call messages: keys (id, with EXTENDED_KEY for 29 bits) by message and by sender."""

    messages: Mapping[str, frozenset[int]]
    senders: Mapping[str, frozenset[int]]

    @classmethod
    def of(cls, databases: Iterable["Database"]) -> "Names":
        """Return the names in all of the databases."""
        messages: dict[str, frozenset[int]] = {}
        senders: dict[str, frozenset[int]] = {}
        for layout in (layout for database in databases for layout in database.layouts.values()):
            key = frozenset({layout.arbitration_id | EXTENDED_KEY * layout.is_extended})
            messages[layout.name] = messages.get(layout.name, frozenset()) | key
            for sender in layout.senders:
                senders[sender] = senders.get(sender, frozenset()) | key
        return cls(messages=messages, senders=senders)


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """A set of frames: by key, by range of ids (of either kind, both ends included), by channel name."""

    keys: frozenset[int] = frozenset()
    ranges: tuple[tuple[int, int], ...] = ()
    channels: frozenset[str] = frozenset()

    def mask(self, columns: Columns, channels: Mapping[str, int]) -> BoolArray:
        """Return which frames (N,) belong to it; `channels`: the log's channel numbers by name."""
        mask: BoolArray = np.zeros(len(columns.t_ns), dtype=bool)
        if self.keys:
            mask |= np.isin(keys_of(columns), list(self.keys))
        for first, last in self.ranges:
            mask |= (columns.arbitration_id >= first) & (columns.arbitration_id <= last)
        numbers = [number for name, number in channels.items() if name in self.channels]
        return mask | np.isin(columns.channel, numbers) if numbers else mask


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Plays what `include` has (None: everything) and `exclude` has not; then `rename`s keys."""

    include: Selection | None = None
    exclude: Selection = Selection()
    rename: Mapping[int, int] = field(default_factory=dict[int, int])

    def mask(self, columns: Columns, channels: Mapping[str, int]) -> BoolArray:
        """Return which frames (N,) are played."""
        played = ~self.exclude.mask(columns, channels)
        return played if self.include is None else played & self.include.mask(columns, channels)

    def renamed(self, columns: Columns) -> Columns:
        """Return the frames under their new ids; one that is not renamed keeps its own."""
        if not self.rename:
            return columns
        keys = keys_of(columns)
        ids, flags = columns.arbitration_id.copy(), columns.flags.copy()
        for old, new in self.rename.items():
            rows = keys == old
            ids[rows] = new & MAX_EXTENDED_ID if new & EXTENDED_KEY else new
            flags[rows] = (flags[rows] & ~np.uint8(EXTENDED)) | np.uint8(EXTENDED * bool(new & EXTENDED_KEY))
        return columns._replace(arbitration_id=ids, flags=flags)


def keys_of(columns: Columns) -> IntArray:
    """Return the keys (N,) of frames; an error frame has none (-1)."""
    keys = columns.arbitration_id.astype(np.int64)
    keys += np.where(columns.flags & EXTENDED, EXTENDED_KEY, 0)
    return np.where(columns.flags & 16, -1, keys)  # 16: ERROR


def choice(
    include: Sequence[str], exclude: Sequence[str], rename: Sequence[str], names: Names | None
) -> Choice:
    """Compile what the command line says; each word may hold several, separated by commas.

    0x123, 0x123x (29 bits, as every id above 0x7FF), 0x100-0x1FF, channel:NAME, and with `names` a
    message or a sender. Raises ConfigError.
    """
    return Choice(
        include=selection("--include", include, names) if include else None,
        exclude=selection("--exclude", exclude, names),
        rename=_renamings(_words(rename)),
    )


def selection(option: str, texts: Sequence[str], names: Names | None) -> Selection:
    """Return the frames that any of the words means; raises ConfigError naming `option`."""
    keys: set[int] = set()
    ranges: list[tuple[int, int]] = []
    channels: set[str] = set()
    for word in _words(texts):
        if word.startswith("channel:"):
            channels.add(word.removeprefix("channel:"))
        elif found := _RANGE.fullmatch(word):
            ranges.append(_bounds(option, word, int(found[1], 16), int(found[2], 16)))
        elif word[:1].isdigit():
            keys.add(key(option, word))
        else:
            keys |= _named(option, word, names)
    return Selection(keys=frozenset(keys), ranges=tuple(ranges), channels=frozenset(channels))


def key(option: str, word: str) -> int:
    """Return the key of an id such as 0x123 or 0x123x; raises ConfigError naming `option`."""
    found = _NUMBER.fullmatch(word)
    number = int(found[1], 16) if found else -1
    if found is None or number > MAX_EXTENDED_ID:
        raise ConfigError(f"{option} {word}: an id was expected, hexadecimal, such as 0x123 or 0x18FF1234")
    return number | EXTENDED_KEY * (number > MAX_STANDARD_ID or bool(found[2]))


def _words(texts: Sequence[str]) -> list[str]:
    return [word.strip() for text in texts for word in text.split(",") if word.strip()]


def _bounds(option: str, word: str, first: int, last: int) -> tuple[int, int]:
    if first > last:
        raise ConfigError(f"{option} {word}: the first id of a range is the lower one")
    return first, last


def _named(option: str, word: str, names: Names | None) -> frozenset[int]:
    kinds = "0x123, 0x100-0x1FF, channel:NAME"
    if names is None:
        raise ConfigError(
            f"{option} {word}: {kinds} were expected; with --dbc FILE also messages and senders"
        )
    for known in (names.messages, names.senders):
        if word in known:
            return known[word]
    near = get_close_matches(word, [*names.messages, *names.senders], n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    raise ConfigError(f"{option} {word}: no message and no sender of the database{hint}")


def _renamings(words: Sequence[str]) -> dict[int, int]:
    found: dict[int, int] = {}
    for word in words:
        old, new = _renaming(word)
        if old in found:
            raise ConfigError(f"--rename {word}: {word.partition('=')[0]} is renamed twice")
        found[old] = new
    return found


def _renaming(word: str) -> tuple[int, int]:
    old, equals, new = word.partition("=")
    if not equals:
        raise ConfigError(f"--rename {word}: OLD=NEW was expected, such as 0x123=0x456")
    return key("--rename", old.strip()), key("--rename", new.strip())
