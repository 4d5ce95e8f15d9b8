"""A number found, and how sure it is."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """A number and its standard deviation."""

    value: float
    std: float
