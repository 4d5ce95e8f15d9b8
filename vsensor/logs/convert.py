"""From one log format into another, run by run: what the target does not hold is refused, or left out."""

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsensor.errors import LogError
from vsensor.logs.chunks import iter_chunks
from vsensor.logs.holding import DISORDER, FORMATS, Sieve
from vsensor.logs.report import Notes
from vsensor.logs.table import Columns, LogTable, joined, table_from
from vsensor.logs.write import LogWriter, open_output, output_format

Progress = Callable[[int], None]
"""Is told how many bytes of the source have been read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """What came of it: frames written (or `what` it counts); `lost` and `notes` as sentences."""

    path: Path
    frames: int
    lost: tuple[str, ...]
    notes: tuple[str, ...]
    what: str = "frames"

    def lines(self) -> list[str]:
        """Return what was written, and what was left out."""
        return [f"{self.path}: {self.frames} {self.what}", *(f"left out: {one}" for one in self.lost)]


def convert_log(
    source: Path,
    target: Path,
    *,
    lossy: bool = False,
    rate_hz: float | None = None,
    progress: Progress | None = None,
) -> Conversion:
    """Write the frames of a log into another format, which the suffix of `target` says.

    The target appears when it is whole; until then, and after an error, one of that name stays as it was.
    Memory does not grow with the log, but for an .mf4 made of frames whose time runs backwards, which must
    be sorted. `rate_hz`: frames per second of text without times. Raises LogError: the log cannot be read or
    holds no frame, the target cannot be written, or does not hold all that is there and `lossy` is not said.
    """
    suffix = output_format(target).removesuffix(".gz")
    sieve = Sieve(FORMATS[suffix])
    notes = Notes()
    with Replacing(target) as part:
        with open_output(target, part) as writer:
            frames = _copy(read_through(source, notes, rate_hz, progress), writer, sieve, notes, lossy=lossy)
        if sieve.lost and not lossy:
            lost = ", ".join(_sentences(sieve))
            raise LogError(f"{source}: {suffix} cannot hold {lost}; --lossy leaves out what it cannot hold")
        if DISORDER in sieve.lost:
            _copy_sorted(source, target, part)
    problems = notes.problems() + _remarks(sieve, suffix, tuple(notes.channels))
    return Conversion(path=target, frames=frames, lost=tuple(_sentences(sieve)), notes=tuple(problems))


class Replacing:
    """Gives a path beside `target`, which takes its place if no error comes. Raises LogError."""

    def __init__(self, target: Path) -> None:
        self._target = target.resolve()
        self._shown = target
        if self._target.exists() and not self._target.is_file():
            raise LogError(f"{target}: cannot be written: is no file")
        self._part = self._target.with_name(f".{os.getpid()}.{self._target.name}")

    def __enter__(self) -> Path:
        return self._part

    def __exit__(self, kind: object, *_: object) -> None:
        try:
            if kind is None:
                with self._part.open("rb") as written:
                    os.fsync(written.fileno())
                self._part.replace(self._target)
        except OSError as error:
            raise LogError(f"{self._shown}: cannot be written: {error.strerror or error}") from None
        finally:
            with suppress(OSError):
                self._part.unlink(missing_ok=True)


def read_through(
    source: Path, notes: Notes, rate_hz: float | None = None, progress: Progress | None = None
) -> Iterator[Columns]:
    """Yield a log's frames up to its end or a fault, which `notes` then tells.

    With `rate_hz` the times are those of so many frames per second from 0 on. Raises LogError if the log
    cannot be opened or holds no frame.
    """
    frames = 0
    try:
        for columns in iter_chunks(source, notes=notes, untimed=rate_hz is not None):
            count = len(columns.t_ns)
            if rate_hz is not None:
                places = np.arange(frames, frames + count)
                columns = columns._replace(t_ns=np.rint(places * (1e9 / rate_hz)).astype(np.int64))
            yield columns
            frames += count
            if progress is not None:
                progress(notes.read_bytes)
    except LogError:
        if not frames:
            raise


def table_through(source: Path, rate_hz: float | None = None, progress: Progress | None = None) -> LogTable:
    """Return a whole log in memory, up to its end or a fault; raises LogError if it holds no frame."""
    notes = Notes()
    columns = joined(list(read_through(source, notes, rate_hz, progress)))
    return table_from(str(source), columns, notes)


def _copy(chunks: Iterator[Columns], writer: LogWriter, sieve: Sieve, notes: Notes, *, lossy: bool) -> int:
    """Return how many frames were written; after the first loss that was not allowed it only counts."""
    frames = 0
    for columns in chunks:
        held = sieve.held(columns)
        writer.name_channels(tuple(notes.channels))
        if lossy or not sieve.lost:
            writer.write_columns(held)
        frames += len(held.t_ns)
    return frames


def _copy_sorted(source: Path, target: Path, part: Path) -> None:
    """Write all frames in order of time."""
    notes = Notes()
    columns = joined(list(read_through(source, notes)))
    with open_output(target, part, tuple(notes.channels)) as writer:
        writer.write_columns(columns.taken(columns.t_ns.argsort(kind="stable")))


def _sentences(sieve: Sieve) -> list[str]:
    return [f"{count} {name}" for name, count in sieve.lost.items()]


def _remarks(sieve: Sieve, suffix: str, channels: tuple[str, ...]) -> list[str]:
    """Return what changed by the format's nature: rounded times, names that became numbers."""
    found = []
    if sieve.rounded:
        found.append(f"{sieve.rounded} times rounded to {sieve.format.resolution_ns // 1000} us")
    named = [name for name in channels if not name.removeprefix("can").isdecimal()]
    if named and not sieve.format.names:
        found.append(f"{suffix} has no names of channels: {', '.join(named)} became numbers")
    return found
