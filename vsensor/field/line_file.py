"""Measured lines as reference, from a file: a LIDAR's, a survey's."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import ConfigError
from vsensor.field.foot import Polyline, nearest_places, resampled_line
from vsensor.field.reference import BESIDE_M, STEP_M, Near, Poses
from vsensor.field.table import need_polars
from vsensor.types import SIDE_NAMES, Array, Side


class FileReference:
    """A line from a file, one for each side, such as a LIDAR's or a survey's.

    CSV or Parquet with the columns side (left, right, next_left, next_right), x_m, y_m in driving direction;
    an empty place breaks a line. In the world frame of the log's pose (ego.x_m, ego.y_m, ego.yaw_rad: x east,
    y north), or without a pose in that of the vehicle where its motion begins (x ahead, y left).
    """

    kind = "file"

    def __init__(self, path: Path, poses: Poses, notes: tuple[str, ...]) -> None:
        """Read the file; raises ConfigError."""
        self.poses, self.notes = poses, notes
        self._lines: dict[Side, Polyline] = {}
        self._places: dict[Side, Array] = {}
        for side, (x, y) in _read_lines(path).items():
            known = np.isfinite(x) & np.isfinite(y)
            broken = np.concatenate([[False], np.cumsum(~known)[known][1:] > np.cumsum(~known)[known][:-1]])
            if np.count_nonzero(known) < 2:
                raise ConfigError(f"{path}: side {SIDE_NAMES[side]} has fewer than 2 points")
            line = resampled_line(x[known], y[known], broken[1:], STEP_M)
            self._lines[side] = line
            self._places[side] = _located(line, poses)

    def near(self, start: int, stop: int, side: Side) -> Iterator[Near]:
        """Yield the one line of the side."""
        if side in self._lines:
            place = self._places[side][start:stop]
            lane = np.zeros(stop - start, dtype=np.int64)
            yield Near(images=np.arange(start, stop), line=self._lines[side], place=place, lane=lane)


def _located(line: Polyline, poses: Poses) -> Array:
    """Return the places (N,) on a line beside the vehicle, NaN where it is not near."""
    known = np.isfinite(poses.x_m)
    places = np.full(len(known), np.nan)
    x, y, yaw = poses.x_m[known], poses.y_m[known], poses.yaw_rad[known]
    places[known] = nearest_places(line, x, y, yaw, BESIDE_M)
    return places


def _read_lines(path: Path) -> dict[Side, tuple[Array, Array]]:
    rows = _parquet_rows(path) if path.suffix.lower() == ".parquet" else _csv_rows(path)
    found: dict[Side, list[tuple[float, float]]] = {}
    sides = {word: side for side, word in SIDE_NAMES.items()}
    sides |= {str(int(side)): side for side in Side}
    for number, (word, x, y) in enumerate(rows, 2):
        side = sides.get(str(word).strip().lower())
        try:
            point = tuple(float(v) if str(v or "").strip() else np.nan for v in (x, y))
        except ValueError:
            raise ConfigError(
                f"{path}: line {number}: x_m, y_m = {x!r}, {y!r}: numbers were expected"
            ) from None
        if side is None:
            raise ConfigError(
                f"{path}: line {number}: side = {word!r}: {', '.join(SIDE_NAMES.values())} expected"
            )
        found.setdefault(side, []).append((point[0], point[1]))
    if not found:
        raise ConfigError(f"{path}: holds no point")
    return {side: (np.array(points)[:, 0], np.array(points)[:, 1]) for side, points in found.items()}


def _csv_rows(path: Path) -> Iterator[tuple[Any, Any, Any]]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            _require_columns(path, reader.fieldnames or ())
            for row in reader:
                yield row["side"], row["x_m"], row["y_m"]
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path}: not CSV: {error}") from None


def _parquet_rows(path: Path) -> Iterator[tuple[Any, Any, Any]]:
    polars = need_polars()
    try:
        frame = polars.read_parquet(path)
    except (OSError, polars.exceptions.PolarsError) as error:
        raise ConfigError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None
    _require_columns(path, frame.columns)
    yield from frame.select("side", "x_m", "y_m").iter_rows()


def _require_columns(path: Path, names: Sequence[str]) -> None:
    missing = [name for name in ("side", "x_m", "y_m") if name not in names]
    if missing:
        raise ConfigError(f"{path}: column {missing[0]} is missing; side, x_m, y_m were expected")
