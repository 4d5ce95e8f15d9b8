"""What an ECU could stumble over in a bus description."""

from collections.abc import Iterable

from vsensor.codec.layout import Database, Layout, SignalLayout


def audit(database: Database) -> list[str]:
    """Return what an ECU could stumble over, one sentence each: ranges, overlaps, start values, timing."""
    found = [f"{a} and {b} have the same id" for a, b in shared_ids(database.layouts.values())]
    for layout in database.layouts.values():
        if not layout.cycle_ms:
            found.append(f"{layout.name}: no cycle time")
        found += [f"{layout.name}: signals {a} and {b} overlap" for a, b in overlaps(layout)]
        for signal in layout.signals.values():
            found += [f"{layout.name}.{signal.name}: {text}" for text in _audit_signal(signal)]
    return found


def shared_ids(layouts: Iterable[Layout]) -> list[tuple[str, str]]:
    """Return the pairs of messages that a receiver cannot tell apart."""
    owner: dict[tuple[int, bool], str] = {}
    found: list[tuple[str, str]] = []
    for layout in layouts:
        other = owner.setdefault((layout.arbitration_id, layout.is_extended), layout.name)
        if other != layout.name:
            found.append((other, layout.name))
    return found


def _audit_signal(signal: SignalLayout) -> list[str]:
    if signal.is_float:
        return []
    low, high, ends = signal.minimum, signal.maximum, _ends(signal)
    excess = excess_range(signal)
    found = [excess] if excess else []
    if is_placeholder(signal):
        found.append(f"range [{low:g}|{high:g}] is a placeholder, the bits hold [{ends[0]:g}|{ends[1]:g}]")
    return [*found, *wrong_raws(signal)]


def wrong_raws(signal: SignalLayout) -> list[str]:
    """Return which of start and SNA value the bits do not hold."""
    raws = () if signal.is_float else (("start value", signal.start_raw), ("SNA value", signal.sna_raw))
    return [
        f"{word} {raw:g} (raw) is not among [{signal.raw_min}|{signal.raw_max}]"
        for word, raw in raws
        if raw is not None and not signal.raw_min <= raw <= signal.raw_max
    ]


def is_placeholder(signal: SignalLayout) -> bool:
    """Return whether nobody wrote a range: editors of databases then put [0|1] or [0|0]."""
    return (signal.minimum, signal.maximum) in ((0, 1), (0, 0)) and signal.length > 1


def excess_range(signal: SignalLayout, steps: float = 0.5) -> str:
    """Return what is wrong with a declared range that the bits miss by more than some steps; "" if nothing.

    A placeholder says nothing of the range, so it exceeds nothing: [0|1] of a curvature.
    """
    low, high, ends = signal.minimum, signal.maximum, _ends(signal)
    slack = abs(signal.scale) * steps
    if signal.is_float or low is None or high is None or is_placeholder(signal):
        return ""
    if low >= ends[0] - slack and high <= ends[1] + slack:
        return ""
    return f"range [{low:g}|{high:g}] exceeds what {signal.length} bits hold, [{ends[0]:g}|{ends[1]:g}]"


def _ends(signal: SignalLayout) -> tuple[float, float]:
    low, high = sorted((signal.physical(signal.raw_min), signal.physical(signal.raw_max)))
    return low, high


def overlaps(layout: Layout) -> list[tuple[str, str]]:
    """Return the pairs of signals that share bits and can be in one frame."""
    owner: dict[int, SignalLayout] = {}
    found: dict[tuple[str, str], None] = {}
    for signal in layout.signals.values():
        for bit in _bits(layout, signal):
            other = owner.setdefault(bit, signal)
            if other is not signal and not _exclusive(other, signal):
                found[other.name, signal.name] = None
    return list(found)


def _bits(layout: Layout, signal: SignalLayout) -> list[int]:
    """Return the bits that a signal covers, counted from bit 0 of byte 0 upwards."""
    places = range(signal.shift, signal.shift + signal.length)
    if not signal.big_endian:
        return list(places)
    return [8 * (layout.length - 1 - place // 8) + place % 8 for place in places]


def _exclusive(a: SignalLayout, b: SignalLayout) -> bool:
    return a.mux_signal is not None and a.mux_signal == b.mux_signal and not a.mux_ids & b.mux_ids
