"""A learned model beside the truth: the law that the drives were made with, or the model that made them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from tools.made_law import cubic_at, quantiles_m, reported_errors_m
from vsensor.error_model import ErrorModel
from vsensor.field.virtual import FitSetting
from vsensor.types import Array

HOUR_S = 3600.0
COLUMN_STEP = 4
"""Every so many speeds are compared: 2 m/s."""
BANDS_M = (0.0, 4.0, 10.0, 20.0, 40.0, 60.0, 80.0, 101.0)
Truth = Callable[[Array, Array, float], Array]
"""(levels, ranges, speed) -> quantiles (L, R) of the size of the reported error, NaN where nothing is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """A model beside the truth, at every `COLUMN_STEP`-th speed: `off` (L, N) relative, `inside` (L, N).

    `seconds` (N,) of driving within the filter's width; `time_off` of the correlation time, relative.
    """

    levels: Array
    off: Array
    inside: Array
    seconds: Array
    range_m: Array
    speed_mps: Array
    time_off: float

    def lines(self) -> list[str]:
        """Return the figures of the issue."""
        off, long = self.off_at(0.95), self.seconds >= HOUR_S
        inside = zip(self.levels.tolist(), self.inside.mean(axis=1).tolist(), strict=True)
        lines = [
            f"95 % surface: mean {off.mean():+.1%}, median size {np.median(np.abs(off)):.1%}, "
            f"largest {np.abs(off).max():.1%} of {off.size} cells",
            f"the same by range: {self._by_range(off)}",
            f"inside of the 95 % interval: all {self.inside.mean():.1%}; "
            + ", ".join(f"{level:.0%} {share:.1%}" for level, share in inside),
            f"correlation time {self.time_off:+.1%}",
        ]
        if long.any():
            size = np.abs(off[long])
            lines.append(
                f"{long.sum()} cells with an hour of driving: largest {size.max():.1%}, "
                f"within 10 %: {np.mean(size < 0.1):.1%}"
            )
        return lines

    def off_at(self, level: float) -> Array:
        """Return how far the surface nearest to a level is off (N,)."""
        return self.off[int(np.argmin(np.abs(self.levels - level)))]

    def _by_range(self, off: Array) -> str:
        band = np.digitize(self.range_m, BANDS_M)
        return ", ".join(
            f"{BANDS_M[k - 1]:.0f}..{BANDS_M[k]:.0f} m {off[band == k].mean():+.1%}"
            for k in np.unique(band).tolist()
        )


def law_truth(
    law: ErrorModel,
    setting: FitSetting | None = None,
    read: Callable[[Array], Array] = cubic_at,
    count: int = 60_000,
) -> Truth:
    """Return the truth of a known law, as the fit and its reader make it; each speed is drawn once."""

    @cache
    def sizes_m(range_m: tuple[float, ...], speed_mps: float) -> Array:
        ranges = np.array(range_m)
        found = reported_errors_m(law, ranges, speed_mps, setting=setting, read=read, count=count)
        return np.sort(np.abs(found), axis=0)

    def truth(levels: Array, range_m: Array, speed_mps: float) -> Array:
        return quantiles_m(sizes_m(tuple(range_m.tolist()), speed_mps), levels)

    return truth


def model_truth(model: ErrorModel) -> Truth:
    """Return the law that a learned model claims for its reported lines, as the truth of what it made."""

    def truth(levels: Array, range_m: Array, speed_mps: float) -> Array:
        column = int(np.argmin(np.abs(model.speed_mps - speed_mps)))
        here = np.where(model.blind[:, column], np.nan, model.absolute_m[:, :, column])
        return np.array([np.interp(range_m, model.range_m, row, right=np.nan) for row in here])

    return truth


def compare(model: ErrorModel, truth: Truth, time_s: float) -> Compared:
    """Compare the cells that both know."""
    parts = []
    for column in range(0, len(model.speed_mps), COLUMN_STEP):
        seen, speed_mps = ~model.blind[:, column], float(model.speed_mps[column])
        if seen.any():
            wanted = truth(model.levels, model.range_m, speed_mps)
            good = seen & np.isfinite(wanted).all(axis=0)
            found, low, high = (
                surface[:, good, column]
                for surface in (model.absolute_m, model.absolute_low_m, model.absolute_high_m)
            )
            wanted = wanted[:, good]
            inside = (low <= wanted) & (wanted <= high)
            speeds = np.full(int(good.sum()), speed_mps)
            parts.append(
                (found / wanted - 1.0, inside, model.seconds[good, column], model.range_m[good], speeds)
            )
    off, inside, seconds, range_m, speed = (
        np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)
    )
    return Compared(
        levels=model.levels,
        off=off,
        inside=inside,
        seconds=seconds,
        range_m=range_m,
        speed_mps=speed,
        time_off=model.correlation_time_s / time_s - 1.0,
    )
