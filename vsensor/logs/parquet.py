"""Decoded signals of a log as Parquet (polars, an extra).

By a DBC, run by run, in constant memory: one row per signal of a frame,

    t_ns  channel  message     signal       value     unit
    ...   can0     LEFT_LINE   LeftOffset   1.8325    m

By profiles, as one table in memory: one row per image, one column per quantity, as `vsensor decode` shows.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.codec import Database, Layout, decode_bulk, load_database
from vsensor.errors import ConfigError, LogError, MissingExtraError
from vsensor.logs.convert import Conversion, Progress, Replacing, read_through, table_through
from vsensor.logs.decode import decode_frames
from vsensor.logs.report import Notes
from vsensor.logs.table import ERROR, EXTENDED, REMOTE, Columns
from vsensor.profile import Profile, load_profiles


def _polars() -> Any:
    try:
        import polars
    except ImportError:
        raise MissingExtraError("polars", "parquet", "a Parquet table") from None
    return polars


def decode_to_parquet(
    source: Path,
    target: Path,
    *,
    profiles: Sequence[str],
    dbc: Path | None,
    rate_hz: float | None = None,
    progress: Progress | None = None,
) -> Conversion:
    """Decode by profiles, if any are named, else by a database. Raises as both, and ConfigError, DbcError."""
    if profiles:
        known = load_profiles(profiles, dbc)
        return quantities_to_parquet(source, target, known, rate_hz=rate_hz, progress=progress)
    if dbc is None:
        raise ConfigError(f"{target}: decoded signals need --dbc FILE or --profile NAME")
    return signals_to_parquet(source, target, load_database(dbc), rate_hz=rate_hz, progress=progress)


def quantities_to_parquet(
    source: Path,
    target: Path,
    profiles: Sequence[Profile],
    *,
    rate_hz: float | None = None,
    progress: Progress | None = None,
) -> Conversion:
    """Write the quantities of the profiles, a row per image. Raises LogError, MissingExtraError."""
    polars = _polars()
    table = decode_frames(table_through(source, rate_hz, progress), profiles).rows()
    frame = polars.DataFrame({"t_ns": table.t_ns, **table.columns}).fill_nan(None)
    with Replacing(target) as part:
        _write(frame.lazy(), part, target)
    return Conversion(path=target, frames=len(table), lost=(), notes=table.findings, what="rows")


def signals_to_parquet(
    source: Path,
    target: Path,
    database: Database,
    *,
    rate_hz: float | None = None,
    progress: Progress | None = None,
) -> Conversion:
    """Write the signals of all frames that the database describes; a signal that is not in a frame, no row.

    Raises LogError (also where no frame is described), MissingExtraError.
    """
    polars = _polars()
    from polars.io.plugins import register_io_source

    notes, unknown, rows = Notes(), dict[int, int](), 0
    layouts = {(one.arbitration_id, one.is_extended): one for one in database.layouts.values()}
    schema = _schema(polars, database)
    faults: list[LogError] = []

    def runs(*_: object) -> Iterator[Any]:
        nonlocal rows
        try:
            for columns in read_through(source, notes, rate_hz, progress):
                for piece in _decoded(columns, layouts, unknown):
                    part = {**piece, "channel": np.array(list(notes.channels))[piece["channel"]]}
                    rows += len(part["t_ns"])
                    yield polars.DataFrame(part, schema=schema)
        except LogError as error:  # polars would put it into an error of its own
            faults.append(error)

    with Replacing(target) as part:
        _write(register_io_source(runs, schema=schema), part, target)
        if faults:
            raise faults[0]
        if not rows:
            raise LogError(f"{source}: holds no frame that {database.path} describes")
    lost = (f"{sum(unknown.values())} frames of {len(unknown)} ids that {database.path} does not describe",)
    found = tuple(notes.problems())
    return Conversion(path=target, frames=rows, lost=lost if unknown else (), notes=found, what="values")


def _schema(polars: Any, database: Database) -> dict[str, Any]:
    signals = [signal for layout in database.layouts.values() for signal in layout.signals.values()]
    return {
        "t_ns": polars.Int64,
        "channel": polars.String,
        "message": polars.Enum(list(dict.fromkeys(database.layouts))),
        "signal": polars.Enum(list(dict.fromkeys(signal.name for signal in signals))),
        "value": polars.Float64,
        "unit": polars.Enum(list(dict.fromkeys(signal.unit for signal in signals))),
    }


def _decoded(
    columns: Columns, layouts: dict[tuple[int, bool], Layout], unknown: dict[int, int]
) -> Iterator[dict[str, Any]]:
    """Yield the values of one message at a time; frames without a layout, or too short, are counted."""
    sent = (columns.flags & (ERROR | REMOTE)) == 0
    keys = columns.arbitration_id.astype(np.int64) * 2 + (columns.flags & EXTENDED)
    for key in np.unique(keys[sent]).tolist():
        rows = np.flatnonzero(sent & (keys == key))
        layout = layouts.get((key >> 1, bool(key & 1)))
        whole = rows[columns.length[rows] >= layout.length] if layout is not None else rows[:0]
        if len(whole) < len(rows):
            unknown[key] = unknown.get(key, 0) + len(rows) - len(whole)
        if layout is None or not len(whole):
            continue
        for name, values in decode_bulk(layout, columns.data[whole][:, : layout.length]).items():
            there = ~np.isnan(values)
            yield {
                "t_ns": columns.t_ns[whole][there],
                "channel": columns.channel[whole][there],
                "message": np.full(np.count_nonzero(there), layout.name),
                "signal": np.full(np.count_nonzero(there), name),
                "value": values[there],
                "unit": np.full(np.count_nonzero(there), layout.signals[name].unit),
            }


def _write(frame: Any, part: Path, target: Path) -> None:
    try:
        frame.sink_parquet(part, compression="zstd")
    except (OSError, _polars().exceptions.PolarsError) as error:  # a full disk among them
        reason = " ".join(str(error).split())
        raise LogError(f"{target}: cannot be written: {reason}") from None
