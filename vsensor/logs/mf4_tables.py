"""The description of an MDF 4 file: its groups of CAN frames, and where each field lies in a record."""

import struct
from dataclasses import dataclass, field

from vsensor.logs.mf4_blocks import Block, Blocks, BrokenError, Data
from vsensor.logs.mf4_unsorted import Whole, split_records
from vsensor.logs.report import Notes
from vsensor.logs.table import (
    Flag,
)

GROUPS = {"CAN_DataFrame": 0, "CAN_RemoteFrame": int(Flag.REMOTE), "CAN_ErrorFrame": int(Flag.ERROR)}
"""Name of a channel group -> flags of all its frames."""
_CHANNEL = struct.Struct("<4B2L")  # type, sync type, data type, bit in the byte, byte, bits
_GROUP = struct.Struct("<QQ8xLL")  # record id, records, data bytes, invalidation bytes
_VARIABLE, _MASTER, _VIRTUAL_MASTER = 1, 2, 3


@dataclass(frozen=True, slots=True)
class Place:
    """Where a channel lies in a record."""

    kind: int
    data_type: int
    bit: int
    byte: int
    bits: int
    data_link: int
    scale: tuple[float, float]  # offset, factor


@dataclass(slots=True)
class Table:
    """A channel group of CAN frames and the bytes of its records."""

    prefix: str
    record_id: int
    count: int
    size: int
    time: Place
    fields: dict[str, Place]
    records: Data | Whole
    variable: Data | Whole | None = None
    faults: list[str] = field(default_factory=list[str])


def tables_of(blocks: Blocks, notes: Notes) -> tuple[int, list[Table]]:
    """Return the start time since 1970 and the groups of CAN frames that hold any."""
    blocks.stream.seek(0)
    head = blocks.stream.read(64)
    if head[:3] not in (b"MDF", b"UnF"):
        raise BrokenError('not an MDF file: it does not begin with "MDF"')
    if len(head) < 64 or not head[8:9] == b"4":
        raise BrokenError(f"MDF version {head[8:12].decode('latin-1')!r}, 4 was expected")
    unfinished: int = struct.unpack_from("<H", head, 60)[0] if head[:3] == b"UnF" else 0
    header = blocks.at(64, "HD")
    if not header.links or len(header.data) < 8:
        raise BrokenError("its header is damaged")
    start_ns, found, place = struct.unpack_from("<Q", header.data)[0], [], header.links[0]
    seen: set[int] = set()
    while place and place not in seen:
        seen.add(place)
        try:
            group = blocks.at(place, "DG")
            found += _group(blocks, group, unfinished)
            place = group.links[0]
        except (BrokenError, struct.error, IndexError) as error:
            notes.fault = f"damaged in its description: {error}"
            break
    if start_ns >> 62:
        raise BrokenError(f"the impossible start time {start_ns}")
    return start_ns, found


def _group(blocks: Blocks, group: Block, unfinished: int) -> list[Table]:
    id_bytes = group.data[0]
    headers: list[tuple[int, Block]] = []
    place = group.links[1]
    while place and len(headers) < 10_000 and place not in {known for known, _ in headers}:
        headers.append((place, blocks.at(place, "CG")))
        place = headers[-1][1].links[0]
    channels = {at: _channels(blocks, block.links[1]) for at, block in headers}
    if not any(_prefix(names) for names in channels.values()):
        return []
    data = Data(blocks, group.links[2], open_end=bool(unfinished & 4))
    whole: dict[int, Whole] = {}
    if id_bytes:
        sizes = {}
        for at, block in headers:
            number, _, width, invalid = _GROUP.unpack_from(block.data)
            variable = bool(struct.unpack_from("<H", block.data, 16)[0] & 1)
            sizes[number] = (at, None if variable else width + invalid)
        whole = split_records(data, id_bytes, sizes)
    tables = []
    for at, block in headers:
        prefix = _prefix(channels[at])
        number, count, width, invalid = _GROUP.unpack_from(block.data)
        records = whole[at] if id_bytes else data
        size = width + invalid
        if prefix is None or size == 0:
            continue
        there = records.size // size
        table = _table(blocks, prefix, channels[at], records, whole, size)
        table.count = there if unfinished & 3 or id_bytes else min(count, there)
        if there < count and records.fault is None and not unfinished & 3:
            table.faults.append(f"{there} of {count} records of {prefix} are there")
        tables += [table] if table.count or records.fault is not None else []
    return tables


def _table(
    blocks: Blocks,
    prefix: str,
    channels: dict[str, Place],
    records: Data | Whole,
    whole: dict[int, Whole],
    size: int,
) -> Table:
    """Return the group's table; raises BrokenError where a field lies outside of the record."""
    time = next((place for place in channels.values() if place.kind in (_MASTER, _VIRTUAL_MASTER)), None)
    if time is None or time.kind == _VIRTUAL_MASTER:
        raise BrokenError(f"{prefix} has no channel of times")
    fields = {name.removeprefix(f"{prefix}."): place for name, place in channels.items() if "." in name}
    for name, place in (*fields.items(), ("time", time)):
        if place.byte + (place.bit + place.bits + 7) // 8 > size:
            raise BrokenError(f"{prefix}: {name} lies outside of its record")
    table = Table(prefix, 0, 0, size, time, fields, records)
    data = fields.get("DataBytes")
    if data is not None and data.kind == _VARIABLE and data.data_link:
        link = data.data_link
        table.variable = whole[link] if link in whole else Data(blocks, link)
    return table


def _prefix(names: dict[str, Place]) -> str | None:
    return next((p for p in GROUPS if any(name.startswith(f"{p}.") for name in names)), None)


def _channels(blocks: Blocks, place: int) -> dict[str, Place]:
    """Return all channels below `place` by name, those inside of structures too."""
    found: dict[str, Place] = {}
    waiting, seen = [place], set[int]()
    while waiting:
        at = waiting.pop()
        if not at or at in seen or len(seen) > 10_000:
            continue
        seen.add(at)
        if blocks.header(at)[0] != "CN":
            continue  # an array or a list of alternatives
        block = blocks.at(at, "CN")
        kind, _, data_type, bit, byte, bits = _CHANNEL.unpack_from(block.data)
        scale = _scale(blocks, block.links[4])
        found.setdefault(
            blocks.text(block.links[2]), Place(kind, data_type, bit, byte, bits, block.links[5], scale)
        )
        waiting += [block.links[0], block.links[1]]
    return found


def _scale(blocks: Blocks, place: int) -> tuple[float, float]:
    """Return offset and factor of a linear conversion; others only name values and do not matter here."""
    if not place:
        return 0.0, 1.0
    block = blocks.at(place, "CC")
    if block.data[0] != 1:
        return 0.0, 1.0
    offset, factor = struct.unpack_from("<2d", block.data, 24)
    return offset, factor
