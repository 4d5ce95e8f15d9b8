"""Trace files: their columns, units and schema, and how they are read; see `vsensor.sinks.trace` for a row.

Written by `vsensor.sinks.rows`. Every file carries its schema, units and what the run says of itself as JSON.
Schema 1 had the columns up to yaw_rate_radps; of such a file the others are not known.
"""

import json
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.errors import ConfigError
from vsensor.schema import check_schema
from vsensor.sinks.rows import PARQUET_KEY, import_polars
from vsensor.types import SIDE_NAMES
from vsensor.world.truth import RANGES_M

SCHEMA = "vsensor.trace/2"
Trace = dict[str, NDArray[Any]]
"""Column name -> array (rows,)."""

P3_COEFFICIENTS = ("offset_m", "heading_rad", "curvature_per_m", "curvature_rate_per_m2")
"""y0, eps, C0, C1 of P3's equation (1): y = y0 + tan(eps) x + C0 x^2 / 2 + C1 x^3 / 6."""
LANE_QUANTITIES = ("lane_width_m", "lateral_speed_mps", "time_to_crossing_s")
POSE = ("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad")
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
_FIRST = tuple(_TYPES)  # the columns of schema 1
_TYPES |= {
    "occluded_by": np.int64,
    "occluded_share": np.float64,
    **dict.fromkeys([f"map_{name}" for name in P3_COEFFICIENTS], np.float64),
    **dict.fromkeys([f"fit_{name}" for name in P3_COEFFICIENTS], np.float64),
    "fit_std_m": np.float64,
    **dict.fromkeys([f"{who}{name}" for name in LANE_QUANTITIES for who in ("", "truth_")], np.float64),
    **dict.fromkeys([f"ego_{name}" for name in POSE], np.float64),
    "acceleration_mps2": np.float64,
    "lateral_acceleration_mps2": np.float64,
    "light": np.uint8,
    "rain": np.float64,
    "visibility_m": np.float64,
}
_UNKNOWN = {"occluded_by": -1, "light": 255}  # of an older file; NaN of all other columns
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
    "occluded_by": "id of the object that hides most of what is hidden of the true line, -1 none",
    "occluded_share": "part of the true line's paint within the window that something hides",
    "map_*": "P3's coefficients at the rear axle by the map's own curve: no fit",
    "fit_*": "P3's coefficients of the best cubic through all true points of the window",
    "ego_*": "pose of the road-level ego frame in the world",
    "light": "0 day, 1 dusk, 2 night, 255 not known",
}
"""What a name's suffix does not say; stands in the file's metadata."""

ROW = np.dtype(list(_TYPES.items()))
"""One row as a numpy record."""


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
    found = _metadata(path, text)
    metadata = check_schema(found, SCHEMA, str(path))
    return _checked(path, columns, is_old=found["schema"] != SCHEMA), metadata


def _metadata(path: Path, text: str) -> dict[str, Any]:
    try:
        metadata = json.loads(text)
    except ValueError:
        metadata = None
    if not isinstance(metadata, dict):
        raise ConfigError(f"{path}: not a trace: its description is no JSON object")
    return metadata


def _checked(path: Path, columns: Mapping[str, NDArray[Any]], *, is_old: bool) -> Trace:
    required = _FIRST if is_old else COLUMNS
    missing = [name for name in required if name not in columns]
    if missing:
        raise ConfigError(f"{path}: column {missing[0]} is missing")
    rows = len(columns["t_ns"])
    unknown = {name: np.full(rows, _UNKNOWN.get(name, np.nan)) for name in COLUMNS if name not in columns}
    columns = {**columns, **unknown}
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
    polars = import_polars()
    try:
        text = polars.read_parquet_metadata(path).get(PARQUET_KEY, "null")
        frame = polars.read_parquet(path)
    except (polars.exceptions.PolarsError, ValueError) as error:
        raise ConfigError(f"{path}: not a whole .parquet file: {error}") from None
    return {name: frame[name].to_numpy() for name in frame.columns}, text
