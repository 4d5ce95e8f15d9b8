"""Reads any CAN log: the format follows from the suffix, `.gz` may stand behind it."""

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from vsensor.errors import LogError
from vsensor.logs.blf import read_blf
from vsensor.logs.candump import read_candump
from vsensor.logs.foreign import read_asc, read_csv, read_trc
from vsensor.logs.mf4 import read_mf4
from vsensor.logs.report import Notes
from vsensor.logs.table import Columns, Grain, LogTable, frames_of, joined, table_from
from vsensor.logs.unpack import GzipStream
from vsensor.types import Frame

Reader = Callable[..., Iterator[Columns]]
"""Of an open file, notes, `chunk` (about how many frames at a time) and, where it can, `place`."""


def _as_text(read: Reader) -> Reader:
    """Return a reader of bytes; Latin-1 decodes any byte, and only names and months are not ASCII."""

    def reader(stream: BinaryIO, notes: Notes, **chunk: Grain) -> Iterator[Columns]:
        text = io.TextIOWrapper(stream, encoding="latin-1")
        try:
            yield from read(text, notes, **chunk)
        finally:
            text.detach()  # who opened the stream closes it

    return reader


READERS: dict[str, Reader] = {
    ".log": read_candump,
    ".asc": _as_text(read_asc),
    ".blf": read_blf,
    ".trc": _as_text(read_trc),
    ".csv": _as_text(read_csv),
    ".mf4": read_mf4,
}
"""Suffix -> reader of its frames."""


def log_format(path: Path) -> str:
    """Return the suffix that says the format, lower case, without `.gz`; raises LogError if unknown."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    if suffixes[-1:] == [".gz"]:
        suffixes.pop()
    if not suffixes or suffixes[-1] not in READERS:
        raise LogError(f"{path}: not a log format that is known: {', '.join(READERS)} (also with .gz) are")
    return suffixes[-1]


def read_chunks(
    path: Path,
    notes: Notes,
    chunk: Grain | None = None,
    reader: Reader | None = None,
    place: tuple[int, ...] | None = None,
) -> Iterator[Columns]:
    """Yield the frames of a log in runs, in file order; garbage and faults are kept in `notes`.

    `chunk`: about so many frames are decoded at a time; `reader`: instead of the suffix's; `place`: from one
    of `notes.place` on. Raises LogError if the file cannot be opened or its format is not known.
    """
    reader = READERS[log_format(path)] if reader is None else reader
    packed = path.suffix.lower() == ".gz"
    try:
        raw = GzipStream(path) if packed else path.open("rb")
        with io.BufferedReader(raw) if isinstance(raw, GzipStream) else raw as stream:
            whole = io.BytesIO(stream.read()) if packed and reader is read_mf4 else stream
            wishes = {"chunk": chunk, "place": place}
            given = {name: wish for name, wish in wishes.items() if wish is not None}
            for number, columns in enumerate(reader(whole, notes, **given)):
                if number % 16 == 0 or len(columns.t_ns) >= 1024:  # it takes a system call
                    notes.read_bytes = raw.place if isinstance(raw, GzipStream) else raw.tell()
                yield columns
            if isinstance(raw, GzipStream) and raw.fault is not None:
                notes.fault = raw.fault
    except FileNotFoundError:
        raise LogError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise LogError(f"{path}: is a folder, a CAN log was expected") from None
    except PermissionError:
        raise LogError(f"{path}: may not be read") from None
    except OSError as error:
        notes.fault = str(error)


def read_log(path: Path | str, progress: Callable[[int], None] | None = None) -> LogTable:
    """Read a whole log. Good lines and the frames before a fault are used; `.report` says what was not.

    `progress` is told how many bytes have been read. Raises LogError if there is no such file, its format is
    not known, or it holds no frame at all.
    """
    path = Path(path)
    notes = Notes()
    chunks = []
    for columns in read_chunks(path, notes):
        chunks.append(columns)
        if progress is not None:
            progress(notes.read_bytes)
    columns = joined(chunks)
    if not len(columns.t_ns):
        raise LogError(f"{path}: {notes.why_empty()}")
    return table_from(str(path), columns, notes)


def iter_frames(path: Path | str, notes: Notes | None = None) -> Iterator[Frame]:
    """Yield the frames of a log in file order while it is read, in constant memory.

    `due_ns` is the log's time; `channel` counts channels in order of appearance (`notes.channels`).
    `notes`, complete after the last frame, gets what was found. Raises as `read_log`.
    """
    path = Path(path)
    found = Notes() if notes is None else notes
    empty = True
    for columns in read_chunks(path, found):
        empty = False
        yield from frames_of(columns)
    if empty:
        raise LogError(f"{path}: {found.why_empty()}")
