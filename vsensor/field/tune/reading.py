"""A log's rows in chunks of columns, as every pass over a table takes them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.error_model import Rule
from vsensor.errors import TableError
from vsensor.field.table import MASKS, LogFile, Masked, need_polars
from vsensor.field.tune.conditions import codes, deciding
from vsensor.types import NANOSECONDS_PER_SECOND

CHUNK = 1 << 18
"""Rows at a time: one of the table's row groups, some 10 MB of columns in each thread."""
SIDES, QUALITIES = 4, 5
KNOWN_MASKS = [
    MASKS.index(mask) for mask in (Masked.USED, Masked.NO_LINE, Masked.BEYOND_RANGE, Masked.REFERENCE_GAP)
]
"""Reasons that leave the report itself worth learning from: whether, how far, how well."""
Progress = Callable[[int], None]
"""Told how many rows were read."""


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows (N,) that have an error and are used, in the table's order; `group` is the condition's place.

    `more` are further columns that were asked for, NaN where unknown. Where a pass does not ask when and
    on which side, `t_ns` and `side` are 0.
    """

    t_ns: np.ndarray
    side: np.ndarray
    range_m: np.ndarray
    error_m: np.ndarray
    speed_mps: np.ndarray
    group: np.ndarray
    more: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """How many rows there are."""
        return len(self.error_m)

    def columns(self) -> tuple[np.ndarray, ...]:
        """Return all columns that every table has, in the order of the fields."""
        return self.t_ns, self.side, self.range_m, self.error_m, self.speed_mps, self.group

    def map(self, change: Callable[[np.ndarray], np.ndarray]) -> "Rows":
        """Return rows of changed columns, without `more`."""
        return rows_of([change(values) for values in self.columns()])


def rows_of(columns: Sequence[np.ndarray]) -> Rows:
    """Return rows of their columns, in the order of `Rows.columns`."""
    t_ns, side, range_m, error_m, speed_mps, group = columns
    return Rows(t_ns, side, range_m, error_m, speed_mps, group)


@dataclass(frozen=True, slots=True, kw_only=True)
class Images:
    """Images of one log and all its sides (N,), by side and time.

    `x_max_m` is NaN where the line is not reported; `known` is False where it is masked for another
    reason: what happened there must not be learned.
    """

    t_ns: np.ndarray
    side: np.ndarray
    speed_mps: np.ndarray
    x_max_m: np.ndarray
    quality: np.ndarray
    known: np.ndarray
    group: np.ndarray

    @property
    def reported(self) -> np.ndarray:
        """Whether the line is reported (N,)."""
        return np.asarray(~np.isnan(self.x_max_m))


@dataclass(slots=True)
class _ImageRows:
    """Gathers the first row of every image and side, over the borders of chunks."""

    last: tuple[int, int] = (-(2**62), -1)
    parts: list[dict[str, np.ndarray]] = field(default_factory=list)

    def add(self, columns: dict[str, np.ndarray], reasons: np.ndarray, group: np.ndarray) -> None:
        t_ns, side = columns["t_ns"], columns["side"]
        first = np.ones(len(t_ns), bool)
        first[1:] = (t_ns[1:] != t_ns[:-1]) | (side[1:] != side[:-1])
        first[0] = (int(t_ns[0]), int(side[0])) != self.last
        self.last = int(t_ns[-1]), int(side[-1])
        at = np.flatnonzero(first)
        here = {name: columns[name].take(at) for name in (*_IMAGE_FIELDS, "range_m")}
        is_reported = np.isfinite(here.pop("range_m"))
        here["x_max_m"] = np.where(is_reported, here["x_max_m"], np.float32(np.nan))
        known = np.isin(reasons.take(at), KNOWN_MASKS)
        self.parts.append({**here, "known": known, "group": group.take(at)})

    def images(self) -> Images:
        columns = {name: np.concatenate([part[name] for part in self.parts]) for name in self.parts[0]}
        order = np.lexsort((columns["t_ns"], columns["side"]))
        return Images(**{name: values[order] for name, values in columns.items()})


_IMAGE_FIELDS = ("t_ns", "side", "speed_mps", "x_max_m", "quality")
_IMAGE_COLUMNS = ("masked", "x_max_m", "quality")
_ROW_COLUMNS = ("t_ns", "side", "range_m", "error_m", "speed_mps", "masked")


def read_log(
    file: LogFile,
    rule: Sequence[Rule] = (),
    progress: Progress | None = None,
    *,
    images: bool = False,
    timed: bool = True,
    more: Sequence[str] = (),
) -> Iterator[Rows | Images]:
    """Yield a log's used rows in runs, and after them its images if asked for; `group` by the rule.

    Not `timed`: without t_ns and side, which a quarter of the reading goes into.
    Raises TableError naming a file that has changed or cannot be read.
    """
    asked = (*deciding(rule), *more)
    read = _ROW_COLUMNS if timed or images else _ROW_COLUMNS[2:]
    names = list(dict.fromkeys((*read, *(_IMAGE_COLUMNS if images else ()), *asked)))
    gathered = _ImageRows()
    for frame in _frames(file.path, names):
        columns = {name: frame[name].to_numpy() for name in names if name not in ("masked", *asked)}
        _require_codes(file.path, columns)
        reasons = frame["masked"].to_physical().to_numpy()
        extra = {name: frame[name].cast(need_polars().Float32).to_numpy() for name in asked}
        columns = extra | columns
        group = codes(rule, extra, len(frame)) if rule else np.zeros(len(frame), np.int32)
        if images:
            gathered.add(columns, reasons, group)
        used = (reasons == 0) & np.isfinite(columns["error_m"]) & np.isfinite(columns["speed_mps"])
        if not used.all():
            at = np.flatnonzero(
                used
            )  # with places a column takes a third of the time that it takes with a mask
            columns = {name: columns[name].take(at) for name in (*read[:-1], *more)}
            group = group.take(at)
        untimed = {} if "t_ns" in columns else dict.fromkeys(("t_ns", "side"), np.broadcast_to(0, len(group)))
        yield Rows(
            **untimed,
            **{name: columns[name] for name in read[:-1]},
            group=group,
            more={name: columns[name] for name in more},
        )
        if progress is not None:
            progress(len(frame))
    if images and gathered.parts:
        yield gathered.images()


def _require_codes(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Refuse sides and qualities that there are not: they are places in what is counted."""
    for name, count in (("side", SIDES), ("quality", QUALITIES)):
        if name in columns and len(wrong := columns[name][(columns[name] < 0) | (columns[name] >= count)]):
            raise TableError(f"{path}: {name} {wrong[0]}: 0 to {count - 1} was expected")


def _frames(path: Path, names: list[str]) -> Iterator[Any]:
    polars = need_polars()
    try:
        lazy = polars.scan_parquet(path)
        rows = lazy.select(polars.len()).collect().item()
        for start in range(0, rows, CHUNK):
            yield lazy.slice(start, CHUNK).select(names).collect()
    except (OSError, polars.exceptions.PolarsError) as error:
        raise TableError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None


def period_ns(t_ns: np.ndarray) -> int:
    """Return the usual time between images of one side (N,) rising; 0 where there is one image only."""
    steps = np.diff(t_ns)
    steps = steps[(steps > 0) & (steps < NANOSECONDS_PER_SECOND)]
    return int(np.median(steps)) if len(steps) else 0
