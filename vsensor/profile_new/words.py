"""Names of signals in words, and what the words say of the line that is meant."""

import re
from collections.abc import Iterable, Set

_WORD = re.compile(r"[A-Z]+(?![a-z])\d*|[A-Z]?[a-z]+\d?(?!\d)|[A-Z]?[a-z]+|\d+")

LEFT = frozenset({"left", "lft", "lf", "lt", "lh", "links", "gauche"})
RIGHT = frozenset({"right", "rgt", "rght", "rt", "rh", "rechts", "droite"})
NEXT = frozenset(
    {"next", "adjacent", "adj", "adjc", "neighbor", "neighbour", "nbr", "outer", "nxt", "second"}
)
CENTRE = frozenset({"virtual", "centre", "center", "ctr", "middle", "mid", "path"})
LANE = frozenset(
    {
        *("lane", "lanes", "line", "lines", "ln", "marking", "markings", "marker", "mark", "mrk", "stripe"),
        *("boundary", "bdry", "border", "laneline", "lanemark", "lka", "lkas", "lks", "ldw", "ldp"),
    }
)


def words_of(name: str) -> tuple[str, ...]:
    """Return the words of a name or sentence in small letters: LftLnPosVal, LINE_OFFSET, virtualLaneC0."""
    return tuple(word.lower() for word in _WORD.findall(name))


def side_of(name: str, siblings: Set[str]) -> str:
    """Return "left", "right", "next_left", "next_right", "centre" as a name says; "" if it says none.

    L and R alone are sides where `siblings`, the names beside it, have the same name with the other letter.
    """
    words = words_of(name)
    lefts = sum(word in LEFT for word in words)
    rights = sum(word in RIGHT for word in words)
    if not lefts and not rights:
        lefts, rights = _by_letter(name, siblings, "L", "R"), _by_letter(name, siblings, "R", "L")
    if lefts and rights:
        return ""
    if lefts or rights:
        is_next = bool(NEXT & set(words)) or lefts > 1 or rights > 1
        return ("next_" if is_next else "") + ("left" if lefts else "right")
    return "centre" if CENTRE & set(words) and (LANE | {"path"}) & set(words) else ""


def _by_letter(name: str, siblings: Set[str], letter: str, other: str) -> int:
    """Count a single letter that is a word of its own and has its counterpart among the siblings."""
    for match in re.finditer(rf"(?:(?<=_)|^){letter}(?=_|$|[A-Z][a-z])|(?<=[a-z]){letter}(?=_|$)", name):
        if name[: match.start()] + other + name[match.end() :] in siblings:
            return 1
    return 0


def has(words: Iterable[str], *wanted: str) -> bool:
    """Return whether one of the words is wanted; "curv*" wants what begins with curv."""
    given = tuple(words)
    return any(
        word.startswith(one[:-1]) if one.endswith("*") else word == one for one in wanted for word in given
    )
