"""Tables of a known law, drawn and not driven: what tuning must find again.

error = Q_t(Phi(z)) * scale(range, speed),  z normal, AR(1) in time, squared-exponential along the range
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import ndtr
from scipy.stats import t as student

from vsensor.field.table import MASKS, Masked, Table, open_table, write_table

RANGES_M = np.arange(1.0, 100.0, 2.0)


@dataclass(frozen=True)
class Law:
    """Student-t with `freedom`, scale growing with range and speed; reach 20 m + 2.667 s * speed."""

    freedom: float = 5.0
    time_s: float = 0.8
    length_m: float = 50.0
    lost_s: float = 0.6
    seen_s: float = 20.0
    bias: float = 0.0
    ranges_m: np.ndarray = None

    def grid(self):
        return RANGES_M if self.ranges_m is None else self.ranges_m

    def scale_m(self, range_m, speed_mps):
        return 0.01 + 0.0004 * range_m + 2e-5 * range_m * speed_mps

    def quantile_m(self, level, range_m, speed_mps):
        """The size not exceeded at a level."""
        return student.ppf(0.5 + 0.5 * level, self.freedom) * self.scale_m(range_m, speed_mps)

    def reach_m(self, speed_mps):
        return np.minimum(20.0 + 80.0 / 30.0 * speed_mps, 100.0)

    def quantile_table(self):
        z = np.linspace(-6.0, 6.0, 4001)
        return z, student.ppf(ndtr(z), self.freedom)


def speeds_of(random, images, period_s, low=5.0, high=35.0):
    """A speed that wanders over its whole range within some minutes (N,) in m/s."""
    phase = 2 * np.pi * np.cumsum(random.uniform(0.7, 1.3) * np.full(images, period_s)) / 300.0
    wave = (phase / np.pi + random.uniform(0, 2)) % 2.0
    return low + (high - low) * np.abs(1.0 - wave)


def processes(random, law, images, period_s):
    """z (images, R)."""
    distance = (law.grid()[:, None] - law.grid()[None]) / law.length_m
    factor = np.linalg.cholesky(np.exp(-0.5 * distance**2) + 1e-8 * np.eye(len(law.grid())))
    white = random.standard_normal((images, len(law.grid()))) @ factor.T
    keep = np.exp(-period_s / law.time_s)
    white[1:] *= np.sqrt(1.0 - keep**2)
    from scipy.signal import lfilter

    return lfilter([1.0], [1.0, -keep], white, axis=0)


def seen_of(random, law, images, period_s):
    """Whether the line is reported (images,): exponential dwell times."""
    seen, state, at = np.ones(images, bool), True, 0
    while at < images:
        mean_s = law.seen_s if state else law.lost_s
        count = max(round(random.exponential(mean_s) / period_s), 1)
        seen[at : at + count] = state
        at, state = at + count, not state
    return seen


def columns_of(random, law, seconds, period_s=0.04, night=False, rain=0.0, **speeds):
    """Rows of one log, in the table's order."""
    images = round(seconds / period_s)
    speed = speeds_of(random, images, period_s, **speeds)
    ranges = law.grid()
    z_grid, table = law.quantile_table()
    parts = []
    for side in (0, 1):
        z = processes(random, law, images, period_s)
        scale = law.scale_m(ranges[None], speed[:, None])
        error = (np.interp(z, z_grid, table) + law.bias) * scale
        seen = seen_of(random, law, images, period_s)
        reach = law.reach_m(speed) * (1.0 - 0.1 * random.random(images))
        here = seen[:, None] & (ranges[None] <= reach[:, None])
        at, place = np.nonzero(here)
        lost = np.flatnonzero(~here.any(axis=1))
        parts.append(
            {
                "image": np.concatenate([at, lost]),
                "side": np.full(len(at) + len(lost), side),
                "range_m": np.concatenate([ranges[place], np.full(len(lost), np.nan)]),
                "error_m": np.concatenate([error[here], np.full(len(lost), np.nan)]),
                "x_max_m": np.concatenate([reach[at], np.full(len(lost), np.nan)]),
                "quality": np.concatenate([np.full(len(at), 3), np.zeros(len(lost))]),
            }
        )
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    order = np.lexsort((joined["range_m"], joined["side"], joined["image"]))
    joined = {name: values[order] for name, values in joined.items()}
    image = joined.pop("image")
    rows = len(image)
    lost = np.isnan(joined["range_m"])
    return joined | {
        "t_ns": 10**18 + np.rint(image * period_s * 1e9).astype(np.int64),
        "masked": np.where(lost, MASKS.index(Masked.NO_LINE), 0).astype(np.uint8),
        "speed_mps": speed[image],
        "acceleration_mps2": random.normal(0, 0.3, rows),
        "yaw_rate_radps": random.normal(0, 0.02, rows),
        "future_yaw_rate_radps": random.normal(0, 0.02, rows),
        "curvature_per_m": random.normal(0, 1e-3, rows),
        "night": np.full(rows, night),
        "rain": np.full(rows, rain),
        "measured": ~lost,
        "lane_width_m": np.full(rows, 3.5),
    }


def write_log(folder: Path, name: str, columns) -> None:
    write_table(folder / f"{name}.parquet", name, [columns], {"log": name, "source": "drawn"})


def made_table(folder: Path, law: Law, seconds, seed=0, **how) -> Table:
    """A table of logs of so many seconds each."""
    for k, length in enumerate(seconds):
        random = np.random.default_rng([seed, k])
        write_log(folder, f"drive_{k}", columns_of(random, law, length, **how))
    return open_table([folder])
