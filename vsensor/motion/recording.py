"""A measured vibration from a file: columns t_s, pitch_mrad, roll_mrad, heave_mm, in CSV or npz."""

import csv
import zipfile
import zlib
from bisect import bisect_right
from dataclasses import dataclass
from math import fmod
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import ConfigError

SCALE_AND_LIMIT = {"pitch_mrad": (1e-3, 500.0), "roll_mrad": (1e-3, 500.0), "heave_mm": (1e-3, 1000.0)}
"""Factor to SI, and the largest plausible value in the file's unit."""


@dataclass(frozen=True, slots=True)
class Recording:
    """A series: `t_s` rising from 0, pitch and roll (rad) and heave (m) at these times.

    Played to its end, then backwards, and so on: there is no jump, whatever it begins and ends with,
    and its values keep their distribution.
    """

    t_s: tuple[float, ...]
    pitch_rad: tuple[float, ...]
    roll_rad: tuple[float, ...]
    heave_m: tuple[float, ...]

    def motion(self, t_ns: int) -> tuple[float, float, float]:
        """Return pitch, roll (rad) and heave (m), linear between the samples."""
        length_s = self.t_s[-1]
        t = fmod(t_ns / 1e9, 2.0 * length_s)
        t = min(t, 2.0 * length_s - t)
        i = min(bisect_right(self.t_s, t), len(self.t_s) - 1) - 1
        part = (t - self.t_s[i]) / (self.t_s[i + 1] - self.t_s[i])
        pitch, roll, heave = self.pitch_rad, self.roll_rad, self.heave_m
        return (
            pitch[i] + part * (pitch[i + 1] - pitch[i]),
            roll[i] + part * (roll[i + 1] - roll[i]),
            heave[i] + part * (heave[i + 1] - heave[i]),
        )


def load_recording(path: Path) -> Recording:
    """Read a vibration file; a column that is not there is 0. Raises ConfigError."""
    columns = _read_npz(path) if path.suffix.lower() == ".npz" else _read_csv(path)
    known = {"t_s", *SCALE_AND_LIMIT}
    if "t_s" not in columns or not set(columns) <= known or len(columns) < 2:
        raise ConfigError(
            f"{path}: columns {', '.join(columns) or 'none'}: t_s and some of "
            f"{', '.join(SCALE_AND_LIMIT)} were expected"
        )
    t = _numbers(path, columns, "t_s")
    if len(t) < 2 or not (np.diff(t) > 0.0).all():
        raise ConfigError(f"{path}: t_s: at least 2 rising values were expected")
    series = {}
    for name, (scale, limit) in SCALE_AND_LIMIT.items():
        values = _numbers(path, columns, name) if name in columns else np.zeros(len(t))
        if len(values) != len(t) or np.abs(values).max() > limit:
            raise ConfigError(f"{path}: {name}: {len(t)} values of at most {limit:g} were expected")
        series[name] = tuple((scale * values).tolist())
    return Recording(
        t_s=tuple((t - t[0]).tolist()),
        pitch_rad=series["pitch_mrad"],
        roll_rad=series["roll_mrad"],
        heave_m=series["heave_mm"],
    )


def _numbers(path: Path, columns: dict[str, Any], name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    try:
        values = np.asarray(columns[name], dtype=np.float64)
    except ValueError:
        raise ConfigError(f"{path}: {name}: numbers were expected") from None
    if values.ndim != 1 or not np.isfinite(values).all():
        raise ConfigError(f"{path}: {name}: a row of finite numbers was expected")
    return values


def _read_npz(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return {key: archive[key] for key in archive.files}
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, EOFError, ValueError, zipfile.BadZipFile, zlib.error, AttributeError) as error:
        raise ConfigError(f"{path}: not a readable .npz: {error}") from None


def _read_csv(path: Path) -> dict[str, Any]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if row]
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path}: not a readable CSV: {error}") from None
    if not rows:
        raise ConfigError(f"{path}: an empty file")
    names = [name.strip() for name in rows[0]]
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            raise ConfigError(f"{path}: row {number} has {len(row)} values, the header {len(names)}")
    return {name: [row[k] for row in rows[1:]] for k, name in enumerate(names)}
