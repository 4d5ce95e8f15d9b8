"""What is in a log, as a table for the terminal."""

import math
from collections.abc import Iterator

from vsensor.logs.inspect import ChannelSummary, LogSummary, MessageSummary

_HEAD = ("id", "name", "frames", "bytes", "cycle ms", "p99 +-", "gaps", "dupl.", "found")


def text_lines(summary: LogSummary) -> Iterator[str]:
    """Yield what was read, what is wrong with it, and a table of the messages of each channel."""
    yield from summary.report.lines()
    for channel in summary.channels:
        own = [message for message in summary.messages if message.channel == channel.name]
        yield ""
        yield (
            f"channel {channel.name}: {channel.frames} frames, {len(own)} ids, "
            f"{_load(channel, summary.bitrate_bps)}"
        )
        yield from _table(own)


def _load(channel: ChannelSummary, bitrate_bps: float) -> str:
    low, high = channel.load
    if math.isnan(low):
        return "load unknown: all frames have one time"
    return f"load {low:.1%} to {high:.1%} at {bitrate_bps / 1e3:g} kbit/s"


def _table(messages: list[MessageSummary]) -> Iterator[str]:
    named = any(message.name for message in messages)
    rows = [_HEAD, *(_row(message) for message in messages)]
    kept = [k for k in range(len(_HEAD)) if k != 1 or named]
    widths = {k: max(len(row[k]) for row in rows) for k in kept}
    for row in rows:
        cells = [row[k].ljust(widths[k]) if k in (1, 8) else row[k].rjust(widths[k]) for k in kept]
        yield "  ".join(cells).rstrip()


def _row(message: MessageSummary) -> tuple[str, ...]:
    digits = 8 if message.is_extended else 3
    lengths = message.lengths
    size = "-" if not lengths else str(lengths[0]) if len(lengths) == 1 else f"{lengths[0]}-{lengths[-1]}"
    gaps = f"{message.gaps} ({message.longest_gap_ms:.0f} ms)" if message.gaps else "-"
    return (
        f"{message.arbitration_id:0{digits}X}",
        message.name,
        str(message.frames),
        f"{size} FD" if message.is_fd else size,
        _milliseconds(message.cycle_ms),
        _milliseconds(message.jitter_p99_ms),
        gaps,
        str(message.duplicates) if message.duplicates else "-",
        ", ".join(message.findings()),
    )


def _milliseconds(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}" if value < 100 else f"{value:.0f}"
