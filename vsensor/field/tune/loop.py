"""Closing the loop through the fit: what the points must be moved by, so that the polynomial has the law.

    applied law ──► errors of the points ──► fit ──► reported law    compared with the tuned one
         ▲                                                │
         └──────────── what it misses, smoothed ──────────┘          a few times

The fit smooths along the range: it takes something away from what changes within some 20 m, and adds it
elsewhere (ERRATA, P1 2.2.2). The same random numbers in every turn, so that turns differ by the law alone;
and what these numbers by chance make of the points, whose law is known, is taken off the reported ones.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from scipy.stats import rankdata

from vsensor.error_model import ErrorModel
from vsensor.field.tune.blocks import add_range
from vsensor.field.tune.correlation import correlation_length_m
from vsensor.field.virtual import FitSetting, VirtualSensor, reach_of, with_applied
from vsensor.types import Array

SAMPLES = 6000
TURNS = 4
DAMPING = 0.8
SPEED_STEP_MPS = 2.5
LENGTHS_M = (5.0, 300.0)
MOST_NODES = 600
"""Of the range grid: 400 m by a metre, and the model's ranges between."""
CHECKED = 0.95
"""Level of the size at which what is left is told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Closed:
    """A model with its applied law; relative misses of the 95 % size, open and closed (largest, mean)."""

    model: ErrorModel
    missed_open: tuple[float, float]
    missed: tuple[float, float]


def close_loop(model: ErrorModel, setting: FitSetting, seed: int = 0) -> Closed:
    """Return the model with `applied_*` such that the fitted polynomials have its signed law.

    Cells that are blind, or farther than the operating range, are not compared.
    """
    random = np.random.default_rng([seed, 0x1007])
    columns = _columns(model, setting)
    if not len(columns):
        return Closed(model=model, missed_open=(0.0, 0.0), missed=(0.0, 0.0))
    half = random.standard_normal((SAMPLES // 2, 2 * MOST_NODES))
    white = np.concatenate([half, -half])
    trial, best, missed_open = model, (model, (np.inf, np.inf)), (np.inf, np.inf)
    for turn in range(TURNS + 1):
        sensor = VirtualSensor.of(trial, setting, columns.tolist())
        z = white[:, : len(sensor.grid_m)] @ sensor.factor.T
        found = _laws(sensor, z, columns)
        miss = _missed(model, columns, found)
        missed_open = miss if turn == 0 else missed_open
        best = (trial, miss) if miss[1] < best[1][1] else best
        if turn < TURNS:
            trial = _corrected(model, trial, columns, found, _length(model, sensor, z, columns))
    return Closed(model=_with_time(best[0], setting, columns, white), missed_open=missed_open, missed=best[1])


def _laws(sensor: VirtualSensor, z: Array, columns: np.ndarray) -> Array:
    """Return the signed law (S, R, C) of the reported errors, without what chance made of the points."""
    model, laws = sensor.model, []
    for v in columns.tolist():
        reported = sensor.errors(z, np.full(len(z), model.speed_mps[v]))
        both = np.quantile(np.stack([reported, sensor.points(z, v)]), model.signed_levels, axis=1)
        laws.append(both[:, 0] - (both[:, 1] - model.applied_signed_m[:, :, v]))
    return np.stack(laws, axis=2)


def _columns(model: ErrorModel, setting: FitSetting) -> np.ndarray:
    """Return the speed columns that are looked at: every 2.5 m/s of those where a line can be fitted."""
    sensor = VirtualSensor.of(model, setting)
    fitted = [k for k, each in sensor.matrices.items() if all(matrix.any() for matrix in each)]
    seen = np.array([k for k in fitted if not model.blind[:, k].all()], dtype=np.int64)
    step = max(round(SPEED_STEP_MPS / float(model.speed_mps[1] - model.speed_mps[0])), 1)
    return np.unique(np.append(seen[::step], seen[-1:]))


def _compared(model: ErrorModel, columns: np.ndarray) -> np.ndarray:
    """Return which ranges (C, R) count at each column."""
    reach = reach_of(model, model.speed_mps[columns])
    return ~model.blind[:, columns].T & (model.range_m[None] <= reach[:, None] + 1e-6)


def _missed(model: ErrorModel, columns: np.ndarray, found: Array) -> tuple[float, float]:
    """Return how far the law (S, R, C) is from the tuned one: the width between 2.5 and 97.5 %, relative.

    The largest and the mean over what is compared.
    """
    levels = [0.5 - 0.5 * CHECKED, 0.5 + 0.5 * CHECKED]

    def width(law: Array) -> Array:
        flat = law.reshape(len(law), -1).T
        ends = np.array([np.interp(levels, model.signed_levels, one) for one in flat])
        return np.asarray(ends[:, 1] - ends[:, 0]).reshape(law.shape[1:])

    wanted = width(model.signed_m[:, :, columns])
    use = _compared(model, columns).T & (wanted > 0.0)
    off = np.abs(width(found)[use] / wanted[use] - 1.0)
    return (float(off.max()), float(off.mean())) if use.any() else (0.0, 0.0)


def _corrected(
    model: ErrorModel, now: ErrorModel, columns: np.ndarray, found: Array, length_m: float
) -> ErrorModel:
    """Return the next trial: law and length moved by what the found ones miss."""
    compared = _compared(model, columns).T[None]
    miss = np.where(compared, model.signed_m[:, :, columns] - found, np.nan)
    smooth = _smooth(_along_range(miss), ndtri(model.signed_levels))
    step = np.stack(
        [
            [np.interp(model.speed_mps, model.speed_mps[columns], line) for line in surface]
            for surface in smooth
        ]
    )
    signed = np.maximum.accumulate(now.applied_signed_m + DAMPING * step, axis=0)
    # a cubic cannot be as short as any length: what it can no longer follow is not driven further
    ratio = np.clip(model.correlation_length_m / length_m, 0.8, 1.25)
    return with_applied(
        now,
        signed,
        float(np.clip(now.applied_length_m * ratio**DAMPING, *LENGTHS_M)),
        now.applied_time_s,
    )


def _along_range(miss: Array) -> Array:
    """Fill what is not compared (NaN) from the nearest range that is, 0 where none is; (S, R, C)."""
    filled = np.zeros_like(miss)
    for column in range(miss.shape[2]):
        known = np.flatnonzero(np.isfinite(miss[0, :, column]))
        if len(known):
            for level in range(miss.shape[0]):
                filled[level, :, column] = np.interp(
                    np.arange(miss.shape[1]), known, miss[level, known, column]
                )
    return filled


def _smooth(miss: Array, score: Array) -> Array:
    """Return what is missed (S, R, C) as a cubic in the normal score: its tail is noise of few samples."""
    weight = np.exp(-0.25 * score**2)  # about 1 / std of a sample's quantile
    basis = np.stack([np.ones_like(score), score, score**2, score**3], axis=1)
    solve = basis @ np.linalg.pinv(basis * weight[:, None]) * weight
    return np.asarray(np.einsum("st,trc->src", solve, miss))


def _scores(reported: Array) -> Array:
    """Return normal scores by rank (N, R)."""
    return ndtri((rankdata(reported, axis=0) - 0.5) / len(reported))


def _length(model: ErrorModel, sensor: VirtualSensor, z: Array, columns: np.ndarray) -> float:
    """Return the correlation length of reported errors, as tuning measures it."""
    use = _compared(model, columns)
    sums = np.zeros((3, len(model.range_m), len(model.range_m)))
    some = z[::6]
    for row, v in enumerate(columns.tolist()):
        scores = _scores(sensor.errors(some, np.full(len(some), model.speed_mps[v])))
        add_range(sums, np.where(use[row], scores, np.nan))
    return correlation_length_m(sums, model.range_m)


def _with_time(model: ErrorModel, setting: FitSetting, columns: np.ndarray, white: Array) -> ErrorModel:
    """Return the model with a time of the points such that the reported scores have the tuned one.

    Products of scores are not kept by a law that is not linear: at one time's distance rho is not 1/e.
    """
    sensor = VirtualSensor.of(model, setting, columns.tolist())
    keep = np.exp(-1.0)
    size = len(sensor.grid_m)
    one = white[:, :size] @ sensor.factor.T
    other = keep * one + np.sqrt(1.0 - keep**2) * (white[:, size : 2 * size] @ sensor.factor.T)
    more = []
    for v in columns.tolist():
        use = _compared(model, np.array([v]))[0]
        if use.any():
            pair = [
                _scores(sensor.errors(z, np.full(len(z), model.speed_mps[v])))[:, use] for z in (one, other)
            ]
            drawn = [_scores(sensor.points(z, v))[:, use] for z in (one, other)]
            more.append(_rho(*pair) - _rho(*drawn))  # the same chance in both
    found = float(np.clip(keep + np.mean(np.concatenate(more)), 0.2, 0.6)) if more else float(keep)
    longer = float(np.log(found) / np.log(keep))
    return with_applied(
        model, model.applied_signed_m, model.applied_length_m, model.correlation_time_s * longer
    )


def _rho(one: Array, other: Array) -> Array:
    """Return the correlation (R,) of scores (N, R)."""
    return np.asarray((one * other).sum(axis=0) / np.sqrt((one**2).sum(axis=0) * (other**2).sum(axis=0)))
