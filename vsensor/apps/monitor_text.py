"""The monitor's text: a screen of tables for a terminal, a line a second for a pipe. No terminal codes."""

from collections.abc import Iterable, Sequence
from math import isnan

from vsensor.apps.bus_watch import BusWatch, Change
from vsensor.apps.watching import FINE, MessageWatch
from vsensor.sinks.table_view import TableLine, line_texts
from vsensor.types import SIDE_NAMES, Side

OTHERS_SHOWN = 6
_HEAD = (
    *("message", "id", "frames", "cycle ms", "of", "longest", "age ms"),
    *("counter", "lost", "jumped", "stood", "CRC wrong", "short", "E2E", "q", "status"),
)
_LEFT_ALIGNED = {0, len(_HEAD) - 1}


def screen(
    watch: BusWatch, title: str, start_ns: int, now_ns: int, *, said: Sequence[str] = (), width: int = 100
) -> list[str]:
    """Return all that is known at `now_ns`, lines of at most `width` where that can be.

    `start_ns` is when listening began; `said` stands below the messages.
    """
    tables = [f"{title}   {_seconds(start_ns, now_ns)}   {frames_text(watch)}", ""]
    lines = watch.lines(now_ns)
    if any(name.endswith(".offset_m") for w in watch.watches for name in _quantities(w)):
        tables += [*line_texts(lines), ""]
    rows = [_row(w, status, now_ns) for w, status in zip(watch.watches, watch.statuses, strict=True)]
    tables += table((_HEAD, *rows))
    if said:
        tables += ["", *said]
    others = [f"{name} {value}" for name, value in watch.others(now_ns)]
    return [*tables, "", *_flowing(others, width)] if others else tables


def fitted(lines: Sequence[str], height: int) -> list[str]:
    """Return the lines that a terminal of so many has room for, and how many are left out."""
    room = height - 1  # the cursor stands below
    if len(lines) <= room:
        return list(lines)
    return [*lines[: room - 1], f"({len(lines) - room + 1} lines more in a taller terminal)"]


def one_line(watch: BusWatch, start_ns: int, now_ns: int) -> str:
    """Return what is known at `now_ns` in one line."""
    parts = [_seconds(start_ns, now_ns)]
    lines = watch.lines(now_ns)
    if any(name.endswith(".offset_m") for w in watch.watches for name in _quantities(w)):
        parts += [_line(side, lines[side]) for side in (Side.LEFT, Side.RIGHT)]
    troubled = watch.troubled
    said = f"{len(troubled)} of {len(watch.watches)} messages not ok" if troubled else "all messages ok"
    return "   ".join([*parts, f"{watch.frames} frames", said])


def change_text(change: Change, start_ns: int) -> str:
    """Return a change of a message's status as a line."""
    layout = change.watch.plan.layout
    text = f"{_seconds(start_ns, change.t_ns)}   {_id(change.watch)} {layout.name}: {change.status}"
    age_ns = change.watch.age_ns(change.t_ns)
    if change.status == "silent" and age_ns is not None:
        text += f" for {age_ns / 1e6:.0f} ms (cycle {change.watch.plan.cycle_ns / 1e6:g} ms)"
    elif change.status == "cycle off":
        text += f": {change.watch.cycle_ms:.1f} ms instead of {change.watch.plan.cycle_ns / 1e6:g} ms"
    return text


def frames_text(watch: BusWatch) -> str:
    """Return how many frames were heard, and of which ids that no profile knows."""
    count = sum(watch.foreign.values())
    if not count:
        return f"{watch.frames} frames"
    most = watch.foreign.most_common(OTHERS_SHOWN)
    shown = ", ".join(f"0x{number:X}" for (number, _), _ in most) + ", ..." * (len(watch.foreign) > len(most))
    return f"{watch.frames} frames, {count} of them of other ids: {shown}"


def table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows under their head, aligned: first and last column to the left, numbers to the right."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join(
            cell.ljust(width) if k in _LEFT_ALIGNED else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _row(watch: MessageWatch, status: str, now_ns: int) -> tuple[str, ...]:
    plan, troubles = watch.plan, watch.troubles
    age_ns = watch.age_ns(now_ns)
    has_counter = watch.is_protected and plan.guard is not None and plan.guard.counter_field is not None
    has_checksum = watch.is_protected and plan.guard is not None and plan.guard.checksum_field is not None
    return (
        plan.layout.name,
        _id(watch),
        str(watch.frames),
        _number(watch.cycle_ms, 1),
        f"{plan.cycle_ns / 1e6:g}" if plan.cycle_ns else "-",
        f"{watch.longest_ns / 1e6:.1f}" if watch.longest_ns else "-",
        "-" if age_ns is None else f"{age_ns / 1e6:.0f}",
        "-" if watch.counter is None else str(watch.counter),
        str(troubles.lost) if has_counter else "-",
        str(troubles.jumped) if has_counter else "-",
        str(troubles.repeated) if has_counter else "-",
        str(troubles.wrong_crc) if has_checksum else "-",
        str(troubles.short),
        watch.reception.value if watch.is_protected else "-",
        _number(watch.quality, 0),
        status if status == FINE else status.upper(),
    )


def _id(watch: MessageWatch) -> str:
    layout = watch.plan.layout
    return f"0x{layout.arbitration_id:0{8 if layout.is_extended else 3}X}"


def _quantities(watch: MessageWatch) -> Iterable[str]:
    return (binding.quantity for binding in watch.plan.told)


def _line(side: Side, line: TableLine | None) -> str:
    if line is None:
        return f"{SIDE_NAMES[side]} -"
    view = "" if isnan(line.x_max_m) else f" to {line.x_max_m:.0f} m"
    return f"{SIDE_NAMES[side]} {line.offset_m:+.3f} m q{line.quality}{view}"


def _seconds(start_ns: int, now_ns: int) -> str:
    return f"{(now_ns - start_ns) / 1e9:8.2f} s"


def _number(value: float, digits: int) -> str:
    return "-" if isnan(value) else f"{value:.{digits}f}"


def _flowing(words: Sequence[str], width: int) -> list[str]:
    """Return words beside each other in columns, as many as fit."""
    column = max(map(len, words)) + 3
    beside = max(1, width // column)
    return [
        "".join(word.ljust(column) for word in words[k : k + beside]).rstrip()
        for k in range(0, len(words), beside)
    ]
