"""Trace files: their columns, units, schema and formats; see `vsensor.sinks.trace` for what a row is.

Formats: .npz (numpy alone reads it), .csv (comment lines begin with `#`), .parquet (needs polars).
Every file carries its schema, units and what the run says of itself as JSON.
"""

import json
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.errors import ConfigError, MissingExtraError
from vsensor.schema import check_schema
from vsensor.types import SIDE_NAMES
from vsensor.world.truth import RANGES_M

SCHEMA = "vsensor.trace/1"
Trace = dict[str, NDArray[Any]]
"""Column name -> array (rows,)."""

_METRES = [f"{r:g}m" for r in RANGES_M]
_TYPES: dict[str, Any] = {
    "t_ns": np.int64,
    "tick": np.int64,
    "side": np.uint8,
    "kind": np.uint8,
    "quality": np.uint8,
    "measured": np.uint8,
    **dict.fromkeys(["x_min_m", "x_max_m", "c0", "c1", "c2", "c3"], np.float64),
    **dict.fromkeys([f"truth_c{power}" for power in range(4)], np.float64),
    **dict.fromkeys([f"truth_y_{r}" for r in _METRES], np.float64),
    **dict.fromkeys([f"y_{r}" for r in _METRES], np.float64),
    "lane_offset_m": np.float64,
    "truth_lane_offset_m": np.float64,
    "reason_unseen": np.uint8,
    "speed_mps": np.float64,
    "yaw_rate_radps": np.float64,
}
COLUMNS: tuple[str, ...] = tuple(_TYPES)
"""The columns of a trace, in order."""

UNITS: Mapping[str, str] = {
    "t_ns": "ns from the start of the run",
    "side": " ".join(f"{side.value}={name}" for side, name in SIDE_NAMES.items()),
    "kind": "MarkingKind as reported",
    "quality": "0..4",
    "measured": "1 measured, 0 predicted or not reported",
    "c0..c3": "y = c0 + c1 x + c2 x^2 + c3 x^3 in m, left positive",
    "truth_c0..c3": "best cubic through the true line where the fit had points",
    "reason_unseen": "0 seen, else why not: see vsensor.types.Unseen",
}
"""What a name's suffix does not say; stands in the file's metadata."""

ROW = np.dtype(list(_TYPES.items()))
"""One row as a numpy record."""

_PARQUET_KEY = "vsensor"

Writer = Callable[[Path, NDArray[Any], Mapping[str, object]], None]


def writer_for(path: Path) -> Writer:
    """Return the writer for the suffix of `path`; raises ConfigError, MissingExtraError."""
    writers: dict[str, Writer] = {".npz": _write_npz, ".csv": _write_csv, ".parquet": _write_parquet}
    if path.suffix not in writers:
        raise ConfigError(f"{path}: a trace ends in {', '.join(writers)}")
    if path.suffix == ".parquet":
        _polars()
    return writers[path.suffix]


def _write_npz(path: Path, table: NDArray[Any], metadata: Mapping[str, object]) -> None:
    columns: dict[str, Any] = {name: np.ascontiguousarray(table[name]) for name in COLUMNS}
    with path.open("wb") as file:
        np.savez_compressed(file, metadata=np.array(json.dumps(metadata)), **columns)


def _write_csv(path: Path, table: NDArray[Any], metadata: Mapping[str, object]) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"# {json.dumps(metadata)}\n{','.join(COLUMNS)}\n")
        for row in table:
            file.write(",".join(map(_cell, row.tolist())) + "\n")
        file.write(f"# rows {len(table)}\n")


def _cell(value: float) -> str:
    return "" if value != value else repr(value)


def _write_parquet(path: Path, table: NDArray[Any], metadata: Mapping[str, object]) -> None:
    frame = _polars().DataFrame({name: np.ascontiguousarray(table[name]) for name in COLUMNS})
    try:
        frame.write_parquet(path, metadata={_PARQUET_KEY: json.dumps(metadata)})
    except _polars().exceptions.PolarsError as error:  # a full disk among them
        raise OSError(str(error)) from None


def _polars() -> Any:
    try:
        import polars
    except ImportError:
        raise MissingExtraError("polars", "parquet", "a Parquet trace") from None
    return polars


def read_trace(path: Path) -> Trace:
    """Return the columns of a trace file; raises ConfigError where it is no trace, cut off, or newer."""
    return read_trace_and_metadata(path)[0]


def read_trace_and_metadata(path: Path) -> tuple[Trace, dict[str, Any]]:
    """Return the columns of a trace file, and what it says of itself (without its schema)."""
    readers = {".npz": _read_npz, ".csv": _read_csv, ".parquet": _read_parquet}
    if path.suffix not in readers:
        raise ConfigError(f"{path}: a trace ends in {', '.join(readers)}")
    try:
        columns, text = readers[path.suffix](path)
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    metadata = check_schema(_metadata(path, text), SCHEMA, str(path))
    return _checked(path, columns), metadata


def _metadata(path: Path, text: str) -> dict[str, Any]:
    try:
        metadata = json.loads(text)
    except ValueError:
        metadata = None
    if not isinstance(metadata, dict):
        raise ConfigError(f"{path}: not a trace: its description is no JSON object")
    return metadata


def _checked(path: Path, columns: Mapping[str, NDArray[Any]]) -> Trace:
    missing = [name for name in COLUMNS if name not in columns]
    if missing:
        raise ConfigError(f"{path}: column {missing[0]} is missing")
    lengths = {name: len(columns[name]) for name in COLUMNS}
    for name, length in lengths.items():
        if length != lengths["t_ns"]:
            raise ConfigError(f"{path}: column {name} has {length} rows, t_ns has {lengths['t_ns']}")
    return {name: _typed(path, name, columns[name]) for name in COLUMNS}


def _typed(path: Path, name: str, column: NDArray[Any]) -> NDArray[Any]:
    """Return the column in its type; refuses words, and anything but whole numbers in whole columns."""
    kind = np.dtype(_TYPES[name])
    number = np.asarray(column) if len(column) else np.empty(0, kind)
    if number.dtype.kind not in "iuf":
        raise ConfigError(f"{path}: column {name} holds no numbers")
    if kind.kind != "f":
        _require_whole(path, name, number, kind)
    return number.astype(kind)


def _require_whole(path: Path, name: str, number: NDArray[Any], kind: np.dtype[Any]) -> None:
    low, high = np.iinfo(kind).min, np.iinfo(kind).max
    if not np.array_equal(number, np.floor(number)):
        raise ConfigError(f"{path}: column {name} holds values that are not whole")
    if len(number) and not low <= number.min() <= number.max() <= high:
        raise ConfigError(f"{path}: column {name} holds values outside of {low} to {high}")


def _read_npz(path: Path) -> tuple[Trace, str]:
    try:
        with path.open("rb") as opened:
            file = np.load(opened, allow_pickle=False)
            if not isinstance(file, np.lib.npyio.NpzFile):
                raise ConfigError(f"{path}: not a trace: one bare array")
            arrays = {name: file[name] for name in file.files}
    except (zipfile.BadZipFile, zlib.error, ValueError, EOFError, KeyError, RuntimeError) as error:
        raise ConfigError(f"{path}: not a whole .npz file: {error}") from None
    text = str(arrays.pop("metadata", "null"))
    return {name: array for name, array in arrays.items() if array.ndim == 1}, text


def _read_csv(path: Path) -> tuple[Trace, str]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a trace: no text") from None
    if len(lines) < 2 or not lines[0].startswith("# {"):
        raise ConfigError(f"{path}: not a trace: its first line should hold the schema")
    names, body = lines[1].split(","), [line for line in lines[2:] if not line.startswith("#")]
    if lines[-1] != f"# rows {len(body)}":
        raise ConfigError(f"{path}: cut off after {len(body)} rows: the line with their number is missing")
    cells = [_numbers(path, number, line, names) for number, line in enumerate(body, 3)]
    columns = zip(*cells, strict=True) if cells else ([] for _ in names)
    return {name: np.array(column) for name, column in zip(names, columns, strict=True)}, lines[0][2:]


def _numbers(path: Path, number: int, line: str, names: list[str]) -> list[float]:
    cells = line.split(",")
    if len(cells) != len(names):
        raise ConfigError(f"{path}: line {number} has {len(cells)} values, {len(names)} were expected")
    try:
        return [_number(cell) for cell in cells]
    except ValueError as error:
        raise ConfigError(f"{path}: line {number}: {error}") from None


def _number(cell: str) -> float:
    if not cell:
        return float("nan")
    return int(cell) if cell.lstrip("-").isdigit() else float(cell)


def _read_parquet(path: Path) -> tuple[Trace, str]:
    polars = _polars()
    try:
        text = polars.read_parquet_metadata(path).get(_PARQUET_KEY, "null")
        frame = polars.read_parquet(path)
    except (polars.exceptions.PolarsError, ValueError) as error:
        raise ConfigError(f"{path}: not a whole .parquet file: {error}") from None
    return {name: frame[name].to_numpy() for name in frame.columns}, text
