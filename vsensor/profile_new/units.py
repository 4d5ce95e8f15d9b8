"""Units as makers write them, in the words that a profile knows."""

from collections.abc import Mapping

from vsensor.codec import SignalLayout
from vsensor.profile import UNITS

_ALIASES: Mapping[str, str] = {
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("kph", "kmh", "km/hr", "kmph"), "km/h"),
    **dict.fromkeys(("meters/sec", "meter/second", "meters/second", "mps"), "m/s"),
    **dict.fromkeys(("degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("deg/sec", "degree/s", "degrees/s", "degrees/second", "°/s"), "deg/s"),
    **dict.fromkeys(("rad/sec", "radians/s", "radians/second"), "rad/s"),
    **dict.fromkeys(("m/s2", "m/s²", "m/ss", "m/sec2", "meter/sec^2"), "m/s^2"),
    **dict.fromkeys(("m-1", "m^-1", "1/meter", "1/metre", "rad/m"), "1/m"),
    **dict.fromkeys(("1/m2", "m-2", "m^-2", "1/m²"), "1/m^2"),
    **dict.fromkeys(("sec", "second", "seconds"), "s"),
    **dict.fromkeys(("msec", "milliseconds"), "ms"),
    **dict.fromkeys(("-", "unitless", "none", "1", "sed", "enum", "bool"), ""),
}
_KNOWN = frozenset(unit for units in UNITS.values() for unit in units)


def known_unit(signal: SignalLayout) -> str | None:
    """Return the unit of a signal as a profile says it, "" if it has none; None if nobody knows it."""
    given = signal.unit.strip()
    if given in _KNOWN:
        return given
    meant = _ALIASES.get(given.lower(), given.lower())
    return meant if meant in _KNOWN else None


def is_of(signal: SignalLayout, si: str) -> bool:
    """Return whether a signal has a unit of this kind, such as km/h of "m/s"."""
    unit = known_unit(signal)
    return unit is not None and bool(unit) and unit in UNITS[si]


def unit_said(signal: SignalLayout, si: str) -> tuple[str, str]:
    """Return the unit to be said, "" if the database says it or it is SI; and what is odd about it."""
    units, meant = UNITS[si], known_unit(signal)
    if signal.unit in units or meant == "":
        return "", ""
    if meant in units:
        return (meant if meant and units[meant] != 1.0 else ""), ""
    return "", f"unit {signal.unit!r} is not known here, taken as {si or 'a number'}"


def contradicts(signal: SignalLayout, si: str) -> bool:
    """Return whether the database says a unit that no quantity of this kind has."""
    unit = known_unit(signal)
    return bool(si and unit) and unit not in UNITS[si]
