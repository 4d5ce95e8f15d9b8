"""Rows of numbers into a file, in constant memory: kept in a nameless file beside it, written out at the end.

Formats: .npz (numpy alone reads it), .csv (comment lines begin with `#`), .parquet (needs polars). Written
beside its place and moved there when it is whole, so a file with the right name is whole.
"""

import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.errors import ConfigError, MissingExtraError

PARQUET_KEY = "vsensor"
"""Under which the metadata of a Parquet file holds the JSON."""

Records = NDArray[Any]
Writer = Callable[[Path, Records, Mapping[str, object]], None]

_CHUNK_ROWS = 4096
_PARQUET_ROWS = 262_144


class RowFile:
    """Takes rows of one numpy record type and writes them to `path` at its close."""

    def __init__(
        self, path: Path, row: np.dtype[Any], metadata: Mapping[str, object], suffixes: Sequence[str] = ()
    ) -> None:
        """Refuse an unknown suffix, a place that cannot be written. Raises ConfigError, MissingExtraError."""
        self._write_file = writer_for(path, suffixes)
        self._path, self._temporary = path, path.with_name(f".{path.name}.{os.getpid()}.part")
        self._row, self._metadata = row, metadata
        self._chunk, self._used, self._rows = np.zeros(_CHUNK_ROWS, row), 0, 0
        try:
            self._temporary.touch()
            self._spool = tempfile.TemporaryFile(dir=path.parent)  # noqa: SIM115
        except OSError as error:
            raise self._refusal(error) from None

    def add(self, row: tuple[Any, ...]) -> None:
        """Keep one row."""
        if self._used == len(self._chunk):
            self._empty()
        self._chunk[self._used] = row
        self._used += 1

    def add_all(self, rows: Records) -> None:
        """Keep rows (N,) of the record type."""
        self._empty()
        self._put(rows)

    def close(self) -> None:
        """Write the file and move it to its place; a second call does nothing. Raises ConfigError."""
        if self._spool.closed:
            return
        try:
            self._empty()
            self._spool.flush()
            self._write_file(self._temporary, self._table(), self._metadata)
            self._temporary.replace(self._path)
        except OSError as error:
            raise self._refusal(error) from None
        finally:
            self._spool.close()
            self._temporary.unlink(missing_ok=True)

    def _table(self) -> Records:
        if not self._rows:
            return np.zeros(0, self._row)
        return np.memmap(self._spool, self._row, mode="r", shape=(self._rows,))

    def _empty(self) -> None:
        self._put(self._chunk[: self._used])
        self._used = 0

    def _put(self, rows: Records) -> None:
        try:
            self._spool.write(rows.tobytes())
        except OSError as error:
            raise self._refusal(error) from None
        self._rows += len(rows)

    def _refusal(self, error: OSError) -> ConfigError:
        return ConfigError(f"{self._path}: cannot be written: {error.strerror or error}")


def writer_for(path: Path, suffixes: Sequence[str] = ()) -> Writer:
    """Return the writer for the suffix of `path`, one of `suffixes` (none: all that there are).

    Raises ConfigError, MissingExtraError.
    """
    known = [suffix for suffix in _WRITERS if suffix in (suffixes or _WRITERS)]
    if path.suffix not in known:
        raise ConfigError(f"{path}: a trace ends in {', '.join(known)}")
    if path.suffix == ".parquet":
        import_polars()
    return _WRITERS[path.suffix]


def import_polars() -> Any:
    """Return polars, or raise MissingExtraError."""
    try:
        import polars
    except ImportError:
        raise MissingExtraError("polars", "parquet", "a Parquet trace") from None
    return polars


def _names(table: Records) -> tuple[str, ...]:
    assert table.dtype.names is not None
    return table.dtype.names


def _write_npz(path: Path, table: Records, metadata: Mapping[str, object]) -> None:
    columns: dict[str, Any] = {name: table[name] for name in _names(table)}
    with path.open("wb") as file:
        np.savez_compressed(file, metadata=np.array(json.dumps(metadata)), **columns)


def _write_csv(path: Path, table: Records, metadata: Mapping[str, object]) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"# {json.dumps(metadata)}\n{','.join(_names(table))}\n")
        for row in table:
            file.write(",".join(map(_cell, row.tolist())) + "\n")
        file.write(f"# rows {len(table)}\n")


def _cell(value: float) -> str:
    return "" if value != value else repr(value)


def _write_parquet(path: Path, table: Records, metadata: Mapping[str, object]) -> None:
    polars = import_polars()
    from polars.io.plugins import register_io_source

    def frame_of(rows: Records) -> Any:
        return polars.DataFrame({name: np.ascontiguousarray(rows[name]) for name in _names(table)})

    def frames(*_: object) -> Iterator[Any]:
        for start in range(0, len(table), _PARQUET_ROWS):
            yield frame_of(table[start : start + _PARQUET_ROWS])

    lazy = register_io_source(frames, schema=frame_of(table[:0]).schema)
    try:
        lazy.sink_parquet(path, compression="zstd", metadata={PARQUET_KEY: json.dumps(metadata)})
    except polars.exceptions.PolarsError as error:  # a full disk among them
        raise OSError(" ".join(str(error).split())) from None


_WRITERS: dict[str, Writer] = {".npz": _write_npz, ".csv": _write_csv, ".parquet": _write_parquet}
