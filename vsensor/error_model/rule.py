"""Which model of a library holds: an ordered list of conditions on what the running sensor knows.

[{"model": "night", "when": {"night": true}},
 {"model": "rain", "when": {"rain": [0.2, 1.0]}},      both ends belong to it, null = no end
 {"model": "day", "when": {}}]                         the first that holds counts; the last always does
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan

import msgspec

from vsensor.schema import Config


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What the sensor knows at an image, named as the columns of the table are; NaN = not known."""

    speed_mps: float = nan
    acceleration_mps2: float = nan
    yaw_rate_radps: float = nan
    curvature_per_m: float = nan
    night: bool = False
    rain: float = 0.0
    visibility_m: float = inf


COLUMNS = tuple(Conditions.__slots__)


class Rule(Config, frozen=True, kw_only=True):
    """The model that holds `when` all conditions do: a truth for night, an interval for a number."""

    model: str
    when: dict[str, bool | tuple[float | None, float | None]]

    def holds(self, conditions: Conditions) -> bool:
        """Return whether every condition holds; what is not known holds none."""
        return all(_holds(getattr(conditions, column), asked) for column, asked in self.when.items())


def _holds(value: float, asked: bool | tuple[float | None, float | None]) -> bool:
    if isinstance(asked, bool):
        return value is asked
    low, high = asked
    return (-inf if low is None else low) <= value <= (inf if high is None else high)


def always(model: str) -> tuple[Rule, ...]:
    """Return the rule that picks one model whatever happens."""
    return (Rule(model=model, when={}),)


def pick(rule: Sequence[Rule], conditions: Conditions) -> str:
    """Return the model's name; the last rule has no condition."""
    return next(one.model for one in rule if one.holds(conditions))


def rule_text(rule: Sequence[Rule]) -> str:
    """Return the rule as the JSON text that stands in a file."""
    return msgspec.json.encode(tuple(rule)).decode()


def rule_from(text: str, models: Sequence[str]) -> tuple[Rule, ...]:
    """Read a rule that picks among `models`; raises ValueError saying what was expected."""
    try:
        rule = msgspec.json.decode(text.encode(), type=tuple[Rule, ...])
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        raise ValueError(str(error)) from None
    for one in rule:
        if one.model not in models:
            raise ValueError(f"{one.model!r}: a model of the file ({', '.join(models)}) was expected")
        for column, asked in one.when.items():
            if column not in COLUMNS:
                raise ValueError(f"{column!r}: one of {', '.join(COLUMNS)} was expected")
            if isinstance(asked, bool) is not (column == "night"):
                raise ValueError(
                    f"{column}: {'true or false' if column == 'night' else '[from, to]'} expected"
                )
    if not rule or rule[-1].when:
        raise ValueError("a last model without condition was expected")
    return rule
