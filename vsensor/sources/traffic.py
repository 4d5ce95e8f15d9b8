"""Vehicles on the lanes beside the ego's and on its own: their shape, and where they are at a time."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, floor, inf
from typing import Annotated, Literal

import msgspec

from vsensor.errors import ConfigError
from vsensor.schema import Config
from vsensor.sources.shapes import Shapes
from vsensor.types import Mesh
from vsensor.world.profiles import LinearProfile, Points, SmoothProfile

MPS_PER_KMH = 1.0 / 3.6
MOST_LANES = 8
FARTHEST_M = 100_000.0
"""No vehicle starts farther away: roads are gone along to where it stands, and a circuit has no end."""

VEHICLE_SIZES_M = {
    "car": (4.6, 1.8, 1.5),
    "van": (6.0, 2.0, 2.6),
    "truck": (16.5, 2.55, 4.0),
    "motorcycle": (2.2, 0.8, 1.5),
}
"""Length, width, height; the truck is the largest articulated vehicle of Directive 96/53/EC."""


class TrafficConfig(Config, frozen=True, kw_only=True):
    """`[[traffic]]`: a vehicle on a lane beside the ego's, a box or a mesh from a file.

    `lanes_left` over time are its changes of lane, smooth between the points: whole numbers at each.

    Without `speed_kmh` it keeps `ahead_m` (from the ego's rear axle to the vehicle's centre); with it,
    `ahead_m` is where it starts, and with `recycle_m` there is one like it every so many metres of road.
    A mesh (.obj .stl .glb; metres, x ahead, z up) has its own size, and stands on the road.
    """

    kind: Literal["car", "van", "truck", "motorcycle"] = "car"
    lanes_left: Points = 0
    ahead_m: Points = 50.0
    speed_kmh: Points | None = None
    recycle_m: Annotated[float, msgspec.Meta(ge=100, le=100_000)] | None = None
    size_m: tuple[float, float, float] | None = None
    mesh: str | None = None
    offset_m: Points = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """A vehicle of the traffic, its motion compiled; `ahead` is None where it has a speed of its own."""

    lanes: SmoothProfile
    offset: SmoothProfile
    size_m: tuple[float, float, float]
    mesh: Mesh | None
    ahead: LinearProfile | None
    start_m: float
    speed: LinearProfile | None
    recycle_m: float

    def speed_mps(self, t_s: float, ego_mps: float) -> float:
        """Return its speed along the road while the ego has that one."""
        if self.speed is not None:
            return self.speed.value(t_s)
        return ego_mps + (self.ahead.slope(t_s) if self.ahead is not None else 0.0)

    def places_m(self, t_s: float, ego_driven_m: float, behind_m: float, ahead_m: float) -> Iterator[float]:
        """Yield how far ahead of the ego it and its like are at `t_s`, from -behind_m to ahead_m."""
        if self.speed is None:
            here_m = self.ahead.value(t_s) if self.ahead is not None else self.start_m
        else:
            here_m = self.start_m + self.speed.integral(t_s) - ego_driven_m
        if self.recycle_m < inf:
            first = ceil((-behind_m - here_m) / self.recycle_m)
            last = floor((ahead_m - here_m) / self.recycle_m)
            yield from (here_m + k * self.recycle_m for k in range(first, last + 1))
        elif -behind_m <= here_m <= ahead_m:
            yield here_m


def _lanes(points: Points, key: str) -> SmoothProfile:
    """Return lanes over time; raises ConfigError for what is between lanes."""
    lanes = SmoothProfile.of(points, key)
    for value in lanes.values:
        if value != round(value) or abs(value) > MOST_LANES:
            raise ConfigError(
                f"{key}: {value:g}: whole numbers from -{MOST_LANES} to {MOST_LANES} were expected"
            )
    return lanes


def vehicle(config: TrafficConfig, number: int, shapes: Shapes) -> Vehicle:
    """Compile a vehicle; raises ConfigError naming its key."""
    where = f"traffic[{number}]"
    ahead = LinearProfile.of(config.ahead_m, f"{where}.ahead_m")
    if max(map(abs, ahead.values)) > FARTHEST_M:
        raise ConfigError(f"{where}.ahead_m: at most {FARTHEST_M:g} m to either side were expected")
    if config.speed_kmh is None and config.recycle_m is not None:
        raise ConfigError(f"{where}.recycle_m: only a vehicle with a speed_kmh of its own comes round again")
    if config.speed_kmh is not None and len(ahead.values) > 1:
        raise ConfigError(f"{where}.ahead_m: one number was expected, since speed_kmh says how it moves on")
    default = None if config.mesh else VEHICLE_SIZES_M[config.kind]
    mesh, size_m = shapes.of(config.mesh, config.size_m or default, where)
    speed = config.speed_kmh
    return Vehicle(
        lanes=_lanes(config.lanes_left, f"{where}.lanes_left"),
        offset=SmoothProfile.of(config.offset_m, f"{where}.offset_m"),
        size_m=size_m,
        mesh=mesh,
        ahead=ahead if speed is None else None,
        start_m=ahead.values[0],
        speed=None if speed is None else LinearProfile.of(speed, f"{where}.speed_kmh", MPS_PER_KMH),
        recycle_m=config.recycle_m if config.recycle_m is not None else inf,
    )
