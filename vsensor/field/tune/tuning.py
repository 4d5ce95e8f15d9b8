"""From a table to a library of models: three passes, surfaces, correlation, persistence, the loop closed."""

import math
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np

from vsensor.error_model import ErrorLibrary, ErrorModel
from vsensor.errors import TableError
from vsensor.field.table import Table
from vsensor.field.tune.blocks import BlockPass, BlockSums
from vsensor.field.tune.conditions import Conditions, conditions
from vsensor.field.tune.correlation import correlation_length_m, correlation_time_s
from vsensor.field.tune.counting import Binning, CountPass
from vsensor.field.tune.dwell import dwell_quantiles
from vsensor.field.tune.fir import Fir, fill_from_nearest, local_scale, low_pass, wider
from vsensor.field.tune.grid import Grid
from vsensor.field.tune.loop import Closed, close_loop
from vsensor.field.tune.quantiles import FEWEST_BLOCKS
from vsensor.field.tune.region import operating_region, range_share
from vsensor.field.tune.spread import Spread, on_cluster, rows_bar, threads
from vsensor.field.tune.surface import (
    SIGNED_LEVELS,
    Intervals,
    Surfaces,
    band_table,
    intervals,
    score_table,
    surfaces,
    unfiltered_m,
)
from vsensor.field.tune.survey import Survey, SurveyPass, cell_sums
from vsensor.field.virtual import FitSetting
from vsensor.types import Array, frozen

LEVELS = (0.5, 0.8, 0.9, 0.95, 0.97, 0.99)
DWELL_LEVELS = np.concatenate([[0.0], np.linspace(0.02, 0.98, 49), [0.99, 0.995, 0.9995]])
SHARE_LEVELS = np.concatenate([[0.001, 0.005], np.linspace(0.01, 0.99, 50), [0.995, 0.999]])
SHOWN_M = 20.0
"""Range of the picture over speed, as P1's fig. 3.10."""
CORRELATED_ROWS = 30_000_000
"""About so many rows are looked at for correlation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneOptions:
    """What the command line says. A cell with less than `least_seconds` of driving is blind."""

    levels: tuple[float, ...] = LEVELS
    by: str = ""
    step_mps: float = 0.5
    order: int = 10
    cutoff_s_per_m: float = 0.2
    region_level: float = 0.95
    block_s: float = 60.0
    least_seconds: float = 60.0
    close_loop: bool = True
    setting: FitSetting = field(default_factory=FitSetting)
    seed: int = 0
    scheduler: str | None = None
    progress: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One condition's model with what is told about it.

    `unfiltered_m` (L, V): quantiles of each speed alone, before the low-pass, at the range `SHOWN_M`.
    """

    name: str
    model: ErrorModel
    spread: Intervals
    closed: Closed | None
    sums: BlockSums
    place: int
    unfiltered_m: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """What tuning found; `skipped` are combinations of conditions that the table does not have.

    `block_s` is how long the blocks were that the intervals come from.
    """

    library: ErrorLibrary
    conditions: tuple[Condition, ...]
    skipped: tuple[str, ...]
    survey: Survey
    block_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Work:
    """What all conditions share."""

    options: TuneOptions
    chosen: Conditions
    levels: Array
    fir: Fir
    grid: Grid
    survey: Survey
    counts: np.ndarray
    binning: Binning
    rows: np.ndarray
    seconds: Array


def tune_table(table: Table, options: TuneOptions) -> Tuned:
    """Learn a library from a table. Raises TableError, MissingExtraError, ConfigError."""
    levels = _levels(options.levels)
    chosen = conditions(options.by)
    fir = low_pass(options.order, options.cutoff_s_per_m, options.step_mps)
    with ExitStack() as stack:
        spread = _spread(table, options, stack)
        survey = spread(SurveyPass(conditions=chosen, step_mps=options.step_mps), table.files)
        grid = survey.grid(options.step_mps)
        rows, seconds, mean_m = cell_sums(survey, grid)
        names = _present(chosen, rows)
        _require_cells(rows.sum(axis=0), seconds.sum(axis=0), options, grid)
        scale_m = local_scale(wider(fir, options.step_mps), rows, mean_m)
        binning = Binning(conditions=chosen, grid=grid, scale_m=scale_m)
        counts = spread(CountPass(binning=binning), table.files)
        work = _Work(
            options=options,
            chosen=chosen,
            levels=levels,
            fir=fir,
            grid=grid,
            survey=survey,
            counts=counts,
            binning=binning,
            rows=rows,
            seconds=seconds,
        )
        found = [_surfaces(work, place) for place in range(len(chosen.names))]
        regions = [_region(work, place) for place in range(len(chosen.names))]
        sums = spread(_block_pass(work, found, regions), table.files)
    tuned = [_condition(work, place, found[place], regions[place], sums) for place in names]
    return _library(work, tuned, len(table.files))


def _levels(levels: Sequence[float]) -> Array:
    found = np.array(levels, dtype=float)
    if not len(found) or not np.all((found > 0.0) & (found < 1.0)) or np.any(np.diff(found) <= 0.0):
        raise TableError(
            f"--levels {','.join(map(str, levels))}: rising values between 0 and 1 were expected"
        )
    return found


def _spread(table: Table, options: TuneOptions, stack: ExitStack) -> Spread:
    if options.scheduler is not None:
        from vsensor.study.workers import cluster_client

        client, _ = cluster_client(options.scheduler)
        return on_cluster(stack.enter_context(client))
    return threads(stack.enter_context(rows_bar(table, 3, shown=options.progress)))


def _present(chosen: Conditions, rows: np.ndarray) -> list[int]:
    """Return the places of conditions that have rows; refuses one that was asked for and has none at all."""
    total = rows.sum(axis=(1, 2))
    for column in chosen.columns:
        picked = [k for k, rule in enumerate(chosen.rule) if column in rule.when]
        if not total[picked].any():
            raise TableError(f"--by {column}: no used row of the table has it; nothing to tune a model from")
    if not total[-1]:
        raise TableError(
            f"--by: no used row is left for the model {chosen.names[-1]!r}, which holds where no other does"
        )
    return np.flatnonzero(total).tolist()


def _require_cells(rows: np.ndarray, seconds: Array, options: TuneOptions, grid: Grid) -> None:
    if np.count_nonzero(rows.sum(axis=0)) < 2:
        raise TableError(
            f"all rows are at one range ({grid.range_m[0]:g} m): a surface needs at least two ranges"
        )
    if seconds.sum(axis=0).max() < options.least_seconds:
        raise TableError(
            f"at most {seconds.sum(axis=0).max():.0f} s of driving at any range, at least "
            f"{options.least_seconds:g} s were expected (--least-seconds)"
        )


def _surfaces(work: _Work, place: int) -> Surfaces:
    return surfaces(
        work.counts[place],
        work.fir,
        work.levels,
        work.binning.scale_m[place],
        work.rows[place],
        work.seconds[place],
    )


def _region(work: _Work, place: int) -> tuple[Array, Array]:
    reach = work.survey.reach[place]
    return operating_region(reach, work.options.step_mps, work.options.region_level)


def _share(work: _Work, place: int, region: tuple[Array, Array]) -> Array:
    reach = work.survey.reach[place]
    speeds = np.arange(len(reach)) * work.options.step_mps
    return range_share(reach, np.interp(speeds, *region), SHARE_LEVELS)


def _block_pass(work: _Work, found: list[Surfaces], regions: list[tuple[Array, Array]]) -> BlockPass:
    return BlockPass(
        binning=work.binning,
        fir=work.fir,
        levels=len(work.levels),
        band_of=np.concatenate([band_table(one).reshape(-1) for one in found]),
        score_of=np.concatenate([score_table(counts, work.fir).reshape(-1) for counts in work.counts]),
        reach_m=np.array([np.interp(work.grid.speed_mps, *region) for region in regions]),
        share=np.array([_share(work, place, region) for place, region in enumerate(regions)]),
        share_levels=SHARE_LEVELS,
        period_ns=max(work.survey.period_ns(), 1),
        block_ns=round(work.options.block_s * 1e9),
        every=max(math.ceil(work.survey.rows / CORRELATED_ROWS), 1),
    )


def _condition(
    work: _Work, place: int, found: Surfaces, region: tuple[Array, Array], sums: BlockSums
) -> Condition:
    spread = intervals(work.counts[place], work.fir, found, sums, place)
    model = _model(work, place, found, spread, region, sums)
    closed = close_loop(model, work.options.setting, work.options.seed) if work.options.close_loop else None
    shown = shown_row(model)
    unfiltered = unfiltered_m(
        work.counts[place][:, shown], work.levels, work.binning.scale_m[place][:, shown]
    )
    return Condition(
        name=work.chosen.names[place],
        model=model if closed is None else closed.model,
        spread=spread,
        closed=closed,
        sums=sums,
        place=place,
        unfiltered_m=unfiltered,
    )


def shown_row(model: ErrorModel) -> int:
    """Return the place of the range whose course over speed is shown."""
    return int(np.argmin(np.abs(model.range_m - SHOWN_M)))


def _blind(work: _Work, place: int, found: Surfaces, spread: Intervals) -> np.ndarray:
    """Return which cells (R, V) have too little driving to be used."""
    few = (found.seconds < work.options.least_seconds) | (spread.blocks < FEWEST_BLOCKS)
    blind = (few | ~found.driven | ~np.isfinite(found.absolute_m).all(axis=0)).T
    if blind.all():
        raise TableError(
            f"model {work.chosen.names[place]!r}: every cell is blind; the best has "
            f"{found.seconds.max():.0f} s of driving in {spread.blocks.max():.1f} blocks of "
            f"{work.options.block_s:g} s, at least {work.options.least_seconds:g} s in {FEWEST_BLOCKS:g} "
            "blocks were expected"
        )
    return blind


def _model(
    work: _Work,
    place: int,
    found: Surfaces,
    spread: Intervals,
    region: tuple[Array, Array],
    sums: BlockSums,
) -> ErrorModel:
    """Return a condition's model, its loop not closed yet."""
    blind = _blind(work, place, found, spread)
    period_s = max(work.survey.period_ns(), 1) / 1e9
    time, along = _own_or_all(sums.time, place), _own_or_all(sums.range, place)
    time_s = correlation_time_s(time[:, :, :-1], period_s)
    length_m = correlation_length_m(along, work.grid.range_m)
    signed = _filled(found.signed_m, blind)
    dwells = [_dwells(work, place, seen=seen) for seen in (False, True)]
    return ErrorModel(
        range_m=frozen(work.grid.range_m),
        speed_mps=frozen(work.grid.speed_mps),
        levels=frozen(work.levels),
        absolute_m=_filled(found.absolute_m, blind),
        absolute_low_m=frozen(np.where(blind, np.nan, spread.low_m.transpose(0, 2, 1))),
        absolute_high_m=frozen(np.where(blind, np.nan, spread.high_m.transpose(0, 2, 1))),
        signed_levels=frozen(SIGNED_LEVELS),
        signed_m=signed,
        applied_signed_m=signed,
        applied_length_m=length_m,
        applied_time_s=time_s,
        correlation_length_m=length_m,
        correlation_time_s=time_s,
        rows=frozen(found.rows.T),
        seconds=frozen(found.seconds.T),
        blind=frozen(blind, bool),
        fir=frozen(work.fir.taps),
        fir_order=float(work.fir.order),
        fir_cutoff_s_per_m=work.fir.cutoff_s_per_m,
        region_speed_mps=frozen(region[0]),
        region_range_m=frozen(region[1]),
        region_level=work.options.region_level,
        dwell_levels=frozen(DWELL_LEVELS if len(dwells[0]) else []),
        lost_dwell_s=frozen(dwells[0]),
        seen_dwell_s=frozen(dwells[1] if len(dwells[0]) else []),
        range_share_levels=frozen(SHARE_LEVELS),
        range_share=frozen(_share(work, place, region)),
        range_time_s=correlation_time_s(time[:, :, -1:], period_s),
        quality_period_s=period_s,
        quality_step=frozen(_markov(work.survey.quality[place])),
        level_period_s=period_s,
        level_step=frozen(_markov(_own_or_all(sums.bands, place))),
        log_count=float(work.survey.logs),
        hours=work.survey.images_ns / 3.6e12,
    )


def _own_or_all(sums: np.ndarray, place: int) -> np.ndarray:
    """Return a condition's sums, or those of all conditions where no looked-at block was its own."""
    return np.asarray(sums[place] if np.any(sums[place]) else sums.sum(axis=0))


def _filled(surface: Array, blind: np.ndarray) -> Array:
    """Return surfaces (S, V, R) as (S, R, V), blind cells like their nearest, rising with the level."""
    turned = np.where(blind, np.nan, surface.transpose(0, 2, 1))
    filled = np.stack([fill_from_nearest(one) for one in turned])
    return frozen(np.maximum.accumulate(filled, axis=0))


def _dwells(work: _Work, place: int, *, seen: bool) -> Array:
    """Return quantiles of runs; empty if no line was ever lost."""
    if not work.survey.dwells.of(None, seen=False)[0].size:
        return np.zeros(0)
    seconds, cut = work.survey.dwells.of(place, seen=seen)
    if not len(seconds):
        seconds, cut = work.survey.dwells.of(None, seen=seen)
    return dwell_quantiles(seconds, cut, DWELL_LEVELS)


def _markov(steps: np.ndarray) -> Array:
    """Return the Markov matrix of counted steps; a state that was never left has the shares of all states."""
    left, entered = steps.sum(axis=1, keepdims=True), steps.sum(axis=0)
    if not entered.any():
        return np.zeros((0, 0))
    return np.asarray(np.where(left > 0, steps / np.maximum(left, 1), entered / entered.sum()))


def _library(work: _Work, tuned: list[Condition], logs: int) -> Tuned:
    from importlib.metadata import version

    names = {one.name for one in tuned}
    rule = tuple(one for one in work.chosen.rule if one.model in names)
    hours = work.survey.images_ns / 3.6e12
    source = (
        f"vsensor tune {version('vsensor')}, {datetime.now(UTC):%Y-%m-%d}: {logs} logs, {hours:.2f} h, "
        f"{work.survey.rows} rows; loop through the fit {'closed' if work.options.close_loop else 'open'}"
    )
    return Tuned(
        library=ErrorLibrary(source=source, rule=rule, models={one.name: one.model for one in tuned}),
        conditions=tuple(tuned),
        skipped=tuple(name for name in work.chosen.names if name not in names),
        survey=work.survey,
        block_s=work.options.block_s,
    )
