"""What the findings on held-out logs say about a model, against limits."""

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np
from scipy.special import kolmogorov, ndtri
from scipy.stats import t as student
from scipy.stats import wasserstein_distance

from vsensor.error_model import ErrorModel
from vsensor.field.tune.correlation import correlation_time_s, time_curve
from vsensor.field.tune.dwell import dwell_quantiles
from vsensor.field.validate.held_out import Found, HeldOut
from vsensor.field.validate.verdict import Band, Check, Judged, ValidateLimits
from vsensor.types import Array

RANGE_BANDS_M = (0.0, 20.0, 40.0, 60.0, 80.0, 100.0, 250.0)
SPEED_BAND_MPS = 10.0
LEAST_SECONDS = 60.0
"""Of driving in a band: of less, two drives of the same law differ by more than a limit."""
MOST_IN_BAND = 40_000
FEWEST_RUNS = 30
LEVELS = np.linspace(0.02, 0.98, 49)


def judge(held: HeldOut, limits: ValidateLimits) -> list[Judged]:
    """Return the verdicts on the models that the logs have rows of."""
    found = [_judged(one, place, held, limits) for place, one in enumerate(held.found)]
    return [one for one in found if one is not None]


def _judged(one: Found, place: int, held: HeldOut, limits: ValidateLimits) -> Judged | None:
    if not one.size_counts:
        return None
    model = one.model
    shares, half, _ = _shares(np.array(one.size_counts))
    signed, _, effective = _shares(np.array(one.signed_counts))
    counts = np.array(one.signed_counts).sum(axis=0)
    rows = int(counts.sum())
    total = rows + one.outside
    bands = _bands(one, held.period_ns / 1e9)
    lags, rho = _rho(one, held.period_ns / 1e9)
    lost, seen = (_runs(one.model, place, held, seen=which) for which in (False, True))
    checks = [
        Check(
            what="rows that the model does not know",
            shown=f"{one.outside / total:.1%} of {total}",
            off=one.outside / total,
            chance=0.0,
            limit=limits.outside,
        )
    ]
    if rows:
        checks += _coverage(model, shares, half, limits)
        checks.append(_pit(model, signed, effective, limits))
        checks += _distances(bands, limits)
        checks += _times(one, held.period_ns / 1e9, limits)
        checks += _losses(one.model, place, held, limits)
    return Judged(
        name=one.name,
        model=model,
        rows=rows,
        effective=float(effective),
        checks=tuple(checks),
        bands=tuple(bands),
        coverage=shares,
        half=half,
        pit=counts / max(rows, 1) / np.diff([0.0, *model.signed_levels, 1.0]),
        lags_s=lags,
        rho=rho,
        lost_s=lost,
        seen_s=seen,
    )


def _shares(counts: np.ndarray) -> tuple[Array, Array, float]:
    """Return the shares at or below each quantile (K,), half their 95 % interval, the effective count.

    `counts` (B, K + 1) by blocks; the variance is that of the block bootstrap, widened as Student's t where
    the blocks are few.
    """
    below = np.cumsum(counts, axis=1)[:, :-1].astype(np.float64)
    rows = counts.sum(axis=1).astype(np.float64)
    total = max(rows.sum(), 1.0)
    share = below.sum(axis=0) / total
    blocks = total**2 / max(float((rows**2).sum()), 1.0)
    variance = ((below - share * rows[:, None]) ** 2).sum(axis=0) / total**2
    normal = ndtri(0.975)
    variance *= blocks / max(blocks - 1.0, 0.5) * (student.ppf(0.975, max(blocks - 1.0, 1.0)) / normal) ** 2
    middle = int(np.argmin(np.abs(share - 0.5)))
    spread = share[middle] * (1.0 - share[middle])
    effective = spread / variance[middle] if variance[middle] > 0.0 else total
    return share, np.asarray(normal * np.sqrt(variance)), float(effective)


def _coverage(model: ErrorModel, shares: Array, half: Array, limits: ValidateLimits) -> list[Check]:
    return [
        Check(
            what=f"errors within the {level:.0%} surface",
            shown=f"{share:.2%} +- {spread:.2%}",
            off=abs(share - level),
            chance=float(spread),
            limit=limits.coverage,
        )
        for level, share, spread in zip(model.levels.tolist(), shares.tolist(), half.tolist(), strict=True)
    ]


def _pit(model: ErrorModel, signed: Array, effective: float, limits: ValidateLimits) -> Check:
    distance = float(np.abs(signed - model.signed_levels).max())
    probability = float(kolmogorov(distance * np.sqrt(effective)))
    # 95 % of the largest distances of so many independent errors are below this
    chance = 1.358 / np.sqrt(effective)
    return Check(
        what="evenness of the errors' places in the law (KS distance)",
        shown=f"{distance:.4f}, p = {probability:.2g} with {effective:.0f} effective rows",
        off=distance,
        chance=float(chance),
        limit=limits.pit,
    )


def _bands(one: Found, period_s: float) -> list[Band]:
    """Return the bands in which at least LEAST_SECONDS were driven with two lines, or twice that with one."""
    range_m, speed, errors = one.sampled()
    found = []
    cell = (speed // SPEED_BAND_MPS).astype(int)
    for low, high in pairwise(RANGE_BANDS_M):
        for step in np.unique(cell).tolist():
            here = (range_m >= low) & (range_m < high) & (cell == step)
            count = int(np.count_nonzero(here))
            lines = np.unique(range_m[here], return_counts=True)[1]
            if not count or lines.max() * period_s < 2.0 * LEAST_SECONDS:
                continue
            some = errors[:, here][:, :: max(count // MOST_IN_BAND, 1)]
            found.append(
                Band(
                    range_m=(low, high),
                    speed_mps=(step * SPEED_BAND_MPS, (step + 1) * SPEED_BAND_MPS),
                    rows=count,
                    mean_m=float(np.abs(some[0]).mean()),
                    distance_m=float(wasserstein_distance(some[0], some[1])),
                    chance_m=max(wasserstein_distance(a, b) for a, b in combinations(some[1:], 2)),
                )
            )
    return found


def _distances(bands: Sequence[Band], limits: ValidateLimits) -> list[Check]:
    """Return a check of the band that is farthest off beyond chance, and none without bands."""
    known = [one for one in bands if one.mean_m > 0.0]
    if not known:
        return []
    worst = max(known, key=lambda one: (one.distance_m - one.chance_m) / one.mean_m)
    return [
        Check(
            what=f"distance of recorded and virtual errors at {worst.range_m[0]:.0f} to "
            f"{worst.range_m[1]:.0f} m, {worst.speed_mps[0]:.0f} to {worst.speed_mps[1]:.0f} m/s (the worst)",
            shown=f"{worst.distance_m:.4f} m of {worst.mean_m:.4f} m (by chance {worst.chance_m:.4f} m)",
            off=worst.distance_m / worst.mean_m,
            chance=worst.chance_m / worst.mean_m,
            limit=limits.wasserstein,
        )
    ]


def _rho(one: Found, period_s: float) -> tuple[Array, Array]:
    curves = [time_curve(sums, period_s) for sums in one.time[:2]]
    return curves[0][0], np.stack([rho for _, rho in curves])


def _times(one: Found, period_s: float, limits: ValidateLimits) -> list[Check]:
    if not one.time[0].any():
        return []
    recorded, virtual, *others = (correlation_time_s(sums, period_s) for sums in one.time)
    return [
        Check(
            what="correlation time",
            shown=f"recorded {recorded:.3f} s, virtual {virtual:.3f} s",
            off=abs(virtual / recorded - 1.0),
            chance=max(abs(other / virtual - 1.0) for other in others),
            limit=limits.correlation_time,
        )
    ]


def _runs(model: ErrorModel, place: int, held: HeldOut, *, seen: bool) -> Array:
    """Return durations (2, Q) at LEVELS, recorded and of the model; empty without any."""
    seconds, cut = held.dwells.of(place, seen=seen)
    table = model.seen_dwell_s if seen else model.lost_dwell_s
    if not len(seconds) or not len(table):
        return np.zeros((2, 0))
    return np.stack([dwell_quantiles(seconds, cut, LEVELS), np.interp(LEVELS, model.dwell_levels, table)])


def _losses(model: ErrorModel, place: int, held: HeldOut, limits: ValidateLimits) -> list[Check]:
    checks = []
    for word, seen in (("lost", False), ("seen", True)):
        cut = held.dwells.of(place, seen=seen)[1]
        ended = int(np.count_nonzero(~cut))
        if ended < FEWEST_RUNS:
            continue
        curves = _runs(model, place, held, seen=seen)
        means = [float(np.trapezoid(curve, LEVELS)) / np.ptp(LEVELS) for curve in curves if len(curve)]
        shown, off = f"{ended} runs recorded, the model loses no line", 1.0
        if means:
            shown = f"recorded {means[0]:.2f} s, virtual {means[1]:.2f} s, {ended} runs"
            off = abs(means[1] / max(means[0], 1e-9) - 1.0)
        # the mean of n exponential durations is known to 1 / sqrt(n)
        checks.append(
            Check(
                what=f"how long a line stays {word}",
                shown=shown,
                off=off,
                chance=1.96 / np.sqrt(ended),
                limit=limits.lost_time,
            )
        )
    return checks
