"""Where the real sensor reports at all: an operating range that grows with speed (P1 3.2, 3.4)."""

import math
from itertools import pairwise
from typing import Annotated

import numpy as np
from msgspec import Meta

from vsensor.schema import Config
from vsensor.types import Array, Detections, LinePoints, Observation

MPS_PER_KMH = 1.0 / 3.6

SpeedKmh = Annotated[float, Meta(ge=0.0, le=400.0)]
RangeM = Annotated[float, Meta(ge=0.0, le=500.0)]


class RegionConfig(Config, frozen=True, kw_only=True):
    """The operating range over speed, linear between the table's points, constant beyond its ends.

    The default rises linearly from 20 m at standstill to 100 m at 108 km/h. P1 (fig. 3.7) finds the
    upper limit of a production sensor's range to be linear in speed; the two end points are ours, set
    so that the sensor looks about 2.7 s ahead from 100 km/h up to where most such sensors end.
    """

    enabled: bool = True
    speed_kmh: tuple[SpeedKmh, ...] = (0.0, 108.0)
    range_m: tuple[RangeM, ...] = (20.0, 100.0)

    def __post_init__(self) -> None:
        """Refuse a table that is no function of speed (ValueError; from a file, a ConfigError)."""
        if len(self.speed_kmh) != len(self.range_m) or not self.speed_kmh:
            raise ValueError(
                f"speed_kmh has {len(self.speed_kmh)} values and range_m {len(self.range_m)}: "
                "the same number was expected, at least one"
            )
        if any(after <= before for before, after in pairwise(self.speed_kmh)):
            raise ValueError(f"speed_kmh = {list(self.speed_kmh)}: rising values were expected")


def operating_range_m(config: RegionConfig, speed_mps: float) -> float:
    """Return the largest x in m at which a point is reported at this speed; inf where not enabled.

    A speed that is not known (NaN) gives the shortest range of the table. Backwards counts as 0.
    """
    if not config.enabled:
        return math.inf
    if math.isnan(speed_mps):
        return min(config.range_m)
    speeds_mps = [speed * MPS_PER_KMH for speed in config.speed_kmh]
    return float(np.interp(speed_mps, speeds_mps, config.range_m))


def limit(config: RegionConfig, observation: Observation, speed_mps: float, exposed_at_ns: int) -> Detections:
    """Return the observed points up to the operating range; every line stays, maybe with 0 points."""
    reach_m = operating_range_m(config, speed_mps)
    lines, sigma = _up_to(observation.lines, observation.sigma_y_m, reach_m)
    return Detections(
        exposed_at_ns=exposed_at_ns,
        lines=lines,
        sigma_y_m=sigma,
        kind=observation.kind,
        colour=observation.colour,
        width_m=observation.width_m,
        operating_range_m=reach_m,
    )


def _up_to(lines: LinePoints, sigma_y_m: Array, reach_m: float) -> tuple[LinePoints, Array]:
    """Return the points with x <= reach_m: the first ones of each line, for x increases along it."""
    within = lines.points_ego_m[:, 0] <= reach_m
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
