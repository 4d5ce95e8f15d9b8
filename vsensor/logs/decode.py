"""Quantities of a log as a table: a row per burst of frames, which for a lane camera is a row per image."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np

from vsensor.errors import LogError
from vsensor.logs.read import read_log
from vsensor.logs.table import Columns, LogTable
from vsensor.profile import QUANTITIES, Column, Profile
from vsensor.types import Array, BoolArray, IntArray

BURST_NS = 5_000_000
"""A longer pause ends a burst: 13 frames at 500 kbit/s take 3 ms, the fastest cycles are 10 ms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DecodedTable:
    """Decoded quantities, R rows; `t_ns` (R,) is the time of each row's first frame.

    `columns`: quantity -> values (R,), NaN = not sent in this row, or not available. `findings` are
    sentences for the user.
    """

    t_ns: IntArray
    columns: dict[str, Array]
    findings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.t_ns)

    def csv_lines(self) -> Iterator[str]:
        """Yield a header and a line per row; times in seconds with all their digits, NaN as nothing."""
        yield ",".join(("time_s", *self.columns))
        for t_ns, row in _rows(self.t_ns, self.columns):
            yield ",".join((_seconds(t_ns), *(_plain(value) for value in row)))

    def text_lines(self, width: int | None = None) -> Iterator[str]:
        """Yield an aligned table, header of two lines; codes by name, NaN as "-", empty columns left out.

        Of more than `width` characters it becomes several tables, one below the other, each with the time.
        """
        kept = {name: values for name, values in self.columns.items() if not np.isnan(values).all()}
        heads = [("", "time_s"), *(tuple(name.split(".", 1)) if "." in name else ("", name) for name in kept)]
        widths = [max(len(part) for part in (*head, "-0.000123")) for head in heads]
        widths[0] = max([len(_seconds(int(t_ns), 6)) for t_ns in self.t_ns[[0, -1]]], default=6)
        names = list(kept)
        for first, last in _tables(widths, width):
            if first:
                yield ""
            some = [widths[0], *widths[first + 1 : last + 1]]
            for part in (0, 1):
                yield _aligned([heads[0][part], *(head[part] for head in heads[first + 1 : last + 1])], some)
            chosen = {name: kept[name] for name in names[first:last]}
            codes = [QUANTITIES[name].codes if name in QUANTITIES else None for name in chosen]
            for t_ns, row in _rows(self.t_ns, chosen):
                cells = [_shown(value, code) for value, code in zip(row, codes, strict=True)]
                yield _aligned([_seconds(t_ns, 6), *cells], some)


def _tables(widths: Sequence[int], width: int | None) -> Iterator[tuple[int, int]]:
    """Yield which columns (from, to; the time, `widths[0]`, not counted) fit beside each other."""
    first, used = 0, widths[0]
    for place, one in enumerate(widths[1:]):
        if width is not None and used + 1 + one > width and place > first:
            yield first, place
            first, used = place, widths[0]
        used += 1 + one
    yield first, len(widths) - 1


def _rows(t_ns: IntArray, columns: dict[str, Array]) -> Iterator[tuple[int, tuple[float, ...]]]:
    values = [column.tolist() for column in columns.values()]
    return zip(t_ns.tolist(), zip(*values, strict=True), strict=True)


def _aligned(cells: Sequence[str], widths: Sequence[int]) -> str:
    return " ".join(cell.rjust(width) for cell, width in zip(cells, widths, strict=True)).rstrip()


def _seconds(t_ns: int, digits: int = 9) -> str:
    return f"{t_ns // 10**9}.{t_ns % 10**9 // 10 ** (9 - digits):0{digits}d}"


def _plain(value: float) -> str:
    if math.isnan(value):
        return ""
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else f"{value:.9g}"


def _shown(value: float, codes: type[IntEnum] | None) -> str:
    if math.isnan(value):
        return "-"
    if codes is not None and value in list(codes):
        return codes(int(value)).name.lower()
    return str(int(value)) if value.is_integer() and abs(value) < 1e9 else f"{value:.6g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DecodedFrames:
    """Quantities of a log by frame: `columns` have places in `used`, the data frames of the log.

    `kinds` (len(used.t_ns),): see Profile.frame_kinds. `findings` are sentences for the user.
    """

    used: Columns
    columns: dict[str, Column]
    kinds: IntArray
    findings: tuple[str, ...]

    def rows(self, wanted: Callable[[str], bool] = lambda name: True) -> DecodedTable:
        """Return the wanted quantities, a row per burst of the frames that carry them."""
        columns = {name: column for name, column in self.columns.items() if wanted(name)}
        return _by_row(columns, self.used, self.kinds, self.findings)

    def series(self, name: str) -> tuple[IntArray, Array]:
        """Return times and values (N,) of a quantity in the order of the log, none if it is not there."""
        column = self.columns.get(name)
        if column is None:
            return np.empty(0, dtype=np.int64), np.empty(0)
        return self.used.t_ns[column.rows], column.values


def decode_log(path: Path | str, profiles: Sequence[Profile]) -> DecodedTable:
    """Decode all quantities of the profiles; a frame with a wrong CRC is left out and counted.

    Raises LogError if the log cannot be read or holds no frame of the profiles.
    """
    return decode_frames(read_log(path), profiles).rows()


def decode_frames(table: LogTable, profiles: Sequence[Profile]) -> DecodedFrames:
    """Decode all quantities of the profiles in a log; raises LogError if it holds no frame of them."""
    mask = table.data_frames()
    used = table.columns.taken(mask)
    extended = (used.flags & 1).astype(bool)
    columns: dict[str, Column] = {}
    findings, kinds = list(table.report.lines()), used.arbitration_id.astype(np.int64)
    for profile in profiles:
        wanted = {plan.layout.arbitration_id for plan in profile.messages}
        known = int(np.isin(used.arbitration_id, list(wanted)).sum())
        checked = profile.decode_arrays(
            used.arbitration_id, used.data, used.length, extended=extended, check=True
        )
        columns |= {
            name: column for name, column in checked.items() if name not in columns and len(column.rows)
        }
        found = profile.frame_kinds(used.arbitration_id, used.data, used.length, extended=extended)
        kinds = np.maximum(kinds, found)
        findings += _losses(profile, table, mask, known)
    if not columns:
        raise LogError(_nothing(table, profiles))
    return DecodedFrames(used=used, columns=columns, kinds=kinds, findings=tuple(findings))


def _losses(profile: Profile, table: LogTable, mask: BoolArray, known: int) -> list[str]:
    """Return how many frames with an id of the profile were refused: too short, or with a wrong CRC."""
    used = table.columns.taken(mask)
    bad, said = 0, "too short or wrong CRC"
    for plan in profile.messages:
        layout = plan.layout
        rows = (used.arbitration_id == layout.arbitration_id) & (used.flags & 1 == layout.is_extended)
        short = rows & (used.length < layout.length)
        bad += int(np.count_nonzero(short))
        guard = plan.guard
        whole = np.flatnonzero(rows & ~short)
        if guard is not None and len(whole) and used.data.shape[1] >= layout.length:
            right = guard.check_bulk(used.data[whole, : layout.length])
            bad += int(np.count_nonzero(~right))
    if profile.bursts:
        extended = (used.flags & 1).astype(bool)
        broken = profile.broken_rows(used.arbitration_id, used.data, used.length, extended=extended)
        torn = int(np.count_nonzero(broken))
        bad, said = max(bad, torn), "too short, wrong CRC, or of an image that is not intact"
    return [f"{bad} of {known} frames of profile {profile.name} left out: {said}"] if bad else []


def _nothing(table: LogTable, profiles: Sequence[Profile]) -> str:
    looked = ", ".join(
        f"{plan.layout.name} 0x{plan.layout.arbitration_id:X}" for p in profiles for plan in p.messages
    )
    ids = np.unique(table.arbitration_id)
    shown = ", ".join(f"0x{number:X}" for number in ids[:8].tolist()) + (", ..." if len(ids) > 8 else "")
    return f"{table.report.path}: holds no intact frame of {looked}; it has {len(ids)} ids: {shown}"


def _by_row(
    columns: dict[str, Column], used: Columns, kinds: IntArray, findings: tuple[str, ...]
) -> DecodedTable:
    """Put every quantity's values into the row of its burst; `kinds` (N,): see Profile.frame_kinds."""
    has_values = np.zeros(len(used.t_ns), dtype=bool)
    for column in columns.values():
        has_values[column.rows] = True
    rows = np.flatnonzero(has_values)
    starts = rows[_burst_starts(used.t_ns[rows], kinds[rows])]
    ordered = [name for name in QUANTITIES if name in columns]
    ordered += sorted(set(columns) - set(ordered))
    values: dict[str, Array] = {}
    for name in ordered:
        place = np.searchsorted(starts, columns[name].rows, side="right") - 1
        values[name] = np.full(len(starts), np.nan)
        values[name][place] = columns[name].values
    return DecodedTable(t_ns=used.t_ns[starts], columns=values, findings=findings)


def _burst_starts(t_ns: IntArray, kinds: IntArray) -> list[int]:
    """Return the places of the frames that begin a row: after a pause, or a kind that the row has."""
    pause = np.concatenate([[True], np.diff(t_ns) > BURST_NS])
    starts: list[int] = []
    seen: set[int] = set()
    for place, (identifier, paused) in enumerate(zip(kinds.tolist(), pause.tolist(), strict=True)):
        if paused or identifier in seen:
            starts.append(place)
            seen.clear()
        seen.add(identifier)
    return starts
