"""Third pass: how shares vary from block to block and log to log, and how errors hang together.

    a block of driving (60 s) ──► errors below each surface, of how many        ──► effective counts
    some blocks, image x range ──► normal scores: products over lags and ranges ──► correlation
                               ──► bands between the surfaces, image to image   ──► level_step

All sums are of whole numbers (scores in 1/256).
"""

import itertools
import zlib
from dataclasses import dataclass, field, fields

import numpy as np
from scipy.special import ndtri

from vsensor.field.table import LogFile
from vsensor.field.tune.counting import Binning, pieces
from vsensor.field.tune.fir import Fir, along_speed
from vsensor.field.tune.grid import SIZES, bin_of
from vsensor.field.tune.reading import SIDES, Images, Progress, Rows, read_log
from vsensor.types import Array

LAGS = (1, 2, 3, 4, 6, 8, 11, 15, 20, 26, 34, 44, 57, 75, 100)
"""In images."""
SCORE_ONE = 256.0


@dataclass(slots=True, kw_only=True)
class BlockSums:
    """Sums over blocks and over logs; G conditions, L levels, V speeds, R ranges.

    `below` (G, L, V, R) and `rows` (G, V, R), weighted by the whole taps; `*_squares` of blocks and logs:
    below * below, below * rows (G, L, V, R), rows * rows (G, V, R). `time` (G, lags, 3, R + 1): products of
    scores at both ends of a lag, and squares at each end; the last range is the range share. `range`
    (G, 3, R, R): products of two ranges, squares of the first where both are there, pairs.
    `bands` (G, L + 1, L + 1) steps from image to image.
    """

    below: np.ndarray
    rows: np.ndarray
    block_squares: list[np.ndarray]
    log_squares: list[np.ndarray]
    time: np.ndarray
    range: np.ndarray
    bands: np.ndarray

    @classmethod
    def zero(cls, groups: int, levels: int, speeds: int, ranges: int) -> "BlockSums":
        """Return sums of nothing."""
        cells, all_levels = (groups, speeds, ranges), (groups, levels, speeds, ranges)

        def squares() -> list[np.ndarray]:
            return [np.zeros(shape, np.int64) for shape in (all_levels, all_levels, cells)]

        return cls(
            below=np.zeros(all_levels, np.int64),
            rows=np.zeros(cells, np.int64),
            block_squares=squares(),
            log_squares=squares(),
            time=np.zeros((groups, len(LAGS), 3, ranges + 1)),
            range=np.zeros((groups, 3, ranges, ranges)),
            bands=np.zeros((groups, levels + 1, levels + 1), np.int64),
        )

    def merge(self, other: "BlockSums") -> "BlockSums":
        """Add what others counted; returns self."""
        for one in fields(self):
            mine, more = getattr(self, one.name), getattr(other, one.name)
            for a, b in zip(*((x if isinstance(x, list) else [x]) for x in (mine, more)), strict=True):
                a += b
        return self


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockPass:
    """Adds logs one at a time. `band_of`, `score_of` (cells * bins,): band and score of a place.

    `reach_m` (G, V) is d_max(v), `share` (G, Q) quantiles of the reported range over it at `share_levels`.
    One block of `every` is looked at for correlation.
    """

    binning: Binning
    fir: Fir
    levels: int
    band_of: np.ndarray
    score_of: np.ndarray
    reach_m: Array
    share: Array
    share_levels: Array
    period_ns: int
    block_ns: int
    every: int

    def start(self) -> BlockSums:
        """Return sums of nothing."""
        groups, speeds, ranges = self.binning.scale_m.shape
        return BlockSums.zero(groups, self.levels, speeds, ranges)

    def add(self, sums: BlockSums, file: LogFile, progress: Progress | None = None) -> None:
        """Add one log."""
        log = _Log(self, sums, zlib.crc32(file.log.encode()))
        places = self.binning.grid.places()
        per_metre = (1.0 / self.binning.scale_m).astype(np.float32).reshape(-1)
        for rows in read_log(file, self.binning.conditions.rule, progress, images=True):
            if isinstance(rows, Images):
                self._add_share(sums, rows)
                continue
            for piece in pieces(rows):
                if piece.count:
                    cell = self.binning.cells(piece, places)
                    place = bin_of(piece.error_m * per_metre.take(cell))
                    place += cell * np.int32(2 * SIZES)
                    log.add(piece, cell, place)
        log.close()

    def _add_share(self, sums: BlockSums, images: Images) -> None:
        """Add the products over lags of the reported range's scores, as if it were one range more."""
        good = images.known & images.reported & np.isfinite(images.speed_mps)
        for group in range(self.binning.scale_m.shape[0]):
            for side in range(SIDES):
                chosen = good & (images.group == group) & (images.side == side)
                if chosen.any():
                    cell = self.binning.grid.speed_cell(images.speed_mps[chosen])
                    score = scores_of(
                        images.x_max_m[chosen] / self.reach_m[group, cell],
                        self.share[group],
                        self.share_levels,
                    )
                    t_ns = images.t_ns[chosen]
                    slot = slots_of(t_ns, self.period_ns)
                    scores = np.full((int(slot[-1]) + 1, 1), np.nan)
                    scores[slot, 0] = np.rint(score * SCORE_ONE)
                    add_time(sums.time[group, :, :, -1:], scores)


def slots_of(t_ns: np.ndarray, period_ns: int) -> np.ndarray:
    """Return the places (N,) of images in time, in periods from the first; a pause is as long as no lag is.

    So a log that was interrupted for days takes no more memory than its images do.
    """
    pauses = np.flatnonzero(np.diff(t_ns) > LAGS[-1] * period_ns) + 1
    slot = np.zeros(len(t_ns), np.int64)
    for start, stop in itertools.pairwise([0, *pauses.tolist(), len(t_ns)]):
        before = slot[start - 1] + LAGS[-1] + 1 if start else 0
        slot[start:stop] = before + np.rint((t_ns[start:stop] - t_ns[start]) / period_ns).astype(np.int64)
    return slot


def scores_of(values: Array, quantiles: Array, levels: Array) -> Array:
    """Return the normal scores (N,) of values by their quantiles (Q,); of equal quantiles the middle one."""
    scores = ndtri(levels)
    low = np.searchsorted(quantiles, values, side="left")
    high = np.searchsorted(quantiles, values, side="right")
    inside = np.interp(values, quantiles, scores)
    tied = high > low
    middle = 0.5 * (scores[np.clip(low, 0, len(scores) - 1)] + scores[np.clip(high - 1, 0, len(scores) - 1)])
    return np.where(tied, middle, inside)


@dataclass(slots=True)
class _Log:
    """One log on its way through the pass."""

    work: BlockPass
    sums: BlockSums
    key: int
    began_ns: int = -1
    block: int = -1
    seen: list[tuple[np.ndarray, ...]] = field(default_factory=list)
    of_block: np.ndarray = field(init=False)
    of_log: list[np.ndarray] = field(init=False)

    def __post_init__(self) -> None:
        groups, speeds, ranges = self.work.binning.scale_m.shape
        self.of_block = np.zeros((groups, speeds, ranges, self.work.levels + 1), np.int64)
        self.of_log = [np.zeros_like(self.sums.below), np.zeros_like(self.sums.rows)]

    def add(self, rows: Rows, cell: np.ndarray, place: np.ndarray) -> None:
        """Add rows, which go on in time."""
        if self.began_ns < 0:
            self.began_ns = int(rows.t_ns[0])
        block = (rows.t_ns - self.began_ns) // self.work.block_ns
        starts = np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1, [len(block)]])
        band = self.work.band_of.take(place)
        for start, stop in itertools.pairwise(starts):
            if block[start] != self.block:
                self.close_block()
                self.block = int(block[start])
            part = slice(start, stop)
            combined = cell[part].astype(np.int64) * (self.work.levels + 1) + band[part]
            low = int(combined.min())
            found = np.bincount(combined - low)
            self.of_block.reshape(-1)[low : low + len(found)] += found
            if (self.key + self.block) % self.work.every == 0:
                self.seen.append(
                    (
                        rows.t_ns[part],
                        rows.side[part],
                        rows.group[part],
                        cell[part],
                        band[part],
                        self.work.score_of.take(place[part]),
                    )
                )

    def close_block(self) -> None:
        """Add the block's squares, and its correlations if it is one that is looked at."""
        if self.block < 0:
            return
        cumulated = np.cumsum(self.of_block, axis=-1)
        taps = self.work.fir.whole
        below = along_speed(taps, np.moveaxis(cumulated[..., :-1], -1, 1), 2)
        rows = along_speed(taps, cumulated[..., -1], 1)
        _add_squares(self.sums.block_squares, below, rows)
        self.of_log[0] += below
        self.of_log[1] += rows
        self.of_block[:] = 0
        if self.seen:
            self._correlate([np.concatenate(parts) for parts in zip(*self.seen, strict=True)])
            self.seen.clear()

    def close(self) -> None:
        """Add the log's squares."""
        self.close_block()
        self.sums.below += self.of_log[0]
        self.sums.rows += self.of_log[1]
        _add_squares(self.sums.log_squares, *self.of_log)

    def _correlate(self, columns: list[np.ndarray]) -> None:
        t_ns, side, group, cell, band, score = columns
        ranges = self.sums.rows.shape[-1]
        slot = np.rint((t_ns - t_ns[0]) / self.work.period_ns).astype(np.int64)
        at = cell % ranges
        for one in range(SIDES):
            chosen = side == one
            if not chosen.any():
                continue
            # a block belongs to the condition that it mostly has: night does not change from image to image
            condition = int(np.bincount(group[chosen]).argmax())
            chosen &= group == condition
            scores = np.full((int(slot[chosen].max()) + 1, ranges), np.nan)
            bands = np.full(scores.shape, -1, np.int16)
            scores[slot[chosen], at[chosen]] = score[chosen]
            bands[slot[chosen], at[chosen]] = band[chosen]
            add_time(self.sums.time[condition, :, :, :ranges], scores)
            add_range(self.sums.range[condition], scores)
            self.sums.bands[condition] += band_steps(bands, self.work.levels + 1)


def _add_squares(squares: list[np.ndarray], below: np.ndarray, rows: np.ndarray) -> None:
    squares[0] += below * below
    squares[1] += below * rows[:, None]
    squares[2] += rows * rows


def add_time(sums: np.ndarray, scores: np.ndarray) -> None:
    """Add products over lags to (lags, 3, R) of scores (slots, R), NaN where there is none."""
    known = ~np.isnan(scores)
    value = np.where(known, scores, 0.0)
    square = value * value
    for place, lag in enumerate(LAGS):
        if lag < len(scores):
            sums[place, 0] += (value[:-lag] * value[lag:]).sum(axis=0)
            sums[place, 1] += (square[:-lag] * known[lag:]).sum(axis=0)
            sums[place, 2] += (square[lag:] * known[:-lag]).sum(axis=0)


def add_range(sums: np.ndarray, scores: np.ndarray) -> None:
    """Add products over pairs of ranges to (3, R, R) of scores (slots, R)."""
    known = (~np.isnan(scores)).astype(np.float64)
    value = np.nan_to_num(scores)
    sums[0] += value.T @ value
    sums[1] += (value * value).T @ known
    sums[2] += known.T @ known


def band_steps(bands: np.ndarray, count: int) -> np.ndarray:
    """Return the steps (count, count) from image to image of bands (slots, R); -1 unknown."""
    before, after = bands[:-1].astype(np.int64), bands[1:].astype(np.int64)
    good = (before >= 0) & (after >= 0)
    return np.bincount(before[good] * count + after[good], minlength=count * count).reshape(count, count)
