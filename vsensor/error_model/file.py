"""The error model's file: a library of models in an .npz that lasts, `vsensor.error_model/2`.

Entries `schema`, `source`, `rule`, and for each model `NAME/KEY` with every KEY of ErrorModel. Files of
schema 1 hold one model with a normal law and are read as that.
"""

import contextlib
import os
import re
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.error_model.checks import KEYS, SCALARS, first_fault
from vsensor.error_model.model import ErrorLibrary, ErrorModel, library_of, normal_model
from vsensor.error_model.rule import rule_from, rule_text
from vsensor.errors import ConfigError
from vsensor.schema import check_schema
from vsensor.types import frozen

SCHEMA = "vsensor.error_model/2"
DEFAULT_FILE = Path(__file__).parents[1] / "scenarios" / "default_error.npz"

_UNREADABLE = (
    *(OSError, EOFError, ValueError, TypeError, NotImplementedError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, KeyError, AttributeError, OverflowError),
)
"""What numpy and zipfile raise on damaged files."""
_TEXTS = ("schema", "source", "rule")
_NAME = re.compile(r"[A-Za-z0-9_.-]+")
_V1 = ("range_m", "speed_mps", "levels", "absolute_m", "std_m", "correlation_time_s", "correlation_length_m")


def save_library(library: ErrorLibrary, path: Path) -> None:
    """Write a file: first beside it, then renamed, so that no half file is left.

    What could not be read back is refused (ConfigError), and nothing is written.
    """
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "source": library.source,
        "rule": rule_text(library.rule),
        **{
            f"{name}/{key}": np.asarray(getattr(model, key))
            for name, model in library.models.items()
            for key in KEYS
        },
    }
    _library(content, path)
    beside = path.with_name(path.name + ".part")
    try:
        with beside.open("wb") as file:
            np.savez_compressed(file, **content)
        os.replace(beside, path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):  # of a disk that is full, or Ctrl-C, nothing stays
            beside.unlink(missing_ok=True)


def load_library(path: Path) -> ErrorLibrary:
    """Read and check a file; raises ConfigError naming the file, the entry, the expectation."""
    content = _read(path)
    schema = str(content.get("schema", "missing"))
    check_schema({"schema": schema}, SCHEMA, str(path))
    return _library_of_v1(content, path) if schema.endswith("/1") else _library(content, path)


def _read(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return {key: archive[key] for key in archive.files}
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except _UNREADABLE as error:
        raise ConfigError(f"{path}: not a readable error model (.npz): {error}") from None


def _library(content: dict[str, Any], path: Path) -> ErrorLibrary:
    names = sorted({key.rpartition("/")[0] for key in content if key not in _TEXTS})
    expected = {*_TEXTS, *(f"{name}/{key}" for name in names for key in KEYS)}
    _require_entries(set(content), expected, path)
    for name in names:
        if not _NAME.fullmatch(name):
            raise ConfigError(f"{path}: model {name!r}: a name of letters, digits, _ . - was expected")
    try:
        rule = rule_from(str(content["rule"]), names)
    except ValueError as error:
        raise ConfigError(f"{path}: rule: {error}") from None
    models = {name: _model(content, name, path) for name in names}
    return ErrorLibrary(source=str(content["source"]), rule=rule, models=models)


def _model(content: dict[str, Any], name: str, path: Path) -> ErrorModel:
    entries = {key: np.asarray(content[f"{name}/{key}"]) for key in KEYS}
    if (fault := first_fault(entries)) is not None:
        raise ConfigError(f"{path}: {name}/{fault}")
    values: dict[str, Any] = {key: frozen(entries[key], bool if key == "blind" else float) for key in KEYS}
    return ErrorModel(**values | {key: float(entries[key]) for key in SCALARS})


def _require_entries(found: set[str], expected: set[str], path: Path) -> None:
    if found != expected:
        wrong = sorted(found ^ expected)
        shown = ", ".join(wrong[:6]) + (f" and {len(wrong) - 6} more" if len(wrong) > 6 else "")
        raise ConfigError(f"{path}: entries missing or unknown: {shown}")


def _library_of_v1(content: dict[str, Any], path: Path) -> ErrorLibrary:
    _require_entries(set(content), {"schema", "source", *_V1}, path)
    has = {key: np.asarray(content[key]) for key in _V1}
    for key in _V1:
        if has[key].dtype.kind not in "fiu" or not np.isfinite(has[key]).all():
            raise ConfigError(f"{path}: {key}: finite numbers were expected")
    if has["std_m"].shape != (has["range_m"].size, has["speed_mps"].size):
        raise ConfigError(f"{path}: std_m: shape (range, speed) expected")
    if np.any(has["std_m"] < 0.0):
        raise ConfigError(f"{path}: std_m: no negative value expected")
    for key in ("correlation_time_s", "correlation_length_m"):
        if has[key].ndim:
            raise ConfigError(f"{path}: {key}: one positive number expected")
    for key in ("range_m", "speed_mps", "levels"):
        if has[key].ndim != 1:
            raise ConfigError(f"{path}: {key}: increasing values expected")
    model = normal_model(**has)
    entries = {f"all/{key}": np.asarray(getattr(model, key)) for key in KEYS}
    try:
        return library_of(_model(entries, "all", path), str(content["source"]))
    except ConfigError as error:
        raise ConfigError(str(error).replace("all/", "")) from None
