"""From counts to surfaces: quantiles, blind cells, and what the third pass needs to look up."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from vsensor.field.tune.blocks import SCORE_ONE, BlockSums
from vsensor.field.tune.fir import Fir, along_speed
from vsensor.field.tune.grid import SIZES, size_edges
from vsensor.field.tune.quantiles import (
    effective_count,
    share_interval,
    signed_quantiles,
    size_quantiles,
    sizes_of,
)
from vsensor.types import Array, BoolArray

SIGNED_LEVELS = ndtr(np.linspace(-3.0902323061678132, 3.0902323061678132, 41))
"""0.001 to 0.999 in even steps of the normal score: between them a law is linear in the score."""
FEWEST_LOGS = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Surfaces:
    """One condition's quantiles in m: `absolute_m` (L, V, R), `signed_m` (S, V, R); NaN where nothing is.

    `rows`, `seconds` (V, R) are those within the filter's width, `driven` where the cell lies between
    speeds that were driven.
    """

    levels: Array
    scale_m: Array
    absolute_m: Array
    signed_m: Array
    rows: Array
    seconds: Array
    driven: BoolArray


def pooled(counts: np.ndarray, fir: Fir) -> Array:
    """Return counts (V, R, bins) weighted along speed, in units of each cell's scale."""
    return along_speed(fir.taps, counts.astype(np.float64), 0)


def surfaces(
    counts: np.ndarray, fir: Fir, levels: Array, scale_m: Array, rows: np.ndarray, seconds: Array
) -> Surfaces:
    """Return the quantiles of counts (V, R, bins), whose cells have `rows` and `seconds` (V, R)."""
    absolute, signed = [], []
    for place in range(counts.shape[1]):  # range by range, for memory
        here = pooled(counts[:, place : place + 1], fir)
        absolute.append(size_quantiles(sizes_of(here), levels))
        signed.append(signed_quantiles(here, SIGNED_LEVELS))
    width = (fir.taps > 0.0).astype(float)
    before = np.maximum.accumulate(rows > 0, axis=0)
    after = np.maximum.accumulate(rows[::-1] > 0, axis=0)[::-1]
    return Surfaces(
        levels=levels,
        scale_m=scale_m,
        absolute_m=np.concatenate(absolute, axis=2) * scale_m,
        signed_m=np.concatenate(signed, axis=2) * scale_m,
        rows=along_speed(width, rows.astype(float), 0),
        seconds=along_speed(width, seconds, 0),
        driven=before & after,
    )


def unfiltered_m(counts: np.ndarray, levels: Array, scale_m: Array) -> Array:
    """Return the quantiles (L, V) of each speed alone, of one range's counts (V, bins) and scales (V,)."""
    return size_quantiles(sizes_of(counts.astype(np.float64)), levels) * scale_m


def band_table(found: Surfaces) -> np.ndarray:
    """Return how many of the levels' surfaces each bin is above (V, R, 2 SIZES), uint8."""
    edges = size_edges()
    middle = 0.5 * (edges[:-1] + edges[1:])
    scaled = np.nan_to_num(found.absolute_m / found.scale_m, nan=np.inf)
    bands = np.zeros((*found.scale_m.shape, SIZES), np.uint8)
    for surface in scaled:
        bands += middle > surface[..., None]
    return np.concatenate([bands[..., ::-1], bands], axis=-1)


def score_table(counts: np.ndarray, fir: Fir) -> np.ndarray:
    """Return the normal score of each bin (V, R, 2 SIZES) in 1 / SCORE_ONE, int16; 0 of nothing."""
    scores = np.zeros(counts.shape, np.int16)
    for place in range(counts.shape[1]):
        here = pooled(counts[:, place], fir)
        total = here.sum(axis=-1, keepdims=True)
        share = (np.cumsum(here, axis=-1) - 0.5 * here) / np.maximum(total, 1e-300)
        least = 0.5 / np.maximum(total, 1.0)
        score = ndtri(np.clip(share, least, 1.0 - least))
        scores[:, place] = np.where(total > 0.0, np.rint(score * SCORE_ONE), 0.0)
    return scores


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervals:
    """`low_m`, `high_m` (L, V, R): 95 % intervals of the absolute surfaces; `effective` (L, V, R) counts.

    `blocks` (V, R) is the effective number of blocks; `between_logs` how many times larger the variance
    from log to log is than blocks alone make it: 1 where that is not known to be more than chance.
    """

    low_m: Array
    high_m: Array
    effective: Array
    blocks: Array
    between_logs: float


def intervals(counts: np.ndarray, fir: Fir, found: Surfaces, sums: BlockSums, group: int) -> Intervals:
    """Return the intervals of a condition's surfaces from its sums over blocks and logs."""
    below, rows = sums.below[group], np.maximum(sums.rows[group], 1)
    share = below / rows
    variance, blocks = _variance(share, rows, [part[group] for part in sums.block_squares])
    of_logs, logs = _variance(share, rows, [part[group] for part in sums.log_squares])
    ratio = _between_logs(variance, of_logs, logs)
    effective = effective_count(found.levels, variance * ratio, blocks)
    low, high = share_interval(found.levels, effective)
    ends = []
    for place in range(counts.shape[1]):
        here = sizes_of(pooled(counts[:, place : place + 1], fir))
        both = np.concatenate([low[:, :, place : place + 1], high[:, :, place : place + 1]])
        ends.append(size_quantiles(here, both))
    scaled = np.concatenate(ends, axis=2) * found.scale_m
    return Intervals(
        low_m=scaled[: len(low)],
        high_m=scaled[len(low) :],
        effective=effective,
        blocks=blocks,
        between_logs=ratio,
    )


def _variance(share: Array, rows: np.ndarray, squares: list[np.ndarray]) -> tuple[Array, Array]:
    """Return the variance (L, V, R) of the shares, and the effective number (V, R) of blocks or logs."""
    below_below, below_rows, rows_rows = (part.astype(np.float64) for part in squares)
    total = rows.astype(np.float64)
    deviation = below_below - 2.0 * share * below_rows + share**2 * rows_rows
    return np.maximum(deviation, 0.0) / total**2, total**2 / np.maximum(rows_rows, 1.0)


def _between_logs(of_blocks: Array, of_logs: Array, logs: Array) -> float:
    known = (of_blocks > 0.0) & (logs >= FEWEST_LOGS)[None]
    if not known.any():
        return 1.0
    count = np.broadcast_to(logs, of_blocks.shape)[known]
    ratio = float(np.mean(of_logs[known] / of_blocks[known] * count / (count - 1.0)))
    by_chance = 2.0 * np.sqrt(2.0 / (float(count.mean()) - 1.0))
    return ratio if ratio > 1.0 + by_chance else 1.0
