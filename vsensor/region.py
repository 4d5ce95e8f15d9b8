"""Where the real sensor reports at all: an operating range that grows with speed (P1 3.2, 3.4)."""

import math
from itertools import pairwise
from typing import Annotated

import numpy as np
from msgspec import Meta

from vsensor.schema import Config
from vsensor.types import Array, Detections, LinePoints, Observation, Reach, frozen

MPS_PER_KMH = 1.0 / 3.6

SPEED_KMH, RANGE_M = (0.0, 108.0), (20.0, 100.0)
"""The operating range where nobody says another one."""
_NOT_BLIND = frozen(np.zeros((0, 2)))

SpeedKmh = Annotated[float, Meta(ge=0.0, le=400.0)]
RangeM = Annotated[float, Meta(ge=0.0, le=500.0)]


class RegionConfig(Config, frozen=True, kw_only=True):
    """The operating range over speed, linear between the table's points, constant beyond its ends.

    A table given here is the whole region. Without one it is the error model's, its blind cells included,
    where its file has one, else 20 m at standstill to 100 m at 108 km/h. P1 (fig. 3.7) finds the
    upper limit of a production sensor's range to be linear in speed; the two end points are ours, set
    so that the sensor looks about 2.7 s ahead from 100 km/h up to where most such sensors end.
    """

    enabled: bool = True
    speed_kmh: tuple[SpeedKmh, ...] | None = None
    range_m: tuple[RangeM, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse a table that is no function of speed (ValueError; from a file, a ConfigError)."""
        speed_kmh, range_m = self.table
        if len(speed_kmh) != len(range_m) or not speed_kmh:
            raise ValueError(
                f"speed_kmh has {len(speed_kmh)} values and range_m {len(range_m)}: "
                "the same number was expected, at least one"
            )
        if any(after <= before for before, after in pairwise(speed_kmh)):
            raise ValueError(f"speed_kmh = {list(speed_kmh)}: rising values were expected")

    @property
    def table(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The speeds in km/h and the ranges in m; what is not given is the default's."""
        speed_kmh = SPEED_KMH if self.speed_kmh is None else self.speed_kmh
        return speed_kmh, RANGE_M if self.range_m is None else self.range_m

    @property
    def is_given(self) -> bool:
        """Whether the region stands here, whatever the error model says."""
        return not self.enabled or self.speed_kmh is not None or self.range_m is not None


def operating_range_m(config: RegionConfig, speed_mps: float) -> float:
    """Return the largest x in m at which a point is reported at this speed; inf where not enabled.

    A speed that is not known (NaN) gives the shortest range of the table. Backwards counts as 0.
    """
    if not config.enabled:
        return math.inf
    speeds_kmh, ranges_m = config.table
    if math.isnan(speed_mps):
        return min(ranges_m)
    speeds_mps = [speed * MPS_PER_KMH for speed in speeds_kmh]
    return float(np.interp(speed_mps, speeds_mps, ranges_m))


def reach_at(config: RegionConfig, speed_mps: float, learned: Reach | None = None) -> Reach:
    """Return how far the sensor reports: as configured, else as the error model `learned` it."""
    if learned is not None and not config.is_given:
        return learned
    range_m = operating_range_m(config, speed_mps)
    return Reach(range_m=range_m, points_m=range_m, blind_m=_NOT_BLIND)


def limit(reach: Reach, observation: Observation, exposed_at_ns: int) -> Detections:
    """Return the observed points within reach; every line stays, maybe with 0 points."""
    lines, sigma = _within(observation.lines, observation.sigma_y_m, reach)
    return Detections(
        exposed_at_ns=exposed_at_ns,
        lines=lines,
        sigma_y_m=sigma,
        kind=observation.kind,
        colour=observation.colour,
        width_m=observation.width_m,
        operating_range_m=reach.points_m,
    )


def _within(lines: LinePoints, sigma_y_m: Array, reach: Reach) -> tuple[LinePoints, Array]:
    """Return the points within reach; x increases along each line."""
    x = lines.points_ego_m[:, 0]
    within = x <= reach.points_m
    for start, end in reach.blind_m.tolist():
        within &= (x < start) | (x >= end)
    if within.all():
        return lines, sigma_y_m
    keep = within.nonzero()[0]
    kept = LinePoints(
        marking=lines.marking,
        starts=keep.searchsorted(lines.starts),
        index=lines.index[keep],
        points_ego_m=lines.points_ego_m.T.take(keep, axis=1).T,
    )
    sigma = sigma_y_m[keep]
    for array in (kept.starts, kept.index, kept.points_ego_m, sigma):
        array.flags.writeable = False
    return kept, sigma
