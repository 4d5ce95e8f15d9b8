"""From a table to a library of models: three passes, surfaces, correlation, persistence, the loop closed."""

import math
from collections.abc import Sequence
from contextlib import ExitStack
from datetime import UTC, datetime

import numpy as np

from vsensor.error_model import ErrorLibrary
from vsensor.errors import TableError
from vsensor.field.table import Table
from vsensor.field.tune.blocks import BlockPass, BlockSums
from vsensor.field.tune.conditions import Conditions, conditions
from vsensor.field.tune.counting import Binning, CountPass
from vsensor.field.tune.fir import local_scale, low_pass, wider
from vsensor.field.tune.grid import Grid
from vsensor.field.tune.loop import close_loop
from vsensor.field.tune.models import SHARE_LEVELS, Work, model_of_work, share_of
from vsensor.field.tune.region import operating_region
from vsensor.field.tune.spread import Spread, on_cluster, rows_bar, threads
from vsensor.field.tune.surface import (
    Surfaces,
    band_table,
    intervals,
    score_table,
    surfaces,
    unfiltered_m,
)
from vsensor.field.tune.survey import SurveyPass, cell_sums
from vsensor.field.tune.tuned import Condition, Tuned, TuneOptions, shown_row
from vsensor.types import Array

CORRELATED_ROWS = 30_000_000
"""About so many rows are looked at for correlation."""


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
        work = Work(
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


def _surfaces(work: Work, place: int) -> Surfaces:
    return surfaces(
        work.counts[place],
        work.fir,
        work.levels,
        work.binning.scale_m[place],
        work.rows[place],
        work.seconds[place],
    )


def _region(work: Work, place: int) -> tuple[Array, Array]:
    reach = work.survey.reach[place]
    return operating_region(reach, work.options.step_mps, work.options.region_level)


def _block_pass(work: Work, found: list[Surfaces], regions: list[tuple[Array, Array]]) -> BlockPass:
    return BlockPass(
        binning=work.binning,
        fir=work.fir,
        levels=len(work.levels),
        band_of=np.concatenate([band_table(one).reshape(-1) for one in found]),
        score_of=np.concatenate([score_table(counts, work.fir).reshape(-1) for counts in work.counts]),
        reach_m=np.array([np.interp(work.grid.speed_mps, *region) for region in regions]),
        share=np.array([share_of(work, place, region) for place, region in enumerate(regions)]),
        share_levels=SHARE_LEVELS,
        period_ns=max(work.survey.period_ns(), 1),
        block_ns=round(work.options.block_s * 1e9),
        every=max(math.ceil(work.survey.rows / CORRELATED_ROWS), 1),
    )


def _condition(
    work: Work, place: int, found: Surfaces, region: tuple[Array, Array], sums: BlockSums
) -> Condition:
    spread = intervals(work.counts[place], work.fir, found, sums, place)
    model = model_of_work(work, place, found, spread, region, sums)
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


def _library(work: Work, tuned: list[Condition], logs: int) -> Tuned:
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
