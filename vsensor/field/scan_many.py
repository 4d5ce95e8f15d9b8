"""Many logs into one table: resumable, in processes or on a cluster, bad logs reported and skipped."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import msgspec

from vsensor.errors import ConfigError, LogError
from vsensor.field.config import load_scan_limits
from vsensor.field.scan import ScanOptions, scan_log
from vsensor.field.table import Info, need_polars
from vsensor.logs import READERS, log_format
from vsensor.pages import new_figure
from vsensor.profile import load_profiles
from vsensor.study import Store, cell_key, run_cells
from vsensor.study.digest import program_digest, referenced_files

CELLS = "cells"
"""Folder in the table of what is finished; the same scan again goes on with the rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanReport:
    """What a scan did: `infos` of the logs in the table, `failures` one line each."""

    infos: tuple[Info, ...]
    failures: tuple[str, ...]
    reused: int
    interrupted: bool


def scan_logs(
    logs: Sequence[Path],
    out: Path,
    options: ScanOptions,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: bool = False,
) -> ScanReport:
    """Write a table file for each log (of folders: each log in them) that has none yet.

    What is wrong for all of them (profile, limits, reference) is raised before the first: VsensorError
    subclasses. A log that fails is a line in `failures`; its file, if it had one, is taken away.
    """
    need_polars()
    found = _log_files(logs)
    options = _checked(options)
    cells = [_cell(log, log_id, out, options) for log_id, log in found.items()]
    store = Store(out / CELLS)
    for cell in cells:  # a result without its file is none
        if not (out / f"{cell['log']}.parquet").is_file():
            (store.folder / f"{cell_key(cell)}.json").unlink(missing_ok=True)
    outcome = run_cells(
        scan_cell, cells, store.folder, scheduler=scheduler, workers=workers, progress=progress
    )
    for failure in outcome.failures:
        (out / f"{failure.cell['log']}.parquet").unlink(missing_ok=True)
    return ScanReport(
        infos=tuple(result for result in outcome.results if result is not None),
        failures=tuple(failure.error for failure in outcome.failures),
        reused=outcome.reused,
        interrupted=outcome.interrupted,
    )


def scan_cell(cell: dict[str, Any]) -> Mapping[str, Any]:
    """Scan the log of one cell, in any process that sees the same files."""
    options = msgspec.convert(cell["options"], ScanOptions)
    return scan_log(Path(cell["source"]), cell["log"], Path(cell["out"]), options)


def _cell(log: Path, log_id: str, out: Path, options: ScanOptions) -> dict[str, Any]:
    """Return all that a log's file depends on; a log by its size and time, as it may be gigabytes."""
    try:
        about = log.stat()
    except OSError as error:
        raise LogError(f"{log}: cannot be read: {error.strerror or error}") from None
    told = asdict(options)
    return {
        "log": log_id,
        "source": str(log.resolve()),
        "size": about.st_size,
        "modified_ns": about.st_mtime_ns,
        "out": str(out.resolve()),
        "options": told,
        "files": referenced_files(told, Path()),
        "program": program_digest(),
    }


def _checked(options: ScanOptions) -> ScanOptions:
    """Return the options with absolute paths; raises what is wrong with any of the files."""
    load_scan_limits(None if options.limits is None else Path(options.limits))
    load_profiles(options.profiles, None if options.dbc is None else Path(options.dbc))
    if options.plots is not None:
        new_figure(purpose="--plots")
    if options.reference != "gta" and not Path(options.reference).exists():
        raise ConfigError(
            f"--reference {options.reference}: no such file; gta, a map (.xodr) or a line "
            "(.csv, .parquet, or a folder with one for each log) was expected"
        )
    given = {field.name: getattr(options, field.name) for field in fields(options)}
    for name in ("dbc", "limits", "reference"):
        if given[name] is not None and given[name] != "gta":
            given[name] = str(Path(given[name]).resolve())
    given["profiles"] = tuple(
        str(Path(name).resolve()) if Path(name).is_file() else name for name in options.profiles
    )
    return ScanOptions(**given)


def _log_files(places: Sequence[Path]) -> dict[str, Path]:
    """Return log id -> file: the file's name without suffixes, with its folder's where two are the same."""
    files: list[Path] = []
    for place in places:
        if place.is_dir():
            inside = sorted(path for path in place.iterdir() if _is_log(path))
            if not inside:
                raise LogError(f"{place}: holds no log ({', '.join(READERS)}, also with .gz)")
            files += inside
        else:
            log_format(place)
            if not place.exists():
                raise LogError(f"{place}: no such file")
            files.append(place)
    files = list({os.path.realpath(path): path for path in files}.values())
    stems = [_stem(path) for path in files]
    names = [
        stem if stems.count(stem) == 1 else f"{path.resolve().parent.name}_{path.name}"
        for stem, path in zip(stems, files, strict=True)
    ]
    for name, path in zip(names, files, strict=True):
        if names.count(name) > 1:
            raise LogError(f"{path}: two logs would have the id {name!r}; rename one")
    return dict(zip(names, files, strict=True))


def _is_log(path: Path) -> bool:
    try:
        return path.is_file() and bool(log_format(path))
    except LogError:
        return False


def _stem(path: Path) -> str:
    name = path.name[: -len(".gz")] if path.name.lower().endswith(".gz") else path.name
    return Path(name).stem
