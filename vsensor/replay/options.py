"""What the command line says of a replay, and times as people write them."""

import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path

from vsensor.errors import ConfigError

EPOCH_FROM_S = 1e8
"""From here on a plain number is a time since 1970: no log is three years long."""
SPEEDS = (Fraction(1, 10), Fraction(100))
LONGEST_S = 1e8


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayOptions:
    """A log and how to play it; texts are as typed, None and () are not given."""

    path: Path
    bus: str | None = None
    map: tuple[str, ...] = ()
    speed: str = "1"
    fast: bool = False
    start: str | None = None
    stop: str | None = None
    loops: int = 1
    max_gap_s: float | None = None
    smooth: bool = False
    rate_hz: float | None = None
    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    rename: tuple[str, ...] = ()
    dbc: tuple[Path, ...] = ()
    profile: tuple[str, ...] = ()
    wait_for: str | None = None
    start_at: str | None = None
    skip_unsendable: bool = False
    overlay: str | None = None
    take_over: str | None = None
    log: Path | None = None
    realtime: bool = False
    repair: tuple[str, ...] = ()
    keep_wrong: bool = False
    source: str | None = None
    target: str | None = None
    camera_x_m: float | None = None
    wheelbase_m: float | None = None


def speed_of(text: str) -> Fraction:
    """Return a speed of 0.1 to 100, to three decimals; raises ConfigError."""
    try:
        speed = Fraction(text).limit_denominator(1000)
    except (ValueError, ZeroDivisionError):
        speed = Fraction(0)
    if not SPEEDS[0] <= speed <= SPEEDS[1]:
        raise ConfigError(f"--speed {text}: a number from 0.1 to 100 was expected")
    return speed


def log_time_ns(option: str, text: str, start_ns: int) -> int:
    """Return a time of a log that starts at `start_ns`: s from its start, s since 1970, or an ISO time.

    A time without a zone is UTC, as in the logs. Raises ConfigError.
    """
    number = _number(text)
    if number is None:
        return epoch_ns(option, text)
    return number if abs(number) >= EPOCH_FROM_S * 1e9 else start_ns + number


def epoch_ns(option: str, text: str) -> int:
    """Return an absolute time, s since 1970 or an ISO time (UTC unless it has a zone), ns since 1970."""
    number = _number(text)
    if number is not None and number >= EPOCH_FROM_S * 1e9:
        return number
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise ConfigError(
            f"{option} {text}: s, or a time such as 2026-03-01T12:00:00 (UTC), was expected"
        ) from None
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    whole = aware.replace(microsecond=0).timestamp()
    return int(whole) * 10**9 + aware.microsecond * 1000


def _number(text: str) -> int | None:
    """Return seconds in plain digits as ns, all digits kept; None if it is no such number."""
    if not re.fullmatch(r"[+-]?(\d+(\.\d*)?|\.\d+)", text):
        return None
    number = Fraction(text) * 10**9
    return math.floor(number) if abs(number) < 1 << 62 else None


def mapping(texts: tuple[str, ...]) -> dict[str, str]:
    """Return bus by channel of CHANNEL=INTERFACE:CHANNEL words; raises ConfigError."""
    found: dict[str, str] = {}
    for text in texts:
        channel, equals, bus = text.partition("=")
        if not equals or not channel or not bus:
            raise ConfigError(
                f"--map {text}: CHANNEL=INTERFACE:CHANNEL was expected, as can1=socketcan:vcan1"
            )
        if channel in found:
            raise ConfigError(f"--map {text}: channel {channel} is mapped twice")
        found[channel] = bus
    return found
