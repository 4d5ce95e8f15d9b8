"""One model per condition: which rows belong to which, and the rule that a running sensor picks by.

--by night,rain             night_rain, night, rain, day: night; rain from 0.2; the rest
--by curvature_per_m:0.001  a column and its edges: below, from 0.001
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np

from vsensor.error_model import Rule
from vsensor.error_model import rule as rules
from vsensor.errors import TableError
from vsensor.field import table

KNOWN = tuple(column for column in rules.COLUMNS if column in table.COLUMNS)
"""What a rule may ask and a table has."""
KNOWN_EDGES = {"rain": (0.2,)}
FLAGS = ("night",)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Column:
    """A column and the classes made of it: `words[k]`, the rule's value `when[k]`; the last is the rest."""

    name: str
    words: tuple[str, ...]
    when: tuple[Any, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """The models to tune, in the order of the rule that picks one."""

    names: tuple[str, ...]
    rule: tuple[Rule, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """The table's columns that decide."""
        return deciding(self.rule)

    def codes(self, values: Mapping[str, np.ndarray], count: int) -> np.ndarray:
        """Return the place in `names` (N,) of each row."""
        return codes(self.rule, values, count)


def deciding(rule: Sequence[Rule]) -> tuple[str, ...]:
    """Return the columns that a rule looks at."""
    return tuple(dict.fromkeys(column for one in rule for column in one.when))


def codes(rule: Sequence[Rule], values: Mapping[str, np.ndarray], count: int) -> np.ndarray:
    """Return the place in the rule (N,) int32 that holds for each row; what is unknown (NaN) holds none."""
    code = np.full(count, len(rule) - 1, np.int32)
    for place in range(len(rule) - 2, -1, -1):
        holds = np.ones(count, bool)
        for column, asked in rule[place].when.items():
            holds &= _holds(values[column], asked)
        code[holds] = place
    return code


def _holds(values: np.ndarray, asked: bool | tuple[float | None, float | None]) -> np.ndarray:
    if isinstance(asked, bool):
        return np.asarray(values == float(asked))
    low, high = asked
    return (values >= (-np.inf if low is None else low)) & (values <= (np.inf if high is None else high))


def conditions(by: str) -> Conditions:
    """Return the models of `--by`; empty: one, named "all". Raises TableError naming an unknown column."""
    columns = tuple(_column(word) for word in by.split(",") if word)
    if len({column.name for column in columns}) < len(columns):
        raise TableError(f"--by {by}: a column twice")
    names, rule = list[str](), list[Rule]()
    for places in product(*(range(len(column.words)) for column in columns)):
        chosen = list(zip(columns, places, strict=True))
        words = [column.words[k] for column, k in chosen if column.words[k]]
        when = {column.name: column.when[k] for column, k in chosen if column.when[k] is not None}
        names.append("_".join(words) or _last(columns))
        rule.append(Rule(model=names[-1], when=when))
    return Conditions(names=tuple(names), rule=tuple(rule))


def _column(word: str) -> _Column:
    name, *texts = word.split(":")
    if name not in KNOWN:
        raise TableError(f"--by {word}: one of {', '.join(KNOWN)} was expected")
    if name in FLAGS:
        if texts:
            raise TableError(f"--by {word}: {name} is true or false and has no edges")
        return _Column(name=name, words=(name, ""), when=(True, None))
    edges = _edges(word, texts) if texts else KNOWN_EDGES.get(name, ())
    if not edges:
        raise TableError(f"--by {word}: expected its edges too, such as {name}:10:20")
    when = [(low, None) for low in edges][::-1]  # the highest first
    words = [name if word == name else f"{name}_from_{low:g}" for low in edges][::-1]
    return _Column(name=name, words=(*words, ""), when=(*when, None))


def _edges(word: str, texts: Sequence[str]) -> tuple[float, ...]:
    try:
        edges = tuple(float(text) for text in texts)
    except ValueError:
        edges = (np.nan,)
    if not all(np.isfinite(edges)) or any(b <= a for a, b in pairwise(edges)):
        raise TableError(f"--by {word}: rising numbers were expected after the column")
    return edges


def _last(columns: Sequence[_Column]) -> str:
    """Return the name of the model for all that no condition picks."""
    if not columns:
        return "all"
    return "day" if columns[0].name == "night" else "rest"
