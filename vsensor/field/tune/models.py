"""A condition's error model from what the three passes over the table counted."""

from dataclasses import dataclass

import numpy as np

from vsensor.error_model import ErrorModel
from vsensor.errors import TableError
from vsensor.field.tune.blocks import BlockSums
from vsensor.field.tune.conditions import Conditions
from vsensor.field.tune.correlation import correlation_length_m, correlation_time_s
from vsensor.field.tune.counting import Binning
from vsensor.field.tune.dwell import dwell_quantiles
from vsensor.field.tune.fir import Fir, fill_from_nearest
from vsensor.field.tune.grid import Grid
from vsensor.field.tune.quantiles import FEWEST_BLOCKS
from vsensor.field.tune.region import range_share
from vsensor.field.tune.surface import (
    SIGNED_LEVELS,
    Intervals,
    Surfaces,
)
from vsensor.field.tune.survey import Survey
from vsensor.field.tune.tuned import TuneOptions
from vsensor.types import Array, frozen

DWELL_LEVELS = np.concatenate([[0.0], np.linspace(0.02, 0.98, 49), [0.99, 0.995, 0.9995]])
SHARE_LEVELS = np.concatenate([[0.001, 0.005], np.linspace(0.01, 0.99, 50), [0.995, 0.999]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
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


def share_of(work: Work, place: int, region: tuple[Array, Array]) -> Array:
    """Return the quantiles (Q,) of the reported range over a condition's operating region."""
    reach = work.survey.reach[place]
    speeds = np.arange(len(reach)) * work.options.step_mps
    return range_share(reach, np.interp(speeds, *region), SHARE_LEVELS)


def _blind(work: Work, place: int, found: Surfaces, spread: Intervals) -> np.ndarray:
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


def model_of_work(
    work: Work,
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
        range_share=frozen(share_of(work, place, region)),
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


def _dwells(work: Work, place: int, *, seen: bool) -> Array:
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
