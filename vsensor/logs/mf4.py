"""Reads CAN bus logging in MDF 4 (.mf4), chunk by chunk; nothing but numpy, no more than a chunk in memory.

Own reader: asammdf reads whole files, and files with flipped bytes ended the whole process in its C code.
Frames stand in channel groups CAN_DataFrame, CAN_RemoteFrame, CAN_ErrorFrame (ASAM bus logging standard),
each a table of records of fixed size; the tables are merged by time:

    DG data group ── CG channel group ── CN channels: where each field lies in a record
     └ data blocks                          └ cn_data: bytes of variable length (u32 length, bytes)
    unsorted: several CG share one DG, each record begins with the number of its group
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from vsensor.logs.mf4_blocks import Blocks, BrokenError, Data
from vsensor.logs.mf4_tables import GROUPS, Place, Table, tables_of
from vsensor.logs.mf4_unsorted import Whole
from vsensor.logs.report import Notes
from vsensor.logs.table import (
    CLASSIC_BYTES,
    FD_BYTES,
    Columns,
    Flag,
    Grain,
    frames_at_a_time,
    joined,
    possible,
)

CHUNK = 1 << 16
LEAST = 64  # records taken apart at a time: fewer take as long
BITS = {"EDL": Flag.FD, "BRS": Flag.BITRATE_SWITCH, "ESI": Flag.ERROR_STATE, "Dir": Flag.TRANSMITTED}
DLC_BYTES = np.array((0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64))
_UNSIGNED, _SIGNED, _REAL = (0, 1), (2, 3), (4, 5)  # little- and big-endian
_FEWEST_SECONDS, _MOST_SECONDS = -4e9, 9e9  # of a time since the start that fits into int64 ns with it


def read_mf4(
    stream: BinaryIO, notes: Notes, chunk: Grain = CHUNK, place: tuple[int, ...] | None = None
) -> Iterator[Columns]:
    """Yield all CAN frames of the file in order of time, in runs of about `chunk`.

    From the beginning, or from a `place` of the notes on: a record of the only group. A fault is kept in
    `notes`.
    """
    try:
        blocks = Blocks(stream)
        start_ns, tables = tables_of(blocks, notes)
    except BrokenError as error:
        notes.fault = str(error)
        return
    if not tables and notes.fault is None:
        notes.fault = "the file holds no CAN bus logging"
    first = place[0] if place and len(tables) == 1 else 0
    runs = [_chunks(table, start_ns, notes, chunk, first) for table in tables]
    for columns in _merged(runs):
        if len(tables) > 1:
            notes.place = None  # of some groups more is read than is given
        yield columns
    for table in tables:
        parts = (table.records, table.variable)
        damaged = [data.fault for data in parts if data is not None and data.fault is not None]
        notes.fault = notes.fault or next(iter([*damaged, *table.faults]), None)


def _chunks(table: Table, start_ns: int, notes: Notes, chunk: Grain, first: int) -> Iterator[Columns]:
    """Yield the frames of one group in file order, from record number `first` on."""
    while first < table.count:
        wanted = min(max(LEAST, frames_at_a_time(chunk)), table.count - first)
        raw = table.records.read(first * table.size, wanted * table.size)
        there = len(raw) // table.size
        if there:
            rows = np.frombuffer(raw, dtype=np.uint8, count=there * table.size).reshape(there, table.size)
            try:
                columns = _columns(table, rows, start_ns, notes)
            except BrokenError as error:
                table.faults.append(str(error))
                return
            notes.place = (first + there,)
            if len(columns.t_ns):
                yield columns
        if there < wanted:
            table.faults.append(f"{first + there} of {table.count} records of {table.prefix} are there")
            return
        first += wanted


def _columns(table: Table, rows: NDArray[np.uint8], start_ns: int, notes: Notes) -> Columns:
    fields, count = table.fields, len(rows)

    def number(name: str) -> NDArray[np.int64]:
        return _integers(rows, fields[name]) if name in fields else np.zeros(count, dtype=np.int64)

    identifiers = number("ID")
    extended = number("IDE") != 0 if "IDE" in fields else identifiers > 0x7FF
    flags = np.where(extended & (table.prefix != "CAN_ErrorFrame"), 1, 0) | GROUPS[table.prefix]
    for name, bit in BITS.items():
        flags |= np.where(number(name) != 0, int(bit), 0)
    length = number("DataLength") if "DataLength" in fields else DLC_BYTES[np.clip(number("DLC"), 0, 15)]
    length = np.clip(length, 0, 255)
    times, sane = _times(rows, table.time, start_ns)
    columns = Columns(
        times,
        (identifiers & 0x1FFF_FFFF).astype(np.uint32),
        _numbered(number("BusChannel"), notes),
        flags.astype(np.uint8),
        length.astype(np.uint8),
        np.zeros((count, CLASSIC_BYTES), dtype=np.uint8),
    )
    good = sane & possible(columns, notes)
    kept = columns if good.all() else columns.taken(good)
    data = _data(table, rows if good.all() else rows[good], kept.length.astype(np.int64))
    if table.prefix == "CAN_RemoteFrame":
        data = np.zeros_like(data)
    notes.impossible(int(np.count_nonzero(~sane)), "a time that no clock shows")
    return kept._replace(data=data)


def _integers(rows: NDArray[np.uint8], place: Place) -> NDArray[np.int64]:
    """Return an integer channel (N,)."""
    size = (place.bit + place.bits + 7) // 8
    if size > 8 or place.data_type not in (*_UNSIGNED, *_SIGNED):
        raise BrokenError(f"an integer of {place.bits} bits and data type {place.data_type}")
    padded = np.zeros((len(rows), 8), dtype=np.uint8)
    part = rows[:, place.byte : place.byte + size]
    padded[:, :size] = part if place.data_type in (0, 2) else part[:, ::-1]
    words = padded.view("<u8")[:, 0]
    spare = np.uint64(64 - place.bits)
    if place.bits == 0:
        return np.zeros(len(rows), dtype=np.int64)
    shifted = words >> np.uint64(place.bit) << spare
    if place.data_type in _SIGNED:
        return shifted.view(np.int64) >> spare.astype(np.int64)
    return (shifted >> spare).view(np.int64)


def _times(
    rows: NDArray[np.uint8], place: Place, start_ns: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return times since 1970 (N,), and which of them are possible; nanoseconds in integers stay exact."""
    offset, factor = place.scale
    step_ns = factor * 1e9
    if (
        place.data_type not in _REAL
        and offset == 0
        and step_ns >= 0.5
        and math.isclose(step_ns, round(step_ns), rel_tol=1e-12)
    ):
        ticks = _integers(rows, place)
        sane = np.abs(ticks) <= int(_MOST_SECONDS * 1e9 / step_ns)
        return start_ns + np.where(sane, ticks, 0) * round(step_ns), sane & (ticks != np.int64(-(2**63)))
    if place.data_type in _REAL and (place.bits not in (32, 64) or place.bit):
        raise BrokenError(f"a time of {place.bits} bits")
    if place.data_type in _REAL:
        size = place.bits // 8
        raw = np.ascontiguousarray(rows[:, place.byte : place.byte + size])
        values: NDArray[Any] = raw.view(f"{'<>'[place.data_type - 4]}f{size}")[:, 0].astype(np.float64)
    else:
        values = _integers(rows, place).astype(np.float64)
    with np.errstate(all="ignore"):  # NaN and infinity are told apart below
        seconds = values if (offset, factor) == (0.0, 1.0) else values * factor + offset
        sane = (seconds > _FEWEST_SECONDS) & (seconds < _MOST_SECONDS)
    return start_ns + np.rint(np.where(sane, seconds, 0.0) * 1e9).astype(np.int64), sane


def _data(table: Table, rows: NDArray[np.uint8], length: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Return data (N, 8) or (N, 64), zero beyond the length."""
    width = CLASSIC_BYTES if not len(length) or length.max() <= CLASSIC_BYTES else FD_BYTES
    data = np.zeros((len(rows), width), dtype=np.uint8)
    place = table.fields.get("DataBytes")
    if place is None or not len(rows):
        return data
    if table.variable is not None:
        _gather(table.variable, _integers(rows, replace(place, data_type=0)), length, data)
    else:
        there = min(width, place.bits // 8)
        data[:, :there] = rows[:, place.byte : place.byte + there]
    data[np.arange(width) >= length[:, None]] = 0
    return data


def _gather(
    variable: Data | Whole, offsets: NDArray[np.int64], length: NDArray[np.int64], data: NDArray[np.uint8]
) -> None:
    """Fill `data` from the bytes of variable length that stand at `offsets` behind a u32 of their length."""
    first, last = int(offsets.min()), int(offsets.max())
    if first < 0 or last + 4 > variable.size or last - first > 64 * CHUNK + (1 << 24):
        raise BrokenError("data bytes lie outside of their block")
    raw = np.frombuffer(variable.read(first, last - first + 4 + FD_BYTES) + bytes(FD_BYTES + 4), np.uint8)
    if len(raw) < last - first + 4:
        raise BrokenError("data bytes are cut off")
    base = offsets - first
    own = raw[base[:, None] + np.arange(4)].copy().view("<u4")[:, 0].astype(np.int64)
    columns = np.arange(data.shape[1])
    data[:] = raw[np.minimum(base[:, None] + 4 + columns, len(raw) - 1)]
    data[columns >= np.minimum(own, length)[:, None]] = 0


def _numbered(numbers: NDArray[np.int64], notes: Notes) -> NDArray[np.uint8]:
    channel = np.zeros(len(numbers), dtype=np.uint8)
    values, first = np.unique(numbers, return_index=True)
    for number in values[np.argsort(first)].tolist():
        channel[numbers == number] = notes.channel(str(number))
    return channel


def _merged(tables: list[Iterator[Columns]]) -> Iterator[Columns]:
    """Yield the runs of all groups as runs in order of time; of equal times, the earlier group's first."""
    heads: list[Columns | None] = [next(table, None) for table in tables]
    while alive := [k for k, head in enumerate(heads) if head is not None]:
        if len(alive) == 1:
            only = alive[0]
            yield _in_order(heads[only])  # type: ignore[arg-type]
            heads[only] = next(tables[only], None)
            continue
        limit = min(int(heads[k].t_ns[-1]) for k in alive)  # type: ignore[union-attr]
        parts = []
        for k in alive:
            head = heads[k]
            due = head.t_ns <= limit  # type: ignore[union-attr]
            parts.append(head.taken(due))  # type: ignore[union-attr]
            rest = head.taken(~due)  # type: ignore[union-attr]
            heads[k] = rest if len(rest.t_ns) else next(tables[k], None)
        yield _in_order(joined(parts))


def _in_order(columns: Columns) -> Columns:
    if (np.diff(columns.t_ns) >= 0).all():
        return columns
    return columns.taken(np.argsort(columns.t_ns, kind="stable"))
