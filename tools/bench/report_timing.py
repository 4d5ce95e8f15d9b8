"""Lateness, encoding and decoding as rows and tables of the report."""

from collections.abc import Mapping, Sequence
from typing import Any

from tools.bench.tables import table
from tools.bench.timing import NAMES, PLACES, TARGETS_MS

Report = Mapping[str, Any]


def encoding(found: Report) -> list[Sequence[object]]:
    """Return the row of encoding."""
    what = f"encoding the native set, {found['frames_a_tick']} frames, p50"
    kept = found["p50_us"] <= found["target_us"]
    return [
        (what, f"{found['target_us']:.0f} µs", f"{found['p50_us']:.1f} µs (p99 {found['p99_us']:.1f})", kept)
    ]


def decoding(found: Report) -> list[Sequence[object]]:
    """Return the rows of decoding."""
    rate, times = found["frames_per_s"], found["times_faster"]
    ours, theirs = rate["checked"], rate["python-can + cantools"]
    return [
        (
            "decoding in memory through a profile, every CRC checked",
            f"{found['target_frames_per_s'] / 1e6:.1f} million frames/s",
            f"{ours / 1e6:.2f} million frames/s ({rate['unchecked'] / 1e6:.2f} unchecked)",
            ours >= found["target_frames_per_s"],
        ),
        (
            "the same against python-can's reader with a cantools loop",
            f"{found['target_times']:.0f} x faster",
            f"{times:.0f} x ({theirs / 1e3:.0f} thousand frames/s)",
            times >= found["target_times"],
        ),
        ("the same: signals unlike cantools", "0", found["unlike_cantools"], found["unlike_cantools"] == 0),
    ]


def timing(found: Report) -> list[Sequence[object]]:
    """Return the rows of lateness that have a target: those on this machine's own kernel."""
    rows: list[Sequence[object]] = []
    for row in found["rows"]:
        p99, place = row["lateness"]["p99"], row["bus"]
        what = f"lateness p99, {NAMES[row['who']]}, {row['cycle_ms']} ms, {place}"
        if row["who"] in TARGETS_MS:
            rows.append(_judged(what, row, p99))
        if row["who"] in ("ours", "realtime") and place == "loopback":
            peer = next(r for r in found["rows"] if _place(r) == ("thread", row["cycle_ms"], place))
            theirs = peer["lateness"]["p99"]
            rows.append(
                (f"{what}: below python-can's thread", f"{theirs:.3f} ms", f"{p99:.3f} ms", p99 < theirs)
            )
        if row["who"] == "long":
            dropped = f"{row['slots_dropped']} of {row['slots']}"
            what = f"slots dropped in {row['seconds'] / 60:.0f} minutes, {row['cycle_ms']} ms, {place}"
            rows.append((what, "0", dropped, row["slots_dropped"] == 0))
    return rows


def timing_page(found: Report) -> str:
    """Return all that was measured about time as tables."""
    text = (
        f"timing.png. Each sender for {found['seconds']:g} s, one after the other, each in a process of its "
        "own. Lateness of the first frame of a burst at the send call, against its slot; of python-can's "
        "thread and the BCM, whose slots nobody knows, against the best of their own frames (the BCM's by "
        "the kernel's receive time). Cycle error: interval between first frames by the kernel's receive "
        "time, less the cycle, without sign. vsensor computes and sends 13 frames a cycle, the others one "
        "that never changes."
    )
    parts = [f"## Timing\n\n{text}"]
    if "vcan" in found:
        parts.append(f"Not measured on vcan: {' '.join(found['vcan'])}")
    for bus, place in PLACES.items():
        rows = [row for row in found["rows"] if row["bus"] == bus]
        if rows:
            parts.append(f"### On {place}\n\n{_table(rows)}")
    refused = {text for row in found["rows"] for text in row.get("not_permitted", ())}
    return "\n\n".join([*parts, *sorted(refused)])


def _judged(what: str, row: Report, p99: float) -> Sequence[object]:
    """Return a row with its target; inside user-mode Linux it is a report only."""
    target = TARGETS_MS[row["who"]]
    counts = row["bus"] == "loopback"
    shown = f"{p99:.3f} ms; slots dropped {row['slots_dropped']} of {row['slots']}"
    return what, f"{target} ms" if counts else "", shown, p99 <= target if counts else None


def _place(row: Report) -> tuple[object, ...]:
    return row["who"], row["cycle_ms"], row["bus"]


def _table(rows: Sequence[Report]) -> str:
    head = (
        "cycle, ms",
        "who",
        "lateness, ms: p50, p99, p99.9, max",
        "cycle error",
        "burst p50, p99",
        "age p50, p99",
    )
    return table(head, [_cells(row) for row in rows])


def _cells(row: Report) -> tuple[object, ...]:
    return (
        row["cycle_ms"],
        NAMES[row["who"]] + (f" ({row['seconds'] / 60:.0f} minutes)" if row["who"] == "long" else ""),
        _numbers(row["lateness"]),
        _numbers(row["cycle_error"]),
        _numbers(row.get("burst", {}), ("p50", "p99")),
        _numbers(row.get("age", {}), ("p50", "p99")),
    )


def _numbers(figures: Report, names: Sequence[str] = ("p50", "p99", "p99.9", "max")) -> str:
    return ", ".join(f"{figures[name]:.3f}" for name in names if name in figures) or "-"
