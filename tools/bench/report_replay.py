"""Replay and conversion as rows and tables of the report."""

from collections.abc import Mapping, Sequence
from typing import Any

from tools.bench.tables import table

Report = Mapping[str, Any]
Row = Sequence[object]
NAMES = {
    "canplayer": "canplayer",
    "python-can": "python-can's player",
    "ours": "vsensor replay",
    "realtime": "vsensor replay --realtime",
    "unthrottled": "the same, kernel.sched_rt_runtime_us = -1",
    "bare": "bare loop, frames made before",
}
OTHERS = ("canplayer", "python-can")
P50_MS, P99_MS, SCHEDULE_P99_MS, HELD_P99_MS, DURATION_MS = 0.3, 1.0, 0.3, 1.0, 5.0
TIMES_PYTHON_CAN, CONVERT_S, FIRST_FRAME_S = 3.0, 15.0, 2.0
FLAT_MB = 20.0
"""Memory may differ by so much between a log and one many times as long: what an allocator keeps."""


def targets(found: Report) -> list[Row]:
    """Return the rows that have a target."""
    rows: list[Row] = []
    if "vcan" in found:
        rows += _beside_others(found["vcan"]["drive"]) + _throughput(found["vcan"]["without_waiting"])
        for who in [name for name in ("ours", "realtime", "unthrottled") if name in found["vcan"]["steady"]]:
            rows += _held(f"3000 frames/s, vcan, {NAMES[who]}", found["vcan"]["steady"][who])
    drive = found["schedule"]["drive"]["ours"]
    p99 = _at(drive, "beyond_queue", "p99")
    what = "replay's schedule at the send call, this machine's kernel, beyond the queue: p99"
    rows.append((what, f"{SCHEDULE_P99_MS} ms", f"{p99:.3f} ms", p99 <= SCHEDULE_P99_MS))
    rows += _held("8000 frames/s, the schedule", found["schedule"]["full"]["ours"])
    return rows + _laid(found) + _long(found)


def page(found: Report) -> str:
    """Return all that was measured of replay as tables."""
    text = (
        f"{found['seconds']:g} s of the RAV4's drive, of 3000 and of 8000 frames/s. Times by the kernel's "
        "receive stamps, counted from each player's own best frame; at the send call on this machine's. "
        "Beyond the queue: less what frames with equal times wait for each other, each for as long as a raw "
        "socket takes to send one. Vsensor with FIFO where named, else as its users start it."
    )
    parts = [f"## Replay\n\n{text}"]
    if "not_on_vcan" in found:
        parts.append(f"Not measured on vcan: {' '.join(found['not_on_vcan'])}")
    places = {f"{log}, send call": players for log, players in found["schedule"].items()}
    if "vcan" in found:
        places = {"drive, vcan": found["vcan"]["drive"], "steady, vcan": found["vcan"]["steady"]} | places
    rows = [(place, NAMES[who], *_cells(one)) for place, all_ in places.items() for who, one in all_.items()]
    quantiles = "p50, p99, p99.9, max, ms"
    head = ("log", "who", f"error: {quantiles}", f"beyond the queue: {quantiles}", "duration, ms", "lost")
    return "\n\n".join([*parts, table(head, rows)])


def _beside_others(drive: Report) -> list[Row]:
    ours, rows = drive["ours"], list[Row]()
    for name, most in (("p50", P50_MS), ("p99", P99_MS)):
        value = _at(ours, "beyond_queue", name)
        what = f"replay on vcan, RAV4's drive, error beyond the queue: {name}"
        rows.append((what, f"{most} ms", f"{value:.3f} ms", value <= most))
    for other in OTHERS:
        for name in ("p50", "p99"):
            one, their = _at(ours, "raw", name), _at(drive[other], "raw", name)
            what = f"the same, raw error {name} below {NAMES[other]}"
            rows.append((what, f"{their:.3f} ms", f"{one:.3f} ms", one < their))
    off_ms = ours.get("duration_error_ms", float("nan"))
    rows.append(
        ("the same: duration", f"{DURATION_MS:g} ms", f"{off_ms:+.3f} ms", abs(off_ms) <= DURATION_MS)
    )
    return [*rows, _order("the same", ours)]


def _throughput(rates: Report) -> list[Row]:
    ours, theirs = (rates[who]["frames_per_s"] for who in ("ours", "python-can"))
    shown = f"{ours / theirs:.1f} x ({ours:.0f} against {theirs:.0f} frames/s)"
    what = "replay without waiting on vcan, against python-can's player"
    peer = f"{ours / rates['canplayer']['frames_per_s']:.2f} x"
    return [
        (what, f"{TIMES_PYTHON_CAN:g} x", shown, ours >= TIMES_PYTHON_CAN * theirs),
        ("the same, against canplayer, in C", "", peer, None),
        _order("the same", rates["ours"]),
    ]


def _held(what: str, one: Report) -> list[Row]:
    p99 = _at(one, "raw", "p99")
    return [
        (f"held rate, {what}: p99", f"{HELD_P99_MS:g} ms", f"{p99:.3f} ms", p99 < HELD_P99_MS),
        _order("the same", one),
    ]


def _laid(found: Report) -> list[Row]:
    rows: list[Row] = []
    for speed, one in found.get("overlay", {}).items():
        off_ms = f"{one['duration_error_ms']:+.1f} ms, {one['frames_per_s']:.0f} frames/s"
        what = f"replay with an overlay at speed {speed}, the schedule: lateness p50, p99"
        rows += [
            (what, "", _pair(one["lateness"]), None),
            ("the same: duration's error, rate", "", off_ms, None),
        ]
    if "gateway" in found:
        one = found["gateway"]
        lost = f"{one['refused']}, {one['images_lost']} of {one['images'] + one['images_lost']}"
        rows += [
            ("gateway on vcan, kernel's receive time to sent: p50, p99", "", _pair(one["latency"]), None),
            ("the same: frames refused, images too late", "", lost, None),
        ]
    return rows


def _pair(figures: Report) -> str:
    return f"{figures['p50']:.3f}, {figures['p99']:.3f} ms"


def _long(found: Report) -> list[Row]:
    quarter, whole = found["convert"]
    seconds, count = whole["seconds"], found["million"]
    rows: list[Row] = [
        (f"{count} frames from .blf to .mf4", f"{CONVERT_S:g} s", f"{seconds:.1f} s", seconds <= CONVERT_S),
        _flat("the same", quarter["memory_mb"], whole["memory_mb"]),
    ]
    for name, first_s in found["first_frame_s"].items():
        if name.startswith("long"):
            what = f"first frame of {10 * count} frames, {name.removeprefix('long')}, from the command on"
            shown = f"{first_s:.2f} s ({found['first_frame_s']['short.log']:.2f} of a short log)"
            rows.append((what, f"{FIRST_FRAME_S:g} s", shown, first_s <= FIRST_FRAME_S))
    return [*rows, _flat("replay of so many", *found["memory_mb"])]


def _flat(what: str, before_mb: float, after_mb: float) -> Row:
    grown = after_mb - before_mb
    shown = f"{grown:+.1f} MB (of {after_mb:.0f})"
    return f"{what}: more memory than for a shorter one", f"{FLAT_MB:g} MB", shown, grown <= FLAT_MB


def _order(what: str, one: Report) -> Row:
    shown = f"{one['lost']}, {one['unlike']}"
    return f"{what}: frames lost, out of order", "0, 0", shown, shown == "0, 0"


def _at(one: Report, kind: str, name: str) -> float:
    """Return a quantile; NaN, which keeps no target, where frames were lost and there is none."""
    return float(one.get(kind, {}).get(name, float("nan")))


def _cells(one: Report) -> tuple[object, ...]:
    figures = (
        ", ".join(f"{value:.3f}" for value in one.get(kind, {}).values()) for kind in ("raw", "beyond_queue")
    )
    off_ms = one.get("duration_error_ms")
    return (*figures, "-" if off_ms is None else f"{off_ms:+.3f}", one["lost"])
