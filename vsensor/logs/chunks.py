"""A log in runs of frames, in constant memory however long it is."""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from vsensor.errors import LogError
from vsensor.logs.candump import read_candump
from vsensor.logs.read import log_format, read_chunks
from vsensor.logs.report import Notes
from vsensor.logs.table import Columns, Grain, frames_at_a_time
from vsensor.logs.untimed import TimedLines, is_untimed

CHUNK = 65536


def iter_chunks(
    path: Path | str,
    *,
    start_ns: int | None = None,
    chunk: Grain = CHUNK,
    notes: Notes | None = None,
    untimed: bool = False,
    place: tuple[int, ...] | None = None,
) -> Iterator[Columns]:
    """Yield a log's frames in runs of 1 to `chunk`, in file order, while it is read.

    Begins with the first frame that is not before `start_ns`. `notes` gets the channels and what was found.
    With `untimed` a text log's frames may lack their times, which are then 0. A small `chunk` takes little
    time a run, which is what a player with frames to send needs. Begins at a `place` that the notes of the
    same log had, if one is given.

    Raises LogError if the log cannot be opened, holds no frame, or, after the frames before it, has a fault;
    MissingExtraError for .mf4 without asammdf.
    """
    path = Path(path)
    found = Notes() if notes is None else notes
    empty, waiting = place is None, True
    for columns in _runs(path, found, chunk, untimed, place):
        empty, behind, found.place = False, found.place, None
        if waiting and start_ns is not None:
            late = columns.t_ns >= start_ns
            if not late.any():
                continue
            columns = columns.taken(slice(int(late.argmax()), None))
        waiting = False
        first, count = 0, len(columns.t_ns)
        while first < count:
            end = first + frames_at_a_time(chunk)
            found.place = behind if end >= count else None
            yield columns.taken(slice(first, end))
            first = end
    if empty:
        raise LogError(f"{path}: {_why_empty(found)}")
    if found.fault is not None:
        raise LogError(f"{path}: reading ended early: {found.fault}")


def _runs(
    path: Path, notes: Notes, chunk: Grain, untimed: bool, place: tuple[int, ...] | None
) -> Iterator[Columns]:
    if not untimed or log_format(path) != ".log":
        return read_chunks(path, notes, chunk, place=place)

    def with_times(stream: BinaryIO, notes: Notes, chunk: Grain) -> Iterator[Columns]:
        return read_candump(io.BufferedReader(TimedLines(stream)), notes, chunk)

    return read_chunks(path, notes, chunk, reader=with_times)


def _why_empty(notes: Notes) -> str:
    if notes.fault is None and any(is_untimed(text.encode()) for _, text in notes.first_garbage):
        return "its frames have no times; --rate FRAMES_PER_S gives them"
    return notes.why_empty()
