"""First pass: which ranges there are, mean sizes per cell, reach, quality, how long lines are lost.

All sums are of whole numbers (sizes in um, times in ns), so that neither the order of logs nor where they
are counted changes them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vsensor.errors import TableError
from vsensor.field.table import LogFile
from vsensor.field.tune.conditions import Conditions
from vsensor.field.tune.dwell import Dwells, dwells_of
from vsensor.field.tune.grid import MAX_RANGE_MM, MAX_SPEED_MPS, Grid, range_mm, speed_cell
from vsensor.field.tune.reading import QUALITIES, SIDES, Images, Progress, Rows, period_ns, read_log

REACH_STEP_M = 0.5
REACH_BINS = 801
MAX_RANGES = 1000


@dataclass(slots=True, kw_only=True)
class Survey:
    """What the first pass counted, over all logs so far; G conditions, V speeds.

    `ranges` maps a range in mm to rows (G, SIDES, V), ns of driving (G, SIDES, V) and sum of sizes in um
    (G, V). `reach` (G, V, REACH_BINS) counts reported ranges, `quality` (G, 5, 5) steps from image to
    image. `periods` maps ns between images to images, `images_ns` is the time with images.
    """

    conditions: int
    speeds: int
    ranges: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=dict)
    reach: np.ndarray = field(init=False)
    quality: np.ndarray = field(init=False)
    dwells: Dwells = field(default_factory=Dwells)
    periods: dict[int, int] = field(default_factory=dict)
    images_ns: int = 0
    logs: int = 0
    rows: int = 0

    def __post_init__(self) -> None:
        self.reach = np.zeros((self.conditions, self.speeds, REACH_BINS), np.int64)
        self.quality = np.zeros((self.conditions, QUALITIES, QUALITIES), np.int64)

    def merge(self, other: "Survey") -> "Survey":
        """Add what another survey counted; returns self."""
        for key, sums in other.ranges.items():
            mine = self.ranges.get(key)
            self.ranges[key] = sums if mine is None else tuple(a + b for a, b in zip(mine, sums, strict=True))
        self.reach += other.reach
        self.quality += other.quality
        self.dwells = self.dwells.merge(other.dwells)
        for key, count in other.periods.items():
            self.periods[key] = self.periods.get(key, 0) + count
        self.images_ns += other.images_ns
        self.logs += other.logs
        self.rows += other.rows
        return self

    def period_ns(self) -> int:
        """Return the usual time between images."""
        return max(self.periods, key=lambda key: (self.periods[key], key)) if self.periods else 0

    def grid(self, step_mps: float) -> Grid:
        """Return the ranges that occur, and speeds up to the fastest; raises TableError for none at all."""
        if not self.rows:
            raise TableError("no row of the table has an error that is used: nothing to learn from")
        driven = np.zeros(self.speeds, bool)
        for rows, _, _ in self.ranges.values():
            driven |= rows.sum(axis=(0, 1)) > 0
        return Grid(
            range_mm=tuple(sorted(self.ranges)),
            step_mps=step_mps,
            speeds=max(int(np.flatnonzero(driven)[-1]) + 1, 2),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyPass:
    """Surveys logs one at a time."""

    conditions: Conditions
    step_mps: float

    def start(self) -> Survey:
        """Return an empty survey."""
        speeds = round(MAX_SPEED_MPS / self.step_mps) + 1
        return Survey(conditions=len(self.conditions.names), speeds=speeds)

    def add(self, survey: Survey, file: LogFile, progress: Progress | None = None) -> None:
        """Add one log."""
        one = self.start()
        one.logs = 1
        for part in read_log(file, self.conditions.rule, progress, images=True):
            if isinstance(part, Rows):
                _count_rows(one, part, self.step_mps, file)
            else:
                _count_images(one, part, self.step_mps)
        for _, time_ns, _ in one.ranges.values():
            time_ns *= one.period_ns()
        survey.merge(one)


def _count_rows(survey: Survey, rows: Rows, step_mps: float, file: LogFile) -> None:
    if not len(rows.t_ns):
        return
    at_mm = range_mm(rows.range_m)
    present = np.flatnonzero(np.bincount(at_mm, minlength=MAX_RANGE_MM + 1))
    if len(present) > MAX_RANGES:
        raise TableError(f"{file.path}: {len(present)} different ranges; a table has a fixed set of them")
    places = np.zeros(MAX_RANGE_MM + 1, np.int32)
    places[present] = np.arange(len(present))
    groups, speeds = survey.conditions, survey.speeds
    cell = (rows.group * SIDES + rows.side) * speeds + speed_cell(rows.speed_mps, step_mps, speeds)
    cell *= len(present)
    cell += places[at_mm]
    size = groups * SIDES * speeds * len(present)
    sizes_um = np.rint(np.abs(rows.error_m) * np.float64(1e6))
    shape = (groups, SIDES, speeds, len(present))
    counts = np.bincount(cell, minlength=size).reshape(shape)
    sums = np.bincount(cell, sizes_um, minlength=size).reshape(shape).sum(axis=1)
    for place, key in enumerate(present.tolist()):
        count, total = counts[..., place], sums[..., place]
        if key in survey.ranges:
            for mine, more in zip(survey.ranges[key], (count, count, total), strict=True):
                mine += more
        else:  # the second is multiplied by the time between images when the log has been read
            survey.ranges[key] = count.copy(), count.copy(), total.copy()
    survey.rows += len(rows.t_ns)


def _count_images(survey: Survey, images: Images, step_mps: float) -> None:
    survey.images_ns += _driven_ns(images)
    one_side = images.side == images.side[0]
    period = period_ns(images.t_ns[one_side])
    survey.periods[period] = survey.periods.get(period, 0) + int(np.count_nonzero(one_side))
    seen = images.known & images.reported & np.isfinite(images.speed_mps)
    cell = speed_cell(np.where(seen, images.speed_mps, 0.0).astype(np.float32), step_mps, survey.speeds)
    reach = np.clip(np.where(seen, images.x_max_m, 0.0) / REACH_STEP_M, 0, REACH_BINS - 1).astype(np.int64)
    place = (images.group * survey.speeds + cell) * REACH_BINS + reach
    survey.reach += np.bincount(place[seen], minlength=survey.reach.size).reshape(survey.reach.shape)
    follows = followers(images, period) & seen[:-1] & seen[1:]
    steps = (images.group[:-1].astype(np.int64) * QUALITIES + images.quality[:-1]) * QUALITIES
    steps += images.quality[1:]
    size = survey.quality.size
    survey.quality += np.bincount(steps[follows], minlength=size).reshape(survey.quality.shape)
    survey.dwells = survey.dwells.merge(dwells_of(images, period))


def followers(images: Images, period: int) -> np.ndarray:
    """Return whether image k + 1 is the next one of the same side (N - 1,)."""
    step = images.t_ns[1:] - images.t_ns[:-1]
    return np.asarray((images.side[1:] == images.side[:-1]) & (step > 0) & (2 * step < 3 * max(period, 1)))


def _driven_ns(images: Images) -> int:
    """Return the time of the log with images: gaps of a second or more do not count."""
    t_ns = np.unique(images.t_ns)
    steps = np.diff(t_ns)
    return int(steps[steps < 1_000_000_000].sum())


def cell_sums(survey: Survey, grid: Grid) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows, seconds of driving and mean size in m of each cell, each (G, V, R); no row: size 0.

    The seconds are those of the side that has more of them: two lines in one image are one time.
    """
    chosen: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]] = [survey.ranges[k] for k in grid.range_mm]
    rows = np.stack([one[0].sum(axis=1) for one in chosen], axis=-1)[:, : grid.speeds]
    seconds = np.stack([one[1].max(axis=1) for one in chosen], axis=-1)[:, : grid.speeds] / 1e9
    sums_m = np.stack([one[2] for one in chosen], axis=-1)[:, : grid.speeds] / 1e6
    return rows, seconds, np.divide(sums_m, rows, out=np.zeros_like(sums_m), where=rows > 0)
