"""One row per picture: where the vehicle is between the lines, as Parquet, CSV or MF4.

y left      left_offset_m > 0        the inner edges, at the front axle
  |  ================================================
  |  --- 0: the vehicle's centreline ----------------    heading_rad: of the lane's lines here
  |  ================================================
            right_offset_m < 0       lane_width_m across the lane
"""

import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from math import atan, nan
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import ConfigError, MissingExtraError, TableError
from vsensor.logs.mf4_signals import write_signals
from vsensor.signals import VehicleConfig, values_from
from vsensor.study.table import replace_file, write_csv
from vsensor.types import (
    NANOSECONDS_PER_SECOND,
    Array,
    CodeArray,
    EgoState,
    LaneEstimate,
    SensorMode,
    SignalValues,
    frozen,
)

SUFFIXES = (".parquet", ".csv", ".mf4")
UNITS = {"t_s": "s", "left_offset_m": "m", "right_offset_m": "m", "lane_width_m": "m", "heading_rad": "rad"}
CONFIDENCES = ("left_confidence", "right_confidence")
_STANDING = EgoState(t_ns=0, position_world_m=frozen([0.0, 0.0, 0.0]), speed_mps=nan)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """What a video says of the vehicle's place in its lane; all columns (N,), NaN where there is nothing.

    Offsets are y of the marking's inner edge at the front axle, left positive, so that the right one is
    below 0; `lane_width_m` is between them across the lane; `heading_rad` the direction of the lines there
    against the vehicle's axis, left positive; confidences 0 (no offset) to 4.
    """

    t_s: Array
    left_offset_m: Array
    right_offset_m: Array
    lane_width_m: Array
    heading_rad: Array
    left_confidence: CodeArray
    right_confidence: CodeArray

    def __len__(self) -> int:
        return len(self.t_s)

    def columns(self) -> dict[str, Any]:
        """Return the columns by name, in their order."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


COLUMNS = tuple(field.name for field in fields(Rows))


def rows_of(vehicle: VehicleConfig, estimates: Iterable[LaneEstimate]) -> Rows:
    """Return a row for each estimate; a line that is seen too far ahead to say where it is gives none."""
    return rows_from(_row(vehicle, estimate) for estimate in estimates)


def rows_from(rows: Iterable[tuple[float, ...]]) -> Rows:
    """Return rows from tuples of the columns in their order."""
    table = np.array(list(rows), dtype=np.float64).reshape(-1, len(COLUMNS))
    return _of(dict(zip(COLUMNS, table.T, strict=True)))


def _row(vehicle: VehicleConfig, estimate: LaneEstimate) -> tuple[float, ...]:
    values = values_from(vehicle, estimate, _STANDING, SensorMode.AVAILABLE)
    left_m, right_m = values["left.lane_offset_m"], values["right.lane_offset_m"]
    headings = [
        _heading_rad(values, word, vehicle.wheelbase_m)
        for word, offset_m in (("left", left_m), ("right", right_m))
        if offset_m == offset_m
    ]
    return (
        estimate.exposed_at_ns / NANOSECONDS_PER_SECOND,
        left_m,
        right_m,
        values["lane.width_m"],
        sum(headings) / len(headings) if headings else nan,
        values["left.quality"] if left_m == left_m else 0.0,
        values["right.quality"] if right_m == right_m else 0.0,
    )


def _heading_rad(values: SignalValues, word: str, x_m: float) -> float:
    c1, c2, c3 = (values[f"{word}.{name}"] for name in ("heading", "c2_per_m", "c3_per_m2"))
    return atan(c1 + x_m * (2.0 * c2 + x_m * 3.0 * c3))


def _of(columns: Mapping[str, Any]) -> Rows:
    kinds = {name: np.uint8 if name in CONFIDENCES else np.float64 for name in COLUMNS}
    return Rows(**{name: frozen(columns[name], kinds[name]) for name in COLUMNS})


# ---- files -----------------------------------------------------------------------------------------------


def require_writable(path: Path) -> None:
    """Raise ConfigError or MissingExtraError for a file that `write_rows` will not be able to write."""
    if path.suffix not in SUFFIXES:
        raise ConfigError(f"{path}: ends in {path.suffix or 'nothing'}; {', '.join(SUFFIXES)} were expected")
    require_place(path)
    if path.suffix == ".parquet":
        _polars("a Parquet table")


def require_place(path: Path) -> None:
    """Raise ConfigError for a place where no file can be."""
    if path.is_dir() or not path.parent.is_dir():
        where = "is a folder" if path.is_dir() else f"there is no folder {path.parent}"
        raise ConfigError(f"{path}: cannot be written: {where}")


def write_rows(path: Path, rows: Rows) -> None:
    """Write the rows by the file's suffix; raises as `require_writable`."""
    require_writable(path)
    if path.suffix == ".mf4":
        write_signals(path, rows.columns(), UNITS)
        return
    if path.suffix == ".csv":
        columns = [_cells(column) for column in rows.columns().values()]
        write_csv(path, [dict(zip(COLUMNS, row, strict=True)) for row in zip(*columns, strict=True)])
        return
    content = io.BytesIO()
    _polars(path.name).DataFrame(rows.columns()).fill_nan(None).write_parquet(content)
    replace_file(path, content.getvalue())


def _cells(column: Any) -> list[Any]:
    return [None if value != value else value for value in column.tolist()]


def read_rows(path: Path) -> Rows:
    """Read rows from Parquet or CSV; other columns are left. Raises TableError, MissingExtraError."""
    polars = _polars(path.name)
    try:
        frame = (
            polars.read_csv(path, infer_schema_length=None)
            if path.suffix == ".csv"
            else polars.read_parquet(path)
        )
    except (OSError, polars.exceptions.PolarsError) as error:
        raise TableError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None
    missing = [name for name in COLUMNS if name not in frame.columns]
    if missing:
        raise TableError(f"{path}: has no column {', '.join(missing)}; {', '.join(COLUMNS)} were expected")
    try:
        filled = {name: frame[name].cast(polars.Float64).fill_null(nan).to_numpy() for name in COLUMNS}
    except polars.exceptions.PolarsError:
        raise TableError(f"{path}: numbers were expected in {', '.join(COLUMNS)}") from None
    return _of({**filled, **{name: np.nan_to_num(filled[name]) for name in CONFIDENCES}})


def _polars(purpose: str) -> Any:
    try:
        import polars
    except ImportError:
        raise MissingExtraError("polars", "parquet", purpose) from None
    return polars
