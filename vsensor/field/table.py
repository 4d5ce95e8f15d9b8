"""The table of errors: one Parquet file per log in a folder, so that merging is listing.

    TABLE/drive_1.parquet    a row per image, side and range; of an image whose line is not reported one row
    TABLE/drive_2.parquet    without a range (quality 0); rows in order of t_ns, side, range_m

Beside the columns (`COLUMNS`) a file says in its metadata which schema it has and what it was made of.
Polars, an extra, reads and writes; nothing here holds more than a chunk of rows in memory.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import MissingExtraError, TableError, VsensorError
from vsensor.logs.convert import Replacing

SCHEMA = "vsensor.table/1"
ROW_GROUP = 1 << 18
"""Rows that are written, and can be skipped by a reader, at a time: 10 MB in memory."""

Info = dict[str, Any]
"""What a file's metadata says, as JSON has it; see `LogFile`."""
Rows = Mapping[str, Any]
"""Column -> array (N,) of some rows; NaN becomes null; `log` is added by the writer."""


class Masked(StrEnum):
    """Why a row should not be learned from; USED is the empty word. Of several reasons the first counts."""

    USED = ""
    INVALID = "invalid"  # a value of the line is missing or impossible
    NO_LINE = "no_line"  # not reported; the row has no range and no error
    RESET = "reset"  # of the sensor, of the log's clock, of the image counter
    LOW_SPEED = "low_speed"
    LANE_CHANGE = "lane_change"  # in reach of what the polynomial shows, and some seconds around it
    BEYOND_RANGE = "beyond_range"  # farther than the sensor says that it sees
    REFERENCE_GAP = "reference_gap"  # no good reference there, so no error


MASKS = tuple(Masked)
"""Code -> reason: `masked` is given to the writer as codes (N,) uint8, places in this."""

COLUMNS: Mapping[str, str] = {
    "log": "Categorical",
    "t_ns": "Int64",
    "side": "Int8",
    "range_m": "Float32",
    "error_m": "Float32",
    "masked": "Enum",
    "speed_mps": "Float32",
    "acceleration_mps2": "Float32",
    "yaw_rate_radps": "Float32",
    "future_yaw_rate_radps": "Float32",
    "curvature_per_m": "Float32",
    "night": "Boolean",
    "rain": "Float32",
    "x_max_m": "Float32",
    "quality": "Int8",
    "measured": "Boolean",
    "lane_width_m": "Float32",
}
"""Name -> polars type. `error_m`: reported line minus reference along its normal, left positive."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LogFile:
    """One file of a table. `info` has log, source, profile, reference, rows, seconds, masked, widths, ranges.

    `vsensor.field.scan` writes them; a file of another origin has `log` at most.
    """

    path: Path
    info: Info

    @property
    def log(self) -> str:
        """The log's id, as the column `log` has it."""
        return str(self.info.get("log", self.path.stem))


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Files of one schema, from one folder or several."""

    files: tuple[LogFile, ...]

    def scan(self, *, used_only: bool = False) -> Any:
        """Return a polars LazyFrame over all rows, or over those with an error that is not masked."""
        polars = need_polars()
        rows = polars.scan_parquet([file.path for file in self.files], glob=False)
        if used_only:
            rows = rows.filter((polars.col("masked") == "") & polars.col("error_m").is_not_null())
        return rows


def need_polars() -> Any:
    """Return polars; raises MissingExtraError without it."""
    try:
        import polars
    except ImportError:
        raise MissingExtraError("polars", "parquet", "a table of errors") from None
    return polars


def polars_schema() -> dict[str, Any]:
    """Return column -> polars type."""
    polars = need_polars()
    words = polars.Enum([str(mask) for mask in MASKS])
    return {name: words if kind == "Enum" else getattr(polars, kind)() for name, kind in COLUMNS.items()}


def write_table(path: Path, log: str, parts: Iterable[Rows], info: Info) -> int:
    """Write one log's file from runs of rows; returns how many rows. The file appears when it is whole.

    `info` is read when the last run has been written, so what is counted on the way can stand in it.
    Raises TableError where it cannot be written, and VsensorErrors of `parts`.
    """
    polars = need_polars()
    from polars.io.plugins import register_io_source

    schema, errors = polars_schema(), list[VsensorError]()

    def runs(*_: object) -> Iterator[Any]:
        try:
            for part in parts:
                rows = _frame(polars, schema, log, part)
                info["rows"] = info.get("rows", 0) + len(rows)
                yield rows
        except VsensorError as error:  # polars would wrap it in an error of its own
            errors.append(error)

    def metadata(_: object) -> dict[str, str]:
        return {"vsensor.schema": SCHEMA, "vsensor.info": json.dumps(info)}

    info["rows"] = 0
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TableError(f"{path.parent}: cannot be made: {error.strerror or error}") from None
    with Replacing(path) as part:
        try:
            source = register_io_source(runs, schema=schema)
            source.sink_parquet(part, compression="zstd", row_group_size=ROW_GROUP, metadata=metadata)
        except (OSError, polars.exceptions.PolarsError) as error:
            reason = " ".join(str(error).split())
            raise TableError(f"{path}: cannot be written: {reason}") from None
        if errors:
            raise errors[0]
    return int(info["rows"])


def _frame(polars: Any, schema: Mapping[str, Any], log: str, part: Rows) -> Any:
    """Return rows as a DataFrame of the schema: NaN as null, codes of `masked` as words."""
    words = polars.Series([str(mask) for mask in MASKS], dtype=schema["masked"])
    columns = {}
    for name, kind in schema.items():
        if name == "log":
            continue
        if name == "masked":
            columns[name] = words[np.asarray(part[name], dtype=np.uint32)].alias(name)
        else:
            columns[name] = polars.Series(name, part[name], nan_to_null=True).cast(kind)
    frame = polars.DataFrame(columns)
    return frame.select(polars.lit(log).cast(schema["log"]).alias("log"), polars.all())


def open_table(places: Sequence[Path | str]) -> Table:
    """Open folders of a table (or single files) as one; a file is read no further than its metadata.

    Raises TableError: nothing there, a file of another schema, or two files of the same log id (naming them).
    """
    files = [_opened(path) for place in places for path in _files(Path(place))]
    by_log: dict[str, Path] = {}
    for file in files:
        other = by_log.setdefault(file.log, file.path)
        if other is not file.path:
            raise TableError(f"{file.path}: log {file.log!r} is in {other} too; its rows would count twice")
    return Table(files=tuple(files))


def _files(place: Path) -> list[Path]:
    if place.is_file():
        return [place]
    if not place.is_dir():
        raise TableError(f"{place}: no such folder")
    found = sorted(path for path in place.glob("*.parquet") if not path.name.startswith("."))
    if not found:
        raise TableError(f"{place}: holds no .parquet file; `vsensor scan` makes a table")
    return found


def _opened(path: Path) -> LogFile:
    polars = need_polars()
    try:
        metadata = polars.read_parquet_metadata(path)
        schema = polars.read_parquet_schema(path)
    except (OSError, polars.exceptions.PolarsError) as error:
        raise TableError(f"{path}: is no whole Parquet file: {' '.join(str(error).split())}") from None
    found = metadata.get("vsensor.schema")
    if found != SCHEMA:
        raise TableError(f"{path}: its schema is {found!r}, {SCHEMA!r} was expected; scan the log again")
    for name, kind in polars_schema().items():
        if schema.get(name) != kind:
            raise TableError(f"{path}: column {name} is {schema.get(name, 'missing')}, expected {kind}")
    try:
        info = json.loads(metadata.get("vsensor.info", "{}"))
    except json.JSONDecodeError:
        raise TableError(f"{path}: its metadata vsensor.info is not JSON") from None
    return LogFile(path=path, info=info)
