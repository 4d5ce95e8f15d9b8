"""MDF 4 (.mf4) with CAN bus logging, read and written in bulk by asammdf (an extra).

Frames stand in the channel groups CAN_DataFrame, CAN_RemoteFrame and CAN_ErrorFrame of the ASAM bus
logging standard; times are float64 seconds since the file's start time (1e-9 s up to some 90 days).
"""

import logging
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from vsensor.errors import MissingExtraError
from vsensor.logs.report import Notes
from vsensor.logs.table import CLASSIC_BYTES, FD_BYTES, Columns, Flag, joined

_GROUPS = {"CAN_DataFrame": 0, "CAN_RemoteFrame": int(Flag.REMOTE), "CAN_ErrorFrame": int(Flag.ERROR)}
_BITS = {"EDL": Flag.FD, "BRS": Flag.BITRATE_SWITCH, "ESI": Flag.ERROR_STATE, "Dir": Flag.TRANSMITTED}


def require_asammdf() -> Any:
    """Return the module; raises MissingExtraError where it is not installed."""
    try:
        import asammdf
    except ImportError:
        raise MissingExtraError("asammdf", "mf4", "an MF4 log") from None
    return asammdf


def read_mf4(stream: BinaryIO, notes: Notes) -> Iterator[Columns]:
    """Yield all CAN frames of the file in order of time, as one run; a fault is kept in `notes`.

    Raises MissingExtraError without asammdf. A file with flipped bytes can end the whole process: seen
    in asammdf 8.8's C code (heap corruption in get_master), where no exception comes that could be caught.
    """
    asammdf = require_asammdf()
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # it prints what is raised here anyway
    if stream.read(3) not in (b"MDF", b"UnF"):
        notes.fault = 'not an MDF file: it does not begin with "MDF"'
        return
    stream.seek(0)
    try:
        mdf = asammdf.MDF(stream, process_bus_logging=False)
    except Exception as error:  # asammdf has no exception of its own for a broken file: any type comes
        notes.fault = f"not a readable MDF file: {type(error).__name__}: {error}"
        return
    parts: list[Columns] = []
    try:
        for index, group in enumerate(mdf.groups):
            parts += _group(mdf, index, group, notes)
    except Exception as error:  # as above, in the data blocks
        notes.fault = f"damaged in its data: {type(error).__name__}: {error}"
    finally:
        mdf.close()
    if not parts and notes.fault is None:
        notes.fault = "the file holds no CAN bus logging"
    columns = joined(parts)
    order = np.argsort(columns.t_ns, kind="stable")
    if len(order):
        yield columns.taken(order)


def _group(mdf: Any, index: int, group: Any, notes: Notes) -> list[Columns]:
    """Return the frames of one channel group, [] if it holds none."""
    names = {str(channel.name) for channel in group.channels}
    prefix = next((name for name in _GROUPS if any(n.startswith(f"{name}.") for n in names)), None)
    if prefix is None or not group.channel_group.cycles_nr:
        return []

    def column(field: str) -> NDArray[Any] | None:
        name = f"{prefix}.{field}"
        return np.asarray(mdf.get(name, group=index, raw=True).samples) if name in names else None

    seconds = mdf.get_master(index)
    count = len(seconds)
    identifiers = _or_zeros(column("ID"), count).astype(np.uint32)
    marked = column("IDE")
    extended = identifiers > 0x7FF if marked is None else marked != 0
    flags = np.where(extended & (prefix != "CAN_ErrorFrame"), int(Flag.EXTENDED), 0) | _GROUPS[prefix]
    for field, bit in _BITS.items():
        flags |= np.where(_or_zeros(column(field), count) != 0, int(bit), 0)
    data, length = _data(column("DataBytes"), column("DataLength"), column("DLC"), count)
    if prefix == "CAN_RemoteFrame":
        data = np.zeros_like(data)
    start_ns = _epoch_ns(mdf.header.start_time)
    return [
        Columns(
            start_ns + np.rint(seconds * 1e9).astype(np.int64),
            identifiers & np.uint32(0x1FFF_FFFF),
            _channels(_or_zeros(column("BusChannel"), count), notes),
            flags.astype(np.uint8),
            length.astype(np.uint8),
            data,
        )
    ]


def _or_zeros(column: NDArray[Any] | None, count: int) -> NDArray[np.int64]:
    return np.zeros(count, dtype=np.int64) if column is None else column.astype(np.int64)


def _data(
    data: NDArray[Any] | None, length: NDArray[Any] | None, dlc: NDArray[Any] | None, count: int
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return data (N, 8) or (N, 64), zero beyond the length, and the length (N,)."""
    if length is None:
        codes = np.array((0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64))
        length = codes[np.clip(_or_zeros(dlc, count), 0, 15)]
    lengths = np.clip(length.astype(np.int64), 0, FD_BYTES)
    width = CLASSIC_BYTES if count == 0 or lengths.max() <= CLASSIC_BYTES else FD_BYTES
    padded = np.zeros((count, width), dtype=np.uint8)
    if data is not None and data.ndim == 2:
        shared = min(width, data.shape[1])
        padded[:, :shared] = data[:, :shared]
    padded[np.arange(width) >= lengths[:, None]] = 0
    return padded, lengths


def _channels(numbers: NDArray[np.int64], notes: Notes) -> NDArray[np.uint8]:
    channel = np.zeros(len(numbers), dtype=np.uint8)
    for number in np.unique(numbers).tolist():
        channel[numbers == number] = notes.channel(str(number))
    return channel


def _epoch_ns(start: datetime) -> int:
    """Return a start time as integer ns since 1970; a time without a zone is read as UTC."""
    aware = start if start.tzinfo is not None else start.replace(tzinfo=UTC)
    return (aware - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1) * 1000


def write_mf4(path: Path, columns: Columns, channel_numbers: NDArray[np.uint8]) -> None:
    """Write a whole log; `channel_numbers` (N,) are the bus channels to write. Raises MissingExtraError."""
    asammdf = require_asammdf()
    first_ns = int(columns.t_ns.min()) if len(columns.t_ns) else 0
    start_ns = first_ns // 1000 * 1000
    mdf = asammdf.MDF(version="4.11")
    mdf.header.start_time = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=start_ns // 1000)
    kind = columns.flags & (Flag.REMOTE | Flag.ERROR)
    for prefix, bits in _GROUPS.items():
        rows = np.flatnonzero(kind == bits)
        rows = rows[np.argsort(columns.t_ns[rows], kind="stable")]  # a master channel must not run backwards
        if len(rows):
            chosen = columns.taken(rows)
            _append(asammdf, mdf, prefix, chosen, channel_numbers[rows], start_ns)
    mdf.save(path, overwrite=True, compression=1)
    mdf.close()


def _append(
    asammdf: Any, mdf: Any, prefix: str, columns: Columns, channels: NDArray[np.uint8], start_ns: int
) -> None:
    from asammdf.blocks.v4_constants import BUS_TYPE_CAN, FLAG_CG_BUS_EVENT, SOURCE_BUS

    width = columns.data.shape[1]
    fields: dict[str, NDArray[Any]] = {
        "BusChannel": channels,
        "ID": columns.arbitration_id,
        "IDE": (columns.flags & Flag.EXTENDED != 0).astype(np.uint8),
        "DLC": _dlc(columns.length),
        "DataLength": columns.length,
        "DataBytes": columns.data,
        **{name: (columns.flags & bit != 0).astype(np.uint8) for name, bit in _BITS.items()},
    }
    layout = [(f"{prefix}.{name}", values.dtype.str, values.shape[1:]) for name, values in fields.items()]
    samples = np.zeros(len(columns.t_ns), dtype=layout)
    for name, values in fields.items():
        samples[f"{prefix}.{name}"] = values
    source = asammdf.Source(prefix, "CAN", "", SOURCE_BUS, BUS_TYPE_CAN)
    seconds = (columns.t_ns - start_ns) / 1e9
    signal = asammdf.Signal(samples=samples, timestamps=seconds, name=prefix, source=source)
    mdf.append([signal], acq_name=f"{prefix}_{width}", acq_source=source, common_timebase=True)
    mdf.groups[-1].channel_group.flags |= FLAG_CG_BUS_EVENT


def _dlc(length: NDArray[np.uint8]) -> NDArray[np.uint8]:
    sizes = np.array((0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64))
    return np.searchsorted(sizes, length).astype(np.uint8)
