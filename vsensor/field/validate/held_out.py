"""Held-out logs beside a model: where recorded errors lie in it, and what the virtual sensor does there.

every row            which quantiles it is above, block by block          ──► coverage, PIT
some blocks          recorded errors  │ virtual errors at the same images ──► distances, autocorrelation
every image          runs of lost and seen lines                          ──► durations
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vsensor.error_model import ErrorLibrary, ErrorModel
from vsensor.field.table import LogFile, Table
from vsensor.field.tune.blocks import LAGS, add_time
from vsensor.field.tune.counting import pieces
from vsensor.field.tune.dwell import Dwells, dwells_of
from vsensor.field.tune.reading import SIDES, Images, Progress, Rows, period_ns, read_log, rows_of
from vsensor.field.validate.place import LawTable, Placed
from vsensor.field.virtual import FitSetting, VirtualSensor, models_of
from vsensor.types import Array

BLOCK_NS = 20_000_000_000
DRAWS = 4
"""Virtual drives beside each recorded one: one against another shows what chance alone does."""


@dataclass(slots=True, kw_only=True)
class Found:
    """What was found of one model. `size_counts` (B, L + 1) and `signed_counts` (B, S + 1) by block.

    `outside` counts rows that the model does not know. `ranges_m`, `speeds_mps` and `errors_m` are lists of
    runs of sampled errors: recorded, then DRAWS virtual ones. `time` (1 + DRAWS, lags, 3, 1).
    """

    model: ErrorModel
    name: str
    size_counts: list[np.ndarray] = field(default_factory=list)
    signed_counts: list[np.ndarray] = field(default_factory=list)
    outside: int = 0
    ranges_m: list[np.ndarray] = field(default_factory=list)
    speeds_mps: list[np.ndarray] = field(default_factory=list)
    errors_m: list[np.ndarray] = field(default_factory=list)
    time: np.ndarray = field(default_factory=lambda: np.zeros((1 + DRAWS, len(LAGS), 3, 1)))

    def sampled(self) -> tuple[Array, Array, Array]:
        """Return range (N,), speed (N,) and errors (1 + DRAWS, N) of the sampled rows."""
        if not self.errors_m:
            return np.zeros(0), np.zeros(0), np.zeros((1 + DRAWS, 0))
        return (
            np.concatenate(self.ranges_m),
            np.concatenate(self.speeds_mps),
            np.concatenate(self.errors_m, axis=1),
        )


@dataclass(slots=True, kw_only=True)
class HeldOut:
    """All models' findings, and the runs of lost and seen lines by model."""

    found: tuple[Found, ...]
    dwells: Dwells
    period_ns: int
    rows: int
    logs: int
    images_ns: int


def look(
    library: ErrorLibrary,
    table: Table,
    setting: FitSetting,
    *,
    seed: int = 0,
    most_rows: int = 6_000_000,
    progress: Progress | None = None,
) -> HeldOut:
    """Look at a table; raises TableError. About `most_rows` are compared with virtual ones."""
    names = [name for name, _ in models_of(library)]
    found = tuple(Found(model=model, name=name) for name, model in models_of(library))
    order = {name: place for place, name in enumerate(names)}
    at_rule = np.array([order[rule.model] for rule in library.rule])
    total = sum(int(file.info.get("rows", 0)) for file in table.files)
    work = _Look(
        library=library,
        found=found,
        at_rule=at_rule,
        laws=[LawTable(one.model) for one in found],
        sensors=[VirtualSensor.of(one.model, setting) for one in found],
        every=max(-(-total // most_rows), 1),
        held=HeldOut(found=found, dwells=Dwells(), period_ns=0, rows=0, logs=0, images_ns=0),
    )
    for place, file in enumerate(sorted(table.files, key=lambda one: one.log)):
        work.log(file, np.random.default_rng([seed, place]), progress)
    return work.held


@dataclass(slots=True, kw_only=True)
class _Look:
    library: ErrorLibrary
    found: tuple[Found, ...]
    at_rule: np.ndarray
    laws: list[LawTable]
    sensors: list[VirtualSensor]
    every: int
    held: HeldOut
    blocks: int = 0

    def log(self, file: LogFile, random: np.random.Generator, progress: Progress | None) -> None:
        """Add one log."""
        self.held.logs += 1
        pending: list[Rows] = []
        block, began = -1, -1
        for part in read_log(file, self.library.rule, progress, images=True):
            if isinstance(part, Images):
                self._images(part)
                continue
            for piece in pieces(part):
                if not len(piece.t_ns):
                    continue
                began = int(piece.t_ns[0]) if began < 0 else began
                number = (piece.t_ns - began) // BLOCK_NS
                for one in np.unique(number).tolist():
                    if one != block:
                        self._block(pending, random)
                        pending, block = [], one
                    pending.append(_chosen(piece, number == one))
        self._block(pending, random)

    def _images(self, images: Images) -> None:
        period = period_ns(images.t_ns[images.side == images.side[0]])
        self.held.period_ns = max(self.held.period_ns, period)
        self.held.images_ns += len(np.unique(images.t_ns)) * period
        runs = dwells_of(images, period).runs
        by_model = (runs[0], runs[1], runs[2], self.at_rule[runs[3]])
        self.held.dwells = self.held.dwells.merge(Dwells(by_model))

    def _block(self, parts: Sequence[Rows], random: np.random.Generator) -> None:
        if not parts:
            return
        rows = _joined(parts)
        self.held.rows += len(rows.t_ns)
        self.blocks += 1
        for place, one in enumerate(self.found):
            here = self.at_rule[rows.group] == place
            if here.any():
                chosen = rows if here.all() else _chosen(rows, here)
                placed = self._count(one, self.laws[place], chosen)
                if self.blocks % self.every == 0 and placed.known.any():
                    self._compare(one, place, _chosen(chosen, placed.known), placed, random)

    def _count(self, one: Found, law: LawTable, rows: Rows) -> Placed:
        parts = [law.place(p.range_m, p.speed_mps, p.error_m) for p in pieces(rows)]
        placed = Placed(
            **{
                name: np.concatenate([getattr(part, name) for part in parts])
                for name in ("known", "size", "signed", "score")
            }
        )
        one.size_counts.append(np.bincount(placed.size, minlength=len(one.model.levels) + 1))
        one.signed_counts.append(np.bincount(placed.signed, minlength=len(one.model.signed_levels) + 1))
        one.outside += int(np.count_nonzero(~placed.known))
        return placed

    def _compare(
        self, one: Found, place: int, rows: Rows, placed: Placed, random: np.random.Generator
    ) -> None:
        """Draw virtual errors for the images of a block, and keep them beside the recorded ones."""
        model, sensor, law = one.model, self.sensors[place], self.laws[place]
        at = np.argmin(np.abs(model.range_m[:, None] - np.unique(rows.range_m)[None]), axis=0)
        column = at[np.searchsorted(np.unique(rows.range_m), rows.range_m)]
        for side in range(SIDES):
            chosen = rows.side == side
            if not chosen.any():
                continue
            t_ns, image = np.unique(rows.t_ns[chosen], return_inverse=True)
            speed = np.zeros(len(t_ns))
            speed[image] = rows.speed_mps[chosen]
            driven = np.cumsum(speed * np.diff(t_ns, prepend=t_ns[0]) / 1e9)
            slot = np.rint((t_ns - t_ns[0]) / max(period_ns(t_ns), 1)).astype(np.int64)
            errors = [rows.error_m[chosen].astype(np.float64)]
            scores = [placed.score[chosen]]
            for _ in range(DRAWS):
                z = sensor.drive(np.diff(t_ns) / 1e9, random)
                virtual = sensor.errors(z, speed, driven)[image, column[chosen]]
                errors.append(virtual)
                again = law.place(rows.range_m[chosen], rows.speed_mps[chosen], virtual)
                scores.append(again.score)
            one.ranges_m.append(rows.range_m[chosen].astype(np.float32))
            one.speeds_mps.append(rows.speed_mps[chosen].astype(np.float32))
            one.errors_m.append(np.stack(errors).astype(np.float32))
            for number, score in enumerate(scores):
                grid = np.full((int(slot[-1]) + 1, len(model.range_m)), np.nan)
                grid[slot[image], column[chosen]] = score
                sums = np.zeros((len(LAGS), 3, len(model.range_m)))
                add_time(sums, grid)
                one.time[number] += sums.sum(axis=-1, keepdims=True)


def _chosen(rows: Rows, mask: np.ndarray) -> Rows:
    return rows.map(lambda values: values[mask])


def _joined(parts: Sequence[Rows]) -> Rows:
    columns = [part.columns() for part in parts]
    return rows_of([np.concatenate(same) for same in zip(*columns, strict=True)])
