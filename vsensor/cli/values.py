"""Types of arguments: a word of the command line as a value, or a sentence that says what was expected."""

import argparse
import math


def positive(text: str) -> float:
    """Return seconds above 0."""
    value = _number(text)
    if not 0.0 < value <= 31_536_000.0:
        raise argparse.ArgumentTypeError(f"{text} s: expected a time above 0, at most a year")
    return value


def moment(text: str) -> float:
    """Return seconds from 0."""
    value = _number(text)
    if not 0.0 <= value <= 31_536_000.0:
        raise argparse.ArgumentTypeError(f"{text} s: expected a time from 0, at most a year")
    return value


def metres(text: str) -> float:
    """Return metres along the road."""
    value = _number(text)
    if not 0.0 <= value <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text}: expected metres, 0 to 1000")
    return value


def dashes(text: str) -> tuple[float, float]:
    """Read metres of paint and gap."""
    words = text.split(",")
    if len(words) != 2:
        raise argparse.ArgumentTypeError(f"{text}: expected metres of paint and gap such as 6,12")
    paint_m, gap_m = (metres(word) for word in words)
    if not paint_m > 0.0:
        raise argparse.ArgumentTypeError(f"{text}: expected some paint")
    return paint_m, gap_m


def port(text: str) -> int:
    """Return the number of a TCP port, 0 for any that is free."""
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text}: expected a port, 0 to 65535")
    return int(text)


def hertz(text: str) -> float:
    """Return a rate per second."""
    value = _number(text)
    if not 1e-3 <= value <= 1e9:
        raise argparse.ArgumentTypeError(f"{text}: expected a rate per second, above 0")
    return value


def bitrate(text: str) -> float:
    """Return bits per second, of 500k, 2M or 125000."""
    value = _number(text.rstrip("kM")) * {"k": 1e3, "M": 1e6}.get(text[-1:], 1.0)
    if not 1e3 <= value <= 20e6:
        raise argparse.ArgumentTypeError(f"{text}: expected bits per second such as 500k, 2M, 125000")
    return value


def share(text: str) -> float:
    """Return a share between 0 and 1, neither of them."""
    value = _number(text)
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(f"{text}: expected a share between 0 and 1")
    return value


def levels(text: str) -> tuple[float, ...]:
    """Return the numbers of a list with commas; the command says what is wrong with their order."""
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: expected levels such as 0.5,0.9,0.95") from None


def ranges(text: str) -> tuple[float, float, float]:
    """Return first, step and last in m, of 1:2:100."""
    try:
        first, step, last = (float(part) for part in text.split(":"))
    except ValueError:
        first, step, last = math.nan, math.nan, math.nan
    if not (0.0 <= first <= last <= 300.0 and step >= 0.01 and (last - first) / step < 10_000):
        raise argparse.ArgumentTypeError(f"{text}: expected FIRST:STEP:LAST in metres, such as 1:2:100")
    return first, step, last


def count(text: str) -> int:
    """Return a whole number from 1."""
    value = _whole(text)
    if not 0 < value <= 100_000:
        raise argparse.ArgumentTypeError(f"{text}: expected an integer from 1 to 100000")
    return value


def seed(text: str) -> int:
    """Return the seed of random draws."""
    value = _whole(text)
    if not 0 <= value < 2**63:
        raise argparse.ArgumentTypeError(f"{text}: expected an integer from 0 to 2^63 - 1")
    return value


def ticks(text: str) -> int:
    """Return a number of ticks from 1."""
    value = _whole(text)
    if not 0 < value < 2**31:
        raise argparse.ArgumentTypeError(f"{text}: expected a number of ticks, at least 1")
    return value


def loops(text: str) -> int:
    """Return how often, 0 for ever."""
    value = _whole(text)
    if not 0 <= value <= 1_000_000:
        raise argparse.ArgumentTypeError(f"{text}: expected how often, 0 to 1000000; 0 is for ever")
    return value


def even(text: str) -> int:
    """Return an even number: the order of a filter."""
    value = _whole(text)
    if not 0 <= value <= 200 or value % 2:
        raise argparse.ArgumentTypeError(f"{text}: expected an even number from 0 to 200")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _whole(text: str) -> int:
    return int(text) if text.isdecimal() else -1
