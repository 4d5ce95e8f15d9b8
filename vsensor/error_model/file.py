"""The error model's file: surfaces over range and speed in an .npz that lasts."""

import os
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import ConfigError
from vsensor.schema import check_schema
from vsensor.types import Array, frozen

SCHEMA = "vsensor.error_model/1"
DEFAULT_FILE = Path(__file__).parents[1] / "scenarios" / "default_error.npz"

_GRIDS = ("range_m", "speed_mps", "levels", "absolute_m", "std_m")
_SCALARS = ("correlation_time_s", "correlation_length_m")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErrorModel:
    """A model file: `range_m` (R,), `speed_mps` (V,), `levels` (L,) increasing.

    `absolute_m` (L, R, V) is the quantile of the error's size, never falling with the level;
    `std_m` (R, V) the standard deviation of the signed error. `source` says where it came from.
    """

    range_m: Array
    speed_mps: Array
    levels: Array
    absolute_m: Array
    std_m: Array
    correlation_time_s: float
    correlation_length_m: float
    source: str


def save_model(model: ErrorModel, path: Path) -> None:
    """Write a model file: first beside it, then renamed, so that no half file is left."""
    content: dict[str, Any] = {key: getattr(model, key) for key in (*_GRIDS, *_SCALARS, "source")}
    beside = path.with_name(path.name + ".part")
    with beside.open("wb") as file:
        np.savez(file, schema=SCHEMA, **content)
    os.replace(beside, path)


def load_model(path: Path) -> ErrorModel:
    """Read and check a model file; raises ConfigError naming the file, the entry, the expectation."""
    content = _read(path)
    check_schema({"schema": str(content.get("schema", "missing"))}, SCHEMA, str(path))
    expected = {"schema", "source", *_GRIDS, *_SCALARS}
    if set(content) != expected:
        wrong = ", ".join(sorted(set(content) ^ expected))
        raise ConfigError(f"{path}: entries missing or unknown: {wrong}")
    for key in (*_GRIDS, *_SCALARS):
        if content[key].dtype.kind not in "fiu" or not np.isfinite(content[key]).all():
            raise ConfigError(f"{path}: {key}: finite numbers were expected")
    _check(content, path)
    values: dict[str, Any] = {key: frozen(content[key]) for key in _GRIDS}
    values |= {key: float(content[key]) for key in _SCALARS}
    return ErrorModel(source=str(content["source"]), **values)


def _read(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return {key: archive[key] for key in archive.files}
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, EOFError, ValueError, TypeError, NotImplementedError, RuntimeError) as error:
        raise ConfigError(f"{path}: not a readable error model (.npz): {error}") from None
    except (zipfile.BadZipFile, zlib.error, KeyError, AttributeError) as error:
        raise ConfigError(f"{path}: not a readable error model (.npz): {error}") from None


def _check(content: dict[str, Any], path: Path) -> None:
    """Refuse what the stages could not interpolate."""
    ranges, speeds, levels = content["range_m"], content["speed_mps"], content["levels"]
    absolute, std = content["absolute_m"], content["std_m"]
    cells = (np.size(ranges), np.size(speeds))
    checks = [
        ("range_m", _increases(ranges, 2), "at least 2 increasing values"),
        ("speed_mps", _increases(speeds, 2), "at least 2 increasing values"),
        ("levels", _increases(levels, 1), "increasing values"),
        ("levels", np.all((levels > 0.0) & (levels < 1.0)), "values between 0 and 1"),
        ("absolute_m", absolute.shape == (np.size(levels), *cells), "shape (levels, range, speed)"),
        ("absolute_m", np.all(absolute >= 0.0), "no negative value"),
        ("absolute_m", np.all(np.diff(absolute, axis=0) >= 0.0), "no value that falls with the level"),
        ("std_m", std.shape == cells, "shape (range, speed)"),
        ("std_m", np.all(std >= 0.0), "no negative value"),
        *((key, content[key].ndim == 0 and content[key] > 0.0, "one positive number") for key in _SCALARS),
    ]
    for key, good, expected in checks:
        if not good:
            raise ConfigError(f"{path}: {key}: {expected} expected")


def _increases(values: Any, at_least: int) -> bool:
    return bool(np.ndim(values) == 1 and len(values) >= at_least and np.all(np.diff(values) > 0.0))
